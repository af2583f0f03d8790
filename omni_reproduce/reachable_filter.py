# SPDX-License-Identifier: MIT
"""A pose filter that knows the world's statistics, in NumPy: whether the posterior bound can be reached.

It is an extended Kalman filter on the state of ``posterior_bound``. It is given what a robot has: counts of its
encoders, late fixes, a gyro. It linearises at its own estimate and has no Jacobian in common with the bound. Nothing of
it comes from the control core.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.posterior_bound import (
    STEP_S,
    STEP_TICKS,
    TICK_S,
    Array,
    Layout,
    Schedule,
    Statistics,
    Wheels,
    age_rounding,
    corrected,
    gain_of,
    next_knot,
    noise_of_step,
    take_fix,
    turned_by,
)

_ENCODER, _FIX, _GYRO, _BIAS, _FLOOR = range(5)


@dataclass(frozen=True)
class Readings:
    """What robots on several paths measure: per step, with the path as the first axis.

    ``turned`` (paths, steps, n) angles of the wheels [rad]. ``fixes`` (paths, steps + 1, 3) the pose with a fix's
    noise, whether or not one is taken then. ``turns`` (paths, steps) by the gyro [rad] or None. ``ways`` (paths, steps,
    2) over the floor [m], in body axes of mid-step, or None. ``truth`` (paths, steps + 1, 3) is for the error.
    """

    turned: Array
    fixes: Array
    turns: Array | None
    truth: Array
    ways: Array | None = None


def measure(record: NDArray[Any], wheels: Wheels, statistics: Statistics, counts: int, seed: int) -> Readings:
    """Return readings along a recorded path: angles rounded down to ``counts`` per turn, and noise drawn by ``seed``.

    ``record`` has a row per tick from time 0 on; ``statistics.fix_sd`` has the shape (3,).
    """
    steps = (len(record) - 1) // STEP_TICKS
    truth = record["truth"][: steps * STEP_TICKS + 1 : STEP_TICKS].copy()
    noise = np.random.default_rng([seed, _FIX]).standard_normal((steps + 1, 3))
    turned = _turned(record, wheels.count, counts, steps, seed)
    turns = _gyro_turns(truth[:, 2], statistics, seed)[None] if statistics.has_gyro else None
    ways = _floor_ways(truth, statistics, seed)[None] if statistics.has_flow else None
    return Readings(turned[None], (truth + noise * statistics.fix_sd)[None], turns, truth[None], ways)


def together(readings: Sequence[Readings]) -> Readings:
    """Return several paths' readings as one, as long as the shortest."""
    steps = min(entry.turned.shape[1] for entry in readings)
    turns = [entry.turns[:, :steps] for entry in readings if entry.turns is not None]
    ways = [entry.ways[:, :steps] for entry in readings if entry.ways is not None]
    return Readings(
        np.concatenate([entry.turned[:, :steps] for entry in readings]),
        np.concatenate([entry.fixes[:, : steps + 1] for entry in readings]),
        np.concatenate(turns) if turns else None,
        np.concatenate([entry.truth[:, : steps + 1] for entry in readings]),
        np.concatenate(ways) if ways else None,
    )


def _turned(record: NDArray[Any], wheels: int, counts: int, steps: int, seed: int) -> Array:
    speeds = record["wheel_rad_s"][: steps * STEP_TICKS + 1, :wheels]
    start = np.random.default_rng([seed, _ENCODER]).uniform(size=(1, wheels)) * 2.0 * np.pi / counts
    passed = np.cumsum(0.5 * TICK_S * (speeds[1:] + speeds[:-1]), axis=0)
    angle = np.concatenate([start, start + passed])[::STEP_TICKS]
    per_rad = counts / (2.0 * np.pi)
    return np.asarray(np.diff(np.floor(angle * per_rad) / per_rad, axis=0))


def _gyro_turns(heading: Array, statistics: Statistics, seed: int) -> Array:
    steps = len(heading) - 1
    noise = np.sqrt(statistics.gyro_step_variance) * np.random.default_rng([seed, _GYRO]).standard_normal(steps)
    drawn = np.random.default_rng([seed, _BIAS]).standard_normal(steps + 1)
    walk = np.cumsum(statistics.gyro_bias_walk * np.sqrt(STEP_S) * drawn[1:])
    bias = statistics.gyro_bias_sd * drawn[0] + walk
    return np.asarray(np.diff(heading) + STEP_S * bias + noise)


def _floor_ways(truth: Array, statistics: Statistics, seed: int) -> Array:
    """Return ways in body axes of mid-step with noise, (steps, 2)."""
    moves = np.diff(truth, axis=0)
    noise = np.random.default_rng([seed, _FLOOR]).standard_normal((len(moves), 2))
    seen = turned_by(-(truth[:-1, 2] + 0.5 * moves[:, 2]), moves[..., None])[:, :2, 0]
    return np.asarray(seen + noise * np.sqrt(statistics.flow_step_variances(moves)))


class Filter:
    """The filter on several paths at once. ``state`` (paths, size) and ``p`` (paths, size, size) have their layout."""

    def __init__(self, paths: int, wheels: Wheels, statistics: Statistics) -> None:
        self._wheels, self._statistics = wheels, statistics
        self.schedule = Schedule(statistics)
        self._layout = Layout(wheels.count, statistics, self.schedule.slots)
        self.state = np.zeros((paths, self._layout.size))
        self.state[:, self._layout.before] = self.state[:, self._layout.after] = 0.5 * statistics.slip_max
        self.p = np.tile(np.diag(self._layout.prior(statistics)), (paths, 1, 1))
        self._fresh = noise_of_step(self._layout, statistics)

    def begin_step(self, step: int, fixes: Array) -> None:
        """Take in what happens at the begin of a step; ``fixes`` (paths, steps + 1, 3)."""
        layout, schedule = self._layout, self.schedule
        if schedule.is_knot(step):
            self.p = next_knot(self.p, layout, self._statistics.slip_variance)
            self.state[:, layout.before] = self.state[:, layout.after]
            self.state[:, layout.after] = 0.5 * self._statistics.slip_max
        taken, arriving = schedule.slot_taken(step), schedule.slot_arriving(step)
        if taken is not None:
            self.p = take_fix(self.p, layout.slot(taken))
            self.state[:, layout.slot(taken)] = self.state[:, :3]
        if arriving is not None:
            h = np.zeros((1, 3, layout.size))
            h[0, :, layout.slot(arriving)] = np.eye(3)
            seen = fixes[:, step - schedule.delay] - self.state[:, layout.slot(arriving)]
            self._correct(h, np.square(self._statistics.fix_sd), seen)

    def move(self, step: int, turned: Array, turn: Array | None, way: Array | None = None) -> None:
        """Move by the angles (paths, n) of the wheels in this step.

        ``turn`` (paths,) by the gyro and ``way`` (paths, 2) over the floor correct before.
        """
        if turn is not None:
            _, jacobian, believed = self._motion(step, turned)
            h = jacobian[:, 2:3] - np.eye(self._layout.size)[2]
            h[:, :, self._layout.bias] = STEP_S
            expected = believed[:, 2] + STEP_S * self.state[:, self._layout.bias][:, 0]
            self._correct(h, np.array([self._statistics.gyro_step_variance]), (turn - expected)[:, None])
        if way is not None:
            after, jacobian, believed = self._motion(step, turned)
            h = jacobian[:, :2].copy()
            h[:, :, :3] = 0.0
            seen = turned_by(0.5 * (self.state[:, 2] + after[:, 2]), np.pad(way, ((0, 0), (0, 1)))[..., None])
            self._correct(h, self._statistics.flow_step_variances(believed), seen[:, :2, 0] - believed[:, :2])
        self.state, f, _ = self._motion(step, turned)
        self.p = f @ self.p @ np.swapaxes(f, -1, -2) + self._fresh

    def _correct(self, h: Array, r: Array, innovation: Array) -> None:
        gain = gain_of(self.p, h, r)
        self.state = self.state + (gain @ innovation[..., None])[..., 0]
        self.p = corrected(self.p, h, gain)

    def _motion(self, step: int, turned: Array) -> tuple[Array, Array, Array]:
        """Return the next state, its Jacobian, and the move in the world frame (paths, 3)."""
        layout, wheels, z = self._layout, self._wheels, self.state
        share = (step % self.schedule.knot + 0.5) / self.schedule.knot
        slip = (1.0 - share) * z[:, layout.before] + share * z[:, layout.after]
        rolled = wheels.radius_m * (turned + z[:, layout.rounding_before] - z[:, layout.rounding_after])
        there = rolled * (1.0 - slip)
        body = there @ wheels.to_body.T
        sources = [-rolled * (1.0 - share), -rolled * share]
        if self._statistics.has_constants:
            radius, distance, angle = np.split(z[:, layout.constants], 3, axis=1)
            axle = body[:, :1] * np.cos(wheels.angle_rad) + body[:, 1:2] * np.sin(wheels.angle_rad)
            lever = -body[:, 2:] * wheels.distance_m
            sources += [there, lever, axle]
            body = (there * (1.0 + radius) + lever * distance + axle * angle) @ wheels.to_body.T
        heading = z[:, 2] + 0.5 * body[:, 2]
        world = turned_by(heading, body[..., None])[..., 0]
        following = z.copy()
        following[:, :3] += world
        following[:, layout.rounding_before] = z[:, layout.rounding_after]
        following[:, layout.rounding_after] = 0.0
        f = np.tile(np.eye(layout.size), (len(z), 1, 1))
        f[:, 0, 2], f[:, 1, 2] = -world[:, 1], world[:, 0]
        gains = turned_by(heading, np.tile(wheels.to_body, (len(z), 1, 1)))
        gains[:, 0] -= 0.5 * world[:, 1:2] * gains[:, 2]
        gains[:, 1] += 0.5 * world[:, 0:1] * gains[:, 2]
        per_rad = gains * (wheels.radius_m * (1.0 - slip))[:, None, :]
        f[:, :3, layout.rounding_before], f[:, :3, layout.rounding_after] = per_rad, -per_rad
        for kind, source in enumerate(sources):
            first = 3 + kind * wheels.count
            f[:, :3, first : first + wheels.count] = gains * source[:, None, :]
        return following, age_rounding(f, layout), world


def filter_errors(robot: Filter, readings: Readings) -> Array:
    """Return the squared errors of x, y, theta in each step, (paths, steps, 3): means as those of the bound."""
    paths, steps = readings.turned.shape[:2]
    robot.state[:, :3] = readings.fixes[:, 0]
    out = np.empty((paths, steps, 3))
    for step in range(steps):
        robot.begin_step(step, readings.fixes)
        out[:, step] = 0.5 * (robot.state[:, :3] - readings.truth[:, step]) ** 2
        turn, way = (None if each is None else each[:, step] for each in (readings.turns, readings.ways))
        robot.move(step, readings.turned[:, step], turn, way)
        out[:, step] += 0.5 * (robot.state[:, :3] - readings.truth[:, step + 1]) ** 2
    return out
