# SPDX-License-Identifier: MIT
"""Known robots are found again, left-out runs come out better, and what the motion does not show is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from omniwheel.errors import LogError
from omniwheel.identification.pose_fit.clock import measure_clock
from omniwheel.identification.pose_fit.scores import dead_reckoned
from omniwheel.identification.pose_fit.study import GeometryStudy, HeldOut, identify_geometry, train_and_test
from omniwheel.identification.pose_fit.wheel_model import PLANT, WheelModel
from omniwheel.identification.pose_fit.windows import run_of
from tests.host.pose_fit.robots import FOUR, NOISE, THREE, Motion, drive, runs, true_values

pytestmark = pytest.mark.full


def largest_heading_error(study: GeometryStudy, shown: HeldOut, probability: float) -> float:
    """Return the bound that the largest heading error of a left-out run exceeds with at most this probability.

    A heading's error has three independent parts: noise of its measurement, noise of the first one, and the error of
    the parameters, whose stated covariance is carried along the path. With one of n groups left out the covariance is
    n / (n - 1) times that of all. Bonferroni's inequality makes a bound for all samples of that for one.
    """
    run, layout, found = study.runs[shown.number], study.layout, study.whole.plain
    values = layout.nominal
    place = [layout.names.index(name) for name in found.names]
    values[place] = found.values
    step = np.sqrt(np.diag(found.covariance))
    columns = []
    for index, width in zip(place, step, strict=True):
        moved = [values + sign * width * np.eye(len(values))[index] for sign in (1.0, -1.0)]
        paths = [dead_reckoned(run, layout.matrix(each), run.truth_s)[0][:, 2] for each in moved]
        columns.append((paths[0] - paths[1]) / (2.0 * width))
    slope = np.column_stack(columns)
    groups = len(study.groups)
    carried = np.einsum("ki,ij,kj->k", slope, found.covariance, slope) * groups / (groups - 1.0)
    quantile = float(np.sqrt(chi2.isf(probability / len(carried), df=1)))
    return quantile * float(np.sqrt(np.max(carried) + 2.0 * NOISE[2] ** 2))


@pytest.mark.parametrize("layout", [THREE, FOUR], ids=["three", "four"])
def test_a_known_robot_is_found_within_the_intervals(layout: WheelModel) -> None:
    truth = true_values(layout, 5)
    study = identify_geometry(runs(layout, truth), layout)
    found = study.whole.plain
    known = dict(zip(layout.names, truth, strict=True))
    plain = [name for name, kind in zip(layout.names, layout.kinds, strict=True) if kind in PLANT]
    assert list(found.names) == plain
    assert sum(found.covers(name, known[name]) for name in plain) >= len(plain) - 1
    for name in plain[: layout.wheels + 1]:
        assert found[name] == pytest.approx(known[name], rel=5e-3)
    assert found["tracked_x_m"] == pytest.approx(0.03, abs=2e-3)
    assert found["tracked_y_m"] == pytest.approx(-0.02, abs=2e-3)
    assert study.whole.refused == ()
    for run in study.held_out:
        assert run.identified.largest_m < 0.25 * run.nominal.largest_m
        assert run.identified.heading_rad < run.nominal.heading_rad
        assert run.identified.heading_rad < largest_heading_error(study, run, 1e-3 / len(study.held_out))


def test_a_radius_by_direction_is_chosen_where_the_wheels_have_one_and_only_there() -> None:
    rolls_apart = identify_geometry(runs(THREE, true_values(THREE, 6, 0.015)), THREE)
    assert "direction" in rolls_apart.whole.model.kinds
    assert rolls_apart.whole.chosen["wheel_1_direction"] == pytest.approx(0.015, abs=3e-3)
    alike = identify_geometry(runs(THREE, true_values(THREE, 6)), THREE)
    for name, value in zip(alike.whole.chosen.names, alike.whole.chosen.values, strict=True):
        if "direction" in name:
            assert abs(value) < 3e-3


def test_a_turn_that_depends_on_translation_is_found_and_chosen_only_where_there_is_one() -> None:
    slides = identify_geometry(runs(THREE, true_values(THREE, 6, turn=-0.03)), THREE)
    assert "turn_translating" in slides.whole.model.kinds
    assert slides.whole.chosen.covers("turn_translating", -0.03)
    assert slides.whole.chosen["turn_translating"] == pytest.approx(-0.03, abs=0.01)
    alike = identify_geometry(runs(THREE, true_values(THREE, 6)), THREE)
    if "turn_translating" in alike.whole.chosen.names:
        assert alike.whole.chosen.covers("turn_translating", 0.0)


def test_the_runs_of_a_named_set_are_not_those_that_are_scored() -> None:
    driven = runs(THREE, true_values(THREE, 5))
    found, held_out = train_and_test(driven, THREE, {"group 0", "group 2"})
    assert [run.number for run in held_out] == [1, 3]
    alone, _ = train_and_test([driven[0], driven[2], driven[3]], THREE, {"group 0", "group 2"})
    np.testing.assert_array_equal(found.matrix, alone.matrix)
    for run in held_out:
        assert run.identified.largest_m < 0.25 * run.nominal.largest_m
    with pytest.raises(LogError, match="group 9"):
        train_and_test(driven, THREE, {"group 9"})


def test_straight_runs_refuse_what_only_turning_shows_and_name_the_motion() -> None:
    truth = true_values(THREE, 7)
    study = identify_geometry(runs(THREE, truth, Motion(turn=0.0)), THREE)
    refused = {refusal.name: refusal.motion for refusal in study.whole.refused}
    assert {"wheel_distance_m", "tracked_x_m", "tracked_y_m"} <= set(refused)
    assert all("turn" in refused[name] for name in ("wheel_distance_m", "tracked_x_m", "tracked_y_m"))
    assert "wheel_distance_m" not in study.whole.plain.names
    assert study.whole.plain["wheel_1_radius_m"] == pytest.approx(truth[0], rel=0.01)


def test_a_robot_that_only_stands_is_refused() -> None:
    still = Motion((0.0, 0.0), 0.0)
    with pytest.raises(LogError, match="radius") as refused:
        identify_geometry(runs(THREE, true_values(THREE, 7), still, 2), THREE)
    assert "drive straight" in str(refused.value.hint)


def test_turning_one_way_only_refuses_the_radius_of_the_other_direction() -> None:
    values = true_values(THREE, 8, 0.015)
    spins = Motion((0.02, 0.02), 0.9, one_way=True)
    study = identify_geometry(runs(THREE, values, spins), THREE)
    assert not any("direction" in name for name in study.whole.chosen.names)


def test_start_and_end_poses_alone_show_radii_and_distance() -> None:
    truth = true_values(THREE, 9)
    logs = []
    for seed in range(16):
        log = drive(THREE, truth, seed, duration_s=12.0)
        poses = log.require_truth()
        ends = replace(poses, time_s=poses.time_s[[0, -1]], xy=poses.xy[[0, -1]], theta=np.unwrap(poses.theta)[[0, -1]])
        logs.append(run_of(replace(log, truth=ends), f"group {seed % 4}", THREE))
    study = identify_geometry(logs, THREE)
    known = dict(zip(THREE.names, truth, strict=True))
    for name in ("wheel_1_radius_m", "wheel_2_radius_m", "wheel_3_radius_m", "wheel_distance_m"):
        assert study.whole.plain[name] == pytest.approx(known[name], rel=0.02)
    assert not any(clock.measured for clock in study.clocks)


def test_offset_and_rate_of_a_foreign_clock_are_found() -> None:
    values = true_values(THREE, 10)
    run = run_of(drive(THREE, values, 10, lag=(1.3, 2e-3)), "", THREE)
    clock = measure_clock(run, THREE.matrix(THREE.nominal))
    assert clock.measured
    assert clock.lag(np.array([20.0]))[0] == pytest.approx(1.34, abs=0.02)
    assert clock.rate == pytest.approx(2e-3, abs=1e-3)
    np.testing.assert_allclose(clock.on_log(20.0 + clock.lag(np.array([20.0]))), 20.0, atol=1e-6)


def test_wheels_in_the_wrong_order_or_a_wrong_sign_are_refused() -> None:
    logs = [drive(THREE, true_values(THREE, 11), seed) for seed in range(2)]
    wrong = [run_of(replace(log, counts=-log.counts), log.name, THREE) for log in logs]
    with pytest.raises(LogError, match="follow"):
        identify_geometry(wrong, THREE)


def test_one_run_gives_geometry_and_no_figure_of_left_out_runs() -> None:
    study = identify_geometry(runs(THREE, true_values(THREE, 12), count=1), THREE)
    assert study.held_out == ()
    assert study.whole.model.name == "geometry"
