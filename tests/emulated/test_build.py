# SPDX-License-Identifier: MIT
"""The emulated board is built where CMake and Ninja are those of the Python environment alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.native import ROOT

TOOLS = Path(sys.executable).parent
BOARD = "omni_firmware_mps2"


def programs_without(folder: Path, *names: str) -> Path:
    """Return a folder with the programs of this computer but those."""
    folder.mkdir()
    for place in (Path("/usr/bin"), Path("/bin")):
        for program in place.iterdir():
            if program.name not in names and not (folder / program.name).exists():
                (folder / program.name).symlink_to(program)
    return folder


@pytest.mark.needs("arm")
def test_the_board_is_configured_without_ninja_on_the_path(tmp_path: Path) -> None:
    environment = {"PATH": str(programs_without(tmp_path / "bin", "cmake", "ninja")), "HOME": str(tmp_path)}
    build = tmp_path / "with a blank"
    options = ["OMNI_PYTHON=OFF", f"CMAKE_MAKE_PROGRAM={TOOLS / 'ninja'}", f"Python_EXECUTABLE={sys.executable}"]
    configure = ["-S", str(ROOT), "-B", str(build), "-G", "Ninja", *(f"-D{option}" for option in options)]
    for words in (
        configure,
        ["--build", str(build), "--target", f"firmware/{BOARD}-prefix/src/{BOARD}-stamp/{BOARD}-configure"],
    ):
        done = subprocess.run(
            [str(TOOLS / "cmake"), *words], env=environment, capture_output=True, text=True, timeout=100, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert (build / "firmware" / "mps2" / "build.ninja").exists()
