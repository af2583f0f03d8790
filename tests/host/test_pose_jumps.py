# SPDX-License-Identifier: MIT
"""A pose estimate that jumps is no motion: neither distance nor speed, but an event with its time and size."""

from __future__ import annotations

import json
import math
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from omni.cli import app
from omni.studio.recorded_log import RecordedLog
from omniwheel.dialect import mavlink
from omniwheel.drive_log.folder import Drive, write_with_figures
from omniwheel.drive_log.listing import headline, list_runs
from omniwheel.log_sources import read_tlog
from omniwheel.pose_jumps import geometry_of, jumps_of, steps_of, without_jumps
from omniwheel.replay import replay
from omniwheel.robots import parameter_table, read_robot
from omniwheel.telemetry_record import TelemetryRecord, read_record
from tests.host.test_tlog_reader import DRIVE, ROBOT, SPEED_M_S, drive, later, log, packed, tracking, wheels

Array = NDArray[np.float64]
END_MS = 3000 + 50 * DRIVE
WAY_M = SPEED_M_S * 0.05 * (DRIVE - 1)
PARAMETERS = packed(mavlink.MAVLink_param_value_message(b"WHEEL_RADIUS", 0.05, 9, 1, 0))


def standing(start_ms: int, x: float, theta: float = 0.0, rows: int = 40) -> bytes:
    times_ms = [start_ms + 50 * row for row in range(rows)]
    return b"".join(packed(wheels(ms, 0.0)) + packed(tracking(ms, x, theta)) for ms in times_ms)


def reads(path: Path) -> TelemetryRecord:
    record = read_record(path)
    opened = RecordedLog(path)
    try:
        marks = [mark for mark in opened.marks() if "jumped" in mark["text"]]
    finally:
        opened.close()
    start_s = min(record.time_s[0], record.wheel_time_s[0])
    assert [mark["time_s"] for mark in marks] == pytest.approx([jump.time_s - start_s for jump in record.jumps])
    assert len([what for _, what in record.events if "jumped" in what]) == len(record.jumps)
    assert record.numbers()["pose_jumps"] == len(record.jumps)
    return record


@pytest.mark.parametrize("away_m", [2.2, -0.5, 0.3, 0.15])
def test_a_drive_whose_estimate_jumps_has_the_way_and_the_speed_of_its_wheels(tmp_path: Path, away_m: float) -> None:
    path = log(tmp_path, PARAMETERS, drive(), drive(END_MS, SPEED_M_S * 0.05 * DRIVE + away_m))
    record = reads(path)
    numbers = record.numbers()
    assert numbers["way_m"] == pytest.approx(2.0 * WAY_M, rel=1e-3)
    assert numbers["top_speed_m_s"] == pytest.approx(SPEED_M_S, rel=1e-2)
    assert numbers["duration_s"] == pytest.approx(0.05 * (2 * DRIVE - 1))
    (jump,) = record.jumps
    assert jump.time_s == pytest.approx(1e-3 * (END_MS - 25))
    assert jump.distance_m == pytest.approx(abs(away_m), abs=0.01)
    assert record.starts == (), "no restart"


def test_a_robot_that_stands_and_is_told_where_it_is_has_not_moved(tmp_path: Path) -> None:
    told = [standing(3000, 0.0), standing(5000, 5.0, 1.0), standing(7000, 0.0, 1.0)]
    record = reads(log(tmp_path, *told))
    assert [round(jump.distance_m, 3) for jump in record.jumps] == [5.0, 5.0]
    assert [jump.turn_rad for jump in record.jumps] == pytest.approx([1.0, 0.0])
    numbers = record.numbers()
    assert (numbers["way_m"], numbers["top_speed_m_s"]) == (0.0, 0.0)


def test_a_turn_alone_is_a_jump_and_the_heading_goes_on_unwrapped_from_there(tmp_path: Path) -> None:
    record = reads(log(tmp_path, standing(3000, 0.0, 3.0), standing(5000, 0.0, -2.0)))
    (jump,) = record.jumps
    assert jump.turn_rad == pytest.approx(math.tau - 5.0, abs=1e-5)


def test_what_a_fix_corrects_is_neither_a_jump_nor_motion(tmp_path: Path) -> None:
    record = reads(log(tmp_path, standing(3000, 0.0), standing(5000, 0.04), standing(7000, 0.0)))
    assert record.jumps == ()
    assert record.numbers()["way_m"] == 0.0
    assert record.numbers()["top_speed_m_s"] == 0.0


def test_a_restart_is_no_jump_and_jumps_before_and_after_it_are_told_apart(tmp_path: Path) -> None:
    first = standing(3000, 0.0) + standing(5000, 4.0)
    record = reads(log(tmp_path, first, later(drive(500, -3.0), 60.0), later(standing(500 + 50 * DRIVE, 9.0), 60.0)))
    assert len(record.starts) == 1
    assert len(record.jumps) == 2
    assert len(record.pose_borders()) == 3
    assert record.numbers()["way_m"] == pytest.approx(WAY_M, rel=1e-3)


@pytest.mark.parametrize("name", ["three_wheel", "four_wheel"])
@pytest.mark.parametrize(("pose_s", "wheels_s"), [(0.02, 0.02), (0.1, 0.2), (0.1, 1.0), (0.5, 1.0), (1.0, 1.0)])
def test_driving_and_turning_as_fast_as_one_likes_is_no_jump(name: str, pose_s: float, wheels_s: float) -> None:
    robot = read_robot(name)
    values = robot.parameter_values()
    radius, distance = values["WHEEL_RADIUS"], values["WHEEL_DIST"]
    bearings = np.radians([values[f"W{wheel + 1}_ANGLE"] for wheel in range(robot.wheels)])
    fine = np.arange(0.0, 20.0, 0.001)
    velocity = np.column_stack(
        (1.5 * np.sin(0.7 * fine), 2.0 * np.cos(0.4 * fine), 5.0 * np.sin(0.5 * fine))
    ) * np.clip(fine - 2.0, 0.0, 1.0).reshape(-1, 1)
    theta = np.cumsum(velocity[:, 2]) * 0.001
    x, y = (np.cumsum(velocity[:, axis]) * 0.001 for axis in (0, 1))
    along = [
        -np.sin(bearing + theta) * velocity[:, 0] + np.cos(bearing + theta) * velocity[:, 1] for bearing in bearings
    ]
    speed = (np.column_stack(along) + distance * velocity[:, 2:]) / radius
    pose = np.column_stack((x, y, np.arctan2(np.sin(theta), np.cos(theta))))
    every, wheel_every = round(pose_s / 0.001), round(wheels_s / 0.001)
    for known in (values, {}):
        steps = steps_of(fine[::every], pose[::every], fine[::wheel_every], speed[::wheel_every], geometry_of(known))
        assert not steps.jumps.any()
        assert np.all(steps.distance_m <= steps.reach_m + 1e-9)


def test_without_wheel_speeds_no_robot_is_faster_than_its_limit() -> None:
    time_s: Array = np.arange(0.0, 2.0, 0.1)
    pose = np.column_stack((9.0 * time_s, 0.0 * time_s, 0.0 * time_s))
    nothing = np.zeros((0, 4))
    assert not steps_of(time_s, pose, nothing[:, 0], nothing, geometry_of({})).jumps.any()
    pose[10:, 1] += 3.0
    steps = steps_of(time_s, pose, nothing[:, 0], nothing, geometry_of({}))
    assert list(np.flatnonzero(steps.jumps)) == [9]
    assert [jump.time_s for jump in jumps_of(time_s, steps)] == pytest.approx([0.95])


@pytest.mark.parametrize("rows", [0, 1])
def test_a_record_without_two_poses_has_no_jump(rows: int) -> None:
    empty = np.zeros((rows, 4))
    steps = steps_of(empty[:, 0], empty[:, :3], empty[:0, 0], empty[:0], geometry_of({}))
    assert jumps_of(empty[:, 0], steps) == []


def test_an_estimate_without_its_jumps_goes_on_as_the_robot_moved() -> None:
    theta = np.linspace(0.0, 2.0, 60)
    true = np.column_stack((np.sin(theta), 1.0 - np.cos(theta), theta))
    jumped = true.copy()
    for row, turn, away in ((20, 0.7, (3.0, -1.0)), (45, -2.0, (0.5, 0.5))):
        cosine, sine = math.cos(turn), math.sin(turn)
        jumped[row:, :2] = jumped[row:, :2] @ np.array([[cosine, sine], [-sine, cosine]]) + away
        jumped[row:, 2] += turn
    found = without_jumps(jumped, np.array([20, 45]))
    assert np.all(np.hypot(*np.diff(found[:, :2], axis=0).T) < 0.04)
    both = np.column_stack((found[:, :2], true[:, :2]))
    gone = [math.dist(both[0, :2], both[-1, :2]), math.dist(both[0, 2:], both[-1, 2:])]
    assert gone[0] == pytest.approx(gone[1], abs=0.1), "but for the two steps themselves"


def test_a_replay_compares_with_what_the_robot_moved(tmp_path: Path) -> None:
    alone = log(tmp_path, standing(3000, 0.0, rows=120))
    assert read_tlog(alone, ROBOT).truth is not None
    path = log(tmp_path, standing(3000, 0.0), standing(5000, 5.0, 1.0), standing(7000, 0.0, 1.0))
    read = read_tlog(path, ROBOT)
    assert read.truth is not None
    assert np.hypot(*(read.truth.xy - read.truth.xy[0]).T).max() == pytest.approx(0.0, abs=1e-9)
    assert np.abs(replay(read, ROBOT).pose).max() == pytest.approx(0.0, abs=1e-9)
    words = ["replay", str(path), "--robot", "three_wheel"]
    told = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert told["rms_m"] == pytest.approx(0.0, abs=1e-6)
    assert [jump["time_s"] for jump in told["truth_jumps"]] == pytest.approx([4.975, 6.975])
    assert "jumped by 5.00 m" in CliRunner().invoke(app, words).stdout
    aligned = CliRunner().invoke(app, ["logs", "align", *words[1:]])
    assert "jumped by 5.00 m" in aligned.stdout


def test_a_plot_names_the_jumps_and_does_not_draw_across_them(tmp_path: Path) -> None:
    path = log(tmp_path, *(standing(3000 + 2000 * part, float(part)) for part in range(8)))
    words = ["plot", str(path), "--out", str(tmp_path / "a.png")]
    told: dict[str, Any] = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    assert len(told["pose_jumps"]) == told["events"] == 7
    assert told["numbers"]["way_m"] == 0.0
    shown = CliRunner().invoke(app, [*words, "--force"]).stdout
    assert "at 4.97 s the pose estimate jumped by 1.00 m" in " ".join(shown.split())
    assert len(read_record(path).pose_borders()) == 7


def test_a_drives_folder_and_the_list_of_runs_tell_of_jumps(tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / "telemetry.tlog").write_bytes(drive() + drive(END_MS, 0.75))
    (folder / "parameters.toml").write_text("[parameters]\nWHEEL_RADIUS = 0.05\n", encoding="utf-8")
    values = parameter_table().defaults()
    began = datetime(2026, 1, 1, tzinfo=timezone.utc)
    write_with_figures(folder, Drive("velocity", began, "done", "x", values, values, 1), parameter_table())
    kept = json.loads((folder / "drive.json").read_text(encoding="utf-8"))
    assert [jump["distance_m"] for jump in kept["pose_jumps"]] == pytest.approx([0.155], abs=1e-3)
    assert kept["numbers"]["top_speed_m_s"] == pytest.approx(SPEED_M_S, rel=0.01)
    assert [event["what"] for event in kept["events"]] == ["the pose estimate jumped by 0.15 m"]
    (entry,) = list_runs(tmp_path)
    assert any("jump" in fact for fact in headline(entry))


def test_a_robots_own_wheels_are_judged_by_the_parameters_beside_the_log(tmp_path: Path) -> None:
    """With a wheel of 1 m, the largest there is, a step of 15 cm at 2 rad/s could have been driven."""
    parts = drive(), drive(END_MS, SPEED_M_S * 0.05 * DRIVE + 0.15)
    assert read_record(log(tmp_path, *parts)).jumps == ()
    (tmp_path / "parameters.toml").write_text("[parameters]\nWHEEL_RADIUS = 0.05\n", encoding="utf-8")
    beside = tmp_path / "telemetry.tlog"
    beside.write_bytes(b"".join(parts))
    assert len(read_record(beside).jumps) == 1


@pytest.mark.parametrize("size", [1 << 9, 1 << 11, 1 << 13])
def test_the_studio_finds_a_jump_between_two_pieces_of_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    monkeypatch.setattr("omni.studio.recorded_log.PIECE_BYTES", size)
    parts = [standing(3000 + 50 * 13 * part, float(part), rows=13) for part in range(12)]
    assert len(reads(log(tmp_path, *parts)).jumps) == 11
