# SPDX-License-Identifier: MIT
"""The pipeline as a user types it: import, show, align, identify, replay; and the replay of our own records."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.dialect import mavlink
from omniwheel.robots import read_robot
from tests.host.logs import synthetic


def omni(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output if code else result.stdout


def omni_json(*arguments: object) -> Any:
    return json.loads(omni(*arguments, "--json"))


@pytest.fixture(scope="module")
def imported(files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with run1..3.npz."""
    folder = tmp_path_factory.mktemp("imported")
    for name in ("run1", "run2", "run3"):
        told = omni_json(
            "logs", "import", files / f"{name}.csv", "--mapping", files / "mapping.toml",
            "--truth", files / f"truth_{name}.csv", "--out", folder / f"{name}.npz",
        )  # fmt: skip
        assert told["rows"] == 1600
        assert all(0.015 < share < 0.04 for share in told["rejected_share"])
    return folder


def test_show_and_align_say_what_a_log_holds(imported: Path, files: Path) -> None:
    facts = omni_json("logs", "show", imported / "run1.npz")
    assert facts["heading"] is True
    assert facts["truth_rows"] == 1600
    found = omni_json("logs", "align", imported / "run1.npz", "--robot", files / "robot.toml")
    assert found["offset_s"] == pytest.approx(synthetic.Known().offset_s, abs=0.2)
    assert "mm RMS" in omni("logs", "align", imported / "run1.npz", "--robot", files / "robot.toml")


def test_the_import_names_a_frozen_column(files: Path, tmp_path: Path) -> None:
    lines = (files / "run1.csv").read_text(encoding="utf-8").splitlines()
    column = [name.strip() for name in lines[0].split(",")].index("w2")
    rows = [line.split(",") for line in lines]
    for row in rows[400:500]:
        row[column] = rows[400][column]
    frozen = tmp_path / "frozen.csv"
    frozen.write_text("\n".join(",".join(row) for row in rows) + "\n", encoding="utf-8")
    said = omni("logs", "import", frozen, "--mapping", files / "mapping.toml", "--out", tmp_path / "frozen.npz")
    assert "w2 is frozen from" in said


@pytest.mark.full
def test_identified_on_some_runs_replays_another(imported: Path, files: Path, tmp_path: Path) -> None:
    out = tmp_path / "identified.toml"
    told = omni_json(
        "identify", "logs", imported / "run1.npz", imported / "run2.npz", "--turn", imported / "run2.npz",
        "--lifted", imported / "run2.npz", "--robot", files / "robot.toml", "--out", out,
    )  # fmt: skip
    assert read_robot(out).parameter_values()["WHEEL_DIST"] == pytest.approx(0.12, rel=0.05)
    report = Path(told["files"]["page"]).read_text(encoding="utf-8")
    assert "## What can be trusted" in report
    assert Path(told["files"]["picture"]).read_bytes().startswith(b"\x89PNG")
    plot, table = tmp_path / "run3.png", tmp_path / "run3.csv"
    replayed = omni_json(
        "replay", imported / "run3.npz", "--robot", out, "--fixes", 5, "--plot", plot, "--csv", table
    )  # fmt: skip
    nominal = omni_json("replay", imported / "run3.npz", "--robot", files / "robot.toml")
    assert replayed["calibration"] == str(tmp_path / "identified.calibration.toml")
    assert nominal["calibration"] is None
    assert replayed["rms_m"] < min(0.012, 0.5 * nominal["rms_m"])
    assert replayed["fixes"]["looked_at"] > 60
    told_by_duty = omni_json("replay", imported / "run3.npz", "--robot", out, "--no-counts")
    assert replayed["rms_m"] != told_by_duty["rms_m"] < 0.5 * nominal["rms_m"]
    without_curve = omni("replay", imported / "run3.npz", "--robot", files / "robot.toml", "--no-counts", code=2)
    assert "motors' curve" in without_curve
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert np.loadtxt(table, delimiter=",", skiprows=1).shape == (1600, 9)
    straight = omni_json(
        "replay", files / "run3.csv", "--mapping", files / "mapping.toml", "--truth", files / "truth_run3.csv",
        "--robot", out,
    )  # fmt: skip
    assert straight["rms_m"] == replayed["rms_m"]
    assert "exists already" in omni(
        "identify", "logs", imported / "run1.npz", imported / "run2.npz", "--robot", files / "robot.toml",
        "--out", out, code=2,
    )  # fmt: skip


@pytest.mark.full
def test_leave_one_out_names_every_run_and_writes_nothing(
    imported: Path, files: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    told = (
        "identify", "logs", imported / "run1.npz", imported / "run2.npz", "--robot", files / "robot.toml",
        "--leave-one-out",
    )  # fmt: skip
    said = omni(*told)
    assert "held out wheels only" in said
    assert "without run2: radii by direction" in said
    found = omni_json(*told)
    assert set(found["runs"]) == {"run1", "run2"}
    assert found["runs"]["run1"]["held_out_shape_rms_m"] <= found["runs"]["run1"]["held_out_rms_m"] < 0.02
    assert list(tmp_path.iterdir()) == []
    assert "writes nothing" in omni(*told, "--out", "x.toml", code=2)
    assert "give --out" in omni(*told[:-1], code=2)


@pytest.mark.full
def test_a_run_folder_is_replayed_with_the_core_that_drove_it(tmp_path: Path) -> None:
    told = omni_json("run", "--core-only", "fault_pose_loss", "--seed", 4, "--out", tmp_path)
    replayed = omni_json("replay", told["folder"], "--robot", told["robot"])
    assert replayed["heading_used"] is False
    assert replayed["clock_offset_s"] == pytest.approx(0.0, abs=0.1)
    assert replayed["rms_m"] < 0.1  # the slip that odometry cannot see
    held = omni_json("replay", told["folder"], "--robot", told["robot"], "--fixes", 20, "--fix-sd", 0.005)
    assert held["fixes"]["rms_m"] < 0.5 * replayed["rms_m"]


def test_a_telemetry_log_is_replayed(tmp_path: Path) -> None:
    """Wheel 1, 2, 3 of three_wheel at 1 rad/s for 10 s: a turn of r t / l."""
    mav = mavlink.MAVLink(None)
    path = tmp_path / "turn.tlog"
    with path.open("wb") as file:
        for step in range(501):
            for message in (
                mavlink.MAVLink_omni_wheels_message(
                    20 * step, [1.0, 1.0, 1.0, 0.0], [1.0] * 4, [0.1] * 4, [0.0] * 4, [0.0] * 4, 1.0, 1.0
                ),
                mavlink.MAVLink_omni_tracking_message(
                    20 * step, [0.0] * 3, [0.0] * 3, [0.0, 0.0, 0.01 * step], [0.1] * 3, 0.0, 0
                ),
            ):
                file.write(struct.pack(">Q", 20_000 * step) + message.pack(mav))
    values = read_robot("three_wheel").parameter_values()
    told = omni_json("replay", path, "--robot", "three_wheel")
    turn = values["WHEEL_RADIUS"] * 10.0 / values["WHEEL_DIST"]
    assert told["rows"] == 501
    assert np.hypot(*told["end_pose"][:2]) < 1e-3
    assert told["end_pose"][2] == pytest.approx(turn, abs=2e-3)


def test_counts_and_fixes_of_a_telemetry_log_are_used(tmp_path: Path) -> None:
    """Wheels at bearings 0, 120 and 240 degrees that turn as 2 : -1 : -1 drive the body along +y."""
    mav = mavlink.MAVLink(None)
    path = tmp_path / "line.tlog"
    values = read_robot("three_wheel").parameter_values()
    rad = 2.0 * np.pi / values["ENC_CPR"]
    with path.open("wb") as file:
        for step in range(201):
            counts = [4 * 40 * step - 2**31, -2 * 40 * step, -2 * 40 * step, 0]
            counts[0] = (counts[0] + 2**31) % 2**32 - 2**31
            y = values["WHEEL_RADIUS"] * 160 * rad * step
            time_us = 20_000 * (step + 1)
            for message in (
                mavlink.MAVLink_omni_sample_message(time_us, counts, [0] * 4, 12.0, [0.0] * 3, 0),
                mavlink.MAVLink_vicon_position_estimate_message(time_us, 0.0, -y, 0.0, 0.0, 0.0, 0.0),
            ):
                file.write(struct.pack(">Q", time_us) + message.pack(mav))
    told = omni_json("replay", path, "--robot", "three_wheel")
    assert told["end_pose"][1] == pytest.approx(values["WHEEL_RADIUS"] * 160 * 200 * rad, rel=1e-3)
    assert told["rms_m"] < 1e-3


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("replay", "none.npz", "--robot", "three_wheel"), "none.npz does not exist"),
        (("replay", "{files}/run1.csv", "--robot", "{files}/robot.toml"), "column mapping"),
        (("replay", "{files}/robot.toml", "--robot", "nope"), "unknown robot or file nope"),
        (("replay", "{npz}", "--robot", "three_wheel"), "counts per revolution"),
        (("replay", "{npz}", "--robot", "{files}/robot.toml", "--calibration", "none.toml"), "no such file"),
        (("logs", "import", "{files}/run1.csv", "--mapping", "none.toml", "--out", "x.npz"), "no column mapping"),
        (("logs", "import", "{files}/run1.csv", "--mapping", "{files}/mapping.toml", "--out", "x.csv"), "ends in .npz"),
        (("logs", "show", "{files}/run1.csv"), "not an imported log"),
        (("identify", "logs", "{npz}", "--robot", "{files}/robot.toml", "--out", "{tmp}/x.toml"), "at least 2"),
        (("identify", "logs", "{npz}", "--robot", "{files}/robot.toml", "--out", "/nowhere/x.toml"), "folder"),
    ],
)
def test_bad_input_says_what_to_do(
    imported: Path, files: Path, tmp_path: Path, arguments: tuple[str, ...], told: str
) -> None:
    places = {"files": files, "npz": imported / "run1.npz", "tmp": tmp_path}
    output = omni(*(argument.format(**places) for argument in arguments), code=2)
    assert told in " ".join(output.replace("│", " ").split())
