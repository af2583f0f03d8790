# SPDX-License-Identifier: MIT
"""Synthetic logs in place of the real ones: a ripple that is in them is found, and none where there is none."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from omni_reproduce import real_logs, real_worlds, ripple
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.played_logs import MujocoRobot, OurRobot, Played, logged, play
from omni_reproduce.real_measured import ACCELEROMETER, HEADED, IDEAL, MUJOCO, OURS, WHEEL, WHEELS_ONLY
from omni_reproduce.registry import select
from omniwheel.errors import LogError
from omniwheel.identification.motor_curve import fit_motor_curve
from omniwheel.logs.calibration import MotorCurve
from omniwheel.logs.log import WheelLog
from tests.host.logs import synthetic
from tests.omni_reproduce.kept_page import PAGE, sections

Array = NDArray[np.float64]
SPEC = read_spec("real_worlds")
HEAD = SPEC["experiment"]
ORDER = 14.0


def write(folder: Path, ripple_m_s2: float) -> Path:
    """Leave run1.csv and run2.csv with their truth; the accelerometer swings 14 times per turn of the fastest wheel."""
    folder.mkdir()
    for seed in (1, 2):
        path, truth = synthetic.write(folder, f"run{seed}", synthetic.Known(), seed)
        truth.rename(folder / f"truth{seed}.csv")
        speed, _ = synthetic.motion(synthetic.Known(), synthetic.duties(seed))
        turned = np.cumsum(np.abs(speed).max(axis=1)) * synthetic.T
        generator = np.random.default_rng(seed)
        both = np.stack([np.cos(ORDER * turned), np.sin(ORDER * turned)], axis=1)
        imu = 0.5 * generator.standard_normal(both.shape) + ripple_m_s2 * both
        head, *lines = path.read_text().splitlines()
        rows = [f"{line},{x:.2f},{y:.2f}" for line, (x, y) in zip(lines, imu, strict=True)]
        path.write_text("\n".join([f"{head},ax,ay", *rows]) + "\n")
    return folder


def peaks(folder: Path) -> dict[str, float]:
    """Return the contrast of the order that stands out, by sensor, and the accelerometer's order."""
    paths = sorted(folder.glob("run*.csv"))
    logs = real_logs.read_logs(paths)
    found = real_worlds.of_logs(HEAD, logs, paths, fit_motor_curve(logs).curve)
    return {
        **{sensor: by_order.contrast for sensor, (by_order, _) in found.peaks.items()},
        "order": found.peaks[ACCELEROMETER][0].order,
    }


@pytest.mark.full
def test_a_ripple_of_the_logs_is_found_and_none_where_there_is_none(tmp_path: Path) -> None:
    there, none = peaks(write(tmp_path / "there", 0.5)), peaks(write(tmp_path / "none", 0.0))
    assert there["order"] == pytest.approx(ORDER, rel=0.1), "the motor curves say the speed no better than that"
    assert there[ACCELEROMETER] > 2.0 * HEAD["stands_out"]
    assert none[ACCELEROMETER] < HEAD["stands_out"]
    assert there[WHEEL] == none[WHEEL] < HEAD["stands_out"]


def test_without_logs_it_says_how_to_give_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_REAL_LOGS", str(tmp_path))
    (row,) = real_worlds.run(Context(tmp_path)).rows
    assert row.ours is None
    assert "OMNI_REAL_LOGS" in row.explanation
    monkeypatch.setenv("OMNI_REAL_LOGS", str(tmp_path / "nowhere"))
    with pytest.raises(LogError, match="no folder"):
        real_worlds.run(Context(tmp_path))


def test_logs_without_an_accelerometer_are_refused(tmp_path: Path) -> None:
    path, _ = synthetic.write(tmp_path, "run1", synthetic.Known(), 1)
    with pytest.raises(LogError, match="no column 'ax'"):
        real_worlds.real_signals(HEAD, still(50), path, CURVE)


@pytest.mark.nightly
def test_the_whole_comparison_runs_on_other_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_REAL_LOGS", str(write(tmp_path / "data", 0.5)))
    result = real_worlds.run(Context(tmp_path, quick=True))
    figures = {(row.setting, row.quantity): row for row in result.rows}
    found = figures[OURS, f"{ACCELEROMETER}, ripple"]
    assert found.published == pytest.approx(np.sqrt(2.0 * (0.5**2 + 0.5 * 0.5**2)), rel=0.1)
    assert found.ours is not None
    ideal = figures[IDEAL, f"{ACCELEROMETER}, ripple"].ours
    assert ideal is not None
    assert found.ours > ideal
    assert "MuJoCo" in figures[MUJOCO, f"{ACCELEROMETER}, ripple"].explanation
    assert any("| logs | 14" in note or "| logs | 13" in note for note in result.notes)


def still(rows: int, wheels: int = 3) -> WheelLog:
    """Return a log of a robot that stands still."""
    return WheelLog(
        name="still",
        period_s=0.01,
        counts_per_revolution=2640,
        time_s=0.01 * np.arange(1, rows + 1, dtype=np.float64),
        counts=np.zeros((rows, wheels)),
        good=np.ones((rows, wheels), dtype=bool),
        duty=np.zeros((rows, wheels)),
        heading_rad=np.zeros(rows),
        sample_s=0.001,
    )


CURVE = MotorCurve(np.full(3, 0.03), np.full(3, 0.03), np.zeros(3), np.zeros(3), np.full(3, 0.1))


@pytest.mark.parametrize("world", [OURS, MUJOCO])
def test_both_worlds_turn_the_wheels_as_the_duties_say(world: str) -> None:
    """A spin: the wheels at 6 rad/s, the body at radius over distance of that, within what drag takes."""
    if world == MUJOCO:
        pytest.importorskip("mujoco", reason="needs pip install 'omniwheel[mujoco]'")
    scenario = real_worlds.scenario_of(SPEC, world, 1)
    robot = (MujocoRobot if world == MUJOCO else OurRobot)(scenario)
    constant = float(scenario.robot.motor["constant_N_m_A"])
    played = play(robot, np.full((100, 3), 6.0 * constant), 0.01)
    late = played.angle[-1] - played.angle[-301]
    assert late / 0.3 == pytest.approx([6.0] * 3, rel=0.08)
    turned = played.pose[-1, 2] - played.pose[-301, 2]
    assert turned == pytest.approx(float(late.mean()) * 0.03 / 0.08, rel=0.02)


def test_the_accelerometer_is_the_change_of_the_velocity() -> None:
    """On ideal wheels nothing tilts: the mean of what it shows is what the speed has gained, in the body's frame."""
    scenario = real_worlds.scenario_of(SPEC, IDEAL, 1)
    constant = float(scenario.robot.motor["constant_N_m_A"])
    ahead = np.array([-0.5, 1.0, -0.5]) * 6.0 * constant
    played = play(OurRobot(scenario), np.tile(ahead, (50, 1)), 0.01)
    speed = (played.pose[-1, :2] - played.pose[-2, :2]) / 1e-3
    assert 1e-3 * played.acceleration.sum(axis=0) == pytest.approx(speed, abs=1e-3)
    assert speed[0] == pytest.approx(0.18, rel=0.05)


def test_a_row_is_what_the_robot_would_have_logged() -> None:
    """One count per 1 ms is 2.38 rad/s; the heading is rounded to its step; counts add up to the angle."""
    ticks = 500
    time = 1e-3 * np.arange(ticks + 1, dtype=np.float64)
    angle = np.outer(time, [2.38, 0.0, -4.0])
    pose = np.stack((0.1 * time, 0.0 * time, 0.2 * time), axis=1)
    shake = np.stack((np.sin(200.0 * np.pi * time[1:]), np.ones(ticks)), axis=1)
    rows, shown = logged(Played(pose, angle, shake), still(50), HEAD["heading_step_rad"])
    quantum = 2.0 * np.pi / 2640 / 1e-3
    assert np.allclose(np.round(shown.wheel_rad_s / quantum) * quantum, shown.wheel_rad_s)
    assert shown.wheel_rad_s[:, 2].mean() == pytest.approx(-4.0, abs=0.3)
    assert rows.counts.sum(axis=0) * rows.rad_per_count == pytest.approx(angle[-1], abs=0.003)
    assert np.abs(shown.acceleration[:, 0]).max() < 1e-9, "100 Hz is a whole swing per row"
    assert shown.acceleration[:, 1] == pytest.approx(1.0)
    steps = rows.heading_rad / HEAD["heading_step_rad"]
    assert np.allclose(np.round(steps), steps)
    assert shown.turn_rate.mean() == pytest.approx(0.2, rel=0.02)
    assert rows.truth is not None
    assert rows.truth.xy[-1, 0] == pytest.approx(0.05)


@pytest.mark.full
def test_a_world_with_a_right_file_drifts_by_its_rollers_alone() -> None:
    """Dead reckoning of a world's log is exact on ideal wheels but for counts, and off by millimetres on rollers."""
    swing = 0.3 * np.sin(np.pi * np.arange(200) / 200.0)[:, None]
    ahead, aside = np.array([-0.5, 1.0, -0.5]), np.array([-0.866, 0.0, 0.866])
    log = replace(still(400), duty=np.concatenate((swing * ahead, swing * aside)))
    drift = {name: real_worlds.in_world(real_worlds.Job(name, 1, (log,), CURVE)).drift_m for name in (IDEAL, OURS)}
    ideal, ours = (drift[name][WHEELS_ONLY][0] for name in (IDEAL, OURS))
    assert ideal < 3e-4
    assert 2.0 * ideal < ours < 5e-3
    assert drift[IDEAL][HEADED][0] < 2e-3, "the heading is rounded to a milliradian: 0.6 mm after 0.6 m"


@pytest.mark.full
def test_two_rows_turn_the_body_half_as_often_as_rollers_pass() -> None:
    """The lever arm alternates from row to row: 9 times per turn with two rows of 9, not at all with one row of 18."""
    assert turn_ripple("our world", 9.0) > 2.0 * turn_ripple("our world", 18.0)
    assert turn_ripple("our world", 9.0) > 2.0 * turn_ripple("our world, one row of 18", 9.0)


def turn_ripple(world: str, order: float) -> float:
    """Return the RMS of the turn rate about an order [rad/s], of a world that drives straight on at 10 rad/s."""
    scenario = real_worlds.scenario_of(SPEC, world, 1)
    volts = float(scenario.robot.motor["constant_N_m_A"]) * np.tile([-5.0, 10.0, -5.0], (300, 1))
    played = play(OurRobot(scenario), volts, 0.01)
    rate = np.diff(played.pose[::10, 2]) / 0.01
    pieces = ripple.pieces_of(np.diff(played.angle[::10], axis=0) / 0.01, 0.01, 1.0, 4.0)
    assert len(pieces) >= 2
    return ripple.band_rms([(rate, pieces)], order, 0.1, 0.01)


def test_pages_say_how_much_rougher_the_real_robot_is() -> None:
    """The kept results have how many times; two pages tell it."""
    (experiment,) = select(["real_worlds"])
    lines = sections(PAGE.read_text(encoding="utf-8"))[experiment.title].splitlines()
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in lines if re.match(r"\| [^|]+ \| [^|]+, ", line)
    ]
    share = {(row[0], row[1]): float(row[4].split()[0]) / float(row[3]) for row in rows}
    times = {name: int(1.0 / share[name, f"{ACCELEROMETER}, at order 18"]) for name in (OURS, MUJOCO)}
    told = f"{times[OURS]} times as strong as in our world and {times[MUJOCO]} times as in MuJoCo"
    assert told in " ".join(PAGE.with_name("reproduce.md").read_text(encoding="utf-8").split())
    wheels = (PAGE.parents[1] / "concepts" / "real-wheels.md").read_text(encoding="utf-8")
    assert f"shakes with its rollers {times[OURS]} times as strongly" in " ".join(wheels.split())
    for name in (OURS, MUJOCO):
        assert all(share[name, f"{quantity}, median of the runs"] < 0.02 for quantity in (HEADED, WHEELS_ONLY))
