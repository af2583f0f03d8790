# SPDX-License-Identifier: MIT
"""What a newcomer mistypes first is answered with what to do, not with what the computer met."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from omniwheel.cli import app


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("sim nosuch", "hint: give one of these names, or a .toml file of your own"),
        ("plot nothing", "hint: give a .tlog file or the folder of a run; `omni runs` lists them"),
        ("monitor", "`omni sitl` simulates one"),
    ],
)
def test_the_hint_says_what_to_type_next(typed: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omniwheel.ports.serial_ports", list)
    monkeypatch.delenv("OMNI_LINK", raising=False)
    result = CliRunner().invoke(app, typed.split(), env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
    assert "Errno" not in result.output
