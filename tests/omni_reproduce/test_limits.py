# SPDX-License-Identifier: MIT
"""The posterior bound: closed forms, the same by other algebra, a filter that reaches it, and nobody below it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.runs import run_in_process
from omni_reproduce import limits
from omni_reproduce.experiment import read_spec
from omni_reproduce.posterior_bound import (
    STEP_S,
    STEP_TICKS,
    TICK_S,
    Array,
    BoundError,
    Schedule,
    Statistics,
    Wheels,
    all_at_once,
    bound_variances,
    motion_gains,
)
from omni_reproduce.reachable_filter import Filter, filter_errors, measure, together
from omniwheel.errors import OmniError
from tests.omni_reproduce import kept_page

SPEC = read_spec(limits.NAME)
THREE = Wheels(np.full(3, 0.05), np.full(3, 0.26), np.radians([0.0, 120.0, 240.0]))
WORLD = Statistics(0.1, 0.5, 50.0, np.array([0.005, 0.004, 0.003]), 0.03)
SEEDS, PATHS = 8, 2
MONTE_CARLO = 0.1
"""How far a mean over a few paths may be below what it estimates."""
FLOW: dict[str, Any] = {"flow_rate_Hz": 50.0, "flow_sd": 1e-4, "flow_share": 0.02}
"""What a sensor of motion over the floor adds to it."""


def drive(twist: Array, statistics: Statistics, wheels: Wheels = THREE, seed: int = 1) -> NDArray[Any]:
    """Return a record of the body velocity ``twist`` (ticks, 3) [m/s, rad/s] with slip of the world's law."""
    ticks, count = len(twist), wheels.count
    record = np.zeros(ticks + 1, [("truth", float, 3), ("wheel_rad_s", float, count), ("slip_ratio", float, count)])
    at = (np.arange(ticks) + 0.5) * TICK_S / statistics.slip_time_s
    knots = np.random.default_rng(seed).uniform(0.0, statistics.slip_max, (int(at[-1]) + 2, count))
    share = (at % 1.0)[:, None]
    record["slip_ratio"][1:] = (1.0 - share) * knots[at.astype(int)] + share * knots[at.astype(int) + 1]
    rim = twist @ np.linalg.pinv(wheels.to_body).T
    record["wheel_rad_s"][1:] = rim / wheels.radius_m / (1.0 - record["slip_ratio"][1:])
    record["wheel_rad_s"][0] = record["wheel_rad_s"][1]
    heading = np.concatenate([[0.0], np.cumsum(twist[:, 2]) * TICK_S])
    middle = 0.5 * (heading[1:] + heading[:-1])
    cosine, sine = np.cos(middle), np.sin(middle)
    along = np.stack([cosine * twist[:, 0] - sine * twist[:, 1], sine * twist[:, 0] + cosine * twist[:, 1]], axis=1)
    record["truth"][1:, :2] = np.cumsum(along, axis=0) * TICK_S
    record["truth"][:, 2] = heading
    return record


def winding(seconds: float) -> Array:
    """Return a body velocity (ticks, 3) that moves all three ways."""
    t = np.arange(round(seconds / TICK_S)) * TICK_S
    return np.stack([0.3 * np.cos(t), 0.2 * np.sin(2.3 * t), 0.8 * np.sin(1.7 * t)], axis=1)


def test_steady_speed_of_unknown_size_is_a_line_through_noisy_points() -> None:
    """So is x of a robot that drives straight along it, with slip of any size that stays.

    Where a line through n points ends, its variance is 2 (2 n - 1) / (n (n + 1)) of theirs. One period later it is
    2 (2 n + 1) / (n (n - 1)).
    """
    sd = 0.005
    world = Statistics(1e3, 1e6, 1.0 / STEP_S, np.full(3, sd), 0.0)
    record = drive(np.tile([0.3, 0.0, 0.0], (1000, 1)), replace(world, slip_max=0.0))
    moves, gains = motion_gains(record, THREE, world)
    found = bound_variances(moves[None], gains[None], 3, world)[0, 10:, 0]
    n = np.arange(11.0, len(moves) + 1.0)
    expected = sd**2 * ((2.0 * n - 1.0) / (n * (n + 1.0)) + (2.0 * n + 1.0) / (n * (n - 1.0)))
    np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("delay_s", [0.0, 0.01, 0.05])
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"wheel_sd": (0.003, 0.002, 0.005)},
        {"gyro_step_variance": 1e-9, "gyro_bias_sd": 0.01},
        {"gyro_step_variance": 1e-9, "gyro_bias_sd": 0.01, "wheel_sd": (0.003, 0.002, 0.005)},
        FLOW,
        {**FLOW, "gyro_step_variance": 1e-9, "gyro_bias_sd": 0.01},
    ],
)
def test_the_recursion_is_least_squares_over_everything_that_arrived(more: dict[str, Any], delay_s: float) -> None:
    world = replace(WORLD, fix_delay_s=delay_s, **more)
    moves, gains = motion_gains(drive(winding(2.0), world), THREE, world)
    found = bound_variances(moves[None], gains[None], 3, world)[0]
    steps = np.arange(20, len(moves) - 1, 7)
    begin = all_at_once(moves, gains, 3, world, steps)
    end = all_at_once(moves, gains, 3, world, steps + 1, arriving=False)
    np.testing.assert_allclose(found[steps], 0.5 * (begin + end), rtol=1e-6)


@pytest.mark.full
def test_to_know_less_raises_the_bound() -> None:
    moves, gains = motion_gains(drive(winding(3.0), WORLD), THREE, WORLD)

    def mean(statistics: Statistics) -> Array:
        return np.asarray(bound_variances(moves[None], gains[None], 3, statistics)[0, 50:].mean(axis=0))

    changes: list[dict[str, Any]] = [
        {"fix_delay_s": 0.05},
        {"fix_rate_Hz": 10.0},
        {"slip_max": 0.2},
        {"count_rad": 0.02},
    ]
    for change in changes:
        assert (mean(replace(WORLD, **change)) > mean(WORLD)).all(), change
    gyro: dict[str, Any] = {"gyro_step_variance": 1e-9, "gyro_bias_sd": 0.01}
    for more in (gyro, FLOW):
        assert (mean(replace(WORLD, **more)) < mean(WORLD)).all()
    assert (mean(replace(WORLD, **gyro, **FLOW)) < mean(replace(WORLD, **gyro))).all()


@pytest.mark.full
@pytest.mark.parametrize(
    "more",
    [{}, {"gyro_step_variance": 2.5e-11, "gyro_bias_sd": 0.009, "gyro_bias_walk": 1e-6}, FLOW],
    ids=["wheels", "gyro", "floor motion"],
)
def test_a_filter_that_knows_the_world_reaches_the_bound(more: dict[str, Any]) -> None:
    """Over many short runs its mean square error is the bound, within what so many runs leave open."""
    world = replace(WORLD, fix_delay_s=0.02, count_rad=2.0 * np.pi / 10000, **more)
    paths = 150
    records = [drive(winding(3.0), world, seed=seed) for seed in range(paths)]
    readings = together([measure(record, THREE, world, 10000, seed) for seed, record in enumerate(records)])
    errors = filter_errors(Filter(paths, THREE, world), readings)[:, 30:]
    moved = [motion_gains(record, THREE, world) for record in records[:3]]
    moves, gains = (np.stack([part[kind] for part in moved]) for kind in (0, 1))
    bound = bound_variances(moves, gains, 3, world)[:, 30:].mean(axis=(0, 1))
    ratio = errors.mean(axis=(0, 1)) / bound
    open_share = errors.mean(axis=1).std(axis=0) / np.sqrt(paths) / bound
    assert (np.abs(ratio - 1.0) < 3.0 * open_share).all(), (ratio, open_share)
    assert (open_share < MONTE_CARLO).all(), "too few paths to say so"


@pytest.mark.full
@pytest.mark.parametrize("key", ["demo", "gyro", "flow"])
def test_the_robot_is_not_below_the_bound(key: str) -> None:
    """Below it the bound would be wrong."""
    bound, told = limits.bound_and_informed_filter(SPEC, key, PATHS)
    reached = limits.reached_by_robot(limits.scenario_of(SPEC, key, "ideal"), 1, SEEDS, 1)
    assert (np.sqrt(np.mean(reached**2, axis=0)) > bound).all()
    assert (told > (1.0 - MONTE_CARLO) * bound).all()
    assert (told < np.sqrt(np.mean(reached**2, axis=0))).all(), "who knows more is better"


def without_creep(record: NDArray[Any], wheels: Wheels) -> NDArray[Any]:
    """Return the record with wheels that turn as the way and the slip ask for."""
    moved = np.diff(record["truth"], axis=0) / TICK_S
    heading = record["truth"][:-1, 2] + 0.5 * TICK_S * moved[:, 2]
    cosine, sine = np.cos(heading), np.sin(heading)
    ahead, aside = cosine * moved[:, 0] + sine * moved[:, 1], cosine * moved[:, 1] - sine * moved[:, 0]
    rim = np.stack([ahead, aside, moved[:, 2]], axis=1) @ np.linalg.pinv(wheels.to_body).T
    speed = rim / wheels.radius_m / (1.0 - record["slip_ratio"][1:, : wheels.count])
    out = record.copy()
    out["wheel_rad_s"][1:-1, : wheels.count] = 0.5 * (speed[1:] + speed[:-1])
    out["wheel_rad_s"][-1, : wheels.count] = speed[-1]
    return out


@pytest.mark.full
def test_creep_is_what_keeps_the_filter_from_the_bound() -> None:
    """With exact fixes it counts. Who knows it, as the bound does, is at the bound."""
    scenario = limits.scenario_of(SPEC, "fix_0_3mm", "ideal")
    wheels, counts = limits.wheels_of(scenario)
    statistics = replace(limits.statistics_of(scenario, 1), fix_sd=np.full(3, 0.0003))
    records = [run_in_process(scenario, seed).record for seed in (1, 2)]
    gained = [motion_gains(record, wheels, statistics) for record in records]
    moves, gains = (np.stack([part[kind] for part in gained]) for kind in (0, 1))
    on_path = np.stack([metrics.on_path(record)[:-1:STEP_TICKS][: moves.shape[1]] for record in records])
    bound = limits.rms(bound_variances(moves, gains, wheels.count, statistics)[on_path])
    known = [without_creep(record, wheels) for record in records]
    creeps, knows = (
        limits.rms(filter_errors(Filter(2, wheels, statistics), together(readings))[on_path])
        for readings in (
            [measure(record, wheels, statistics, counts, seed) for seed, record in enumerate(chosen, start=1)]
            for chosen in (records, known)
        )
    )
    assert (creeps > 1.05 * knows).all(), creeps / knows
    np.testing.assert_allclose(knows, bound, rtol=0.03)


def test_on_the_kept_page_nobody_is_below_the_bound() -> None:
    body = kept_page.sections(kept_page.PAGE.read_text(encoding="utf-8"))[SPEC["experiment"]["title"]]
    ratios = {}
    for line in body.splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 5 and cells[1].endswith("robot"):
            ratios[cells[0]] = float(cells[3].split(" ")[0]) / float(cells[4])
    assert len(ratios) == len(SPEC["setting"])
    assert min(ratios.values()) > 1.0, ratios


def test_statistics_are_those_of_the_scenario() -> None:
    rough = limits.statistics_of(limits.scenario_of(SPEC, "gyro_rough", "ideal"), 2)
    assert rough.gyro_step_variance > (1.745e-4) ** 2 * STEP_S
    assert (rough.slip_max, rough.slip_time_s, rough.fix_delay_s) == (0.1, 5.0, 0.02)
    differ = limits.statistics_of(limits.scenario_of(SPEC, "tolerances", "ideal"), 4)
    np.testing.assert_allclose(differ.fix_sd[:, 0], 0.005 * np.array([0.625, 0.875, 1.125, 1.375]))
    np.testing.assert_allclose(differ.wheel_sd, 0.98658 * np.array([0.003, 0.002, 0.005]), rtol=1e-4)
    assert limits.statistics_of(limits.scenario_of(SPEC, "demo", "real"), 1).wheel_sd == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "named"),
    [({"fix_rate_Hz": 0.0}, "fix_rate_Hz"), ({"fix_rate_Hz": 333.0}, "fix_rate_Hz"), ({"fix_delay_s": 0.003}, "delay")],
)
def test_times_that_fit_no_step_are_refused(change: dict[str, Any], named: str) -> None:
    with pytest.raises(BoundError, match=named) as refused:
        Schedule(replace(WORLD, **change))
    assert isinstance(refused.value, OmniError)
    assert refused.value.hint
    assert STEP_TICKS * TICK_S == STEP_S


def test_a_turn_over_the_floor_is_not_in_the_bound_and_refused() -> None:
    """A bound without it would be too high."""
    turns = limits.scenario_of(SPEC, "flow", "ideal").with_world({"flow_turns": 1})
    with pytest.raises(BoundError, match="flow_turns"):
        limits.statistics_of(turns, 1)
    ways = limits.statistics_of(limits.scenario_of(SPEC, "flow", "ideal"), 1)
    assert (ways.flow_rate_Hz, ways.flow_sd, ways.flow_share) == (50.0, 1e-4, 0.02)
    assert not limits.statistics_of(limits.scenario_of(SPEC, "demo", "ideal"), 1).has_flow
