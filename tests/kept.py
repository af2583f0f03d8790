# SPDX-License-Identifier: MIT
"""What passed for certain inputs: a dear check is not made again while everything it depends on has the same content.

tests/kept.txt has a line for each: the digest of the inputs, and the check's name. OMNI_KEPT says what is done with it:

    (not set)   a check whose line is there is left out
    ignore      every check is made, as in `make nightly`
    write       as if not set; what passes gets a line, in place of the name's old ones (`make kept`)

A command is kept by the content of files and folders, and its tools' versions:

    python -m tests.kept NAME --of PATH ... [--tool PROGRAM ...] -- COMMAND ...

Git may join the lines of two branches (`merge=union`): each is true by itself.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "tests" / "kept.txt"
VARIABLE = "OMNI_KEPT"
IGNORE, WRITE = "ignore", "write"
DIGITS = 20
"""Of a digest: 80 bits."""
_PASSED_BY = {"version_gen.h"}
"""Headers that change with each commit, and hold nothing but its number."""


def _mode() -> str:
    mode = os.environ.get(VARIABLE, "")
    if mode not in ("", IGNORE, WRITE):
        raise ValueError(f"{VARIABLE}={mode}: it can be {IGNORE} or {WRITE}")
    return mode


def digest(*parts: str | bytes) -> str:
    """Return a digest of these parts, in this order."""
    state = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        state.update(f"{len(content)}:".encode() + content)
    return state.hexdigest()[:DIGITS]


def files_digest(paths: Iterable[Path]) -> str:
    """Return a digest of these files, and of all files in these folders, with their names."""
    parts: list[str | bytes] = []
    for top in paths:
        found = [top] if top.is_file() else sorted(top.rglob("*"))
        for path in found:
            if path.is_file() and "__pycache__" not in path.parts:
                parts += [str(path.relative_to(top.parent)), path.read_bytes()]
    return digest(*parts)


def has_passed(name: str, inputs: str, file: Path = FILE) -> bool:
    """Return whether the check has passed for inputs of this digest, and may be left out."""
    return _mode() != IGNORE and f"{inputs} {name}" in _lines(file)


def note_passed(passed: Iterable[tuple[str, str]], file: Path = FILE) -> None:
    """Write down names and digests of checks that passed, if OMNI_KEPT is "write"."""
    rows = dict(passed)
    if _mode() == WRITE and rows:
        others = [line for line in _lines(file) if line.partition(" ")[2] not in rows]
        lines = {*others, *(f"{inputs} {name}" for name, inputs in rows.items())}
        text = "\n".join(sorted(lines, key=lambda line: line.partition(" ")[::-1]))
        file.write_text(f"{text}\n", encoding="utf-8")


def drop(prefix: str, names: Iterable[str], file: Path = FILE) -> None:
    """Drop the lines of checks below a prefix that are none any more, if OMNI_KEPT is "write"."""
    if _mode() == WRITE:
        wanted = set(names)
        rows = [(line, line.partition(" ")[2]) for line in _lines(file)]
        stay = [line for line, name in rows if not name.startswith(prefix) or name in wanted]
        file.write_text("".join(f"{line}\n" for line in stay), encoding="utf-8")


def _lines(file: Path) -> list[str]:
    return file.read_text(encoding="utf-8").splitlines() if file.is_file() else []


# What a compiler reads, or a linter that is one.


@cache
def _read(path: Path) -> tuple[str, tuple[str, ...]] | None:
    """Return a source's digest and the names that it includes; None: it is not there."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    names = re.findall(r'^\s*#\s*include\s*[<"]([^">]+)[>"]', content.decode(errors="replace"), flags=re.MULTILINE)
    return digest(content), tuple(names)


def _folders(command: Sequence[str], directory: Path) -> list[Path]:
    found = []
    for i, word in enumerate(command):
        if word in ("-I", "-isystem", "-iquote"):
            found.append(directory / command[i + 1])
        elif word.startswith("-I"):
            found.append(directory / word[2:])
    return found


def _without_places(command: Sequence[str]) -> list[str]:
    """Return the words that say how to compile, not where what lies: two work trees have the same."""
    words, skip = [], False
    for word in command[1:]:
        is_place = skip or word.startswith("-I") or ("/" in word and not word.startswith("-D"))
        skip = word in ("-I", "-isystem", "-iquote", "-o")
        if not is_place and not skip:
            words.append(word)
    return words


def source_digest(source: Path, command: Sequence[str], directory: Path, *more: str) -> str:
    """Return a digest of a source, of all headers that it may include from this command's folders, and of the flags.

    Headers of the compiler stand for its version: name it in ``more``. Conditions around an #include do not count.
    """
    folders = _folders(command, directory)
    parts, seen, waiting = [*_without_places(command), *more], set[Path](), [source.resolve()]
    while waiting:
        path = waiting.pop()
        known = _read(path)
        if path in seen or known is None:
            continue
        seen.add(path)
        parts += [path.name, "" if path.name in _PASSED_BY else known[0]]
        for name in reversed(known[1]):
            places = (folder / name for folder in (path.parent, *folders))
            found = next((place for place in places if place.is_file()), None)
            waiting += [] if found is None else [found.resolve()]
    return digest(*parts)


def compiled_sources(database: Path) -> dict[Path, tuple[list[str], Path]]:
    """Return command and folder by the source files of a compile_commands.json."""
    entries = json.loads(database.read_text(encoding="utf-8"))
    return {Path(entry["file"]): (shlex.split(entry["command"]), Path(entry["directory"])) for entry in entries}


def version_of(*command: str) -> str:
    """Return what a tool says of its version."""
    return subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout


def main(arguments: list[str]) -> int:
    """Run a command unless it has passed for the same content; return its exit code."""
    at = arguments.index("--") if "--" in arguments else len(arguments)
    parser = argparse.ArgumentParser(description="Run a command unless it has passed.", usage="%(prog)s ... -- COMMAND")
    parser.add_argument("name")
    parser.add_argument("--of", type=Path, action="append", required=True, help="file or folder whose content counts")
    parser.add_argument("--tool", action="append", default=[], help="whose version counts")
    options, command = parser.parse_args(arguments[:at]), arguments[at + 1 :]
    missing = [path for path in options.of if not path.exists()]
    if not command or missing:
        parser.error(f"there is no {missing[0]}" if missing else "which command? behind --")
    complete = all(map(shutil.which, options.tool))
    versions = [version_of(tool) for tool in options.tool] if complete else []
    inputs = digest(files_digest(options.of), *versions, *command)
    if complete and has_passed(options.name, inputs):
        sys.stdout.write(f"{options.name}: not made again, it has passed ({VARIABLE}={IGNORE} makes it)\n")
        return 0
    status = subprocess.run(command, check=False).returncode
    if complete and status == 0:
        note_passed([(options.name, inputs)])
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
