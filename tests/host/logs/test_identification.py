# SPDX-License-Identifier: MIT
"""Identification recovers the synthetic robot; on the real one it is judged by the runs it has not seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omni_reproduce.real_logs import ROBOT_FOLDER, read_logs
from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.identification.log_study import LogStudy, _Job, identify_from_logs, run_job
from omniwheel.identification.motor_curve import fit_motor_curve
from omniwheel.identification.odometry_calibration import dead_reckon, identify_odometry
from omniwheel.identification.path_fit import RIDGES, USUAL_RIDGE, Rolled, Settings, fit_turning
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import Mapping, read_mapping
from omniwheel.robots import read_robot
from tests.host.logs import synthetic

KNOWN = synthetic.Known()


@pytest.fixture(scope="module")
def study(runs: list[WheelLog], robot: Robot) -> LogStudy:
    return identify_from_logs(runs, robot)


@pytest.mark.full
def test_radii_by_wheel_and_direction_are_recovered(study: LogStudy) -> None:
    whole = study.whole
    assert whole.forward_radius_m == pytest.approx(KNOWN.forward_m, rel=0.05)
    assert whole.reverse_radius_m == pytest.approx(KNOWN.reverse_m, rel=0.05)
    assert whole.distance_seen
    assert whole.wheel_distance_m == pytest.approx(KNOWN.distance_m, rel=0.03)


@pytest.mark.full
def test_motor_curves_are_recovered(study: LogStudy) -> None:
    fit = study.whole.curve
    for slope, dead in (
        ("forward_duty_per_rad_s", "forward_deadband"),
        ("reverse_duty_per_rad_s", "reverse_deadband"),
    ):
        for name, known in ((slope, KNOWN.duty_per_rad_s), (dead, KNOWN.deadband)):
            off = (getattr(fit.curve, name) - known) / getattr(fit.sd, name)
            assert np.all(np.abs(off) < 4.0), name
    assert fit.curve.time_constant_s == pytest.approx(np.full(3, KNOWN.lag_s), rel=0.2)
    assert np.all(fit.sd.forward_deadband < 0.02)


def test_the_left_out_run_is_predicted_to_a_few_millimetres(study: LogStudy) -> None:
    assert study.median_m("nominal") > 0.03
    assert study.median_m("held_out") < 0.01
    for run in study.scored:
        found = run.held_out.alignment
        assert found.offset_s == pytest.approx(KNOWN.offset_s, abs=0.03)
        assert found.rotation_rad == pytest.approx(KNOWN.rotation_rad, abs=0.05)
        assert not found.mirrored


def test_a_mirrored_truth_is_seen_through(tmp_path: Path, mapping: Mapping, robot: Robot) -> None:
    known = synthetic.Known(mirrored=True, offset_s=-0.8)
    logs = [import_log(*_swap(synthetic.write(tmp_path, f"run{k}", known, k), mapping))[0] for k in (4, 5)]
    found = identify_odometry(logs, robot)
    assert found.forward_radius_m == pytest.approx(known.forward_m, rel=0.08)


def _swap(paths: tuple[Path, Path], mapping: Mapping) -> tuple[Path, Mapping, Path]:
    return paths[0], mapping, paths[1]


@pytest.mark.full
def test_a_wrong_sign_is_noticed(runs: list[WheelLog], robot: Robot) -> None:
    with pytest.raises(LogError, match="against the measured heading"):
        identify_odometry([replace(log, counts=-log.counts, duty=-log.duty) for log in runs], robot)


@pytest.mark.full
def test_runs_that_do_not_turn_leave_the_nominal_distance(runs: list[WheelLog], robot: Robot) -> None:
    still = [replace(log, heading_rad=np.zeros(len(log.time_s))) for log in runs]
    found = identify_odometry(still, robot)
    assert not found.distance_seen
    assert found.wheel_distance_m == pytest.approx(robot.parameter_values()["WHEEL_DIST"])


def test_what_the_logs_lack_is_named(runs: list[WheelLog], robot: Robot) -> None:
    with pytest.raises(LogError, match="no heading"):
        identify_odometry([replace(runs[0], heading_rad=np.full(len(runs[0].time_s), np.nan))], robot)
    with pytest.raises(LogError, match="no ground truth"):
        identify_odometry([replace(runs[0], truth=None)], robot)
    with pytest.raises(LogError, match="never driven"):
        fit_motor_curve([replace(runs[0], duty=np.zeros_like(runs[0].duty))])
    with pytest.raises(LogError, match="at least 2"):
        identify_from_logs(runs[:1], robot)
    with pytest.raises(LogError, match="duplicate run names"):
        identify_from_logs([runs[0], runs[0]], robot)


def test_a_direction_that_was_never_driven_is_marked(runs: list[WheelLog]) -> None:
    forward = [replace(log, duty=np.maximum(log.duty, 0.0), good=log.good & (log.duty >= 0.0)) for log in runs]
    fit = fit_motor_curve(forward)
    assert np.all(np.isinf(fit.sd.reverse_deadband))
    assert np.all(np.isfinite(fit.sd.forward_deadband))


def test_a_run_that_is_left_out_has_no_say_in_what_predicts_it(
    study: LogStudy, runs: list[WheelLog], robot: Robot
) -> None:
    """Another truth, other counts and another heading of run 2: what is identified without it keeps every bit."""
    other = runs[1]
    truth = other.require_truth()
    strange = replace(
        other,
        counts=other.counts[::-1],
        heading_rad=0.5 * other.heading_rad,
        truth=replace(truth, xy=1.7 * truth.xy[:, ::-1]),
    )
    jobs = [_Job((runs[0], log, runs[2]), robot, (), 1) for log in (other, strange)]
    found = [run_job(job) for job in jobs]
    for name in ("forward_radius_m", "reverse_radius_m"):
        assert np.array_equal(getattr(found[0], name), getattr(found[1], name))
        assert np.array_equal(getattr(found[0], name), getattr(study.without[1], name))
    assert found[0].settings == found[1].settings
    assert found[0].robot.overrides == found[1].robot.overrides


def test_turning_by_wheel_and_direction_is_what_the_headings_say(runs: list[WheelLog]) -> None:
    speed, _ = synthetic.motion(KNOWN, synthetic.duties(1))
    angle = speed * synthetic.T
    rolled = Rolled(runs[0], np.concatenate((np.maximum(angle, 0.0), np.minimum(angle, 0.0)), axis=1))
    rows = np.column_stack((-np.sin(synthetic.BEARINGS), np.cos(synthetic.BEARINGS), np.ones(3)))
    inverse = np.linalg.inv(rows)
    gains = fit_turning([rolled], inverse, 1e-6)
    assert gains is not None
    assert gains == pytest.approx(np.array((*KNOWN.forward_m, *KNOWN.reverse_m)) / KNOWN.distance_m, rel=0.02)
    still = replace(runs[0], heading_rad=np.zeros(len(angle)))
    assert fit_turning([replace(rolled, log=still)], inverse, 0.03) is None


def test_turning_by_direction_is_chosen_where_wheels_do_turn_so_and_tells_a_new_run(
    tmp_path: Path, study: LogStudy, runs: list[WheelLog], mapping: Mapping, robot: Robot
) -> None:
    """Three runs can choose, by leaving out one; two cannot, and have one gain for all."""
    new, _, truth = _swap(synthetic.write(tmp_path, "run9", KNOWN, 9), mapping)
    log, _ = import_log(new, mapping, truth)
    assert study.whole.settings.ridge in RIDGES
    assert study.whole.settings.turn_ridge is not None
    off = []
    for found in (study.whole, study.without[0]):
        run, _ = dead_reckon(log, found.robot, found.calibration, use_heading=False)
        off.append(float(np.std(run.pose[:, 2] - log.heading_rad)))
    assert study.without[0].settings == Settings(USUAL_RIDGE, None, study.without[0].settings.counts)
    assert off[0] < 0.5 * off[1]


@pytest.mark.nightly
def test_real_runs_left_out_are_as_near_as_wanted(real_logs: Path) -> None:
    """Wanted: 45 mm on the measured heading, 60 mm by the wheels alone."""
    robot = read_robot(ROBOT_FOLDER / "robot.toml")
    runs = read_logs(sorted(real_logs.glob("run*.csv")))
    turns = read_logs(sorted(real_logs.glob("spin*.csv")))
    found = identify_from_logs(runs, robot, turns)
    assert 0.12 < found.median_m("nominal") < 0.2
    assert found.median_m("held_out") <= 0.045
    assert found.median_m("held_out_wheels_only") <= 0.060
    assert max(run.held_out.alignment.rms_m for run in found.scored) < 0.1


def test_real_counts_are_samples_with_a_noise_of_their_own(real_logs: Path) -> None:
    """What docs/guides/logs.md says: no angle adds up, four counts of noise."""
    mapping = read_mapping(ROBOT_FOLDER / "mapping.toml")
    for path in sorted(real_logs.glob("run*.csv")):
        log, summary = import_log(path, mapping)
        assert np.abs(summary.noise_correlation).max() < 0.06
        assert 3.4 < min(summary.noise_counts) < max(summary.noise_counts) < 5.3
        assert log.quantum_rad_s == pytest.approx(2.38, rel=1e-3)
