# SPDX-License-Identifier: MIT
"""The planted bugs: patches beside this file, each with what it would do on a robot in its head."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
HERE = Path(__file__).resolve().parent
END_OF_HEAD = "---\n"
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


class Tree:
    """A copy of the sources in which bugs are planted. The work tree is never touched."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        if not (folder / ".pio").exists() and (ROOT / ".pio" / "build").is_dir():
            shutil.copytree(ROOT / ".pio", folder / ".pio")  # objects that need not be built again
        self.refresh()

    def refresh(self) -> None:
        """Bring the copy to what the work tree has. What was built in it stays."""
        listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, check=True).stdout
        for name in filter(None, listed.decode().split("\0")):
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

    def build(self, pio: Path) -> tuple[Path | None, str]:
        """Build three_wheel; return the image, or None and the compiler's last words."""
        command = [str(pio), "run", "-s", "-d", str(self.folder), "-e", "three_wheel"]
        core = os.environ.get("PLATFORMIO_CORE_DIR") or str(KIT if KIT.is_dir() else "")
        env = {**os.environ, **({"PLATFORMIO_CORE_DIR": core} if core else {})}
        done = subprocess.run(command, cwd=self.folder, env=env, capture_output=True, text=True, check=False)
        image = self.folder / ".pio" / "build" / "three_wheel" / "firmware.elf"
        return (image, "") if done.returncode == 0 else (None, (done.stderr or done.stdout).strip()[-300:])
