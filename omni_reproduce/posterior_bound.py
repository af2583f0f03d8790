# SPDX-License-Identifier: MIT
"""The posterior Cramer-Rao bound of a causal pose estimate in the simulated world, along given true paths.

Tichavsky, Muravchik, Nehorai, "Posterior Cramer-Rao bounds for discrete-time nonlinear filtering", IEEE Transactions on
Signal Processing 46, 1998. With Jacobians along the truth its recursion is that of a Kalman filter's covariance. It is
used in this form, because a noise-free motion has no information form.

Nothing here comes from the control core, and nothing is read from a filter. What is random in the world stands in
``Statistics``; hil_sim's sources say so: slip.c, sensor_pose.c, sensor_gyro.c. The state is

    x, y, theta, slip at the knot before (n), slip at the knot after (n), [constants of the wheels (3 n)], [gyro bias],
    rounding of the wheels' angles at the step's begin (n) and end (n),
    and the pose at the time of each fix that is on its way.

Knots are independent and slip is linear between them, so the state is Markov and its second moments are exact. Slip is
uniform from 0 to its largest value; the recursion takes a normal variable of the same variance. So this is the bound of
filters that know the first two moments of slip, and of all filters where slip is normal. Rounding to counts is
treated likewise, independent from step to step. The creep of the wheels is taken as known: to know more makes the bound
lower, never too high. Arrays of several paths have the path as their first axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import OmniError

Array = NDArray[np.float64]

TICK_S = 1e-3
STEP_TICKS = 10
STEP_S = STEP_TICKS * TICK_S
UNKNOWN_M2 = 1.0
"""Variance of each number of a pose of which nothing is known [m^2, rad^2]."""


@dataclass(frozen=True)
class Wheels:
    """Where ideal wheels stand: radius and distance from the middle [m], bearing [rad], each of shape (n,)."""

    radius_m: Array
    distance_m: Array
    angle_rad: Array

    @property
    def count(self) -> int:
        """Number of wheels."""
        return len(self.radius_m)

    @cached_property
    def to_body(self) -> Array:
        """From what each wheel rolls to the body's motion, in least squares: shape (3, n)."""
        rows = np.stack([-np.sin(self.angle_rad), np.cos(self.angle_rad), self.distance_m], axis=1)
        return np.asarray(np.linalg.pinv(rows))


@dataclass(frozen=True)
class Statistics:
    """What is random in a world, in SI units.

    ``fix_sd`` is that of x, y, theta; shape (3,), or (paths, 3) where it differs. ``wheel_sd`` are the standard
    deviations of each wheel's radius and distance (relative) and bearing [rad]; all 0: as the robot file says.
    ``count_rad`` is the angle of an encoder's count. ``gyro_step_variance`` [rad^2] is that of the turn in STEP_S; 0:
    no gyro. A sensor of motion over the floor has ``flow_rate_Hz`` readings of x and y; 0: none. Their standard
    deviation is ``flow_sd`` [m], and ``flow_share`` of the way that each measures, in squares. ``start_variance`` is
    that of each number of the pose at first [m^2, rad^2]; 0: the robot is told where it stands.
    """

    slip_max: float
    slip_time_s: float
    fix_rate_Hz: float
    fix_sd: Array
    fix_delay_s: float
    count_rad: float = 0.0
    wheel_sd: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyro_step_variance: float = 0.0
    gyro_bias_sd: float = 0.0
    gyro_bias_walk: float = 0.0
    flow_rate_Hz: float = 0.0
    flow_sd: float = 0.0
    flow_share: float = 0.0
    start_variance: float = UNKNOWN_M2

    @property
    def slip_variance(self) -> float:
        """Variance of a uniform slip ratio from 0 to ``slip_max``."""
        return self.slip_max**2 / 12.0

    @property
    def rounding_variance(self) -> float:
        """Variance of an angle's rounding to counts [rad^2]."""
        return self.count_rad**2 / 12.0

    @property
    def has_gyro(self) -> bool:
        """Whether there is a gyro."""
        return self.gyro_step_variance > 0.0

    @property
    def has_flow(self) -> bool:
        """Whether there is a sensor of motion over the floor."""
        return self.flow_rate_Hz > 0.0

    def flow_step_variances(self, moves: Array) -> Array:
        """Return the variances [m^2] of x and y that it measures in a step, (..., 2), for moves (..., 3) in a step.

        As if a reading was divided evenly among its steps: that tells a little more than the reading.
        """
        steps = 1.0 / (self.flow_rate_Hz * STEP_S)
        way2 = np.sum(moves[..., :2] ** 2, axis=-1) * steps**2
        return np.repeat(((self.flow_sd**2 + self.flow_share**2 * way2) / steps)[..., None], 2, axis=-1)

    @property
    def has_constants(self) -> bool:
        """Whether wheels differ from the robot file."""
        return any(self.wheel_sd)


class BoundError(OmniError, ValueError):
    """A world for which the bound is not computed."""

    exit_code = 2


class Schedule:
    """When things happen, in steps of STEP_S.

    Raises BoundError without fixes if the pose is not known at first, and for times between two steps.
    """

    def __init__(self, statistics: Statistics) -> None:
        fixes = statistics.fix_rate_Hz > 0.0
        if not fixes and statistics.start_variance >= UNKNOWN_M2:
            problem = "fix_rate_Hz is 0 and nothing is known of the pose at first: there is no bound"
            raise BoundError(problem, hint="give the world a pose sensor")
        self.knot = _steps("slip_time_s", statistics.slip_time_s)
        self.period = _steps("1 / fix_rate_Hz", 1.0 / statistics.fix_rate_Hz) if fixes else 0
        self.delay = _steps("fix_delay_s", statistics.fix_delay_s)
        self.slots = self.delay // self.period + 1 if fixes else 0

    def slot_taken(self, step: int) -> int | None:
        """Return the slot that a fix taken at this step goes to."""
        return step // self.period % self.slots if self.slots > 0 and step % self.period == 0 else None

    def slot_arriving(self, step: int) -> int | None:
        """Return the slot of the fix that arrives at this step."""
        return self.slot_taken(step - self.delay) if step >= self.delay else None

    def is_knot(self, step: int) -> bool:
        """Return whether the slip's next piece begins here."""
        return step > 0 and step % self.knot == 0


def _steps(name: str, seconds: float) -> int:
    steps = round(seconds / STEP_S)
    if abs(steps * STEP_S - seconds) > 1e-9:
        problem = f"{name} is {seconds:g} s, which is between two steps of the bound"
        raise BoundError(problem, hint=f"choose a multiple of {STEP_S:g} s")
    return steps


class Layout:
    """Where the parts of the state stand."""

    def __init__(self, wheels: int, statistics: Statistics, slots: int) -> None:
        self.before = slice(3, 3 + wheels)
        self.after = slice(self.before.stop, self.before.stop + wheels)
        self.constants = slice(self.after.stop, self.after.stop + (3 * wheels if statistics.has_constants else 0))
        self.bias = slice(self.constants.stop, self.constants.stop + (1 if statistics.has_gyro else 0))
        self.rounding_before = slice(self.bias.stop, self.bias.stop + wheels)
        self.rounding_after = slice(self.rounding_before.stop, self.rounding_before.stop + wheels)
        self.core = self.rounding_after.stop
        self.size = self.core + 3 * slots

    def slot(self, number: int) -> slice:
        """Return the place of a pose that is remembered for its fix."""
        return slice(self.core + 3 * number, self.core + 3 * number + 3)

    def prior(self, statistics: Statistics) -> Array:
        """Return the variances before anything is known, (size,)."""
        out = np.zeros(self.size)
        out[:3] = statistics.start_variance
        out[self.before] = out[self.after] = statistics.slip_variance
        if statistics.has_constants:
            wheels = self.before.stop - self.before.start
            out[self.constants] = np.repeat(np.square(statistics.wheel_sd), wheels)
        out[self.bias] = statistics.gyro_bias_sd**2
        out[self.rounding_before] = out[self.rounding_after] = statistics.rounding_variance
        return out


def motion_gains(record: NDArray[Any], wheels: Wheels, statistics: Statistics) -> tuple[Array, Array]:
    """Return how one path's pose moves per step and how that depends on what is unknown.

    ``record`` has a row per tick from time 0 on. Returns the moves (steps, 3) and the gains (steps, 3, sources). The
    sources are slips, constants of the wheels, and at last the angles that the wheels turn by.
    """
    pose = record["truth"]
    speeds = record["wheel_rad_s"][:, : wheels.count]
    slips = record["slip_ratio"][1:, : wheels.count]
    turned = 0.5 * TICK_S * (speeds[1:] + speeds[:-1])
    rolled = wheels.radius_m * turned
    share = (((np.arange(len(turned)) + 0.5) * TICK_S / statistics.slip_time_s) % 1.0)[:, None]
    sources = [-rolled * (1.0 - share), -rolled * share]
    moved = np.diff(pose, axis=0)
    middle = pose[:-1] + 0.5 * moved
    cosine, sine = np.cos(middle[:, 2]), np.sin(middle[:, 2])
    if statistics.has_constants:
        ahead = cosine * moved[:, 0] + sine * moved[:, 1]
        aside = cosine * moved[:, 1] - sine * moved[:, 0]
        along_axle = np.outer(ahead, np.cos(wheels.angle_rad)) + np.outer(aside, np.sin(wheels.angle_rad))
        sources += [rolled * (1.0 - slips), -np.outer(moved[:, 2], wheels.distance_m), along_axle]
    per_wheel = np.stack(sources, axis=1)  # (ticks, kinds, n)
    body = per_wheel[:, None] * wheels.to_body[None, :, None, :]
    body = body.reshape(len(turned), 3, -1)
    steps = len(turned) // STEP_TICKS
    world = turned_by(middle[:, 2], body)
    ends = np.repeat(pose[STEP_TICKS::STEP_TICKS][:steps], STEP_TICKS, axis=0)
    ticks = steps * STEP_TICKS
    lever = ends[:, :2] - middle[:ticks, :2]
    world = world[:ticks]
    world[:, 0] -= lever[:, 1, None] * world[:, 2]
    world[:, 1] += lever[:, 0, None] * world[:, 2]
    gains = world.reshape(steps, STEP_TICKS, 3, -1).sum(axis=1)
    half = np.arange(steps) * STEP_TICKS + STEP_TICKS // 2
    per_rad = wheels.to_body * (wheels.radius_m * (1.0 - slips[half]))[:, None, :]
    gains = np.concatenate([gains, turned_by(pose[half, 2], per_rad)], axis=2)
    return np.diff(pose[: ticks + 1 : STEP_TICKS], axis=0), gains


def turned_by(heading: Array, body: Array) -> Array:
    """Return columns of body motions (k, 3, n) as the world sees them at headings (k,) [rad]."""
    cosine, sine = np.cos(heading)[:, None], np.sin(heading)[:, None]
    ahead, aside, turn = body[:, 0], body[:, 1], body[:, 2]
    return np.stack([cosine * ahead - sine * aside, sine * ahead + cosine * aside, turn], axis=1)


def transition(moves: Array, gains: Array, layout: Layout) -> Array:
    """Return the Jacobian of one step of several paths, (paths, size, size), for moves (paths, 3) and their gains."""
    out = np.tile(np.eye(layout.size), (len(moves), 1, 1))
    out[:, 0, 2], out[:, 1, 2] = -moves[:, 1], moves[:, 0]
    wheels = layout.before.stop - layout.before.start
    out[:, :3, 3 : layout.constants.stop] = gains[..., :-wheels]
    out[:, :3, layout.rounding_before] = gains[..., -wheels:]
    out[:, :3, layout.rounding_after] = -gains[..., -wheels:]
    return age_rounding(out, layout)


def age_rounding(jacobian: Array, layout: Layout) -> Array:
    """Write into a step's Jacobian that rounding at its end is that at the next one's begin, and return it."""
    wheels = layout.before.stop - layout.before.start
    jacobian[:, layout.rounding_before, layout.rounding_before] = 0.0
    jacobian[:, layout.rounding_before, layout.rounding_after] = np.eye(wheels)
    jacobian[:, layout.rounding_after, layout.rounding_after] = 0.0
    return jacobian


def take_fix(p: Array, place: slice) -> Array:
    """Return the covariance with the pose of now remembered at ``place``."""
    p = p.copy()
    p[:, place, :] = p[:, :3, :]
    p[:, :, place] = p[:, :, :3]
    return p


def next_knot(p: Array, layout: Layout, variance: float) -> Array:
    """Return the covariance after the slip's knot: what was ahead is behind, and a new value is ahead."""
    p = p.copy()
    p[:, layout.before, :] = p[:, layout.after, :]
    p[:, :, layout.before] = p[:, :, layout.after]
    p[:, layout.after, :] = 0.0
    p[:, :, layout.after] = 0.0
    where = np.arange(layout.after.start, layout.after.stop)
    p[:, where, where] = variance
    return p


def gain_of(p: Array, h: Array, r: Array) -> Array:
    """Return the Kalman gain (paths, size, m) for a measurement h (paths or 1, m, size) with variances r (..., m)."""
    noise = np.zeros((len(p), h.shape[-2], h.shape[-2]))
    noise[..., np.arange(h.shape[-2]), np.arange(h.shape[-2])] = r
    ph = p @ np.swapaxes(h, -1, -2)
    return np.asarray(np.swapaxes(np.linalg.solve(h @ ph + noise, np.swapaxes(ph, -1, -2)), -1, -2))


def corrected(p: Array, h: Array, gain: Array) -> Array:
    """Return the covariance after that measurement, kept symmetric."""
    p = p - gain @ (h @ p)
    return np.asarray(0.5 * (p + np.swapaxes(p, -1, -2)))


def noise_of_step(layout: Layout, statistics: Statistics) -> Array:
    """Return the covariance (size, size) of what is new in a step: the bias's walk, and the rounding at its end."""
    out = np.zeros(layout.size)
    out[layout.bias] = statistics.gyro_bias_walk**2 * STEP_S
    out[layout.rounding_after] = statistics.rounding_variance
    return np.diag(out)


def turn_row(step: Array, layout: Layout) -> Array:
    """Return what a gyro's turn in a step says about the state before it, (paths, 1, size), from its Jacobian."""
    row = step[:, 2:3, :].copy()
    row[:, :, 2] = 0.0
    row[:, :, layout.bias] = STEP_S
    return row


def way_rows(step: Array) -> Array:
    """Return what the way in a step says about the state before it, (paths, 2, size), from its Jacobian.

    The way is that in body axes. Its noise is the same in all directions, so the world's axes do.
    """
    rows = step[:, :2, :].copy()
    rows[:, :, :3] = 0.0
    return rows


def bound_variances(moves: Array, gains: Array, wheels: int, statistics: Statistics) -> Array:
    """Return the bound of the variances of x, y, theta in each step, (paths, steps, 3), in m^2 and rad^2.

    ``moves`` (paths, steps, 3) and ``gains`` (paths, steps, 3, sources) come from ``motion_gains``. A step's figure is
    the mean of that at its begin, after what arrives there, and that at its end, before.
    """
    schedule = Schedule(statistics)
    layout = Layout(wheels, statistics, schedule.slots)
    p = np.tile(np.diag(layout.prior(statistics)), (len(moves), 1, 1))
    axes = np.arange(3)
    fix_r = np.square(statistics.fix_sd)
    fresh = noise_of_step(layout, statistics)
    out = np.empty(moves.shape)
    for step in range(moves.shape[1]):
        if schedule.is_knot(step):
            p = next_knot(p, layout, statistics.slip_variance)
        taken, arriving = schedule.slot_taken(step), schedule.slot_arriving(step)
        if taken is not None:
            p = take_fix(p, layout.slot(taken))
        if arriving is not None:
            h = np.zeros((1, 3, layout.size))
            h[0, :, layout.slot(arriving)] = np.eye(3)
            p = corrected(p, h, gain_of(p, h, fix_r))
        out[:, step] = 0.5 * p[:, axes, axes]
        f = transition(moves[:, step], gains[:, step], layout)
        if statistics.has_gyro:
            h = turn_row(f, layout)
            p = corrected(p, h, gain_of(p, h, np.array([statistics.gyro_step_variance])))
        if statistics.has_flow:
            h = way_rows(f)
            p = corrected(p, h, gain_of(p, h, statistics.flow_step_variances(moves[:, step])))
        p = f @ p @ np.swapaxes(f, -1, -2) + fresh
        out[:, step] += 0.5 * p[:, axes, axes]
    return out


def all_at_once(
    moves: Array, gains: Array, wheels: int, statistics: Statistics, steps: NDArray[np.int64], arriving: bool = True
) -> Array:
    """Return the same variances of one path after the given steps, from one set of normal equations; for tests.

    No recursion and no state: the unknowns are the first pose, all knots of slip, the wheels' constants and the gyro's
    bias. Everything that arrived by then is weighted at once. ``moves`` (steps, 3), ``gains`` (steps, 3, sources);
    returns (len(steps), 3). ``arriving``: with the fix that arrives at that very time. The bias must not walk, angles
    are not rounded, and ``start_variance`` is not 0.
    """
    schedule = Schedule(statistics)
    knots = len(moves) // schedule.knot + 2
    constants = 3 * wheels if statistics.has_constants else 0
    size = 3 + knots * wheels + constants + int(statistics.has_gyro)
    prior = np.full(size, statistics.slip_variance)
    prior[:3] = statistics.start_variance
    prior[3 + knots * wheels : size - int(statistics.has_gyro)] = np.repeat(np.square(statistics.wheel_sd), wheels)[
        :constants
    ]
    if statistics.has_gyro:
        prior[-1] = statistics.gyro_bias_sd**2
    pose = np.zeros((len(moves) + 1, 3, size))
    pose[0, :, :3] = np.eye(3)
    turns, ways = np.zeros((len(moves), size)), np.zeros((len(moves), 2, size))
    for step, (move, gain) in enumerate(zip(moves, gains, strict=True)):
        own = np.zeros((3, size))
        at = 3 + step // schedule.knot * wheels
        own[:, at : at + 2 * wheels] = gain[:, : 2 * wheels]
        own[:, 3 + knots * wheels : 3 + knots * wheels + constants] = gain[:, 2 * wheels : -wheels]
        turns[step], ways[step] = own[2], own[:2]
        own[0] -= move[1] * pose[step, 2]
        own[1] += move[0] * pose[step, 2]
        pose[step + 1] = pose[step] + own
    if statistics.has_gyro:
        turns[:, -1] = STEP_S
    out = np.empty((len(steps), 3))
    for row, step in enumerate(steps):
        last = step - schedule.delay + int(arriving) if schedule.slots > 0 else 0
        taken = np.arange(0, last, max(schedule.period, 1))
        seen = pose[taken] / statistics.fix_sd[:, None]
        information = np.diag(1.0 / prior) + np.einsum("kai,kaj->ij", seen, seen)
        if statistics.has_gyro:
            information += turns[:step].T @ turns[:step] / statistics.gyro_step_variance
        if statistics.has_flow:
            weighted = ways[:step] / statistics.flow_step_variances(moves[:step])[..., None]
            information += np.einsum("kai,kaj->ij", ways[:step], weighted)
        out[row] = np.diag(pose[step] @ np.linalg.solve(information, pose[step].T))
    return out
