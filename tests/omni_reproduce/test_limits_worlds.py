# SPDX-License-Identifier: MIT
"""Worlds that a seed draws: the same each time, all different, in their ranges; and nobody is below the bound."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim.batch import run_batch
from omni_reproduce import limits, limits_worlds
from omni_reproduce.limits_worlds import Outcome, World, draw, trials
from omni_reproduce.posterior_bound import Array, Schedule

PAGE = Path(__file__).resolve().parents[2] / "docs/report/reproduce.md"
MANY, KEPT_WORLD = 60, 9
NUMBERS = {
    "slip_max": limits_worlds.SLIP_MAX,
    "slip_time_s": limits_worlds.SLIP_TIME_S,
    "fix_sd_xy_m": limits_worlds.FIX_SD,
    "fix_sd_theta_rad": limits_worlds.FIX_SD,
    "friction_coefficient": limits_worlds.FRICTION,
}


@pytest.mark.full
def test_a_seed_draws_the_same_worlds_however_many_and_another_seed_others() -> None:
    assert draw(4, 2) == draw(4, 2)
    assert len({draw(seed, number).title for seed in (1, 2) for number in range(1, 21)}) == 40


@pytest.mark.full
def test_worlds_are_inside_their_ranges_and_reach_all_kinds() -> None:
    worlds = [draw(7, number) for number in range(MANY)]
    for name, (low, high) in NUMBERS.items():
        found = np.array([world.entry["world"][name] for world in worlds])
        assert low <= found.min() < found.max() <= high, name
        assert found.min() < low + 0.25 * (high - low), name
    assert {world.entry["scenario"] for world in worlds} == set(limits_worlds.ROBOTS)
    assert {world.entry["world"]["fix_rate_Hz"] for world in worlds} == set(limits_worlds.FIX_RATES_HZ)
    gyros = sum("GYRO_AXIS" in world.entry["parameters"] for world in worlds)
    assert 0.25 * MANY < gyros < 0.75 * MANY


def test_the_robot_is_told_of_its_sensors_and_of_nothing_else() -> None:
    for number in range(20):
        entry = draw(3, number).entry
        told = {"EKF_R_XY": entry["world"]["fix_sd_xy_m"], "EKF_R_TH": entry["world"]["fix_sd_theta_rad"]}
        if "gyro_rate_Hz" in entry["world"]:
            told |= {"GYRO_AXIS": 3, "GYRO_ND": entry["world"]["gyro_noise_density"]}
        assert entry["parameters"] == told


@pytest.mark.full
def test_every_world_fits_the_steps_of_the_bound() -> None:
    for number in range(MANY):
        spec = {"setting": {"drawn": draw(11, number).entry}}
        Schedule(limits.statistics_of(limits.scenario_of(spec, "drawn", "ideal"), 1))


@pytest.mark.nightly
def test_a_row_of_the_page_is_that_of_today_and_nobody_is_below_the_bound() -> None:
    """One world of the page's twenty; the others take minutes."""
    world = draw(1, KEPT_WORLD)
    outcome = limits_worlds.outcome_of(world, 8)
    assert limits_worlds.row(KEPT_WORLD, world, outcome) in PAGE.read_text(encoding="utf-8").splitlines()
    assert outcome.stopped == 0
    assert set(outcome.reached) == {(wheels, trial) for wheels in limits.WHEELS for trial in trials()}
    shipped, *others = trials()
    for trial in trials():
        assert (outcome.ratio("ideal", trial) > 1.0).all()
    for trial in others:
        assert (outcome.reached["ideal", shipped] != outcome.reached["ideal", trial]).all(), "it reaches the robot"
    assert (outcome.reached["real", shipped] != outcome.reached["ideal", shipped]).all(), "so do the wheels"


@pytest.mark.parametrize(("number", "trial"), [(6, 1), (11, 1), (7, 0), (14, 0)])
def test_wheels_that_skid_do_not_make_a_gyro_worse_than_none(number: int, trial: int) -> None:
    """What wheels and gyro were apart in a skid once taught slip ratios, and the error was 4 to 120 times as large."""
    spec = {"experiment": {"seed": limits_worlds.FIRST_RUN}, "setting": {"drawn": draw(1, number).entry}}
    driven = limits.scenario_of(spec, "drawn", "ideal").with_parameters(list(trials().values())[trial])
    with_gyro = run_batch(driven, limits_worlds.FIRST_RUN, 8).rows
    without = run_batch(driven.with_parameters({"GYRO_AXIS": 0.0}), limits_worlds.FIRST_RUN, 8).rows
    assert (with_gyro["completed"] == 1.0).all()
    for name in ("estimate_position_m", "estimate_theta_rad"):
        assert with_gyro[name].max() < 1.1 * without[name].max(), name


def made(ideal: float, real: float, gain: float) -> Outcome:
    """Return an outcome with a bound of 2 mm and 1 mrad; all but the defaults have errors ``gain`` times as large."""
    bound = np.array([2.0, 1.0])
    pairs: dict[tuple[str, str], Array] = {}
    for wheels, ratio in (("ideal", ideal), ("real", real)):
        for number, trial in enumerate(trials()):
            pairs[wheels, trial] = (gain if number else 1.0) * ratio * bound
    return Outcome(bound, pairs, 0)


def test_a_row_and_the_summary_say_what_was_found() -> None:
    outcome = made(1.5, 2.0, 0.9)
    row = limits_worlds.row(3, World("a title", {}), outcome)
    stopped = limits_worlds.row(3, World("a title", {}), replace(outcome, stopped=2))
    assert "| a title (2 runs stopped) |" in stopped
    assert row == (
        "| 3 | a title | 2.00 / 1.00 | 3.00 / 1.50 (1.50 / 1.50)"
        + " | 2.70 / 1.35 (1.35 / 1.35)"
        + " | 4.00 / 2.00 (2.00 / 2.00)"
        + " | 3.60 / 1.80 (1.80 / 1.80)"
        + " |"
    )
    lines = limits_worlds.summary([made(1.5, 2.0, 0.9), made(1.2, 1.3, 1.1), made(1.1, 1.2, 1.0)])
    assert lines[0] == "Over the bound on ideal wheels, as shipped: median 1.20 / 1.20, worst 1.50 / 1.50."
    for line, trial in zip(lines[2:3], list(trials())[1:], strict=True):
        assert f"ideal wheels {trial} is better by more than 1 % in 1 / 1 of 3 worlds, and worse in 1 / 1" in line


def test_an_estimate_below_its_bound_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Then the bound would be wrong, and with it the whole table."""
    monkeypatch.setattr(limits_worlds, "outcome_of", lambda *_: made(0.9, 1.2, 1.0))
    with pytest.raises(SystemExit) as stopped:
        limits_worlds.main(["--worlds", "1"])
    assert stopped.value.code == 1
    assert "below the bound" in capsys.readouterr().err
    monkeypatch.setattr(limits_worlds, "outcome_of", lambda *_: made(1.0, 0.95, 1.0))
    limits_worlds.main(["--worlds", "1"])


@pytest.mark.parametrize("name", ["worlds", "seeds"])
def test_wrong_arguments_are_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        limits_worlds.main([f"--{name}", "0"])
    assert refused.value.code == 2
    assert f"--{name} is 0; 1 or more are needed" in capsys.readouterr().err
