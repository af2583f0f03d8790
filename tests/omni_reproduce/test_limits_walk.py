# SPDX-License-Identifier: MIT
"""A filter that takes slip for a random walk: right in a world where it is one, and never better than who knows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from omni_reproduce import limits, limits_walk
from omni_reproduce.experiment import read_spec
from omni_reproduce.limits_walk import WalkFilter
from omni_reproduce.posterior_bound import TICK_S, Array
from omni_reproduce.reachable_filter import Readings, filter_errors, measure, together
from tests.omni_reproduce.test_limits import THREE, WORLD, drive, winding

VARIANCE_PER_S = 0.004
PATHS = 100


def walking(seed: int) -> NDArray[Any]:
    """Return a record whose slip ratios walk at random, from the mean that the filter is told."""
    record = drive(winding(3.0), replace(WORLD, slip_max=0.0))
    steps = np.random.default_rng(seed).normal(0.0, np.sqrt(VARIANCE_PER_S * TICK_S), (len(record) - 1, 3))
    record["slip_ratio"][1:] = 0.5 * WORLD.slip_max + np.cumsum(steps, axis=0)
    record["wheel_rad_s"][1:] /= 1.0 - record["slip_ratio"][1:]
    return record


def readings_of(world: Any, records: list[NDArray[Any]]) -> Readings:
    return together([measure(record, THREE, world, 10**6, seed) for seed, record in enumerate(records)])


@pytest.mark.full
def test_where_slip_is_a_walk_its_errors_are_as_large_as_it_says() -> None:
    """And with steps ten times too small or too large they are larger than with the right ones."""
    readings = readings_of(WORLD, [walking(seed) for seed in range(PATHS)])
    errors: dict[float, Array] = {}
    for factor in (0.1, 1.0, 10.0):
        robot = WalkFilter(PATHS, THREE, WORLD, factor * VARIANCE_PER_S)
        errors[factor] = filter_errors(robot, readings)[:, 100:].mean(axis=(0, 1))
        if factor == 1.0:
            off = robot.state[:, :3] - readings.truth[:, -1]
            square = np.einsum("ki,kij,kj->k", off, np.linalg.inv(robot.p[:, :3, :3]), off).mean() / 3.0
            assert square == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (3 * PATHS)))
    assert (errors[1.0] < errors[0.1]).all()
    assert (errors[1.0] < errors[10.0]).all()


def test_the_state_has_each_ratio_twice_and_both_are_one() -> None:
    readings = readings_of(WORLD, [walking(1)])
    robot = WalkFilter(1, THREE, WORLD, VARIANCE_PER_S)
    filter_errors(robot, readings)
    assert robot.state[0, 3:6] == pytest.approx(robot.state[0, 6:9], abs=1e-12)
    assert robot.p[0, 3:6, 3:6] == pytest.approx(robot.p[0, 6:9, 6:9], abs=1e-12)
    assert robot.p[0, 3:6, 3:6] == pytest.approx(robot.p[0, 3:6, 6:9], abs=1e-12)
    assert robot.state[0, 3:6].std() > 0.001, "it has learned something of each"


def test_a_walk_that_hardly_steps_keeps_what_it_was_told_first() -> None:
    """A filter of slip that is constant: its variance only falls."""
    readings = readings_of(WORLD, [walking(1)])
    robot = WalkFilter(1, THREE, WORLD, 0.0)
    before = np.diag(robot.p[0])[3:6].copy()
    filter_errors(robot, readings)
    assert (np.diag(robot.p[0])[3:6] < 0.5 * before).all()
    moving = WalkFilter(1, THREE, WORLD, VARIANCE_PER_S)
    filter_errors(moving, readings)
    assert (np.diag(moving.p[0])[3:6] > np.diag(robot.p[0])[3:6]).all()


@pytest.mark.full
def test_nobody_who_knows_less_is_better_and_the_row_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(limits_walk, "PATHS", 1)
    monkeypatch.setattr(limits_walk, "FACTORS", (0.2, 0.5))
    limits_walk.main(["demo", "--seeds", "2"])
    head, _, row = capsys.readouterr().out.splitlines()
    assert head == "| setting | told the law of slip | takes slip for a walk | robot as shipped |"
    title, told, walk, robot = (cell.strip() for cell in row.strip("| ").split(" | "))
    assert title == "demo"
    ratios = [[float(figure) for figure in cell.split(" (")[0].split(" / ")] for cell in (told, walk, robot)]
    assert np.less(ratios[0], ratios[1]).all()
    assert min(ratios[1] + ratios[2]) > 1.0
    assert walk.endswith(("(x 0.2)", "(x 0.5)"))


@pytest.mark.full
def test_the_factor_with_the_least_sum_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    driven = limits.drive(read_spec(limits.NAME), "demo", 1)
    monkeypatch.setattr(limits_walk, "FACTORS", (0.01, 0.4, 100.0))
    assert limits_walk.best_walk(driven, limits.bound_of(driven))[0] == 0.4
