# SPDX-License-Identifier: MIT
"""The planted bugs: patches beside this file, each with what it would do on a robot in its head."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
HERE = Path(__file__).resolve().parent
END_OF_HEAD = "---\n"
ROBOT = "three_wheel"
"""The robot whose image they are planted in."""
KIT = ROOT / "build" / "platformio-core"
"""PlatformIO's platform and tools as CI puts them together, if PLATFORMIO_CORE_DIR does not say where they are."""


@dataclass(frozen=True)
class Bug:
    """One patch. ``missed`` says why no check of this model can find it; "" where one should."""

    name: str
    title: str
    robot: str
    missed: str
    path: Path

    @property
    def digest(self) -> str:
        """Return what tells this patch from an earlier one of its name."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()[:16]


def read_bug(path: Path) -> Bug:
    """Read a patch's head: ``Subject``, ``On a robot``, and perhaps ``Missed``. Raises ValueError if one is missing."""
    head, found, _ = path.read_text(encoding="utf-8").partition(END_OF_HEAD)
    fields = dict(line.split(": ", 1) for line in head.splitlines())
    if not found or not {"Subject", "On a robot"} <= fields.keys():
        raise ValueError(f"{path.name}: its head needs Subject and On a robot, then a line ---")
    return Bug(path.stem, fields["Subject"], fields["On a robot"], fields.get("Missed", ""), path)


def all_bugs() -> list[Bug]:
    """Return all of them, by name."""
    return [read_bug(path) for path in sorted(HERE.glob("*.patch"))]


def _listed(*under: str) -> list[str]:
    """Return the files that git knows, perhaps only those under some folders."""
    command = ["git", "-C", str(ROOT), "ls-files", "-z", *under]
    listed = subprocess.run(command, capture_output=True, check=True).stdout
    return sorted(filter(None, listed.decode().split("\0")))


class Tree:
    """A copy of the sources in which bugs are planted. The work tree is never touched."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        if not (folder / ".pio").exists() and (ROOT / ".pio" / "build").is_dir():
            shutil.copytree(ROOT / ".pio", folder / ".pio")  # objects that need not be built again
        self.refresh()

    def refresh(self) -> None:
        """Bring the copy to what the work tree has. What was built in it stays."""
        for name in _listed():
            source, target = ROOT / name, self.folder / name
            if not source.is_file() or (target.is_file() and source.read_bytes() == target.read_bytes()):
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)

    def plant(self, bug: Bug) -> None:
        """Put a bug into the sources as they are. Raises subprocess.CalledProcessError if its patch does not fit."""
        self.refresh()
        outside = {**os.environ, "GIT_CEILING_DIRECTORIES": str(self.folder.resolve().parent)}
        command = ["git", "apply", "--whitespace=nowarn", str(bug.path)]
        subprocess.run(command, cwd=self.folder, env=outside, check=True, capture_output=True, text=True)

    def image(self, bug: Bug | None, keep: Path) -> Path:
        """Return the image with a bug, or with none; built once for these sources and kept in the folder ``keep``.

        Raises SystemExit if the patch does not fit any more or does not build: that is no bug that could be flashed.
        """
        name, digest = (bug.name, bug.digest) if bug is not None else ("clean", "")
        kept = keep / f"{name}-{hashlib.sha256((self._sources() + digest).encode()).hexdigest()[:16]}.elf"
        if kept.is_file():
            return kept
        if bug is None:
            self.refresh()
        else:
            try:
                self.plant(bug)
            except subprocess.CalledProcessError as error:
                raise SystemExit(f"{name}.patch does not fit the sources any more: {error.stderr.strip()}") from error
        image, words = self.build()
        if image is None:
            raise SystemExit(f"{name}: does not build: {words}")
        keep.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(image, kept.with_suffix(".part"))
        kept.with_suffix(".part").rename(kept)
        return kept

    def _sources(self) -> str:
        """Return what tells these sources of the image from others."""
        state = hashlib.sha256()
        for name in _listed("firmware", "shared", "platformio.ini"):
            if (ROOT / name).is_file():
                state.update(name.encode() + hashlib.sha256((ROOT / name).read_bytes()).digest())
        return state.hexdigest()

    def build(self) -> tuple[Path | None, str]:
        """Build the image; return it, or None and the compiler's last words."""
        command = [str(Path(sys.executable).parent / "pio"), "run", "-s", "-d", str(self.folder), "-e", ROBOT]
        core = os.environ.get("PLATFORMIO_CORE_DIR") or str(KIT if KIT.is_dir() else "")
        env = {**os.environ, **({"PLATFORMIO_CORE_DIR": core} if core else {})}
        done = subprocess.run(command, cwd=self.folder, env=env, capture_output=True, text=True, check=False)
        image = self.folder / ".pio" / "build" / ROBOT / "firmware.elf"
        return (image, "") if done.returncode == 0 else (None, (done.stderr or done.stdout).strip()[-300:])
