# SPDX-License-Identifier: MIT
"""A robot of which everything is known, as a foreign log shows it: coarse counts, spikes, foreign clock and frame.

Written from first principles in NumPy: wheel i at bearing a and distance l moves its contact r w = (-sin a, cos a) .
v + l wz.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

T = 0.01
COUNTS = 264
RAD = 2.0 * np.pi / COUNTS
SAMPLE_S = 0.001
RAD_SAMPLE = RAD * SAMPLE_S / T
"""A reading of the analogue angle is rounded to this: one count of a sample is as fast as one of a whole row."""
BEARINGS = np.radians([150.0, 270.0, 30.0])

MAPPING = """
[log]
name = "synthetic"
period_s = 0.01
[log.time]
column = "t"
[wheels]
columns = ["w1", "w2", "w3"]
quantity = "speed"
unit = "rad/s"
counts_per_revolution = 264
[duty]
columns = ["u1", "u2", "u3"]
full_scale = 100.0
[heading]
column = "alpha"
sign = -1
[spikes]
threshold = 4.0
[truth]
time = "time_s"
x = "x_m"
y = "y_m"
"""

ROBOT = """
[robot]
name = "synthetic"
[geometry]
wheels = 3
wheel_radius_m = 0.03
wheel_distance_m = 0.1
wheel_angle_deg = [150.0, 270.0, 30.0]
[encoder]
counts_per_revolution = 264
[wiring]
in1_channel = [0, 2, 4]
in2_channel = [1, 3, 5]
[parameters]
KF_MODE = 0.0
EKF_MODE = 1.0
EKF_Q_XY = 0.01
EKF_Q_TH = 0.02
EKF_R_XY = 0.01
EKF_R_TH = 0.01
"""


@dataclass(frozen=True)
class Known:
    """What the synthetic robot is; radii by direction [m], curves in duty, the truth's clock and frame."""

    forward_m: tuple[float, float, float] = (0.030, 0.033, 0.028)
    reverse_m: tuple[float, float, float] = (0.031, 0.030, 0.027)
    distance_m: float = 0.12
    duty_per_rad_s: tuple[float, float, float] = (0.030, 0.027, 0.033)
    deadband: tuple[float, float, float] = (0.05, 0.08, 0.03)
    lag_s: float = 0.1
    offset_s: float = 1.37
    rotation_rad: float = 0.7
    mirrored: bool = False
    shift: tuple[float, float] = (0.4, -0.2)
    noise_counts: float = 2.0
    reading_rad: float = 0.007
    spike_share: float = 0.02
    wheels: int = field(default=3, init=False)


def duties(seed: int, seconds: float = 16.0) -> Array:
    """Duties (n, 3) of translations in six directions, a turn each way, and rest at both ends."""
    steps = round(seconds / T)
    generator = np.random.default_rng(seed)
    angles = generator.permutation(6) * np.pi / 3.0 + generator.uniform(-0.2, 0.2, 6)
    legs = [np.stack((-np.sin(BEARINGS), np.cos(BEARINGS)), axis=1) @ (np.cos(a), np.sin(a)) * 0.4 for a in angles]
    legs += [np.full(3, 0.25), np.full(3, -0.25)]
    length = (steps - 100) // len(legs)
    moving = np.concatenate([np.tile(leg, (length, 1)) for leg in legs])
    duty = np.zeros((steps, 3))
    duty[50 : 50 + len(moving)] = moving
    return duty


def motion(known: Known, duty: Array) -> tuple[Array, Array]:
    """True wheel speeds (n, 3) and true poses (n, 3) at the end of each period."""
    slope, dead = np.array(known.duty_per_rad_s), np.array(known.deadband)
    wanted = np.sign(duty) * np.maximum(np.abs(duty) - dead, 0.0) / slope
    keep = np.exp(-T / known.lag_s)
    speed = np.zeros_like(duty)
    for k in range(1, len(duty)):
        speed[k] = keep * speed[k - 1] + (1.0 - keep) * wanted[k - 1]
    radius = np.where(speed >= 0.0, known.forward_m, known.reverse_m)
    rows = np.column_stack((-np.sin(BEARINGS), np.cos(BEARINGS), np.full(3, known.distance_m)))
    body = (radius * speed) @ np.linalg.inv(rows).T
    theta = np.cumsum(body[:, 2]) * T
    middle = theta - 0.5 * T * body[:, 2]
    vx = np.cos(middle) * body[:, 0] - np.sin(middle) * body[:, 1]
    vy = np.sin(middle) * body[:, 0] + np.cos(middle) * body[:, 1]
    return speed, np.column_stack((np.cumsum(vx) * T, np.cumsum(vy) * T, theta))


def to_truth_frame(known: Known, xy: Array) -> Array:
    """Points (n, 2) of the robot's frame in the truth's."""
    flipped = xy * (1.0, -1.0) if known.mirrored else xy
    c, s = np.cos(known.rotation_rad), np.sin(known.rotation_rad)
    return np.asarray(flipped @ np.array([[c, s], [-s, c]]) + known.shift)


def counts_of_rows(known: Known, speed: Array, generator: np.random.Generator) -> Array:
    """Counts since the row before of an encoder, and a noise that the next count does not take back."""
    angle = np.cumsum(speed * T, axis=0) / RAD
    counts = np.diff(np.round(angle), axis=0, prepend=0.0)
    return np.asarray(counts + np.round(generator.normal(0.0, known.noise_counts, counts.shape)))


def counts_of_samples(known: Known, speed: Array, generator: np.random.Generator) -> Array:
    """Two readings of an analogue angle at each row, SAMPLE_S apart, each with a noise of its own and rounded."""
    end = np.cumsum(speed * T, axis=0)
    both = np.stack((end - speed * SAMPLE_S, end))
    read = np.round((both + generator.normal(0.0, known.reading_rad, both.shape)) / RAD_SAMPLE)
    return np.asarray(read[1] - read[0])


def write(folder: Path, name: str, known: Known, seed: int, *, sampled: bool = False) -> tuple[Path, Path]:
    """Write NAME.csv and truth_NAME.csv and return their paths; ``sampled``: see :func:`counts_of_samples`."""
    generator = np.random.default_rng(1000 + seed)
    duty = duties(seed)
    speed, pose = motion(known, duty)
    counts = (counts_of_samples if sampled else counts_of_rows)(known, speed, generator)
    spikes = generator.random(counts.shape) < known.spike_share
    counts += np.where(spikes, generator.choice([-60.0, 60.0], counts.shape), 0.0)
    time = T * np.arange(1, len(duty) + 1)
    heading = np.mod(-pose[:, 2] + 6.2, 2.0 * np.pi)
    table = np.column_stack((time, heading, counts * RAD / T, 100.0 * duty))
    log, truth = folder / f"{name}.csv", folder / f"truth_{name}.csv"
    np.savetxt(log, table, delimiter=",", header="t,alpha,w1,w2,w3,u1,u2,u3", comments="", fmt="%.6f")
    xy = to_truth_frame(known, pose[:, :2])
    np.savetxt(
        truth,
        np.column_stack((time + known.offset_s, xy)),
        delimiter=",",
        header="time_s,x_m,y_m",
        comments="",
        fmt="%.7f",
    )
    return log, truth
