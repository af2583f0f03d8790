# SPDX-License-Identifier: MIT
"""Runs a command that checks an image, unless it has passed for this image: see tests/kept.py.

usage: python -m tests.image_build.kept_check NAME IMAGE.elf [--file FILE ...] -- COMMAND ...

What counts: the bytes that the image puts into flash memory, but for the number of its commit; the command; the files;
all Python and C code that the checks can reach; the versions of the packages that emulate and read. Exit code: the
command's.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import grimp

from emulated_teensy.image_file import FLASH_BASE, Image, read_image
from image_check.run import MODULES
from tests import kept
from tests.proof.frama_c import without_comments

ROOT = kept.ROOT
BUILD_ID = "_ZN4omni8build_idE"
PACKAGES = ("capstone", "numpy", "pyelftools", "unicorn")
PYTHON = ("emulated_teensy", "hil_sim", "image_check", "omniwheel", "omni_schema")
GENERATED = "omniwheel.telemetry_gen"
C_SUFFIXES = (".c", ".h", ".cpp", ".hpp")
C_FOLDERS = (
    *("shared/core", "shared/link", "emulated_teensy", "hil_sim", "host/native"),
    *("firmware/boards/common", "firmware/boards/posix"),
)
"""The simulated world, and the PC's firmware, with which the check `path` compares."""
SHARED = ("params.toml", "world.toml", "robots", "link", "generate")
DATA = (*(f"shared/{name}" for name in SHARED), "hil_sim/scenarios")
STATIC = "tests/image/static"


def load_offset(image: Image, address: int) -> int:
    """Return where in flash memory the bytes of an address lie before the start-up copies them."""
    for segment in image.elf.iter_segments("PT_LOAD"):
        start, size = segment["p_vaddr"], segment["p_filesz"]
        if start <= address < start + size:
            return int(segment["p_paddr"] + address - start) - FLASH_BASE
    raise ValueError(f"{image.path} loads nothing to {address:#x}")


def image_content(path: Path) -> bytes:
    """Return what an image puts into flash memory, its commit's number blanked."""
    image = read_image(path)
    begin = load_offset(image, image.symbols[BUILD_ID])
    size = next(s["st_size"] for s in image.elf.get_section_by_name(".symtab").iter_symbols() if s.name == BUILD_ID)
    return image.flash[:begin] + bytes(size) + image.flash[begin + size :]


def python_code() -> list[Path]:
    """Return the modules that the checks can import, those within functions, too."""
    graph = grimp.build_graph(*PYTHON, cache_dir=None)
    names = {f"image_check.{name}" for name in MODULES}
    for name in sorted(names):
        names |= graph.find_upstream_modules(name)
    places = {"omniwheel": ROOT / "host", "omni_schema": ROOT / "shared" / "generate"}
    stems = [places.get(name.partition(".")[0], ROOT) / name.replace(".", "/") for name in sorted(names - {GENERATED})]
    found = [path for stem in stems for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.is_file()]
    assert len(found) == len(stems), "a module without a file"
    return [*found, *sorted((ROOT / STATIC).iterdir(), key=str)]


def check_code() -> str:
    """Return a digest of what checks an image."""
    data = [path for name in DATA for path in _files(ROOT / name)]
    texts = [path.read_text(encoding="utf-8") for path in [*python_code(), *data] if path.is_file()]
    sources = [path for folder in C_FOLDERS for path in sorted((ROOT / folder).rglob("*"))]
    texts += [without_comments(path.read_text(encoding="utf-8")) for path in sources if path.suffix in C_SUFFIXES]
    return kept.digest(*texts, *(f"{name} {version(name)}" for name in PACKAGES))


def _files(path: Path) -> list[Path]:
    return [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.suffix in (".py", ".toml", ".xml"))


def main() -> int:
    """Run the command line and return its exit code."""
    words, command = sys.argv[1:], []
    if "--" in words:
        words, command = words[: words.index("--")], words[words.index("--") + 1 :]
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0], usage="%(prog)s ... -- COMMAND")
    parser.add_argument("name")
    parser.add_argument("image", type=Path)
    parser.add_argument("--file", type=Path, action="append", default=[], help="whose content counts, too")
    options = parser.parse_args(words)
    if not command:
        parser.error("which command? behind --")
    files = [path.read_bytes() for path in options.file]
    inputs = kept.digest(image_content(options.image), check_code(), *command, *files)
    if kept.has_passed(options.name, inputs):
        print(f"{options.name}: not made again, it has passed ({kept.VARIABLE}={kept.IGNORE} makes it)")
        return 0
    status = subprocess.run(command, check=False).returncode
    if status == 0:
        kept.note_passed([(options.name, inputs)])
    return status


if __name__ == "__main__":
    sys.exit(main())
