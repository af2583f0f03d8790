# SPDX-License-Identifier: MIT
"""The replay is the core's own estimate: against an independent integration, with fixes, and on our own records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.logs.calibration import Calibration, MotorCurve, load_calibration, save_calibration
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import Mapping
from omniwheel.replay import Fixes, replay
from tests.host.logs import synthetic

KNOWN = synthetic.Known(
    forward_m=(0.03, 0.03, 0.03), reverse_m=(0.03, 0.03, 0.03), distance_m=0.1, noise_counts=0.0, spike_share=0.0
)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory, mapping: Mapping) -> WheelLog:
    """A run without noise of the robot that the nominal robot file describes."""
    return import_log(synthetic.write(tmp_path_factory.mktemp("clean"), "clean", KNOWN, 1)[0], mapping)[0]


def test_dead_reckoning_is_the_true_motion_to_the_resolution_of_the_counts(clean: WheelLog, robot: Robot) -> None:
    _, pose = synthetic.motion(KNOWN, synthetic.duties(1))
    run = replay(clean, robot, use_heading=False)
    assert np.abs(run.pose[:, :2] - pose[:, :2]).max() < 4e-3  # a count is 0.7 mm of rolling
    assert np.abs(run.pose[:, 2] - pose[:, 2]).max() < 0.02
    assert np.all(run.pose_sd[-1] > 10.0 * run.pose_sd[0])


def test_a_measured_heading_corrects_a_wrong_wheel_distance(clean: WheelLog, robot: Robot) -> None:
    _, pose = synthetic.motion(KNOWN, synthetic.duties(1))
    wrong = replace(robot, overrides={**robot.overrides, "WHEEL_DIST": 0.16})
    alone, helped = (replay(clean, wrong, use_heading=use).pose[:, 2] - pose[:, 2] for use in (False, True))
    assert np.abs(alone).max() > 0.5
    assert np.abs(helped).max() < 0.15


def test_rejected_counts_are_bridged(clean: WheelLog, robot: Robot) -> None:
    spiky = clean.counts.copy()
    spiky[::50] += 40.0
    good = np.ones_like(clean.good)
    good[::50] = False
    bad, bridged = (replay(replace(clean, counts=spiky, good=g), robot).pose for g in (np.ones_like(good), good))
    true = replay(clean, robot).pose
    assert np.abs(bridged - true).max() < 0.1 * np.abs(bad - true).max()


def test_missing_rows_are_bridged(clean: WheelLog, robot: Robot) -> None:
    keep = np.ones(len(clean.time_s), dtype=bool)
    keep[400:404] = False
    counts = clean.counts.copy()
    counts[404] = counts[400:405].sum(axis=0)
    cut = WheelLog(
        clean.name, clean.period_s, clean.counts_per_revolution, clean.time_s[keep], counts[keep], clean.good[keep],
        clean.duty[keep], clean.heading_rad[keep],
    )  # fmt: skip
    assert np.allclose(replay(cut, robot).pose[-1], replay(clean, robot).pose[-1], atol=2e-3)


def test_fixes_hold_the_estimate_and_their_nis_is_that_of_their_noise(clean: WheelLog, robot: Robot) -> None:
    _, pose = synthetic.motion(KNOWN, synthetic.duties(1))
    rows = np.arange(10, len(pose), 10)
    sd = 0.01
    noise = np.random.default_rng(5).normal(0.0, sd, (len(rows), 2))
    given = Fixes(clean.time_s[rows], pose[rows, :2] + noise, sd)
    calm = replace(robot, overrides={**robot.overrides, "WHEEL_RADIUS": 0.036})
    alone = replay(clean, calm, use_heading=False)
    held = replay(clean, calm, use_heading=False, fixes=given)
    distance = [np.hypot(*(run.pose[:, :2] - pose[:, :2]).T).mean() for run in (alone, held)]
    assert distance[1] < 0.3 * distance[0]
    exact = replay(clean, replace(robot, overrides={**robot.overrides, "EKF_Q_XY": 0.0005}), fixes=given)
    assert exact.accepted >= len(rows)
    # Heading fixes are exact here, so that two of the three degrees of freedom are noisy; 1 +- 4 / sqrt(n).
    assert np.mean(exact.nis) / 2.0 == pytest.approx(1.0, abs=4.0 / np.sqrt(len(rows)))


def test_a_calibration_drives_the_filters_by_the_motor_curve(tmp_path: Path, clean: WheelLog, robot: Robot) -> None:
    speed, _ = synthetic.motion(KNOWN, synthetic.duties(1))
    slope, dead = np.array(KNOWN.duty_per_rad_s), np.array(KNOWN.deadband)
    calibration = Calibration(np.ones(3), np.ones(3), MotorCurve(slope, slope, dead, dead, np.full(3, KNOWN.lag_s)))
    save_calibration(calibration, tmp_path / "robot.calibration.toml")
    again = load_calibration(tmp_path / "robot.calibration.toml", 3)
    assert np.allclose(again.curve.speed(clean.duty), calibration.curve.speed(clean.duty))
    gain = 0.36
    motor = {"MOT_K": gain, "MOT_B": 0.0, "MOT_R": 2.0, "MOT_L": 1e-4, "MOT_J": KNOWN.lag_s * gain**2 / 2.0}
    filtered = replace(robot, overrides={**robot.overrides, **motor, "KF_MODE": 1.0, "KF_R_W": 5.0, "KF_Q_W": 1.0})
    blind = replace(clean, good=np.zeros_like(clean.good))
    run = replay(blind, filtered, again)
    assert np.abs(run.wheel_rad_s - speed).max() < 0.15


def test_without_a_heading_the_turn_scale_says_it_and_the_other_scales_the_path(
    tmp_path: Path, clean: WheelLog, robot: Robot
) -> None:
    """Wheels of a robot file that is 10 % too small turn right with 1.1, and roll 20 % too far with 1.2."""
    _, pose = synthetic.motion(KNOWN, synthetic.duties(1))
    values = robot.parameter_values()
    small = replace(robot, overrides={**robot.overrides, "WHEEL_RADIUS": values["WHEEL_RADIUS"] / 1.1})
    slope, dead = np.array(KNOWN.duty_per_rad_s), np.array(KNOWN.deadband)
    curve = MotorCurve(slope, slope, dead, dead, np.full(3, KNOWN.lag_s))
    given = Calibration(np.full(3, 1.32), np.full(3, 1.32), curve, np.full(3, 1.1))
    save_calibration(given, tmp_path / "robot.calibration.toml")
    calibration = load_calibration(tmp_path / "robot.calibration.toml", 3)
    plain = replay(clean, small, replace(given, turn_scale=None), use_heading=False).pose
    assert calibration.turn_scale is not None
    turned = replay(clean, small, calibration, use_heading=False).pose
    wanted = np.unwrap(pose[:, 2]) - pose[0, 2]
    assert np.abs(turned[:, 2] - wanted).max() < 0.1 * np.abs(plain[:, 2] - wanted).max()
    way, true_way = (np.hypot(*np.diff(each[::50, :2], axis=0).T).sum() for each in (turned, pose))
    assert way / true_way == pytest.approx(1.2, abs=0.02)
    odometry = replace(small, overrides={**small.overrides, "EKF_MODE": 0.0})
    assert np.isfinite(replay(clean, odometry, calibration, use_heading=False).pose).all(), "no fix of a heading there"


def test_a_frozen_heading_is_bridged_by_how_the_wheels_turn(clean: WheelLog, robot: Robot) -> None:
    """The heading is lost for two seconds of turning; the file's wheels turn the body 10 % too little."""
    _, pose = synthetic.motion(KNOWN, synthetic.duties(1))
    turning = int(np.argmax(np.abs(pose[200:, 2] - pose[:-200, 2])))
    lost = clean.heading_rad.copy()
    lost[turning : turning + 200] = np.nan
    slope, dead = np.array(KNOWN.duty_per_rad_s), np.array(KNOWN.deadband)
    curve = MotorCurve(slope, slope, dead, dead, np.full(3, KNOWN.lag_s))
    short = np.full(3, 1.0 / 1.1)
    off = []
    for given in (Calibration(short, short, curve), Calibration(short, short, curve, np.ones(3), np.ones(3))):
        run = replay(replace(clean, heading_rad=lost), robot, given)
        off.append(np.abs(run.pose[:, 2] - (pose[:, 2] - pose[0, 2])).max())
    assert off[1] < 0.5 * off[0]


def test_a_wrong_calibration_is_named(tmp_path: Path) -> None:
    path = tmp_path / "robot.calibration.toml"
    path.write_text("[odometry]\nforward_scale = [1.0, nan, 1.0]\n[motor_curve]\n", encoding="utf-8")
    with pytest.raises(LogError, match="forward_scale"):
        load_calibration(path, 3)
    path.write_text("[odometry]\n", encoding="utf-8")
    with pytest.raises(LogError, match="motor_curve"):
        load_calibration(path, 3)


def test_another_robots_file_is_refused(clean: WheelLog, robot: Robot) -> None:
    with pytest.raises(LogError, match="counts per revolution"):
        replay(clean, replace(robot, overrides={**robot.overrides, "ENC_CPR": 1000.0}))
    with pytest.raises(LogError, match="EKF_MODE"):
        replay(clean, replace(robot, overrides={**robot.overrides, "EKF_MODE": 0.0}))
    with pytest.raises(LogError, match="wheels"):
        replay(clean, replace(robot, wheels=4))
