# SPDX-License-Identifier: MIT
"""A device that is given for a file is refused: /dev/zero has no end."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni.cli import app

pytestmark = pytest.mark.skipif(not Path("/dev/zero").is_char_device(), reason="no such device on this system")


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "line",
    [
        "run x.toml",
        "run demo --robot ./x.toml",
        "run demo --preset ./x.params",
        "montecarlo x.toml",
        "drive path x.csv --link tcp:127.0.0.1:9",
        "plot x.tlog",
        "replay x.tlog --robot three_wheel",
        "identify telemetry x.tlog",
        "logs show x.npz",
        "robots check ./x.toml",
        "params load x.params --link tcp:127.0.0.1:9",
    ],
)
def test_a_device_is_refused_by_its_name(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for end in ("toml", "csv", "tlog", "npz", "params"):
        (tmp_path / f"x.{end}").symlink_to("/dev/zero")
    done = CliRunner().invoke(app, line.split())
    assert done.exit_code in (1, 2)
    assert "x." in done.output
    assert not any(path.is_file() for path in tmp_path.rglob("*"))
