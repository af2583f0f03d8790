# SPDX-License-Identifier: MIT
"""A command replaces no file by its name alone: --force is needed, or it is a picture where a picture is drawn."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel import sync

KEPT = "# somebody's notes\n"
NOWHERE = ("--link", "tcp:127.0.0.1:9")
WRITERS = {
    "params save": ("params", "save", "{file}.toml", *NOWHERE),
    "logs import": ("logs", "import", "run.csv", "--mapping", "mapping.toml", "--out", "{file}.npz"),
    "plot": ("plot", "runs/demo", "--out", "{file}.png"),
    "plot of a log": ("plot", "drive.tlog", "--out", "{file}.png"),
    "record": ("record", "{file}.tlog", *NOWHERE),
    "mocap record": ("mocap", "record", "{file}.csv", "--source", "simulated"),
    "replay's table": ("replay", "run.npz", "--csv", "{file}.csv"),
    "export": ("robots", "export", "three_wheel", "{file}.urdf"),
    "replay's picture": ("replay", "run.npz", "--plot", "{file}.png"),
    "tune's picture": ("tune", "--set", "WS_P=6", "--plot", "{file}.png", "--revert", *NOWHERE),
    "host-control's": ("host-control", "pose", "0", "0", "0", "--simulate", "--plot", "{file}.png"),
    "top speeds": ("robots", "check", "three_wheel", "--plot", "{file}.png"),
    "wiring": ("robots", "wiring", "three_wheel", "--out", "{file}.svg"),
    "bring-up": ("bringup", "--yes", "--out", "{folder}", *NOWHERE),
}


def run(*words: object) -> int:
    return CliRunner().invoke(app, [str(word) for word in words]).exit_code


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_of_another_kind_is_kept(tmp_path: Path, name: str) -> None:
    words = [word.format(file=tmp_path / "bringup", folder=tmp_path) for word in WRITERS[name]]
    target = next((Path(word) for word in words if word.startswith(str(tmp_path / "b"))), tmp_path / "bringup.md")
    target.write_text(KEPT)
    assert run(*words) == 2
    assert target.read_text() == KEPT
    assert list(tmp_path.iterdir()) == [target]


def test_with_force_it_is_replaced(tmp_path: Path) -> None:
    target = tmp_path / "robot.urdf"
    target.write_text(KEPT)
    assert run("robots", "export", "three_wheel", target, "--force") == 0
    assert target.read_text() != KEPT


def test_a_drawing_is_drawn_again(tmp_path: Path) -> None:
    target = tmp_path / "wiring.svg"
    for robot in ("three_wheel", "four_wheel"):
        assert run("robots", "wiring", robot, "--out", target) == 0
    four = target.read_text()
    assert run("robots", "wiring", "three_wheel", "--out", target) == 0
    assert target.read_text() != four


def test_what_is_no_regular_file_is_written_into() -> None:
    assert run("robots", "export", "three_wheel", "/dev/null", "--format", "urdf") == 0


def test_a_picture_beside_a_log_is_not_replaced_unasked(tmp_path: Path) -> None:
    with sync.simulate() as robot:
        robot.sleep(0.5)
        robot.run.save(tmp_path / "x.tlog")
    picture = tmp_path / "x.png"
    kept = b"\x89PNG of something else"
    picture.write_bytes(kept)
    result = CliRunner().invoke(app, ["plot", str(tmp_path / "x.tlog")])
    assert result.exit_code == 2
    assert picture.read_bytes() == kept
    assert CliRunner().invoke(app, ["plot", str(tmp_path / "x.tlog"), "--force"]).exit_code == 0
    assert picture.read_bytes() != kept
