# SPDX-License-Identifier: MIT
"""Faults that are switched while the world runs, by lines that somebody else writes."""

from __future__ import annotations

import json
import random
from typing import Any, cast

import pytest

from hil_sim.c_events import TICKS_PER_S
from hil_sim.faults import MAX_FAULTS
from hil_sim.live_faults import ICE, ICE_FRICTION, LIVE_FAULTS
from hil_sim.live_world import SPEEDS, CommandLineError, LiveWorld
from hil_sim.lockstep import LockstepLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from hil_sim.schema import WORLD
from hil_sim.world import World
from omniwheel._core import lib

NOT_OFFERED = {"link_silence", "clock_stuck"}
GYRO_FAULTS = {"gyro_silent", "gyro_stuck", "gyro_offset"}
FLOW_FAULTS = {"flow_silent", "flow_stuck", "flow_jump"}


class Pace:
    """Stands in for the link: takes the speed."""

    def __init__(self) -> None:
        self.factor = 1.0

    def set_realtime_factor(self, factor: float) -> None:
        self.factor = factor


def made(scenario: str = "sitl") -> tuple[LiveWorld, World, Pace]:
    checked, pace = load_scenario(scenario), Pace()
    world = new_world(checked)
    return LiveWorld(checked, cast(LockstepLink, pace), world), world, pace


def apply_command(live: LiveWorld, **command: Any) -> None:
    live.apply_command(json.dumps(command))


def on(live: LiveWorld) -> list[tuple[str, int | None]]:
    return [(one["fault"], one["wheel"]) for one in live.state()["on"]]


def active(world: World, name: str, wheel: int) -> bool:
    world.step()
    return bool(lib.hil_world_fault_active(world.c, WORLD.faults[name].number, wheel))


def test_every_fault_of_the_world_is_offered_or_named_as_left_out() -> None:
    offered = {fault.name for fault in LIVE_FAULTS}
    assert offered == set(WORLD.faults) - NOT_OFFERED | {ICE}
    assert all(fault.words and fault.reaction.endswith(".") for fault in LIVE_FAULTS)


def names(live: LiveWorld) -> set[str]:
    return {fault["name"] for fault in live.catalogue()["faults"]}


def test_a_gyros_faults_are_offered_where_the_robot_has_one() -> None:
    assert names(made("gyro")[0]) >= GYRO_FAULTS
    assert names(made("gyro_no_fixes")[0]) >= GYRO_FAULTS
    assert not names(made("sitl")[0]) & GYRO_FAULTS
    unused = load_scenario("gyro").with_parameters({"GYRO_AXIS": 0.0})
    assert not names(LiveWorld(unused, cast(LockstepLink, Pace()), new_world(unused))) & GYRO_FAULTS


def test_a_floor_motion_sensors_faults_are_offered_where_the_robot_has_one() -> None:
    assert names(made("flow")[0]) >= FLOW_FAULTS
    assert not names(made("gyro")[0]) & FLOW_FAULTS
    unused = load_scenario("flow").with_parameters({"FLOW_MODE": 0.0})
    assert not names(LiveWorld(unused, cast(LockstepLink, Pace()), new_world(unused))) & FLOW_FAULTS


@pytest.mark.parametrize("scenario", ["sitl", "gyro", "flow"])
def test_every_offered_fault_goes_on_and_off(scenario: str) -> None:
    live, world, _ = made(scenario)
    for fault in live.catalogue()["faults"]:
        wheel = {"wheel": fault["wheels"][-1]} if fault["wheels"] else {}
        apply_command(live, fault=fault["name"], on=True, **wheel)
        assert on(live) == [(fault["name"], wheel.get("wheel"))]
        if fault["name"] != ICE:
            assert active(world, fault["name"], wheel.get("wheel", 1) - 1)
        apply_command(live, fault=fault["name"], on=False, **wheel)
        assert on(live) == []
        assert fault["name"] == ICE or not active(world, fault["name"], wheel.get("wheel", 1) - 1)


def test_a_pulled_encoder_counts_no_more_until_it_is_mended() -> None:
    live, world, _ = made()
    apply_command(live, fault="wheel_turned", wheel=2, on=True)
    apply_command(live, fault="encoder_stuck", wheel=2, on=True)
    world.step(10)
    before = world.sense().counts[1]
    world.step(200)
    assert world.sense().counts[1] == before
    apply_command(live, fault="encoder_stuck", wheel=2, on=False)
    world.step(200)
    assert world.sense().counts[1] != before
    assert on(live) == [("wheel_turned", 2)]


def test_a_turn_by_hand_of_a_given_duration_is_one_revolution() -> None:
    live, world, _ = made("stand")
    apply_command(live, fault="wheel_turned", wheel=2, on=True, duration_s=2.0)
    before = world.sense().counts[1]
    world.step(3 * TICKS_PER_S)
    assert on(live) == []
    assert world.sense().counts[1] - before == pytest.approx(10000, rel=0.02)


@pytest.mark.parametrize("change", [{"duration_s": 0.0}, {"duration_s": "2"}, {"duration_s": 2.0, "on": False}])
def test_a_duration_that_is_none_changes_nothing(change: dict[str, Any]) -> None:
    live, _, _ = made()
    with pytest.raises(CommandLineError, match="duration_s"):
        apply_command(live, **{"fault": "wheel_turned", "wheel": 2, "on": True, **change})
    assert on(live) == []


def test_switching_on_twice_replaces_the_value() -> None:
    live, world, _ = made()
    apply_command(live, fault="battery_sag", on=True)
    apply_command(live, fault="battery_sag", on=True, value=6.5)
    world.step(2)
    assert world.sense().battery_V == pytest.approx(6.5, abs=0.01)
    assert on(live) == [("battery_sag", None)]


def test_a_sagging_supply_is_below_the_robots_own_limit() -> None:
    checked = load_scenario("sitl").with_parameters({"BAT_V_MIN": 7.0})
    world = new_world(checked)
    apply_command(LiveWorld(checked, cast(LockstepLink, Pace()), world), fault="battery_sag", on=True)
    world.step(2)
    assert 5.0 < world.sense().battery_V < 7.0


def test_ice_lowers_the_friction_and_mending_brings_it_back() -> None:
    live, world, _ = made()
    grip, limit = world.c.config.friction_coefficient, world.c.plant.inverse_limit_N[0]
    apply_command(live, fault=ICE, on=True)
    assert world.c.config.friction_coefficient == pytest.approx(ICE_FRICTION)
    assert world.c.plant.inverse_limit_N[0] == pytest.approx(limit * grip / ICE_FRICTION)
    apply_command(live, fault=ICE, on=True)
    apply_command(live, mend=True)
    assert world.c.plant.inverse_limit_N[0] == pytest.approx(limit)
    assert on(live) == []


def test_the_scenarios_own_fault_shows_when_it_comes_and_can_be_mended() -> None:
    live, world, _ = made("fault_motor_dead")
    assert on(live) == []
    apply_command(live, mend=True)
    apply_command(live, fault="encoder_stuck", wheel=2, on=True)
    world.step(5 * TICKS_PER_S)
    assert set(on(live)) == {("motor_dead", 1), ("encoder_stuck", 2)}
    apply_command(live, mend=True)
    assert on(live) == []
    assert not active(world, "motor_dead", 0)


def test_what_the_world_cannot_show_is_not_offered() -> None:
    without_fixes = {fault["name"] for fault in made("fast_no_fixes")[0].catalogue()["faults"]}
    assert "pose_loss" not in without_fixes
    assert "encoder_stuck" in without_fixes
    assert ICE not in {fault["name"] for fault in _on_plant("kinematic").catalogue()["faults"]}
    assert made("four_wheel")[0].catalogue()["faults"][0]["wheels"] == [1, 2, 3, 4]


def _on_plant(plant: str) -> LiveWorld:
    checked = load_scenario("sitl").with_plant(plant)
    return LiveWorld(checked, cast(LockstepLink, Pace()), new_world(checked))


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_speed_changes(speed: float) -> None:
    live, _, pace = made()
    apply_command(live, speed=speed)
    assert pace.factor == speed == live.state()["speed"]


BAD = {
    "x": "not JSON",
    "[]": "not a JSON object",
    "null": "not a JSON object",
    "{}": "none of",
    '{"fault": "encoder_stuc", "wheel": 1, "on": true}': "did you mean encoder_stuck",
    '{"fault": "link_silence", "on": true}': "must be one of",
    '{"fault": ["ice"], "on": true}': "must be one of",
    '{"fault": "encoder_stuck", "on": true}': "a wheel from 1 to 3",
    '{"fault": "encoder_stuck", "wheel": 0, "on": true}': "a wheel from 1 to 3",
    '{"fault": "encoder_stuck", "wheel": 4, "on": true}': "a wheel from 1 to 3",
    '{"fault": "encoder_stuck", "wheel": 1.5, "on": true}': "a wheel from 1 to 3",
    '{"fault": "encoder_stuck", "wheel": true, "on": true}': "a wheel from 1 to 3",
    '{"fault": "encoder_stuck", "wheel": {}, "on": true}': "a wheel from 1 to 3",
    '{"fault": "encoder_stuck", "wheel": 1}': "true or false",
    '{"fault": "encoder_stuck", "wheel": 1, "on": 1}': "true or false",
    '{"fault": "encoder_stuck", "wheel": 1, "on": true, "value": 1}': "does not apply",
    '{"fault": "battery_sag", "wheel": 1, "on": true}': "does not apply",
    '{"fault": "battery_sag", "on": true, "value": -1}': "allowed is",
    '{"fault": "battery_sag", "on": true, "value": "8"}': "finite number",
    '{"fault": "battery_sag", "on": true, "value": NaN}': "not finite",
    '{"fault": "battery_sag", "on": true, "value": 1e999}': "not finite",
    '{"fault": "ice", "on": true, "value": 0}': "allowed is",
    '{"fault": "ice", "on": true, "speed": 1}': "more than one",
    '{"fault": "ice", "on": true, "at": 1}': "at",
    '{"speed": 0}': "must be one of",
    '{"speed": -1}': "must be one of",
    '{"speed": true}': "must be one of",
    '{"speed": "1"}': "must be one of",
    '{"speed": []}': "must be one of",
    '{"speed": 1000}': "must be one of",
    '{"mend": false}': "must be true",
    '{"mend": true, "speed": 1}': "more than one",
    "[" * 900: "not JSON",
    " " * 5000 + '{"mend": true}': "longer than",
}


@pytest.mark.parametrize("line", BAD, ids=range(len(BAD)))
def test_a_bad_line_is_refused_in_words_and_changes_nothing(line: str) -> None:
    live, world, pace = made()
    apply_command(live, fault="encoder_stuck", wheel=3, on=True)
    apply_command(live, speed=0.5)
    before, config = live.state(), bytes(_config_of(world))
    with pytest.raises(CommandLineError, match="No fault or speed was changed") as refusal:
        live.apply_command(line)
    assert BAD[line] in str(refusal.value)
    assert len(str(refusal.value)) < 600
    assert (live.state(), bytes(_config_of(world)), pace.factor) == (before, config, 0.5)


def _config_of(world: World) -> Any:
    from omniwheel._core import ffi

    return ffi.buffer(ffi.addressof(world.c, "config"))


def test_random_lines_never_do_anything_but_refuse() -> None:
    live, _, _ = made()
    draw = random.Random(3)
    good = '{"fault": "encoder_stuck", "wheel": 1, "on": true}'
    for _ in range(2000):
        line = bytearray(good.encode())
        for _ in range(draw.randint(1, 4)):
            line[draw.randrange(len(line))] = draw.randrange(256)
        try:
            live.apply_command(line.decode(errors="replace"))
        except CommandLineError:
            continue
    live.apply_command(good)
    assert ("encoder_stuck", 1) in on(live)


def test_too_many_faults_are_refused_and_the_others_stay() -> None:
    live, _, _ = made("four_wheel")
    wanted = [
        {"fault": fault["name"], "wheel": wheel, "on": True}
        for fault in live.catalogue()["faults"]
        for wheel in fault["wheels"]
    ]
    for command in wanted[:MAX_FAULTS]:
        apply_command(live, **command)
    with pytest.raises(CommandLineError, match=f"at most {MAX_FAULTS}"):
        apply_command(live, **wanted[MAX_FAULTS])
    assert len(on(live)) == MAX_FAULTS
