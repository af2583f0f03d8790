# SPDX-License-Identifier: MIT
"""What the check of an image cannot do is reported at once, and is no failed check of the image."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from typer.testing import CliRunner

from image_check.run import all_checks
from omni.checks import app
from tests.host.hex_files import teensy_program, write_hex

pytest.importorskip("intelhex")


def refused(path: Path, *words: str, code: int) -> str:
    result = CliRunner().invoke(app, ["image", str(path), *words], env={"COLUMNS": "400"})
    assert result.exit_code == code, (result.output, result.stderr)
    assert "✗" not in result.output
    return result.stderr


@pytest.fixture
def image(tmp_path: Path) -> Path:
    return write_hex(tmp_path / "firmware.hex", teensy_program())


def test_without_the_processor_emulator_no_check_is_said_to_have_failed(
    image: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    said = refused(image, code=1)
    assert "unicorn" in said
    assert "pip install 'omniwheel[flash]'" in said


def test_a_robot_or_a_check_that_is_none_comes_with_those_there_are(
    image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "three_wheel" in refused(image, "--robot", "tree_wheel", code=2)
    assert "power-cuts" in refused(image, "--only", "powercuts", code=2)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text("")
    assert "give a file with its suffix: mine.toml" in refused(image, "--robot", "mine", code=2)


def test_each_check_of_the_list_begins_a_line_with_its_whole_name() -> None:
    """What it does goes on below, indented, where the terminal is narrow."""
    listed = CliRunner().invoke(app, ["image", "--list"], env={"COLUMNS": "40"}).stdout.splitlines()
    begun = [line.split()[0] for line in listed if not line.startswith(" ")]
    assert begun == [check.name for check in all_checks()]
