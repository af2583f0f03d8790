# SPDX-License-Identifier: MIT
"""The edges of what the tick lets through: counts, supply, set-points; and what it forgets between two drives."""

from __future__ import annotations

import math
from typing import Any

import pytest

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench, silent

BAD = (math.nan, math.inf, -math.inf)
NUMBERS = [("pose", name) for name in ("x", "y", "theta")] + [("twist", name) for name in ("vx", "vy", "wz")]


@pytest.mark.parametrize("kind", ["POSE", "VELOCITY_BODY", "DUTY"])
@pytest.mark.parametrize(("part", "name"), [*NUMBERS, *[("duty", i) for i in range(4)]])
def test_no_part_of_a_set_point_may_be_no_number_used_or_not(kind: str, part: str, name: Any) -> None:
    for bad in BAD:
        bench = Bench()
        bench.arm()
        bench.command(getattr(lib, f"OMNI_SETPOINT_{kind}"))
        values = getattr(bench.inputs.setpoint, part)
        if part == "duty":
            values[name] = bad
        else:
            setattr(values, name, bad)
        out = bench.tick()
        assert out.faults & lib.OMNI_FAULT_NOT_FINITE
        assert silent(out)


@pytest.mark.parametrize("place", [(2.0, 0.0), (0.0, 2.0), (-2.0, -2.0)])
def test_a_pose_on_the_limit_belongs_to_the_world_and_one_beyond_does_not(place: tuple[float, float]) -> None:
    bench = Bench(LIM_POS=2.0)
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(*place, 0.0))
    assert not bench.tick().faults & lib.OMNI_WARN_SETPOINT
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(place[0] * 1.001, place[1] * 1.001, 0.0))
    assert bench.tick().faults & lib.OMNI_WARN_SETPOINT


def test_a_supply_that_is_low_for_a_moment_stops_nothing() -> None:
    bench = Bench()
    bench.arm()
    for _ in range(3):
        bench.inputs.battery_V = 8.0
        assert bench.tick(count=lib.OMNI_BATTERY_TICKS - 1).state == lib.OMNI_STATE_ARMED
        bench.inputs.battery_V = 12.0
        assert bench.tick().state == lib.OMNI_STATE_ARMED
    bench.inputs.battery_V = 8.0
    assert bench.tick(count=lib.OMNI_BATTERY_TICKS).faults & lib.OMNI_FAULT_BATTERY


@pytest.mark.parametrize("way", [1, -1])
def test_four_counts_in_a_tick_are_always_possible_and_at_no_supply_a_fifth_is_not(way: int) -> None:
    for counts, possible in ((4, True), (5, False)):
        bench = Bench(BAT_V_MIN=0.0)
        bench.inputs.battery_V = 1e-4
        bench.tick(count=2)
        bench.angle[1] = (way * counts + 0.5) * math.tau / bench.values[lib.OMNI_PARAM_ENC_CPR]
        warned = bool(bench.tick().faults & lib.OMNI_WARN_ENCODER)
        assert warned != possible, counts


def test_a_wheel_moves_further_while_ticks_are_missed() -> None:
    """At thrice the no-load speed over five tick periods; in a single one that is impossible."""
    for periods in (1, 5):
        bench = Bench()
        bench.tick(count=2)
        no_load_rad_s = bench.outputs.supply_V / lib.omni_motor_speed_gain(ffi.addressof(bench.config, "motor"))
        bench.angle[2] += 2.9 * no_load_rad_s * 5e-3
        bench.time_us += (periods - 1) * 1000
        assert bool(bench.tick().faults & lib.OMNI_WARN_ENCODER) == (periods == 1)


@pytest.mark.parametrize("wheel", range(3))
def test_a_counter_that_is_somewhere_else_owes_nothing_for_the_time_before(wheel: int) -> None:
    """What was guessed while it was away is not taken back from the counts after the jump."""
    bench = Bench()
    bench.arm()
    for _ in range(40):
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.5, 0.5, 0.5, 0.0))
        bench.tick(count=10)
    bench.inputs.counts_valid = 0xF & ~(1 << wheel)
    bench.tick()
    bench.inputs.counts_valid = 0xF
    bench.angle[wheel] += 3.0
    bench.tick()
    before = bench.outputs.pose.theta
    turned = bench.tick().pose.theta - before
    assert turned == pytest.approx(bench.outputs.rate.wz * 1e-3, rel=0.2)


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
def test_every_wheel_filter_that_has_met_no_number_starts_over(robot_name: str) -> None:
    for wheel in range(Bench(robot_name).wheels):
        bench = Bench(robot_name)
        bench.tick(count=5)
        bench.robot.estimator.motor_kf[wheel].x[1] = math.nan
        bench.tick()
        out = bench.tick()
        assert all(math.isfinite(out.wheel_rad_s[i]) for i in range(4)), wheel


def test_a_second_drive_ramps_up_from_rest() -> None:
    bench = Bench(LIM_A=0.5)
    bench.arm()
    for _ in range(20):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0.0, 0.0))
        out = bench.tick(count=20)
    assert out.reference.rate.vx == pytest.approx(0.1)
    bench.tick(lib.OMNI_EVENT_DISARM, count=300)
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0.0, 0.0))
    assert bench.arm().reference.rate.vx == pytest.approx(0.5e-3, rel=1e-3)


def test_a_margin_of_nothing_still_covers() -> None:
    """Condition 44 holds with equality: a robot at rest needs no gain."""
    bench = Bench(ISMC_K_TH=0.0, CTL_MODE=float(lib.OMNI_CTL_MODE_ISMC))
    bench.arm()
    bench.turning = False
    out = bench.tick(count=700)
    assert out.ismc_margin[2] == 0.0
    assert not out.faults & lib.OMNI_WARN_ISMC_GAIN


def test_a_track_that_was_lost_is_forgotten_with_the_stop() -> None:
    bench = Bench(SAFE_ERR_XY=0.05, SAFE_STALL_V=60.0)
    bench.arm()
    bench.turning = False
    for _ in range(400):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(1.0, 0.0, 0.0))
        bench.tick()
    assert bench.outputs.state == lib.OMNI_STATE_FAILSAFE
    assert bench.outputs.fault_history & lib.OMNI_FAULT_TRACKING
    bench.command(lib.OMNI_SETPOINT_NONE)
    bench.tick(lib.OMNI_EVENT_DISARM, count=300)  # its wheels come to rest
    bench.arm()


@pytest.mark.parametrize("mode", [0.0, 1.0, 2.0], ids=["no sensor", "way", "way and turn"])
def test_a_sensor_of_the_floor_that_has_nothing_to_say_hides_no_fault(mode: float) -> None:
    bench = Bench(FLOW_MODE=mode)
    bench.arm()
    bench.tick(count=10)
    bench.inputs.battery_V = math.nan
    assert bench.tick().faults & lib.OMNI_FAULT_NOT_FINITE
    bench.time_us += 1_000_000
    assert bench.tick().faults & lib.OMNI_FAULT_TIME
