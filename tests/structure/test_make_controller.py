# SPDX-License-Identifier: MIT
"""What make does with CONTROLLER=folder: another build for another folder or content, and none for the same."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Literal

import pytest
from scikit_build_core.settings.skbuild_read_settings import SettingsReader

from tests.native import ROOT

pytestmark = pytest.mark.full
EXAMPLE = ROOT / "examples" / "controllers" / "lqr"


def stamp(controller: Path | None, **environment: str) -> str:
    """Return the file on which make lets the build depend."""
    words = [f"CONTROLLER={controller}"] if controller else []
    clean = {name: value for name, value in os.environ.items() if name not in ("OMNI_CONTROLLER", "CONTROLLER")}
    command = ["make", "-pnq", "help", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env={**clean, **environment})
    (found,) = re.findall(r"^CONTROLLER_STAMP := (\S+)$", done.stdout, re.MULTILINE)
    return str(found)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(EXAMPLE, tmp_path / "my contröllers" / "lqr"))


@pytest.mark.parametrize("name", ["lqr.c", "lqr.h", "parameters.toml"])
def test_a_change_of_a_controller_is_another_build(folder: Path, name: str) -> None:
    before = stamp(folder)
    assert before == stamp(folder)
    with (folder / name).open("a", encoding="utf-8") as file:
        file.write("\n")
    assert stamp(folder) != before


def test_the_environment_names_it_too_and_without_it_the_build_is_the_trees_own(folder: Path) -> None:
    assert stamp(None, OMNI_CONTROLLER=str(folder)) == stamp(folder) != stamp(EXAMPLE)
    assert stamp(None) == "build/stamp-controller-none"


def test_a_folder_that_is_not_there_is_an_error() -> None:
    done = subprocess.run(
        ["make", "-n", "setup", "CONTROLLER=/no/such folder"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "CONTROLLER=/no/such folder: no such folder" in done.stderr


@pytest.mark.parametrize("state", ["editable", "wheel"])
def test_pip_hands_the_folder_to_cmake(state: Literal["editable", "wheel"], monkeypatch: pytest.MonkeyPatch) -> None:
    """An editable install has settings of its own, which must not replace the others."""
    monkeypatch.setenv("OMNI_CONTROLLER", "/a folder")
    asserts = "ON" if state == "editable" else "OFF"
    expected = {"OMNI_ASSERTS": asserts, "OMNI_CONTROLLER": "/a folder"}
    assert SettingsReader.from_file(ROOT / "pyproject.toml", {}, state=state).settings.cmake.define == expected
    monkeypatch.delenv("OMNI_CONTROLLER")
    expected["OMNI_CONTROLLER"] = ""
    assert SettingsReader.from_file(ROOT / "pyproject.toml", {}, state=state).settings.cmake.define == expected
