# SPDX-License-Identifier: MIT
"""The best without fixes: a closed form, the same by other algebra, nobody below it, and the page's table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.figures import no_fix as no_fix_figures
from bench.figures import no_fix_bound
from hil_sim.processes import worker_pool
from hil_sim.world import IDEAL_WHEELS
from omni_reproduce.posterior_bound import (
    STEP_S,
    UNKNOWN_M2,
    BoundError,
    Schedule,
    Statistics,
    all_at_once,
    bound_variances,
    motion_gains,
)
from tests.hil_sim.test_no_fix_figures import PAGE
from tests.omni_reproduce.test_limits import THREE, drive, winding

ALONE = Statistics(0.1, 0.5, 0.0, np.full(3, 0.005), 0.0, start_variance=1e-6)
GYRO = {"gyro_step_variance": 1e-9, "gyro_bias_sd": 0.01}


@pytest.mark.parametrize("more", [{}, GYRO, {"flow_rate_Hz": 50.0, "flow_sd": 1e-4, "flow_share": 0.02, **GYRO}])
def test_without_fixes_the_recursion_is_least_squares_over_what_the_sensors_say(more: dict[str, float]) -> None:
    world = replace(ALONE, **more)  # type: ignore[arg-type]
    moves, gains = motion_gains(drive(winding(2.0), world), THREE, world)
    found = bound_variances(moves[None], gains[None], 3, world)[0]
    steps = np.arange(20, len(moves) - 1, 7)
    begin, end = (all_at_once(moves, gains, 3, world, at) for at in (steps, steps + 1))
    np.testing.assert_allclose(found[steps], 0.5 * (begin + end), rtol=1e-6)


def test_where_wheels_say_nothing_the_heading_is_what_a_gyro_adds_up() -> None:
    """White noise w, a bias b and its walk q over the time t: w t + b^2 t^2 + q^2 t^3 / 3."""
    world = replace(ALONE, slip_max=1e4, start_variance=0.0, gyro_bias_walk=3e-3, **GYRO)  # type: ignore[arg-type]
    moves, gains = motion_gains(drive(winding(4.0), replace(world, slip_max=0.0)), THREE, world)
    found = bound_variances(moves[None], gains[None], 3, world)[0, :, 2]
    t = (np.arange(len(found)) + 0.5) * STEP_S
    expected = 1e-9 * t / STEP_S + (0.01 * t) ** 2 + 3e-3**2 * t**3 / 3.0
    np.testing.assert_allclose(found[20:], expected[20:], rtol=0.02)


def test_a_world_without_fixes_needs_a_known_start() -> None:
    with pytest.raises(BoundError, match="nothing is known of the pose"):
        Schedule(replace(ALONE, start_variance=UNKNOWN_M2))


def test_an_angle_that_does_not_change_is_not_rounded_anew() -> None:
    turned = np.zeros((35, 3))
    turned[12, 1] = 0.1
    assert no_fix_bound.standing(turned, 3).tolist() == [True, False, True]


@pytest.mark.full
def test_a_longer_rest_and_more_sensors_lower_the_bound() -> None:
    found = {each.title: no_fix_bound.scenario_of(each, 20) for each in no_fix_figures.SETS if "turn" not in each.title}
    wheels, gyro, rested, both = (no_fix_bound.end_variances(scenario, 1) for scenario in found.values())
    assert rested[2] < 0.6 * gyro[2] < 0.01 * wheels[2]
    assert both[0] < 0.1 * gyro[0] < 0.1 * wheels[0]


@pytest.mark.full
def test_the_robot_is_not_below_the_bound() -> None:
    """Eight runs of 40 s leave a factor of two open."""
    gyro = no_fix_figures.SETS[1]
    on_ideal = replace(gyro, world={**gyro.world, **IDEAL_WHEELS})
    reached = np.array([no_fix_figures.drift(on_ideal, 40, seed)[:2] for seed in range(8)])
    x, y, theta = no_fix_bound.end_variances(no_fix_bound.scenario_of(gyro, 40), 0)
    assert np.mean(reached[:, 0] ** 2) > 0.5 * (x + y)
    assert np.mean(reached[:, 1] ** 2) > 0.5 * theta


@pytest.mark.full
def test_what_the_bound_does_not_know_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    no_fix_bound.main(["--paths", "1", "--seconds", "2"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + len(no_fix_figures.SETS)
    assert [line.split("|")[1].strip() for line in lines if "not computed" in line] == ["floor motion: way and turn"]


@pytest.mark.nightly
def test_the_page_has_the_table() -> None:
    page = PAGE.read_text(encoding="utf-8")
    with worker_pool() as pool:
        for each in no_fix_figures.SETS:
            if "turn" not in each.title:
                assert no_fix_bound.row(each, no_fix_bound.PATHS, no_fix_figures.SECONDS, pool) in page
