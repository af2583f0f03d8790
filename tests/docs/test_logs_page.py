# SPDX-License-Identifier: MIT
"""The first example of the page about logs works for whoever has run the demo, and ends as the page says."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni.cli import app

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "logs.md"


@pytest.mark.full
def test_the_first_example_needs_the_demo_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = PAGE.read_text(encoding="utf-8")
    block = re.search(r"```sh\n(.*?)```", page, re.DOTALL)
    assert block is not None
    monkeypatch.chdir(tmp_path)
    said = []
    for line in ("omni run", *block[1].splitlines()):
        result = CliRunner().invoke(app, shlex.split(line)[1:], env={"COLUMNS": "200"})
        assert result.exit_code == 0, (line, result.output)
        said.append(result.stdout)
    told = re.search(r"says `([^`]+)`", page)
    assert told is not None
    assert told[1] in said[1]
    assert (tmp_path / "replay.png").stat().st_size > 10_000
