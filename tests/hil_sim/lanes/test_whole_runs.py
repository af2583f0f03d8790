# SPDX-License-Identifier: MIT
"""Eight whole runs in lanes, world and robot, do bit for bit what each does alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench.figures import flow as flow_figures
from hil_sim import core
from hil_sim.dispersion import Dispersion
from hil_sim.faults import Fault
from hil_sim.patches import FloorPatch
from hil_sim.runs import new_world, run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omniwheel._core import ffi, lib
from tests.hil_sim.batches import assert_the_same_without_lanes

RUNS = 8
MEMBERS = ("world", "robot", "inputs", "outputs", "metrics", "ticks")
SHORT = {"TRJ_SIZE": 0.05, "TRJ_PERIOD": 1.0, "TRJ_PETALS": 2.0, "TRJ_ROT": 0.0, "TRJ_SCALE": 0.0}


class Eight:
    """Eight runs of a scenario that differ by their seeds, armed after half a second."""

    def __init__(self, scenario: Scenario) -> None:
        self.table = scenario.robot.table
        self.values = scenario.parameter_values()
        self.start_pose = scenario.start_pose
        self.runs = ffi.new("hil_run_t[8]")
        self.each = ffi.new("hil_run_t *[8]", [ffi.addressof(self.runs, i) for i in range(RUNS)])
        config = core.robot_config(self.values, self.table, 0)
        why = ffi.new("char[]", 160)
        for number, run in enumerate(self.each):
            world = new_world(scenario.with_seed(100 + number)).c
            assert lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) == lib.HIL_OK

    def advance(self, ticks: int, lanes: bool) -> int:
        """Run ticks; return how many of them in lanes."""
        done = int(lib.hil_lanes_advance(self.each, ticks)) if lanes else 0
        for run in self.each:
            lib.hil_run_advance(run, ticks - done)
        return done

    def place(self) -> None:
        for run in self.each:
            run.inputs.pose.x, run.inputs.pose.y, run.inputs.pose.theta = self.start_pose
            run.inputs.events |= lib.OMNI_EVENT_SET_POSE

    def arm(self) -> None:
        for run in self.each:
            assert lib.hil_run_start_trajectory(run) == lib.OMNI_OK
            run.inputs.events |= lib.OMNI_EVENT_ARM

    def tune(self) -> None:
        """Give every run a gain of its own."""
        for number, run in enumerate(self.each):
            values = {**self.values, "ISMC_LAM_XY": 3.0 + number}
            lib.hil_run_set_config(run, core.robot_config(values, self.table, 1))

    def bytes_of(self, run: Any, member: str) -> bytes:
        """Return a member's memory, without where it points to."""
        if member == "ticks":
            return bytes(ffi.buffer(ffi.addressof(run, "ticks")))
        copy = ffi.new(ffi.typeof(getattr(run, member)).cname + " *", getattr(run, member))
        if member == "inputs":
            copy.trajectory = ffi.NULL
        if member == "robot":
            copy.reference_generator.trajectory = ffi.NULL
            copy.config = ffi.NULL
        return bytes(ffi.buffer(copy))

    def story(self, lanes: bool) -> Iterator[None]:
        """Play what happens to a run, in pieces."""
        self.advance(1, lanes)
        self.place()
        self.advance(499, lanes)
        yield
        self.arm()
        for ticks in (1, 7, 200, 200, 200, 192):
            self.advance(ticks, lanes)
            yield
        self.tune()
        for ticks in (200, 200, 200, 200, 200):
            self.advance(ticks, lanes)
            yield


def assert_the_same(scenario: Scenario) -> Any:
    """Play a scenario both ways; return what the lanes say of themselves."""
    stats = ffi.new("hil_lanes_stats_t *")
    alone, together = Eight(scenario), Eight(scenario)
    lib.hil_lanes_take_stats(stats)
    for _ in zip(alone.story(lanes=False), together.story(lanes=True), strict=True):
        for number in range(RUNS):
            for member in MEMBERS:
                one, other = (eight.bytes_of(eight.each[number], member) for eight in (alone, together))
                assert one == other, f"{member} of run {number} at {alone.runs[0].ticks} ticks"
    assert np.ptp([run.world.pose[0] for run in alone.each]) > 0.0 or scenario.name == "stand"
    lib.hil_lanes_take_stats(stats)
    return stats


def test_on_ice_sensors_that_lead_at_other_times_are_the_same_in_lanes() -> None:
    """The fast robot without fixes; its sensor of motion over the floor is proved when its wheels begin to spin."""
    setting = next(each for each in flow_figures.SETTINGS if each.patches)
    scenario = flow_figures.scenario_of(setting, 100, True)
    alone, together = Eight(scenario), Eight(scenario)
    ticks = 0
    for eight, lanes in ((alone, False), (together, True)):
        eight.advance(1, lanes)
        eight.place()
        eight.advance(2000, lanes)
        eight.arm()
        ticks = sum(eight.advance(500, lanes) for _ in range(9))
    led = [run.robot.estimator.flow.override_count for run in alone.each]
    assert max(led) > min(led) > 0
    assert ticks > 0.9 * 4500
    for number in range(RUNS):
        for member in MEMBERS:
            one, other = (eight.bytes_of(eight.each[number], member) for eight in (alone, together))
            assert one == other, f"{member} of run {number}"


@pytest.fixture(autouse=True)
def _best_level() -> Iterator[None]:
    yield
    lib.hil_lanes_set_level(lib.HIL_LANES_BEST)


@pytest.mark.parametrize(
    "name", ["demo", "four_wheel", "no_slip", "comparison", "hands", "original_law", "fast", "ideal"]
)
def test_runs_in_lanes_are_the_runs_alone(name: str) -> None:
    stats = assert_the_same(load_scenario(name))
    assert stats.lane_ticks > 0.8 * (stats.lane_ticks + stats.scalar_ticks)


def test_bridges_that_chop_do_so_in_lanes_as_alone() -> None:
    """At 0.4 A the demo's robot cannot keep up: some of its runs chop where others do not."""
    scenario = load_scenario("demo").with_parameters(SHORT).with_world({"bridge_trip_A": 0.4})
    plain = load_scenario("demo").with_parameters(SHORT)
    assert_the_same(scenario)
    assert (run_in_process(scenario).record["truth"][-1] != run_in_process(plain).record["truth"][-1]).any()


def test_noise_levels_that_follow_the_innovations_do_so_in_lanes_as_alone() -> None:
    scenario = load_scenario("demo").with_parameters({**SHORT, "EKF_ADAPT": 0.1})
    stats = assert_the_same(scenario)
    assert stats.lane_ticks > 0.8 * (stats.lane_ticks + stats.scalar_ticks)


def test_bridges_that_open_and_a_supply_that_sags_do_so_in_lanes_as_alone() -> None:
    """Bridges open, and the supply is drained, at other times in each run; the robots' own limits act, too."""
    numbers = {
        "bridge_overcurrent_A": 1.2,
        "supply_limit_A": 1.0,
        "winding_thermal_K_W": 5.0,
        "bridge_thermal_K_W": 40.0,
    }
    scenario = load_scenario("demo").with_parameters({**SHORT, "LIM_I": 0.9, "SAFE_I": 0.8})
    assert_the_same(scenario.with_world(numbers))


PATCHES = (FloorPatch((0.0, 0.3), (-0.5, 0.5), 0.3), FloorPatch((0.3, 0.3), (0.2, 0.2), 0.1, radius_m=0.3))


@pytest.mark.parametrize("name", ["demo", "fast"])
def test_worn_wheels_on_patches_behind_gears_with_play_do_the_same_in_lanes(name: str) -> None:
    """Wheels enter patches, and teeth part and meet, at other times in each run."""
    spread = (Dispersion("wheel_friction", -0.3, 0.1, relative=True), Dispersion("wheel_drag", sd=0.3))
    scenario = load_scenario(name).with_parameters(SHORT).with_world({"backlash_rad": 0.01})
    scenario = replace(scenario, dispersion=spread, patches=PATCHES, wheel_numbers={"wheel_friction": (0.5, 1.0, 0.8)})
    stats = assert_the_same(scenario)
    assert stats.lane_ticks > 0.8 * (stats.lane_ticks + stats.scalar_ticks)


@pytest.mark.parametrize("change", [{"patches": PATCHES}, {"world": {"backlash_rad": 0.01}}])
def test_runs_on_another_floor_or_behind_other_gears_are_not_taken_together(change: dict[str, Any]) -> None:
    plain = load_scenario("demo")
    changed = replace(plain, **{**change, "world": {**plain.world, **change.get("world", {})}})
    one, other = Eight(plain), Eight(changed)
    mixed = ffi.new("hil_run_t *[8]", [*list(one.each)[:4], *list(other.each)[4:]])
    assert lib.hil_lanes_advance(mixed, 100) == 0


@pytest.mark.parametrize("level", [lib.HIL_LANES_BASELINE, lib.HIL_LANES_AVX2], ids=["baseline", "avx2"])
def test_any_processor_gives_the_same_bits(level: int) -> None:
    lib.hil_lanes_set_level(level)
    assert assert_the_same(load_scenario("demo")).lane_ticks > 1000


def test_lanes_part_and_meet_again() -> None:
    """Fixes get lost in some runs and not in others; the path begins and ends at different times."""
    scenario = load_scenario("demo").with_parameters(SHORT)
    scenario = replace(scenario, world={**scenario.world, "fix_drop_probability": 0.01}, start_pose=(0.05, 0.0, 0.0))
    stats = assert_the_same(scenario)
    assert stats.divergences > 3
    assert stats.lane_ticks > stats.scalar_ticks


@pytest.mark.parametrize("plant", ["full", "slip", "kinematic", "kinematic+motors", "linear"])
def test_every_plant_runs_in_lanes(plant: str) -> None:
    assert assert_the_same(replace(load_scenario("demo"), plant=plant)).lane_ticks > 800


def test_more_edges_in_a_tick_than_32_bits_hold_are_the_same_in_lanes() -> None:
    scenario = replace(load_scenario("demo"), faults=(Fault("wheel_turned", 0.0, 1.0, wheel=1, value=1e6),))
    alone, together = Eight(scenario), Eight(scenario)
    for eight, lanes in ((alone, False), (together, True)):
        for run in eight.each:
            run.world.config.counts_per_revolution = 2**31 - 1
        eight.advance(50, lanes)
    for one, other in zip(alone.each, together.each, strict=True):
        assert one.world.counts[1] != 0
        assert alone.bytes_of(one, "world") == together.bytes_of(other, "world")


FAULTS = [
    Fault("encoder_noisy", 0.2, 0.6, wheel=1, value=2.0),
    Fault("pose_jump", 0.8, 1.0, value=0.05),
    Fault("pose_freeze", 1.0, 1.2),
    Fault("battery_sag", 1.1, 1.3, value=11.0),
    Fault("i2c_nack", 1.3, 1.302),
    Fault("pose_delay", 1.3, 1.5, value=0.05),
    Fault("tick_late", 1.4, 1.45, value=0.002),
    Fault("chip_power", 1.6, 1.7),
    Fault("motor_dead", 1.7, 2.0, wheel=2),
]


def test_faults_are_the_same_in_lanes() -> None:
    assert_the_same(replace(load_scenario("demo"), faults=tuple(FAULTS)))


def test_runs_that_differ_in_kind_are_refused() -> None:
    three, four = Eight(load_scenario("demo")), Eight(load_scenario("four_wheel"))
    mixed = ffi.new("hil_run_t *[8]", [*list(three.each)[:4], *list(four.each)[4:]])
    assert lib.hil_lanes_advance(mixed, 100) == 0
    assert [run.ticks for run in mixed] == [0] * RUNS
    lib.hil_lanes_set_level(lib.HIL_LANES_NONE)
    assert lib.hil_lanes_advance(three.each, 100) == 0


def test_batches_are_the_same_without_lanes() -> None:
    """Blocks of less than eight, runs that end at different times."""
    scenario = replace(load_scenario("demo").with_parameters(SHORT), start_pose=(0.05, 0.0, 0.0))
    assert_the_same_without_lanes(scenario, 3, 13)
