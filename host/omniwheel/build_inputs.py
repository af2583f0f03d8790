# SPDX-License-Identifier: MIT
"""Which files of the source tree ``make setup`` builds from; a script, too: prints them for the Makefile.

Python modules are no inputs: an editable install runs them from the tree. Needs nothing but Python itself, so that make
can ask before there is a virtual environment.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

FOLDERS = ("shared", "firmware", "emulated_teensy", "hil_sim", "host/native", "cmake")
TOP_FILES = ("CMakeLists.txt", "pyproject.toml")
_EVERYWHERE = (".c", ".h", ".cpp", ".hpp", ".ld", ".cmake", "CMakeLists.txt")
_SCHEMAS = (".toml", ".xml")
_GENERATORS = ("shared/generate", "host/native", "hil_sim/lanes")


def build_inputs(root: str) -> Iterator[str]:
    """Yield the inputs' paths from ``root``, with slashes."""
    yield from TOP_FILES
    for folder in FOLDERS:
        for where, _, names in os.walk(os.path.join(root, folder)):
            inside = os.path.relpath(where, root).replace(os.sep, "/")
            schemas = _SCHEMAS if folder == "shared" else ()
            suffixes = (*_EVERYWHERE, *schemas, *((".py",) if inside.startswith(_GENERATORS) else ()))
            yield from (f"{inside}/{name}" for name in names if name.endswith(suffixes))


if __name__ == "__main__":
    sys.stdout.write("\n".join(build_inputs(".")))
