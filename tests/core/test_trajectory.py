# SPDX-License-Identifier: MIT
"""Trajectories: exact derivatives, smooth joins, limits kept, rest at the end."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from omniwheel._core import ffi, lib

Array = NDArray[np.float64]

TYPES = {
    name: getattr(lib, f"OMNI_TRJ_TYPE_{name.upper()}")
    for name in ("hold", "waypoints", "line", "circle", "rose", "report", "random", "identify", "spline")
}
ROTATIONS = {name: getattr(lib, f"OMNI_TRJ_ROT_{name.upper()}") for name in ("fixed", "spin", "sine", "tangent")}
WAYPOINTS = [(0.0, 0.0, 0.0), (0.4, 0.1, 1.0), (0.3, -0.5, 3.0), (-0.2, 0.2, -3.0)]


def kinematics() -> Any:
    """Return the three-wheel platform's matrices."""
    config = ffi.new("omni_kinematics_config_t *")
    config.wheels = 3
    for i in range(3):
        config.radius_m[i] = 0.0508
        config.distance_m[i] = 0.2632
        config.angle_rad[i] = 2 * math.pi * i / 3
    k = ffi.new("omni_kinematics_t *")
    assert lib.omni_kinematics_init(k, config) == lib.OMNI_OK
    return k


KINEMATICS = kinematics()
BEARINGS = 2 * np.pi * np.arange(3) / 3
DEFAULTS: dict[str, Any] = {
    "type": "rose",
    "rotation": "sine",
    "petals": 8,
    "size_m": 0.5,
    "period_s": 20.0,
    "laps": 1.0,
    "rotation_amplitude_rad": 0.5,
    "rotation_cycles": 4.0,
    "seed": 7,
    "scale": True,
    "margin": 0.8,
    "ramp_s": 2.0,
    "wheel_limit_rad_s": 3.0,
    "voltage_limit_V": 12.0,
    "ff_speed_V_s": 3.62,
    "ff_acceleration_V_s2": 0.0257,
}


@dataclass
class Plan:
    """A plan and its inputs."""

    options: dict[str, Any]
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    waypoints: list[tuple[float, float, float]] = field(default_factory=lambda: list(WAYPOINTS))
    result: int = 0

    def __post_init__(self) -> None:
        config = ffi.new("omni_trajectory_config_t *")
        values = DEFAULTS | self.options
        values["type"] = TYPES.get(values["type"], values["type"])
        values["rotation"] = ROTATIONS.get(values["rotation"], values["rotation"])
        for name, value in values.items():
            setattr(config, name, value)
        points = ffi.new("omni_waypoints_t *")
        points.count = len(self.waypoints)
        for i, pose in enumerate(self.waypoints[: lib.OMNI_MAX_WAYPOINTS]):
            points.pose[i] = pose
        self.config = values
        self.c = ffi.new("omni_trajectory_t *")
        self.result = lib.omni_trajectory_plan(self.c, config, KINEMATICS, points, ffi.new("omni_pose_t *", self.at))

    def path(self, u: float) -> tuple[Array, Array, Array]:
        """Return pose, first and second derivative at path time u."""
        pose, first, second = ffi.new("omni_pose_t *"), ffi.new("omni_twist_t *"), ffi.new("omni_twist_t *")
        lib.omni_path_evaluate(self.c, u, pose, first, second)
        return (
            np.array([pose.x, pose.y, pose.theta]),
            np.array([first.vx, first.vy, first.wz]),
            np.array([second.vx, second.vy, second.wz]),
        )

    def at_us(self, time_us: int) -> Any:
        """Return the reference."""
        reference = ffi.new("omni_reference_t *")
        lib.omni_trajectory_evaluate(self.c, time_us, reference)
        return reference

    def sample(self, times_us: NDArray[Any]) -> tuple[Array, Array, Array, Array]:
        """Return pose, rate, acceleration (n x 3) and phase at integer times."""
        rows = []
        for t in times_us:
            r = self.at_us(int(t))
            rows.append(
                [
                    r.pose.x,
                    r.pose.y,
                    r.pose.theta,
                    r.rate.vx,
                    r.rate.vy,
                    r.rate.wz,
                    r.acceleration.vx,
                    r.acceleration.vy,
                    r.acceleration.wz,
                    r.phase,
                ]
            )
        table = np.array(rows)
        return table[:, :3], table[:, 3:6], table[:, 6:9], table[:, 9]

    def end_us(self) -> int:
        """Return the first time, to a millisecond, at which the path is done."""
        low, high = 0, 1000
        while self.at_us(high).phase != lib.OMNI_PHASE_DONE:
            low, high = high, 2 * high
        while high - low > 1000:
            middle = (low + high) // 2
            if self.at_us(middle).phase == lib.OMNI_PHASE_DONE:
                high = middle
            else:
                low = middle
        return high


def wheel_motion(poses: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """Return wheel speeds and accelerations from the contact points' velocities, without the core's matrices."""
    speeds, changes = [], []
    for bearing in BEARINGS:
        angle = poses[:, 2] + bearing
        drive = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
        drive_change = -np.stack([np.cos(angle), np.sin(angle)], axis=1) * rates[:, 2:]
        speeds.append((np.sum(drive * rates[:, :2], axis=1) + 0.2632 * rates[:, 2]) / 0.0508)
        changes.append(
            (np.sum(drive * accelerations[:, :2] + drive_change * rates[:, :2], axis=1) + 0.2632 * accelerations[:, 2])
            / 0.0508
        )
    return np.array(speeds), np.array(changes)


def wrap(angle: Array) -> Array:
    """Wrap angles into [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


CASES = [
    *[{"type": "rose", "petals": n, "rotation": r} for n in (1, 2, 3, 4, 5, 6, 8, 12) for r in ("sine", "tangent")],
    {"type": "rose", "petals": 7, "rotation": "spin", "rotation_amplitude_rad": -4.0},
    *[{"type": "circle", "rotation": r} for r in ROTATIONS],
    *[{"type": "line", "rotation": r, "laps": 3.0} for r in ROTATIONS],
    {"type": "hold", "rotation": "spin"},
    {"type": "hold", "rotation": "sine"},
    {"type": "report", "period_s": 60.0},
    {"type": "waypoints", "period_s": 5.0, "laps": 2.0},
    {"type": "random", "period_s": 5.0},
    {"type": "identify", "laps": 2.0, "rotation_amplitude_rad": 2 * math.pi},
    {"type": "identify", "laps": 1.5, "rotation_amplitude_rad": 3.0},
]


@pytest.mark.parametrize("case", CASES, ids=lambda c: "-".join(str(v) for v in c.values()))
def test_path_derivatives_are_exact(case: dict[str, Any]) -> None:
    plan = Plan(case)
    assert plan.result == lib.OMNI_OK
    period = plan.config["period_s"]
    h = period / 400 if case["type"] in ("waypoints", "random") else period / 100 / (2 + plan.config["petals"])
    for u in np.linspace(0.07, 0.93, 23) * plan.c.duration_s:
        u32 = float(np.float32(u))
        if case["type"] in ("waypoints", "random", "line") and abs(u32 / period - round(u32 / period)) < 0.01:
            continue  # the third derivative steps where two legs meet
        if case["type"] == "identify" and abs(4 * u32 / period - round(4 * u32 / period)) < 0.05:
            continue  # and the fourth where a rate begins or ends to change
        # A polynomial through nine points: its own error is far below float32's.
        offsets = np.linspace(-2, 2, 9) * h
        exact_u = np.array([float(np.float32(u32 + d)) for d in offsets])
        poses = np.array([plan.path(v)[0] for v in exact_u])
        poses[:, 2] = poses[4, 2] + wrap(poses[:, 2] - poses[4, 2])
        _, first, second = plan.path(u32)
        speed = np.maximum(np.abs(first).max(), 0.02)
        curve = np.maximum(np.abs(second).max(), 0.02)
        fits = [np.polynomial.Polynomial.fit(exact_u - u32, poses[:, axis], 6) for axis in range(3)]
        rounding = 6e-7 * np.maximum(1.0, np.abs(poses).max(axis=0))
        first_error = np.abs([f.deriv(1)(0.0) for f in fits] - first)
        second_error = np.abs([f.deriv(2)(0.0) for f in fits] - second)
        assert np.all(first_error <= 2e-4 * speed + 2 * rounding / h)
        assert np.all(second_error <= 2e-3 * curve + 6 * rounding / h**2)


@pytest.mark.parametrize("petals", range(1, 13))
def test_rose_has_its_petals_and_closes(petals: int) -> None:
    plan = Plan({"petals": petals, "rotation": "fixed"})
    u = np.linspace(0.0, plan.c.duration_s, 4000, endpoint=False)
    poses = np.array([plan.path(float(v))[0] for v in u])
    radius = np.hypot(poses[:, 0], poses[:, 1])
    peaks = (radius >= np.roll(radius, 1)) & (radius > np.roll(radius, -1)) & (radius > 0.499)
    assert peaks.sum() == petals
    assert radius.max() == pytest.approx(0.5, abs=1e-5)
    start, first, second = plan.path(0.0)
    end, end_first, end_second = plan.path(plan.c.duration_s)
    np.testing.assert_allclose(start, [0.5, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(end, start, atol=1e-6)
    np.testing.assert_allclose(end_first, first, atol=1e-6)
    np.testing.assert_allclose(end_second, second, atol=1e-6)


def test_rose_matches_its_polar_form() -> None:
    plan = Plan({"petals": 8, "rotation": "fixed"})
    for u in np.linspace(0.0, 20.0, 101):
        bearing = 2 * np.pi * float(np.float32(u)) / 20.0
        radius = 0.5 * np.cos(4 * bearing)
        expected = [radius * np.cos(bearing), radius * np.sin(bearing), 0.0]
        np.testing.assert_allclose(plan.path(float(u))[0], expected, atol=2e-6)


@pytest.mark.parametrize("laps", [1.0, 2.0, 3.5])
def test_identify_drives_circles_then_spins_both_ways_and_ends_where_it_began(laps: float) -> None:
    plan = Plan({"type": "identify", "laps": laps, "rotation_amplitude_rad": math.tau, "period_s": 40.0})
    segment = laps * 40.0
    assert plan.c.duration_s == pytest.approx(4 * segment)
    turned = []
    for n in range(4):
        samples = [plan.path(float(u)) for u in n * segment + np.linspace(0.0, segment, 1000)]
        poses, rates = np.array([s[0] for s in samples]), np.array([s[1] for s in samples])
        for end in (0, -1):
            np.testing.assert_allclose(rates[end], 0.0, atol=1e-5)
        bearing = np.unwrap(np.arctan2(poses[:, 1], poses[:, 0]))
        heading = np.unwrap(poses[:, 2])
        np.testing.assert_allclose(np.hypot(poses[:, 0], poses[:, 1]), 0.5, atol=1e-6)
        turned.append((bearing[-1] - bearing[0], heading[-1] - heading[0]))
        rate = np.abs(rates[:, 2]) if n >= 2 else np.hypot(rates[:, 0], rates[:, 1]) / 0.5
        cruise = rate[(np.abs(np.linspace(0.0, segment, 1000) - 0.5 * segment) < 0.5 * segment - 10.5)]
        assert np.ptp(cruise) < 1e-5
        assert cruise[0] == pytest.approx(math.tau * laps / (segment - 10.0), rel=1e-5)
    full = math.tau * laps
    np.testing.assert_allclose(turned, [(full, 0), (-full, 0), (0, full), (0, -full)], atol=1e-4)
    np.testing.assert_allclose(plan.path(4 * segment)[0], plan.path(0.0)[0], atol=1e-6)


def test_identify_without_laps_goes_round_for_ever() -> None:
    plan = Plan({"type": "identify", "laps": 0.0, "period_s": 20.0})
    assert plan.c.duration_s < 0.0
    for u in (3.0, 31.0, 55.0, 75.0):
        for here, there in zip(plan.path(u), plan.path(u + 8000.0), strict=True):
            np.testing.assert_allclose(here, there, atol=1e-3)


def test_report_path_is_equation_81() -> None:
    plan = Plan({"type": "report", "period_s": 600.0})
    for u in np.linspace(0.0, 600.0, 301):
        t = float(np.float32(u))
        turn = 2 * np.pi * t
        expected = 0.5 * np.array(
            [
                np.sin(turn / 12) + np.cos(turn / 14),
                np.sin(turn / 5) + np.cos(turn / 4),
                np.sin(turn / 16) + np.cos(turn / 8),
            ]
        )
        np.testing.assert_allclose(plan.path(t)[0], expected, atol=3e-6)


@pytest.mark.parametrize("petals", [1, 2, 3, 4, 6, 8, 11])
def test_tangent_heading_follows_the_path_without_jumps(petals: int) -> None:
    plan = Plan({"petals": petals, "rotation": "tangent"})
    samples = [plan.path(float(u)) for u in np.linspace(0.0, 19.99, 3000)]
    poses, firsts = np.array([s[0] for s in samples]), np.array([s[1] for s in samples])
    direction = np.arctan2(firsts[:, 1], firsts[:, 0])
    np.testing.assert_allclose(wrap(poses[:, 2] - direction), 0.0, atol=2e-5)
    assert np.abs(np.diff(poses[:, 2])).max() < 0.3


@pytest.mark.parametrize("case", CASES, ids=lambda c: "-".join(str(v) for v in c.values()))
def test_limits_hold_and_motion_is_smooth_from_start_to_rest(case: dict[str, Any]) -> None:
    plan = Plan(case, at=(0.1, -0.2, 0.3))
    end = plan.end_us()
    times = np.unique(np.linspace(0, end + 5000, 6000).astype(np.int64))
    poses, rates, accelerations, phases = plan.sample(times)
    wheels, changes = wheel_motion(poses, rates, accelerations)
    assert np.abs(wheels).max() <= 0.8 * 3.0 * 1.003
    assert np.abs(3.62 * wheels + 0.0257 * changes).max() <= 0.8 * 12.0 * 1.003
    assert np.all(np.diff(phases) >= 0)
    # Position is the integral of rate and rate that of acceleration: no step anywhere, joins included.
    dt = np.diff(times)[:, None] * 1e-6
    for value, slope in ((poses, rates), (rates, accelerations)):
        moved = np.diff(value, axis=0)
        if value is poses:
            moved[:, 2] = wrap(moved[:, 2])
        trapezoid = 0.5 * (slope[1:] + slope[:-1]) * dt
        scale = np.abs(slope).max() * dt.max() + 1e-6
        assert np.abs(moved - trapezoid).max() <= 0.05 * scale
    assert rates[0] == pytest.approx([0, 0, 0], abs=1e-7)
    assert rates[-1] == pytest.approx([0, 0, 0], abs=1e-7)
    assert accelerations[-1] == pytest.approx([0, 0, 0], abs=1e-7)
    last = plan.path(plan.c.duration_s)[0]
    np.testing.assert_allclose(poses[-1], last, atol=2e-4)


@pytest.mark.full
def test_scale_is_no_larger_than_needed() -> None:
    plan = Plan({"period_s": 5.0})
    assert plan.c.scale > 1.5
    assert plan.c.scale == plan.c.needed_scale
    poses, rates, accelerations, _ = plan.sample(np.linspace(0, plan.end_us(), 20000).astype(np.int64))
    wheels, changes = wheel_motion(poses, rates, accelerations)
    volts = 3.62 * wheels + 0.0257 * changes
    assert max(np.abs(wheels).max() / 2.4, np.abs(volts).max() / 9.6) == pytest.approx(1.0, abs=5e-3)


def test_without_scaling_the_demand_is_reported_and_kept() -> None:
    plan = Plan({"period_s": 5.0, "scale": False})
    assert plan.c.scale == 1.0
    assert plan.c.needed_scale > 1.5
    assert plan.c.peak_wheel_rad_s > 3.0
    slow = Plan({"period_s": 200.0})
    assert slow.c.scale == 1.0
    assert 0.0 < slow.c.needed_scale < 1.0


def test_short_ramp_is_paid_for_by_slowing_down() -> None:
    plan = Plan(
        {
            "type": "circle",
            "rotation": "fixed",
            "period_s": 12.0,
            "ramp_s": 0.05,
            "margin": 1.0,
            "wheel_limit_rad_s": 100.0,
            "ff_acceleration_V_s2": 0.3,
        }
    )
    poses, rates, accelerations, _ = plan.sample(np.arange(0, plan.end_us(), 1000))
    wheels, changes = wheel_motion(poses, rates, accelerations)
    assert np.abs(3.62 * wheels + 0.3 * changes).max() <= 12.0 * 1.003


@pytest.mark.parametrize(
    ("at", "limits"),
    [((1.5, 1.0, 0.0), (0.3, 5.0)), ((0.5, 0.0, 2.0), (5.0, 0.4)), ((-0.5, 0.3, -1.0), (0.2, 0.2))],
    ids=["translating", "turning", "both"],
)
def test_a_lead_in_accelerates_as_much_as_it_may(at: tuple[float, float, float], limits: tuple[float, float]) -> None:
    """On quick wheels acceleration is what limits it; without limits it is as short as it was."""
    quick = {"wheel_limit_rad_s": 100.0, "voltage_limit_V": 100.0, "ff_speed_V_s": 0.3, "ff_acceleration_V_s2": 1e-3}
    plan = Plan({**quick, "lead_in_m_s2": limits[0], "lead_in_rad_s2": limits[1]}, at=at)
    _, _, accelerations, phases = plan.sample(np.linspace(0, plan.c.lead_in_s * 1e6 - 1.0, 2000))
    assert np.all(phases == lib.OMNI_PHASE_LEAD_IN)
    shares = np.hypot(accelerations[:, 0], accelerations[:, 1]) / limits[0], np.abs(accelerations[:, 2]) / limits[1]
    assert max(share.max() for share in shares) == pytest.approx(1.0, rel=0.01)
    assert Plan(quick, at=at).c.lead_in_s < 0.7 * plan.c.lead_in_s


def test_lead_in_ends_at_the_start_at_rest() -> None:
    plan = Plan({}, at=(-1.0, 0.7, 2.0))
    lead_us = int(plan.c.lead_in_s * 1e6)
    assert lead_us > 200_000
    before, after = plan.at_us(lead_us - 1), plan.at_us(lead_us + 1)
    assert before.phase == lib.OMNI_PHASE_LEAD_IN
    assert after.phase == lib.OMNI_PHASE_PATH
    for r in (before, after):
        assert (r.pose.x, r.pose.y, r.pose.theta) == pytest.approx((0.5, 0.0, 0.0), abs=2e-6)
        assert (r.rate.vx, r.rate.vy, r.rate.wz) == pytest.approx((0, 0, 0), abs=1e-5)
    assert Plan({}, at=(0.5005, 0.0, 0.0005)).c.lead_in_s == 0.0


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_whole_turns_of_the_robot_are_kept(turns: int) -> None:
    plan = Plan({"rotation": "fixed"}, at=(0.5, 0.0, 2 * math.pi * turns + 0.4))
    assert plan.c.start.theta == pytest.approx(2 * math.pi * turns, abs=1e-5)


def test_hold_stays() -> None:
    plan = Plan({"type": "hold", "rotation": "fixed", "laps": 0.0}, at=(1.0, 2.0, 3.0))
    r = plan.at_us(3_600_000_000)
    assert (r.pose.x, r.pose.y, r.pose.theta) == pytest.approx((1.0, 2.0, 3.0))
    assert r.phase == lib.OMNI_PHASE_PATH


def test_endless_path_is_exact_after_ten_hours() -> None:
    options = {"laps": 0.0, "period_s": 60.0, "rotation": "spin", "rotation_amplitude_rad": 1.0, "scale": False}
    plan = Plan(options, at=(0.5, 0.0, 0.0))
    assert plan.c.duration_s < 0
    lead = int(plan.c.lead_in_s * 1e6)
    hours = 10 * 3600 * 1_000_000
    times = lead + hours + np.arange(0, 2_000_000, 1000)
    poses, rates, _, _ = plan.sample(times)
    assert plan.c.scale == 1.0
    # The clock covers half of its 2 s ramp.
    u = (times - lead - 1_000_000) % 60_000_000 / 60e6
    bearing = 2 * np.pi * u
    expected = 0.5 * np.cos(4 * bearing)[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    np.testing.assert_allclose(poses[:, :2], expected, atol=5e-6)
    steps = np.diff(poses[:, :2], axis=0) - 0.5e-3 * (rates[1:, :2] + rates[:-1, :2])
    assert np.abs(steps).max() < 2e-6
    laps, _, _, _ = plan.sample(lead + 1_000_000 + 60_000_000 * np.array([100, 101]))
    assert wrap(laps[1, 2] - laps[0, 2]) == pytest.approx(1.0, abs=1e-5)


def test_random_points_depend_on_the_seed_alone_and_stay_inside() -> None:
    def points(seed: int) -> Array:
        w = Plan({"type": "random", "seed": seed, "period_s": 5.0}).c.waypoints
        return np.array([[w.pose[i].x, w.pose[i].y, w.pose[i].theta] for i in range(w.count)])

    np.testing.assert_array_equal(points(3), points(3))
    assert np.abs(points(3) - points(4)).max() > 0.1
    everything = np.concatenate([points(seed) for seed in range(60)])
    assert np.abs(everything[:, :2]).max() <= 0.5
    assert np.abs(everything[:, :2].mean(axis=0)).max() < 0.03
    assert everything[:, :2].std(axis=0) == pytest.approx([0.5 / 3**0.5] * 2, rel=0.05)


def test_known_points_of_a_seed_are_the_same_on_every_machine() -> None:
    w = Plan({"type": "random", "seed": 1, "period_s": 5.0, "size_m": 1.0}).c.waypoints
    expected = reference_point(1, 0)
    assert (w.pose[0].x, w.pose[0].y) == expected


def reference_point(seed: int, index: int) -> tuple[float, float]:
    """Return a point computed with Python integers."""

    def mix(h: int) -> int:
        h ^= h >> 16
        h = h * 0x85EBCA6B & 0xFFFFFFFF
        h ^= h >> 13
        h = h * 0xC2B2AE35 & 0xFFFFFFFF
        return h ^ h >> 16

    def uniform(i: int) -> float:
        bits = mix(mix((seed + 0x9E3779B9) & 0xFFFFFFFF) ^ mix(i + 1)) >> 8
        return bits / 2.0**23 - 1.0

    return uniform(3 * index), uniform(3 * index + 1)


def test_waypoints_are_visited_the_short_way_round() -> None:
    plan = Plan({"type": "waypoints", "period_s": 5.0})
    for i, (x, y, theta) in enumerate(WAYPOINTS):
        pose, first, _ = plan.path(5.0 * i)
        assert pose[:2] == pytest.approx([x, y], abs=1e-6)
        assert float(wrap(np.array(pose[2] - theta))) == pytest.approx(0.0, abs=1e-5)
        assert first == pytest.approx([0, 0, 0], abs=1e-6)
    assert plan.c.duration_s == pytest.approx(15.0)
    # From 3.0 to -3.0 rad is 0.28 rad, not 6.
    assert plan.path(15.0)[0][2] - plan.path(10.0)[0][2] == pytest.approx(2 * math.pi - 6.0, abs=1e-5)


@pytest.mark.parametrize(
    ("options", "result"),
    [
        ({"size_m": math.nan}, lib.OMNI_ERR_NOT_FINITE),
        ({"margin": math.inf}, lib.OMNI_ERR_NOT_FINITE),
        ({"type": 9}, lib.OMNI_ERR_RANGE),
        ({"rotation": 9}, lib.OMNI_ERR_RANGE),
        ({"petals": 0}, lib.OMNI_ERR_RANGE),
        ({"petals": 33}, lib.OMNI_ERR_RANGE),
        ({"period_s": 0.0}, lib.OMNI_ERR_RANGE),
        ({"laps": -1.0}, lib.OMNI_ERR_RANGE),
        ({"margin": 0.0}, lib.OMNI_ERR_RANGE),
        ({"ramp_s": -1.0}, lib.OMNI_ERR_RANGE),
        ({"wheel_limit_rad_s": 0.0}, lib.OMNI_ERR_RANGE),
    ],
)
def test_bad_configuration_holds_the_pose(options: dict[str, Any], result: int) -> None:
    plan = Plan(options, at=(1.0, 2.0, 3.0))
    assert plan.result == result
    r = plan.at_us(5_000_000)
    assert (r.pose.x, r.pose.y, r.pose.theta) == pytest.approx((1.0, 2.0, 3.0))
    assert (r.rate.vx, r.rate.vy, r.rate.wz) == (0.0, 0.0, 0.0)


def test_bad_waypoints_and_start_hold() -> None:
    assert Plan({"type": "waypoints"}, waypoints=[(0.0, 0.0, 0.0)]).result == lib.OMNI_ERR_RANGE
    bad = [(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0)]
    assert Plan({"type": "waypoints"}, waypoints=bad).result == lib.OMNI_ERR_NOT_FINITE
    spun = [(0.0, 0.0, 1e12), (0.1, 0.0, 0.0)]
    assert Plan({"type": "waypoints"}, waypoints=spun).result == lib.OMNI_ERR_RANGE
    assert Plan({}, at=(0.0, 0.0, -1e12)).result == lib.OMNI_ERR_RANGE
    nowhere = Plan({}, at=(math.nan, 0.0, 0.0))
    assert nowhere.result == lib.OMNI_ERR_NOT_FINITE
    assert nowhere.at_us(0).pose.x == 0.0


def test_a_path_shorter_than_its_ramps_still_ends_at_rest_in_place() -> None:
    plan = Plan({"period_s": 1.0, "ramp_s": 5.0, "size_m": 0.01}, at=(0.01, 0.0, 0.0))
    end = plan.end_us()
    poses, rates, _, _ = plan.sample(np.arange(0, end + 2000, 500))
    np.testing.assert_allclose(poses[-1], [0.01, 0.0, 0.0], atol=1e-6)
    assert np.abs(rates[-1]).max() < 1e-7
    assert np.abs(np.diff(rates, axis=0)).max() < 0.01
