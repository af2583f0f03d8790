# SPDX-License-Identifier: MIT
"""``omni`` and ``python -m omni``. Nothing is imported above, so that Ctrl-C is answered from the first moment."""

import sys

INTERRUPTED = 130


def main() -> None:
    """Run the command line; Ctrl-C while its modules load ends it without a traceback, too."""
    try:
        from omni.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(INTERRUPTED)
    except ImportError as error:  # before there is a command line that could say it
        from omniwheel.stale_build import HINT, stale_build

        said = stale_build(error)
        if said is None:
            raise
        sys.stderr.write(f"error: {said}\nhint: {HINT}\n")
        sys.exit(1)


if __name__ == "__main__":
    main()
