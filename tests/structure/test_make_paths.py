# SPDX-License-Identifier: MIT
"""The Makefile works in a clone, and with a robot file, whose path has blanks and other letters than ASCII's."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STUDIO = Path("host/omni/studio")
# Leaves the files that the page takes from npm, as npm ci does.
NPM = """#!/bin/sh
mkdir -p node_modules/uplot/dist
for name in dist/uPlot.esm.js dist/uPlot.min.css LICENSE; do echo "$*" >node_modules/uplot/$name; done
"""
# Notes its arguments and the robot file of PlatformIO's build.
NOTE = """#!/bin/sh
printf '%s\\n' "$OMNI_ROBOT" "$@" >>calls
"""


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Return a folder with the Makefile, what its page needs, and programs that only note their use."""
    folder = tmp_path / "my röbot" / "omniwheel"
    for name in ("Makefile", "pyproject.toml", STUDIO / "package.json", STUDIO / "package-lock.json"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    script(folder / ".venv" / "bin" / "npm", NPM)
    for name in ("python", "pio", "omni"):
        script(folder / ".venv" / "bin" / name, NOTE)
    (folder / ".venv" / "stamp-tools").touch()
    (folder / ".venv" / "stamp-platformio").touch()
    return folder


def make(clone: Path, *words: str) -> None:
    """Run make in the clone, with the system's commands but npm."""
    commands = clone.parent / "bin"
    commands.mkdir()
    for name in ("sh", "cp", "rm", "mkdir", "touch", "find", "echo", "realpath"):
        (commands / name).symlink_to(str(shutil.which(name)))
    environment = {key: value for key, value in os.environ.items() if not key.startswith("MAKE")}
    old = [word for stamp in ("tools", "platformio") for word in ("-o", f".venv/stamp-{stamp}")]
    done = subprocess.run(
        [str(shutil.which("make")), *old, *words],
        cwd=clone,
        env={**environment, "PATH": str(commands)},
        capture_output=True,
        encoding="utf-8",
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_page_is_made(clone: Path) -> None:
    make(clone, "studio-page")
    assert (clone / STUDIO / "vendor" / "uPlot.esm.js").read_text(encoding="utf-8").startswith("ci ")
    assert not (clone / "calls").exists(), "npm is there: nothing is to be installed"


def test_the_firmware_is_built_for_a_robot_file(clone: Path) -> None:
    robot = clone.parent / "mein röbot.toml"
    robot.touch()
    make(clone, "firmware", "ROBOT=../mein röbot.toml")
    calls = (clone / "calls").read_text(encoding="utf-8").splitlines()
    assert calls[calls.index("--robot") + 1] == "../mein röbot.toml"
    assert calls[calls.index("run") - 1] == str(robot)
