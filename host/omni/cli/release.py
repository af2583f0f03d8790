# SPDX-License-Identifier: MIT
"""``make release``: the .hex, the .elf and the report of its check for each robot; checksums of all, and of the wheel.

usage: python -m omni.cli.release --out dist [--changed] [--depth short|ci|nightly]

Exit code 1: a robot's firmware cannot be built or does not pass; then there are no checksums.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from pathlib import Path

from omni.cli.common import console, error_console
from omni.cli.image_check import check_image
from omniwheel import __version__
from omniwheel.errors import FlashError, OmniError
from omniwheel.files import write_bytes, write_text
from omniwheel.flashing.hex_file import read_hex
from omniwheel.flashing.source import Build, build, source_dir
from omniwheel.robots import robot_names

CHECKSUMS = "SHA256SUMS"


def release(out: Path, *, changed: bool, depth: str) -> list[Path]:
    """Write the release's files below ``out`` and return them. Raises FlashError.

    ``changed``: a work tree that is not what was committed is no reason to refuse. ``depth``: of the images' check.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / CHECKSUMS).unlink(missing_ok=True)
    files = []
    for robot in robot_names():
        made = build(robot)
        if made.changed and not changed:
            hint = "commit first, or ARGS=--changed for a release that says so"
            raise FlashError("the work tree has uncommitted changes", hint=hint)
        files += _robot_files(out, robot, made, depth)
    files += sorted(out.glob(f"omniwheel-{__version__}-*.whl"))
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    write_text(out / CHECKSUMS, "".join(sums))
    return [*files, out / CHECKSUMS]


def _robot_files(out: Path, robot: str, made: Build, depth: str) -> list[Path]:
    image = read_hex(made.hex)
    lines = [
        f"omniwheel {__version__} for {robot}",
        f"commit {made.git_hash or 'unknown'}{', changed' if made.changed else ''}",
        f"{image.size} bytes, SHA-256 of the .hex file {image.sha256}",
        "",
        check_image(made.elf, robot, depth=depth),
    ]
    name = f"omniwheel-{__version__}-{robot}"
    files = [out / f"{name}.{kind}" for kind in ("hex", "elf", "check.md")]
    write_bytes(files[0], made.hex.read_bytes())
    write_bytes(files[1], made.elf.read_bytes())
    write_text(files[2], "\n".join(lines) + "\n")
    return files


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    from image_check.check import CI, DEPTHS

    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=source_dir() / "dist")
    parser.add_argument("--changed", action="store_true", help="allow uncommitted changes in the work tree")
    parser.add_argument("--depth", choices=DEPTHS, default=CI, help="depth of each image's check")
    options = parser.parse_args(arguments)
    try:
        files = release(options.out, changed=options.changed, depth=options.depth)
    except OmniError as error:
        error_console.print(f"error: {error}\n{error.hint}", markup=False)
        return 1
    console.print(*[str(path) for path in files], sep="\n", markup=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
