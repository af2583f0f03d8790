# SPDX-License-Identifier: MIT
"""Compiles and links the program with one file changed, from the objects that `make setup` left.

The core is linked into a shared library of its own, which the Python extension of ``build/mutation/site`` loads: a
mutant of the core is one compiler run and one small link. A mutant of the firmware is a PC firmware.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from tests.mutation.operators import Mutant, find_mutants
from tests.native import ROOT, generated_dir

OUT = ROOT / "build" / "mutation"
SITE = OUT / "site"
CORE_LIBRARY = "libomni_core_under_test.so"
COMPILER = Path(__file__).with_name("compiler.sh")
COMPILE_TIMEOUT_S = 120
PACKAGES = {
    "omniwheel": "host",
    "omni": "host",
    "omni_schema": "shared/generate",
    **dict.fromkeys(("bench", "emulated_teensy", "hil_sim", "image_check", "omni_reproduce"), "."),
}

FIRMWARE_RUNS = (
    "tests/hil_sim/test_lockstep.py",
    "tests/hil_sim/test_runs.py",
    "tests/host/bringup",
    "tests/host/mocap/test_bridge.py",
    "tests/host/test_firmware_process.py",
    "tests/host/test_presets.py",
)
"""Tests outside tests/firmware and tests/radio that run the firmware as a process."""


class BuildError(Exception):
    """Something that must compile does not; the message holds the tool's words."""


@dataclass(frozen=True)
class Area:
    """A folder of sources, and the tests that may find its mutants."""

    name: str
    folder: Path
    options: tuple[str, ...]
    tests: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    """Tests that compare with a build whose sources are not changed: they see any difference, as a golden hash does."""

    @property
    def sources(self) -> list[Path]:
        return sorted(path for path in self.folder.rglob("*") if path.suffix in (".c", ".cpp"))

    def mutants(self) -> list[Mutant]:
        return find_mutants(ROOT, self.sources, self.folder, self.options)


def areas() -> dict[str, Area]:
    """Return what is mutated, by name."""
    generated = generated_dir()
    common = (f"-I{ROOT / 'shared' / 'core' / 'include'}", f"-I{generated / 'include'}")
    core = Area(
        "core",
        ROOT / "shared" / "core" / "src",
        ("-std=c99", *common),
        ("tests/core", "tests/hil_sim"),
        ("tests/hil_sim/lanes/", "tests/hil_sim/test_batch.py", "tests/hil_sim/test_c_timeline.py"),
    )
    cpp = ("-x", "c++", "-std=c++17", f"-I{ROOT / 'firmware'}", *common, "-isystem", str(generated / "mavlink"))
    app = Area("app", ROOT / "firmware" / "app", cpp, ("tests/firmware", "tests/radio", *FIRMWARE_RUNS))
    return {area.name: area for area in (core, app)}


@dataclass(frozen=True)
class Compiled:
    """What became of a mutant: ``refused`` holds the compiler's first error; ``same``: equal object code."""

    refused: str = ""
    same: bool = False
    product: Path | None = None
    """The core's library or the firmware."""


class Builder:
    """Compiles mutants of one area in a folder of its own."""

    def __init__(self, area: Area, extra: Sequence[str] = ()) -> None:
        self.area = area
        self.build = generated_dir().parent
        self.folder, self._lock = _own_folder(area.name)
        self._extra = list(extra)
        self._commands = _commands(self.build, area.folder)
        self._copy = self.folder / area.folder.name
        self._texts = {path: path.read_bytes() for path in area.folder.rglob("*") if path.is_file()}
        shutil.copytree(area.folder, self._copy)

    def try_mutant(self, mutant: Mutant) -> Compiled:
        """Compile and, if that changes anything, link it. Raises BuildError if linking fails."""
        original = ROOT / mutant.file
        changed = self._copy_of(original)
        changed.write_bytes(self._changed(mutant))
        try:
            objects: dict[Path, Path] = {}
            for source in self._users(original):
                target = self.folder / f"{source.name}.o"
                if words := self._compile(source, target):
                    return Compiled(refused=words)
                if target.read_bytes() != self.object_of(source).read_bytes():
                    objects[source] = target
            if not objects:
                return Compiled(same=True)
            return Compiled(product=self.link(objects))
        finally:
            changed.write_bytes(self._texts[original])

    def _changed(self, mutant: Mutant) -> bytes:
        """Return the mutant's source. Raises BuildError if it is not the one that the mutants were found in."""
        path = ROOT / mutant.file
        text = self._texts[path]
        if path.read_bytes() != text:
            raise BuildError(f"{mutant.file} has changed meanwhile: run it again, results so far are kept")
        return mutant.apply(text)

    def test_environment(self, mutant: Mutant | None, product: Path) -> dict[str, str]:
        """Return what a test needs to reach the mutant."""
        if self.area.name == "core":
            return {"OMNI_FIRMWARE": str(OUT / "no-firmware")}
        cache = shutil.which("ccache") or ""
        changed = {"OMNI_FIRMWARE": str(product), "CXX": shlex.quote(str(COMPILER)), "CC": f"{cache} cc".strip()}
        if mutant is not None:
            shutil.rmtree(self.folder / "changed", ignore_errors=True)
            # A folder of its own: in a known one ccache does not look whether a header has come that hides another.
            app = self.folder / "changed" / hashlib.sha256(mutant.key.encode()).hexdigest()[:16] / "app"
            place = app / (ROOT / mutant.file).relative_to(self.area.folder)
            place.parent.mkdir(parents=True)
            place.write_bytes(self._changed(mutant))
            changed["OMNI_ORIGINAL"] = str(ROOT / mutant.file)
            changed["OMNI_CHANGED"] = str(place)
            if place.suffix == ".h":
                changed["OMNI_OPTIONS"] = shlex.quote(f"-I{app.parent}")
        return changed

    def compile_all(self) -> dict[Path, Path]:
        """Compile every source of the area with the extra options; for builds that are instrumented."""
        objects = {}
        for source in self.area.sources:
            objects[source] = self.folder / f"{source.name}.o"
            if words := self._compile(source, objects[source]):
                raise BuildError(words)
        return objects

    def object_of(self, source: Path) -> Path:
        """Return the object that `make setup` made of a source."""
        return self._commands[source][1]

    def link(self, changed: Mapping[Path, Path], more: Sequence[str] = ()) -> Path:
        """Link with these objects in place of the originals'. Raises BuildError."""
        objects = [str(changed.get(source, self.object_of(source))) for source in self.area.sources]
        archives = [str(self.build / part) for part in ("shared/core/libomni_core.a", "shared/link/libomni_link.a")]
        if self.area.name == "core":
            product = self.folder / "under_test.so"
            tables = sorted(map(str, self.build.glob("shared/core/CMakeFiles/omni_core.dir/**/generated/src/*.o")))
            run(["cc", "-shared", f"-Wl,-soname,{CORE_LIBRARY}", *objects, *tables, *more, "-o", str(product)])
        else:
            product = self.folder / "omni-firmware"
            boards = sorted(map(str, self.build.glob("firmware/CMakeFiles/omni_firmware.dir/boards/**/*.o")))
            run(["c++", *objects, *boards, *archives, *more, "-o", str(product)])
        return product

    def _compile(self, source: Path, target: Path) -> str:
        """Compile the copy of a source; return the first error."""
        compiler, *options = self._commands[source][0]
        command = [
            compiler,
            f"-I{self.folder}",
            *(word.replace(f"-I{self.area.folder}", f"-I{self._copy}") for word in options),
            *self._extra,
            "-c",
            str(self._copy_of(source)),
            "-o",
            str(target),
        ]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=self.build, timeout=COMPILE_TIMEOUT_S
        )
        if done.returncode == 0:
            return ""
        return next((line for line in done.stderr.splitlines() if "error" in line), done.stderr)[-300:] or "no words"

    def _copy_of(self, path: Path) -> Path:
        return self._copy / path.relative_to(self.area.folder)

    def _users(self, changed: Path) -> list[Path]:
        """Return the sources whose objects a change of this file can change."""
        if changed.suffix != ".h":
            return [changed]
        users = []
        for source in self.area.sources:
            command = [*self._commands[source][0], "-MM", str(source)]
            done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=self.build)
            if str(changed) in map(os.path.normpath, done.stdout.split()):
                users.append(source)
        return users


def _own_folder(name: str) -> tuple[Path, IO[str]]:
    """Return an empty folder that no other run uses while the lock is open."""
    OUT.mkdir(parents=True, exist_ok=True)
    for number in range(100):
        folder = OUT / f"{name}-{number}"
        lock = folder.with_suffix(".lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return folder, lock
    raise BuildError(f"a hundred runs at once in {OUT}?")


def _commands(build: Path, folder: Path) -> dict[Path, tuple[list[str], Path]]:
    """Return per source the compiler's command without warnings, input and output, and the object it wrote."""
    commands = {}
    for entry in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        source = Path(entry["file"])
        words = shlex.split(entry["command"])
        if folder not in source.parents or "lanes" in entry["command"] or source in commands:
            continue
        target = build / words[words.index("-o") + 1]
        kept = [word for word in words[: words.index("-o")] if not word.startswith("-W")]
        if Path(kept[0]).name == "ccache":
            kept = kept[1:]
        commands[source] = ([*kept, "-w"], target)
    return commands


def prepare_site() -> None:
    """Lay out the Python packages with an extension that takes the core from its own library. Raises BuildError."""
    build = generated_dir().parent
    stamp = SITE / "stamp"
    state = _state(build)
    if stamp.exists() and stamp.read_text(encoding="utf-8") == state:
        return
    shutil.rmtree(SITE, ignore_errors=True)
    leave_out = shutil.ignore_patterns("*.c", "*.cpp", "*.h", "__pycache__")
    for package, folder in PACKAGES.items():
        shutil.copytree(ROOT / folder / package, SITE / package, ignore=leave_out)
    run([_tool("cmake"), "--install", str(build), "--prefix", str(SITE)])
    extension = SITE / "omniwheel" / "_core.abi3.so"
    core = Builder(areas()["core"])
    library = SITE / CORE_LIBRARY
    shutil.copy(core.link({}), library)
    parts = [
        *("host/native/CMakeFiles/_core.dir/_core.c.o", "hil_sim/libhil_sim.a"),
        *("emulated_teensy/libemulated_teensy.a", "shared/link/libomni_link.a"),
    ]
    extension.unlink()
    inputs = [*(str(build / part) for part in parts), str(library)]
    run(["c++", "-shared", *inputs, f"-Wl,-rpath,{SITE}", "-lm", "-ldl", "-o", str(extension)])
    firmware = SITE / "omniwheel" / "bin" / "omni-firmware"
    firmware.rename(firmware.with_name("omni-firmware-original"))
    firmware.write_text(f'#!/bin/sh\nexec "${{OMNI_FIRMWARE:-{firmware}-original}}" "$@"\n', encoding="utf-8")
    firmware.chmod(0o755)
    stamp.write_text(state, encoding="utf-8")


def _state(build: Path) -> str:
    """Return what tells whether the site must be laid out again."""
    parts = [build / "host" / "native" / "_core.abi3.so", build / "firmware" / "omni-firmware"]
    parts += (path for package, folder in PACKAGES.items() for path in sorted((ROOT / folder / package).rglob("*.py")))
    return "".join(f"{path} {path.stat().st_mtime_ns}\n" for path in parts)


def python() -> tuple[str, dict[str, str]]:
    """Return the interpreter without this environment's start-up hook, and the path that brings the packages back."""
    packages = sysconfig.get_path("platlib")
    base = str(getattr(sys, "_base_executable", sys.executable))
    return base, {"PYTHONPATH": ":".join(map(str, (SITE, packages, ROOT)))}


def run(command: Sequence[str]) -> None:
    """Run a tool. Raises BuildError with its words."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=COMPILE_TIMEOUT_S)
    if done.returncode != 0:
        raise BuildError(f"{shlex.join(command)}\n{done.stderr[-2000:]}")


def _tool(name: str) -> str:
    beside = Path(sys.executable).with_name(name)
    return str(beside) if beside.exists() else name
