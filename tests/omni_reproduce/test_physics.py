# SPDX-License-Identifier: MIT
"""Both worlds get the same: wheels, floor, duties. What our world says was written down before MuJoCo was asked."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim.metrics import on_path
from hil_sim.runs import new_world, run_in_process
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.physics import (
    END,
    FIXES,
    LEAST,
    QUANTITIES,
    SPEEDS,
    Case,
    _rows,
    agree,
    both,
    duties,
    ours,
    predict,
    scenario_of,
)

SPEC = read_spec("physics")
CASE = Case("fast_three_wheel", "level", "rose_3", 1, 2.0)


def test_there_are_twenty_manoeuvres_three_robots_and_three_floors() -> None:
    assert [len(SPEC[name]) for name in ("manoeuvre", "robot", "floor")] == [20, 3, 3]
    assert set(SPEC["wanted"]) == set(QUANTITIES) == set(LEAST)


@pytest.mark.parametrize("floor", SPEC["floor"])
def test_duties_played_open_loop_give_the_same_run_in_our_world(floor: str) -> None:
    scenario = scenario_of(SPEC, replace(CASE, floor=floor), fixes=False)
    record = run_in_process(scenario).record
    world = new_world(scenario)
    poses = []
    for duty, armed in duties(record, 3):
        poses.append(world.truth)
        if armed:
            world.drive_voltage(float(world.c.config.battery_V) * duty)
        world.step()
    driven = on_path(record)
    assert np.abs(np.array(poses) - record["truth"])[driven].max() < 1e-12
    assert np.ptp(record["truth"][:, 0]) > 0.2


@pytest.mark.full
def test_the_floor_makes_a_difference() -> None:
    found = {floor: ours(replace(CASE, floor=floor)) for floor in SPEC["floor"]}
    assert found["slippery"] != found["level"] != found["slope"]


def test_figures_agree_within_what_is_wanted() -> None:
    assert agree(SPEC, SPEEDS, 1.019, 1.0)
    assert not agree(SPEC, SPEEDS, 1.021, 1.0)
    assert agree(SPEC, SPEEDS, 0.0005, 0.0), "both are next to nothing"


@pytest.mark.full
def test_wheel_speeds_are_those_of_mujoco_within_two_percent() -> None:
    pytest.importorskip("mujoco", reason="needs pip install 'omniwheel[mujoco]'")
    our, their = both(replace(CASE, driven_s=1.0))
    assert our[SPEEDS] == pytest.approx(their[SPEEDS], rel=0.02)


@pytest.mark.nightly
def test_the_prediction_is_what_our_world_says() -> None:
    found = predict(Context(Path()))
    assert found == {robot: SPEC["prediction"][robot] for robot in SPEC["robot"]}


def test_creep_is_what_a_slope_costs_without_fixes() -> None:
    """The reason given for the slow robot: with stiffer rubber most of the difference to MuJoCo is gone."""
    errors = []
    for stiffness in (2e3, 2e4):
        scenario = scenario_of(SPEC, Case("three_wheel", "slope", "circle", 1, 4.0), fixes=False)
        record = run_in_process(scenario.with_world({"slip_stiffness_N_s_m": stiffness})).record
        last = record[on_path(record)][-1]
        errors.append(float(np.hypot(*(last["estimate"] - last["truth"])[:2])))
    assert errors[1] < 0.3 * errors[0]
    assert errors[0] > 2e-3


def test_the_guide_says_what_the_table_says() -> None:
    docs = Path(__file__).parents[2] / "docs"
    table = (docs / "report" / "results.md").read_text(encoding="utf-8")
    shares = {
        name: [round(float(row)) for row in re.findall(rf"\| {name}: cases within 20 % \| % \| ([\d.]+) ", table)]
        for name in (FIXES, END)
    }
    air = [round(float(row)) for row in re.findall(r"\| wheels in the air: cases within 30 % \| % \| ([\d.]+) ", table)]
    guide = " ".join((docs / "guides" / "mujoco.md").read_text(encoding="utf-8").split())
    assert "in {}, {} and {} % of the cases".format(*shares[FIXES]) in guide
    assert f"in {min(shares[END])} to {max(shares[END])} % of the cases" in guide
    assert f"They do in {air[1]} % of the fast robot's cases, and in {air[2]} % of the four-wheel robot's." in guide
    lifted = re.findall(r"^\| four_wheel \| wheels in the air, MuJoCo \| 1 \| ([\d.]+) \|$", table, re.MULTILINE)
    assert f"[{100 * float(lifted[0]):.1f} %]" in guide


def test_a_row_has_the_prediction_beside_what_was_found() -> None:
    pair = (dict.fromkeys(QUANTITIES, 1.0), dict.fromkeys(QUANTITIES, 2.0))
    for robot in SPEC["robot"]:
        for quantity in QUANTITIES:
            ours_, theirs, _ = _rows(SPEC, robot, quantity, [pair])
            assert ours_.explanation.endswith(f": {SPEC['prediction'][robot][quantity]:.3g}")
            assert (ours_.ours, theirs.ours) == (1.0, 2.0)
            assert theirs.quantity == f"{quantity}, MuJoCo"
