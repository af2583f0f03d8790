# SPDX-License-Identifier: MIT
"""Runs of robots whose true geometry is known: counts from exact kinematics, poses of a tracked point with noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.identification.pose_fit.wheel_model import WheelModel
from omniwheel.identification.pose_fit.windows import Run, run_of
from omniwheel.logs.log import Truth, WheelLog

Array = NDArray[np.float64]

PERIOD_S = 0.02
COUNTS = 10_000
NOISE = (1e-3, 1e-3, 2e-3)
"""Standard deviation of a measured pose [m, m, rad]."""
THREE = WheelModel(0.05, 0.2, np.radians([300.0, 60.0, 180.0]))
FOUR = WheelModel(0.02, 0.15, np.radians([45.0, 315.0, 135.0, 225.0]))


@dataclass(frozen=True)
class Motion:
    """Amplitudes of speed [m/s] and turn rate [rad/s]; ``one_way``: it turns to the left only."""

    speed: tuple[float, float] = (0.4, 0.3)
    turn: float = 0.8
    one_way: bool = False


def twists(motion: Motion, seed: int, duration_s: float) -> Array:
    """Return body twists (n, 3) that begin and end at rest."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration_s, PERIOD_S)
    phase = random.uniform(0.0, 2.0 * np.pi, 3)
    waves = [np.sin(rate * time + start) for rate, start in zip((0.9, 1.3, 0.55), phase, strict=True)]
    turn = motion.turn * (0.6 + 0.4 * waves[2] if motion.one_way else waves[2])
    ramp = np.minimum(1.0, np.minimum(time, time[-1] - time) / 1.0)[:, None]
    return np.asarray(np.column_stack((motion.speed[0] * waves[0], motion.speed[1] * waves[1], turn)) * ramp)


def true_values(layout: WheelModel, seed: int, direction: float = 0.0, turn: float = 0.0) -> Array:
    """Return parameters (p,) of a robot 1 to 3 % off its drawing, its tracked point 20 to 40 mm off its centre.

    ``turn``: by how much more of its turn it turns where it goes straight.
    """
    random = np.random.default_rng(seed)
    n = layout.wheels
    values = layout.nominal
    values[:n] *= 0.97 + 0.01 * random.uniform(-1.0, 1.0, n)
    values[n] *= 0.98
    values[n + 1 : n + 4] = (0.03, -0.02, 0.01)
    values[-n - 1 : -1] = direction * np.resize((1.0, -1.0), n)
    values[-1] = turn
    return values


def drive(
    layout: WheelModel,
    values: Array,
    seed: int,
    motion: Motion | None = None,
    duration_s: float = 40.0,
    lag: tuple[float, float] = (0.0, 0.0),
) -> WheelLog:
    """Return a log with truth; ``lag`` is the truth clock's offset [s] and rate [s/s], known to be 0 where it is 0.

    The wheels' angles solve the odometry equation with the least rolling: four wheels do not strain.
    """
    random = np.random.default_rng(1000 + seed)
    twist = twists(motion or Motion(), seed, duration_s)
    n = layout.wheels
    matrix = layout.matrix(values)
    forward, backward = matrix[:, :n], matrix[:, n : 2 * n]
    speed, turn = np.hypot(twist[:, 0], twist[:, 1]), layout.distance_m * np.abs(twist[:, 2])
    rolled = twist.copy()
    rolled[:, 2] /= 1.0 + values[-1] * speed / np.maximum(speed + turn, 1e-9)
    angle = np.linalg.pinv(0.5 * (forward + backward)) @ (rolled * PERIOD_S).T
    for _ in range(5):
        used = np.where(angle > 0.0, values[-n - 1 : -1, None], -values[-n - 1 : -1, None])
        plain = 0.5 * (forward + backward)
        angle = np.linalg.pinv(plain) @ (rolled * PERIOD_S).T / (1.0 + used)
    total = np.cumsum(angle.T, axis=0) * COUNTS / (2.0 * np.pi)
    counts = np.diff(np.round(total), axis=0, prepend=np.zeros((1, n)))
    heading = 0.3 + np.cumsum(twist[:, 2]) * PERIOD_S
    middle = heading - 0.5 * twist[:, 2] * PERIOD_S
    chord = np.sinc(0.5 * twist[:, 2] * PERIOD_S / np.pi) * PERIOD_S
    steps = np.column_stack(
        (
            np.cos(middle) * twist[:, 0] - np.sin(middle) * twist[:, 1],
            np.sin(middle) * twist[:, 0] + np.cos(middle) * twist[:, 1],
        )
    )
    pose = np.column_stack((np.cumsum(steps * chord[:, None], axis=0), heading))
    time = PERIOD_S * np.arange(len(twist), dtype=np.float64)
    noisy = pose + random.normal(0.0, NOISE, pose.shape)
    truth_s = time + lag[0] + lag[1] * time
    return WheelLog(
        name=f"run{seed}",
        period_s=PERIOD_S,
        counts_per_revolution=COUNTS,
        time_s=time,
        counts=counts,
        good=np.ones(counts.shape, dtype=bool),
        duty=np.zeros(counts.shape),
        heading_rad=np.full(len(time), np.nan),
        truth=Truth(truth_s, noisy[:, :2], noisy[:, 2], same_clock=lag == (0.0, 0.0)),
    )


def runs(layout: WheelModel, values: Array, motion: Motion | None = None, count: int = 4) -> list[Run]:
    """Return so many runs, each a group of its own."""
    return [run_of(drive(layout, values, seed, motion), f"group {seed}", layout) for seed in range(count)]
