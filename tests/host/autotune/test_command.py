# SPDX-License-Identifier: MIT
"""``omni autotune``: what it says and writes once the drives are over. The drives are tested elsewhere."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.autotune import page, procedure
from omniwheel.autotune.choice import Choice
from tests.host.stepped import robot


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """A robot whose autotune restores the old values, because only the margins speak for the new ones."""
    outcome = SimpleNamespace(
        old={"WS_P": 4.0},
        new={"WS_P": 2.0},
        kept=False,
        choice=Choice(False, "no metric improves", "wheel loops: gain margin 1.2 of 2"),
        verdicts=[],
        design=SimpleNamespace(fit=SimpleNamespace(fit=0.9)),
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(procedure, "autotune", lambda *_: outcome)
    monkeypatch.setattr(page, "write_page", lambda _outcome, _required, _table, folder: folder / page.PAGE)
    with robot() as url:
        yield url


def tune(link: str, *words: str) -> Any:
    result = CliRunner().invoke(app, ["autotune", "--link", link, *words], env={"COLUMNS": "300"})
    assert result.exit_code == 0, (result.output, result.stderr, result.exception)
    return result


def test_what_was_asked_for_and_not_done_is_said(link: str) -> None:
    said = tune(link, "--name", "tuned", "--store").stdout
    assert not Path("tuned.toml").exists()
    assert "tuned.toml was not written" in said
    assert "nothing was stored" in said
    assert "--prefer margin" in said
    assert page.AFTER in said
    assert "tuned.toml" not in tune(link).stdout


def test_json_says_that_there_is_no_robot_file(link: str) -> None:
    report = json.loads(tune(link, "--name", "tuned", "--json").stdout)
    assert report["robot_file"] is None
    assert report["lacking"]
