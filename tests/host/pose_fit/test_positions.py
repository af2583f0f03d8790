# SPDX-License-Identifier: MIT
"""A truth of positions without headings: one marker off the centre, whose place is fitted, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from omniwheel.errors import LogError
from omniwheel.identification.pose_fit.clock import measure_clock
from omniwheel.identification.pose_fit.scores import score
from omniwheel.identification.pose_fit.study import identify_geometry
from omniwheel.identification.pose_fit.wheel_model import PLANT, WheelModel
from omniwheel.identification.pose_fit.windows import best_turn, cut, linearised, run_of, with_start_heading
from omniwheel.logs.log import WheelLog
from tests.host.pose_fit.robots import FOUR, NOISE, THREE, Array, drive, true_values

MARKER = (0.09, -0.06, 0.0)


def marked(layout: WheelModel, seed: int) -> Array:
    """Return the parameters of a robot with a marker 0.1 m off its centre."""
    values = true_values(layout, seed)
    values[layout.wheels + 1 : layout.wheels + 4] = MARKER
    return values


def positions(log: WheelLog) -> WheelLog:
    truth = log.require_truth()
    return replace(log, truth=replace(truth, theta=np.full(len(truth.time_s), np.nan)))


@pytest.mark.full
@pytest.mark.parametrize("layout", [THREE, FOUR], ids=["three", "four"])
def test_one_marker_off_the_centre_shows_geometry_and_its_own_place(layout: WheelModel) -> None:
    truth = marked(layout, 5)
    runs = [run_of(positions(drive(layout, truth, seed)), f"run {seed}", layout) for seed in range(4)]
    study = identify_geometry(runs, layout)
    found, known = study.whole.plain, dict(zip(layout.names, truth, strict=True))
    wanted = {n for n, kind in zip(layout.names, layout.kinds, strict=True) if kind in PLANT} - {"tracked_heading_rad"}
    assert set(found.names) == wanted
    assert [refusal.name for refusal in study.whole.refused] == ["tracked_heading_rad"]
    assert sum(found.covers(name, known[name]) for name in wanted) >= len(wanted) - 1
    assert found["tracked_x_m"] == pytest.approx(MARKER[0], abs=3e-3)
    assert found["tracked_y_m"] == pytest.approx(MARKER[1], abs=3e-3)
    assert found["wheel_distance_m"] == pytest.approx(known["wheel_distance_m"], rel=5e-3)
    for run in study.held_out:
        assert run.identified.largest_m < 0.25 * run.nominal.largest_m
        assert np.isnan(run.identified.heading_rad)


def test_slopes_of_positions_are_those_of_poses_at_the_heading_that_fits_best() -> None:
    values = marked(THREE, 1)
    log = drive(THREE, values, 1, duration_s=15.0)
    with_heading, without = (
        cut(run, 0, run.truth_s)[0] for run in (run_of(log, "", THREE), run_of(positions(log), "", THREE))
    )
    matrix = THREE.matrix(values)
    residual, slope, start = linearised(without, matrix)
    assert not residual[:, 2].any()
    assert not slope[:, 2].any()
    assert not start[:, 2].any()
    # At the true geometry positions are off by their noise: the first one's and that of the heading that was fitted.
    assert np.sqrt(np.mean(residual[:, :2] ** 2)) < 3.0 * NOISE[0]
    posed = replace(with_heading, start=with_start_heading(without, matrix).start)
    np.testing.assert_allclose(slope[:, :2], linearised(posed, matrix)[1][:, :2])


def test_the_turn_of_points_is_found_whatever_their_shift() -> None:
    points = np.random.default_rng(1).normal(size=(20, 2))
    cosine, sine = np.cos(2.5), np.sin(2.5)
    turned = points @ np.array([[cosine, sine], [-sine, cosine]]) + (3.0, -1.0)
    assert best_turn(points, turned) == pytest.approx(2.5)


def test_a_score_without_headings_fits_the_start_heading() -> None:
    values = marked(THREE, 3)
    log = drive(THREE, values, 3)
    bare = score(run_of(positions(log), "", THREE), THREE.matrix(values))
    assert bare.largest_m <= score(run_of(log, "", THREE), THREE.matrix(values)).largest_m + 4.0 * NOISE[0]
    assert np.isnan(bare.heading_rad)


def test_a_foreign_clock_is_found_from_the_speed() -> None:
    values = true_values(THREE, 10)
    run = run_of(positions(drive(THREE, values, 10, lag=(1.3, 2e-3))), "", THREE)
    clock = measure_clock(run, THREE.matrix(values))
    assert clock.lag(np.array([20.0]))[0] == pytest.approx(1.34, abs=0.02)


@pytest.mark.full
def test_a_mirrored_frame_is_refused() -> None:
    logs = []
    for seed in range(2):
        log = positions(drive(THREE, marked(THREE, 4), seed))
        truth = log.require_truth()
        logs.append(replace(log, truth=replace(truth, xy=truth.xy * (1.0, -1.0))))
    with pytest.raises(LogError, match="follow"):
        identify_geometry([run_of(log, log.name, THREE) for log in logs], THREE)
