# SPDX-License-Identifier: MIT
"""Follows the recipe of a page of docs/how-to-add in a scratch copy of the repository: copy, edit, count, build, drive.

A page says what to do in a few kinds of sentences, and the test does just that:

- "Create `path`:", then a block of code: a new file.
- "In `path`, add below the line that begins with `text`:", or "below the last line", or "above the line", or
  "at the end of the table `[name]`:", then a block of code.
- "In `path`, add `entry` at the end of `list` of `NAME`": a list within one line of a TOML file.
- "In `path`, put `new` in place of `old`."

``N`` as a number stands for the number after the largest one there. Everything else on the page is for the reader.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "how-to-add"
NOT_COUNTED = ("docs/", "tests/", "CHANGELOG.md")
"""Where an extension may touch what it likes."""

_CREATE = re.compile(r"Create `([^`]+)`:$")
_LINE = re.compile(r"In `([^`]+)`, add (above|below) the (last )?line that begins with `([^`]+)`:$")
_TABLE = re.compile(r"In `([^`]+)`, add at the end of the table `([^`]+)`:$")
_LIST = re.compile(r"[Ii]n `([^`]+)`, add `([^`]+)` at the end of `([^`]+)` of `([^`]+)`")
_REPLACE = re.compile(r"[Ii]n `([^`]+)`, put `([^`]+)` in place of `([^`]+)`")
_CODE = re.compile(r"^```\w*\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class RecipeError(Exception):
    """A page that cannot be followed, or a command that failed on the way."""


@dataclass(frozen=True)
class Edit:
    """One step. ``where`` says what ``mark`` is: create, replace, above, below, last (line), table, or a list."""

    path: str
    new: str
    where: str = "create"
    mark: str = ""

    def apply(self, root: Path) -> None:
        """Do it. Raises RecipeError if the file is not as the page says."""
        path = root / self.path
        if self.where == "create":
            if path.exists():
                raise RecipeError(f"{self.path} is there already")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(self.new, encoding="utf-8")
            return
        text = path.read_text(encoding="utf-8")
        if self.where == "replace":
            if text.count(self.mark) != 1:
                raise RecipeError(f"{self.path} has '{self.mark}' {text.count(self.mark)} times")
            path.write_text(text.replace(self.mark, self.new), encoding="utf-8")
            return
        lines = text.splitlines(keepends=True)
        if self.where in ("above", "below", "last", "table"):
            new = self.new.replace('id="N"', f'id="{_next(re.findall(r"<message id=.([0-9]+)", text))}"')
            lines.insert(self._place(lines), new)
        else:
            self._add_to_list(lines)
        path.write_text("".join(lines), encoding="utf-8")

    def _place(self, lines: Sequence[str]) -> int:
        """Return before which line the new ones come."""
        places = [number for number, line in enumerate(lines) if line.lstrip().startswith(self.mark)]
        if not places or (len(places) > 1 and self.where != "last"):
            raise RecipeError(f"{self.path} has {len(places)} lines that begin with '{self.mark}'")
        if self.where == "above":
            return places[0]
        if self.where == "table":
            return next((n for n in range(places[0] + 1, len(lines)) if not lines[n].strip()), len(lines))
        return places[-1] + 1

    def _add_to_list(self, lines: list[str]) -> None:
        places = [number for number, line in enumerate(lines) if line.startswith(f"{self.mark} =")]
        found = re.search(rf"\b{self.where} = {{ (.*?) }}", lines[places[0]]) if len(places) == 1 else None
        if found is None:
            raise RecipeError(f"{self.path} has no list '{self.where}' of '{self.mark}'")
        entry = re.sub(r"\bN$", str(_next(re.findall(r"= ([0-9]+)", found[1]))), self.new)
        line = lines[places[0]]
        lines[places[0]] = f"{line[: found.end(1)]}, {entry}{line[found.end(1) :]}"

    def renamed(self, names: Mapping[str, str]) -> Edit:
        """Return the same step for something of another name."""
        path, new = self.path, self.new
        for before, after in names.items():
            path, new = path.replace(before, after), new.replace(before, after)
        return replace(self, path=path, new=new)


def _next(numbers: Sequence[str]) -> int:
    return max(map(int, numbers), default=0) + 1


def read_page(text: str) -> list[Edit]:
    """Return the steps of a page, in its order. Raises RecipeError for a sentence without its block of code."""
    edits: list[Edit] = []
    prose_and_code = _CODE.split(text)
    for prose, code in zip_longest(prose_and_code[::2], prose_and_code[1::2]):
        waiting: list[Edit] = []
        for paragraph in _paragraphs(prose):
            if waiting:
                raise RecipeError(f"no code follows on what {waiting[0].path} is to be given")
            edits += [Edit(found[1], found[2], "replace", found[3]) for found in _REPLACE.finditer(paragraph)]
            edits += [Edit(found[1], found[2], found[3], found[4]) for found in _LIST.finditer(paragraph)]
            if found := _CREATE.search(paragraph):
                waiting.append(Edit(found[1], code or ""))
            elif found := _LINE.search(paragraph):
                waiting.append(Edit(found[1], code or "", "last" if found[3] else found[2], found[4]))
            elif found := _TABLE.search(paragraph):
                waiting.append(Edit(found[1], code or "", "table", found[2]))
        edits += waiting
    if any(not edit.new for edit in edits):
        raise RecipeError("no code follows on the last of the steps")
    return edits


def _paragraphs(text: str) -> Iterator[str]:
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        yield " ".join(paragraph.split())


class Scratch:
    """A copy of the repository's sources. Its build and its Python packages are its own, too."""

    def __init__(self, root: Path, controller: Path | None = None) -> None:
        """Copy the work tree, with what is not committed yet, to the new folder ``root``.

        ``controller``: folder of a controller outside the tree, to be built in.
        """
        self.root = root
        self._controller = controller
        listed = call(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], ROOT)
        for name in filter(None, listed.split("\0")):
            if (ROOT / name).is_file():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / name, root / name)
        self._before = self._state()

    def begin(self) -> None:
        """Count from now on what is touched."""
        self._before = self._state()

    def _state(self) -> dict[str, bytes]:
        files = (path for path in self.root.rglob("*") if path.is_file() and "build" not in path.parts)
        return {path.relative_to(self.root).as_posix(): path.read_bytes() for path in files}

    def follow(self, edits: Sequence[Edit]) -> None:
        """Apply the steps in their order."""
        for edit in edits:
            edit.apply(self.root)

    def touched(self) -> list[str]:
        """Return the files that are new or different now, those of docs and tests left out."""
        now, before = self._state(), self._before
        names = sorted(name for name in now.keys() | before.keys() if now.get(name) != before.get(name))
        return [name for name in names if not name.startswith(NOT_COUNTED)]

    def build(self, *targets: str) -> Path:
        """Build CMake targets, not optimised. Return the build folder; raise RecipeError with the tool's words."""
        build = self.root / "build" / "recipe"
        search = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
        environment = dict(os.environ, PATH=search, CCACHE_BASEDIR=str(self.root), CCACHE_NOHASHDIR="1")
        environment.pop("LD_PRELOAD", None)
        if ccache := shutil.which("ccache"):
            environment |= {"CMAKE_C_COMPILER_LAUNCHER": ccache, "CMAKE_CXX_COMPILER_LAUNCHER": ccache}
        plain = ["-DCMAKE_BUILD_TYPE=None", "-DCMAKE_C_FLAGS=-O0", "-DCMAKE_CXX_FLAGS=-O0", "-DOMNI_LANES_AVX2=OFF"]
        plain += ["-G", "Ninja"] if shutil.which("ninja", path=search) else []
        folders = ["-S", str(self.root), "-B", str(build), f"-DPython_EXECUTABLE={sys.executable}"]
        folders += [f"-DOMNI_CONTROLLER={self._controller or ''}"]
        call(["cmake", *folders, *plain], self.root, environment)
        call(["cmake", "--build", str(build), "--parallel", "2", "--target", *targets], self.root, environment)
        return build

    def packages(self) -> Path:
        """Build extension and firmware, once, and return a folder with this copy's packages around them."""
        site = self.root / "build" / "site"
        if not site.exists():
            build = self.build("_core", "omni_firmware")
            shutil.copytree(self.root / "host" / "omniwheel", site / "omniwheel")
            shared = self.root / "shared"
            for schema in (build / "generated" / "params.toml", shared / "world.toml"):
                shutil.copyfile(schema, site / "omniwheel" / schema.name)
            for written in (build / "generated" / "python").glob("*.py"):
                shutil.copyfile(written, site / "omniwheel" / written.name)
            for name in ("robots", "presets"):
                shutil.copytree(shared / name, site / "omniwheel" / name)
            (site / "omniwheel" / "dialects").symlink_to(build / "generated" / "dialects")
            (site / "omniwheel" / "bin").symlink_to(build / "firmware")
            for package in ("emulated_teensy", "hil_sim", "image_check", "host/omni"):
                (site / Path(package).name).symlink_to(self.root / package)
            (site / "omni_schema").symlink_to(shared / "generate" / "omni_schema")
            extension = next((build / "host" / "native").glob("_core*.*so"))
            shutil.copyfile(extension, site / "omniwheel" / extension.name)
        return site


def call(command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None) -> str:
    """Run a command in a folder and return its output. RecipeError with the tool's words if it fails."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        raise RecipeError(f"{' '.join(command[:6])} ...\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")
    return done.stdout
