# SPDX-License-Identifier: MIT
"""WS_FF_BODY: the feed-forward's voltages move wheels and body as the reference wants, by an independent model.

The model solves the body, its wheels and the rolling constraint together, without the core's pseudo-inverse.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench

Array = NDArray[np.float64]
TICK_S = 1e-3
OPEN = {
    "WS_P": 0.0,
    "WS_I": 0.0,
    "CTL_MODE": 2.0,
    "FL_KP_XY": 0.0,
    "FL_KP_TH": 0.0,
    "EKF_MODE": 0.0,
    "LIM_WHEEL": 200.0,
    "BAT_V_NOM": 60.0,
    "LIM_V": 5.0,
    "SAFE_ERR_XY": 100.0,
    "SAFE_ERR_TH": 100.0,
}
"""Nothing but the feed-forward, and no limit in its way."""
PATH = {"TRJ_TYPE": 3.0, "TRJ_SIZE": 0.1, "TRJ_PERIOD": 4.0, "TRJ_LAPS": 0.0, "TRJ_RAMP": 1.0, "TRJ_SCALE": 0.0}
ROBOTS = ["three_wheel", "fast_three_wheel", "four_wheel"]


def rotation(theta: float) -> Array:
    """World to body."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


class Model:
    """A robot of the core's parameters: M a = R^T B^T f, J phi'' = K i - b phi' - r f, V = R i + K phi', rolling."""

    def __init__(self, bench: Bench) -> None:
        value = {name: float(bench.values[getattr(lib, f"OMNI_PARAM_{name}")]) for name in NEEDED}
        self.j, self.b, self.k, self.r = (value[f"MOT_{name}"] for name in "JBKR")
        self.body = np.diag([value["MASS"], value["MASS"], value["INERTIA"]])
        self.radius = value["WHEEL_RADIUS"]
        count = int(value["WHEELS"])
        angles = [math.radians(bench.values[lib.OMNI_PARAM_W1_ANGLE + i]) for i in range(count)]
        self.rows = np.array([[-math.sin(a), math.cos(a), value["WHEEL_DIST"]] for a in angles])

    def acceleration(self, theta: float, twist: Array, speeds: Array, volts: Array) -> Array:
        """Return the body's acceleration over the ground (world) for its world twist, all wheels rolling.

        Volts go to motors that turn at ``speeds`` [rad/s].
        """
        n, turn = len(self.rows), rotation(theta)
        body = turn @ twist
        turning = body[2] * np.array([body[1], -body[0], 0.0])
        torque = self.k * (volts - self.k * speeds) / self.r - self.b * speeds
        # unknowns: a (3, world), f (n), wheel accelerations (n)
        matrix, right = np.zeros((3 + 2 * n, 3 + 2 * n)), np.zeros(3 + 2 * n)
        matrix[:3, :3] = self.body
        matrix[:3, 3 : 3 + n] = -turn.T @ self.rows.T
        matrix[3 : 3 + n, 3 : 3 + n] = self.radius * np.eye(n)
        matrix[3 : 3 + n, 3 + n :] = self.j * np.eye(n)
        right[3 : 3 + n] = torque
        matrix[3 + n :, :3] = -self.rows @ turn
        matrix[3 + n :, 3 + n :] = self.radius * np.eye(n)
        right[3 + n :] = self.rows @ turning
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0][:3])


NEEDED = ("MOT_J", "MOT_B", "MOT_K", "MOT_R", "MASS", "INERTIA", "WHEEL_RADIUS", "WHEEL_DIST", "WHEELS")


def poses_speeds_volts(bench: Bench, ticks: int) -> tuple[Array, Array, Array]:
    """Return the references (ticks, 3), the wheel speeds that were asked for and the volts (ticks, wheels)."""
    poses, speeds, volts = [], [], []
    for _ in range(ticks):
        out = bench.tick()
        poses.append([out.reference.pose.x, out.reference.pose.y, out.reference.pose.theta])
        speeds.append([out.wheel_reference[i] for i in range(bench.wheels)])
        volts.append([out.duty[i] * out.supply_V for i in range(bench.wheels)])
    return np.array(poses), np.array(speeds), np.array(volts)


def on_a_circle(robot: str, body: float, **changes: float) -> tuple[Bench, Array, Array, Array]:
    """Drive a circle on which the heading swings, by the feed-forward alone."""
    bench = Bench(robot, **OPEN, WS_FF_BODY=body, **changes)
    bench.arm()
    bench.follow(**{**PATH, **changes}, TRJ_ROT=2.0, TRJ_ROT_AMP=0.3, TRJ_ROT_N=2.0)
    bench.tick(count=4000)
    return (bench, *poses_speeds_volts(bench, 900))


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("body", [0.0, 1.0])
def test_the_voltages_give_the_acceleration_of_the_path(robot: str, body: float) -> None:
    """Wanted is the second difference of the reference's poses over 20 ms: no formula of the core is in it."""
    bench, poses, speeds, volts = on_a_circle(robot, body)
    model, apart = Model(bench), 20
    assert np.abs(volts).max() < 59.0
    worst = 0.0
    for at in range(apart, len(poses) - apart, 50):
        wanted = (poses[at + apart] - 2.0 * poses[at] + poses[at - apart]) / (apart * TICK_S) ** 2
        twist = (poses[at + apart] - poses[at - apart]) / (2 * apart * TICK_S)
        given = model.acceleration(poses[at][2], twist, speeds[at], volts[at])
        along = float(np.hypot(*wanted[:2]))
        worst = max(worst, float(np.hypot(*(given - wanted)[:2])) / along, abs(given[2] - wanted[2]) / 3.0)
    assert (worst < 0.002) if body else (worst > 0.1), worst


def test_without_it_mass_does_not_matter_and_with_it_it_does() -> None:
    light, heavy, counted = (
        on_a_circle("fast_three_wheel", body, MASS=mass)[3] for body, mass in ((0.0, 1.0), (0.0, 9.0), (1.0, 9.0))
    )
    assert np.array_equal(light, heavy)
    assert not np.array_equal(light, counted)


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_velocity_that_turns_while_it_grows_gets_what_the_ground_needs(robot: str) -> None:
    """The demand is in the body's frame, so the ground feels its change and the turning: v' + w x v."""
    bench = Bench(robot, **OPEN, WS_FF_BODY=1.0, LIM_A=0.5, LIM_W=4.0)
    bench.arm()
    model = Model(bench)
    demand, before = (0.6, -0.3, 2.0), np.zeros(3)
    checked = 0
    for number in range(600):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=demand)
        out = bench.tick()
        speeds = np.array([out.wheel_reference[i] for i in range(bench.wheels)])
        twist = np.linalg.lstsq(model.rows, model.radius * speeds, rcond=None)[0]
        if number > 100 and number % 100 == 0:
            change = (twist - before) / TICK_S
            felt = change + twist[2] * np.array([-twist[1], twist[0], 0.0])
            volts = np.array([out.duty[i] * out.supply_V for i in range(bench.wheels)])
            given = model.acceleration(0.0, twist, speeds, volts)
            np.testing.assert_allclose(given, felt, atol=0.02)
            checked += 1
        before = twist
    assert checked == 4


numbers = st.floats(-3.0, 3.0)


@given(
    st.lists(st.floats(0.02, 0.2), min_size=4, max_size=4),
    st.lists(st.floats(0.05, 0.5), min_size=4, max_size=4),
    st.lists(st.floats(-0.4, 0.4), min_size=4, max_size=4),
    st.sampled_from([3, 4]),
    st.tuples(numbers, numbers, numbers),
)
def test_the_share_of_each_wheel_is_least_norm_and_moves_the_body(
    radii: list[float], distances: list[float], offsets: list[float], wheels: int, felt: Any
) -> None:
    angles = [offset + 2.0 * math.pi * i / wheels for i, offset in enumerate(offsets[:wheels])]
    geometry = ffi.new("omni_kinematics_config_t *", {"wheels": wheels})
    geometry.radius_m, geometry.distance_m, geometry.angle_rad = radii[:wheels], distances[:wheels], angles
    k = ffi.new("omni_kinematics_t *")
    assert lib.omni_kinematics_init(k, geometry) == lib.OMNI_OK
    own, mass, inertia = 0.002, 3.0, 0.05
    load = ffi.new("omni_body_load_t *", {"used": True, "mass_m2": mass / own, "inertia": inertia / own})
    start = [1.0, -2.0, 3.0, 4.0]
    change = ffi.new("float[4]", start)
    lib.omni_kinematics_add_body_inertia(k, load, ffi.new("omni_twist_t *", list(felt)), change)
    rows = np.array([[-math.sin(a), math.cos(a), d] for a, d in zip(angles, distances, strict=False)])
    wrench = np.array([mass, mass, inertia]) * felt
    force = np.linalg.lstsq(rows.T, wrench, rcond=None)[0]
    torque = own * (np.array(list(change)) - start)[:wheels]
    np.testing.assert_allclose(torque, np.array(radii[:wheels]) * force, atol=2e-4, rtol=1e-3)
    assert list(change)[wheels:] == start[wheels:]


def test_a_plan_counts_the_body_once_the_feed_forward_does() -> None:
    """The voltage of the fast robot's path is what the loops then ask for; the path is slowed down by it if need be."""
    for body in (0.0, 1.0):
        bench, _, _, volts = on_a_circle("fast_three_wheel", body, TRJ_PERIOD=1.0)
        assert float(np.abs(volts).max()) == pytest.approx(bench.plan.peak_voltage_V, rel=0.05)
    slowed, plain = (Bench("fast_three_wheel", WS_FF_BODY=body, LIM_WHEEL=200.0) for body in (1.0, 0.0))
    for robot in (slowed, plain):
        robot.arm()
        robot.follow(TRJ_TYPE=3.0, TRJ_SIZE=0.4, TRJ_PERIOD=1.5, TRJ_LAPS=1.0)
    assert slowed.plan.scale > plain.plan.scale > 1.0


def test_a_plan_with_a_body_that_is_no_number_is_refused() -> None:
    bench = Bench("fast_three_wheel", WS_FF_BODY=1.0)
    at = ffi.new("omni_pose_t *")
    plan = ffi.new("omni_trajectory_t *")
    for bad, result in ((math.nan, lib.OMNI_ERR_NOT_FINITE), (-1.0, lib.OMNI_ERR_RANGE)):
        for field in ("mass_m2", "inertia"):
            config = ffi.new("omni_trajectory_config_t *", bench.config.trajectory)
            setattr(config.body_load, field, bad)
            kinematics = ffi.addressof(bench.config, "kinematics")
            assert lib.omni_trajectory_plan(plan, config, kinematics, ffi.NULL, at) == result
