# SPDX-License-Identifier: MIT
"""The memory table of docs/concepts/teensy.md: measures a built image, and compares with or writes what the page says.

usage: python -m tests.image_build.memory_page [--write] [--environment three_wheel]

Exit code 1: the page says something else. The table names its compiler: figures of another one are not compared, the
budgets are.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.parity.budget_page import is_current, replace_block

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "firmware" / "boards" / "teensy40" / "platformio"))

from memory_budget import KB, STACK_AT_LEAST, Usage, rows  # noqa: E402

PAGE = ROOT / "docs" / "concepts" / "teensy.md"
BLOCK = "memory"
COMMAND = "make firmware-memory ARGS=--write"
_WHAT = {
    "FLASH": "everything",
    "ITCM": "code that runs; shares 512 KB with DTCM in blocks of 32 KB",
    "DTCM": "constants and variables",
    "RAM2": "USB buffers",
}


class MeasureError(RuntimeError):
    """The image or its compiler is not there; says what to do."""


def block(usage: Usage, environment: str, compiler: str) -> list[str]:
    """Return the lines between the page's markers."""
    lines = [
        f"`{environment}`, {compiler} with PlatformIO's flags, in KB:",
        "",
        "| | used | budget | there is | what |",
        "|---|---:|---:|---:|---|",
    ]
    for name, used, budget, there in rows(usage):
        lines.append(f"| {name} | {used / KB:.0f} | {budget / KB:.0f} | {there / KB:.0f} | {_WHAT[name]} |")
    left = f"| stack | {usage.stack / KB:.0f} left | ≥ {STACK_AT_LEAST / KB:.0f} | | what ITCM and DTCM leave |"
    return [*lines, left]


def difference(page: str, measured: list[str]) -> str:
    """Return a sentence if the page's block is not what was measured, "" if it is."""
    written = _block_of(page)
    if is_current(page, BLOCK, measured):
        return ""
    same_compiler = bool(written) and written[0] == measured[0]
    if not same_compiler and _without_figures(written) == _without_figures(measured):
        return ""
    return f"{PAGE.name} does not say what this build takes: {COMMAND}, and look at the difference"


def _block_of(page: str) -> list[str]:
    begin, end = f"<!-- {BLOCK} -->", f"<!-- /{BLOCK} -->"
    return page.split(begin, 1)[-1].split(end, 1)[0].strip("\n").splitlines()


def _without_figures(lines: list[str]) -> list[list[str]]:
    """Drop the compiler's line and the column of measured figures."""
    return [[cell for column, cell in enumerate(line.split("|")) if column != 2] for line in lines[1:]]


def toolchain() -> Path:
    """Return the folder of the compiler that PlatformIO uses. Raises MeasureError."""
    core = Path(os.environ.get("PLATFORMIO_CORE_DIR") or Path.home() / ".platformio")
    folder = core / "packages" / "toolchain-gccarmnoneeabi-teensy" / "bin"
    if shutil.which("arm-none-eabi-gcc", path=str(folder)) is None:
        raise MeasureError(f"there is no compiler in {folder}; set PLATFORMIO_CORE_DIR as for the build")
    return folder


def measure(environment: str) -> list[str]:
    """Return the block for the image that was built in this environment. Raises MeasureError."""
    image = ROOT / ".pio" / "build" / environment / "firmware.elf"
    if not image.is_file():
        raise MeasureError(f"{image.relative_to(ROOT)} is not built: make firmware ROBOT={environment}")
    tools = toolchain()
    sizes = _said(tools / "arm-none-eabi-size", "-A", str(image))
    version = _said(tools / "arm-none-eabi-gcc", "-dumpfullversion").strip()
    return block(Usage.from_size_output(sizes), environment, f"arm-none-eabi-gcc {version}")


def _said(*command: str | Path) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    parser.add_argument("--environment", default="three_wheel", help="of platformio.ini")
    options = parser.parse_args(arguments)
    try:
        measured = measure(options.environment)
    except MeasureError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(*measured, sep="\n")
    page = PAGE.read_text(encoding="utf-8")
    if options.write:
        PAGE.write_text(replace_block(page, BLOCK, measured), encoding="utf-8")
        return 0
    problem = difference(page, measured)
    if problem:
        print(f"error: {problem}", file=sys.stderr)
    return int(bool(problem))


if __name__ == "__main__":
    sys.exit(main())
