# SPDX-License-Identifier: MIT
"""The filter study over many runs at once: every number is a NumPy array with one entry per run.

What a careful NumPy user would write: no loop over runs, and one covariance for all motors of all runs. It does not
depend on the data. Ours computes it for each. Left out: checks of the inputs, late fixes, gates, wrapped angles.
"""

from __future__ import annotations

import numpy as np

from bench.filter_model import FIX, MEASURED, MOTOR, NORMALS, POSE, Array, FilterModel, FilterRun


def run(model: FilterModel, runs: int, steps: int, seed: int) -> FilterRun:
    """Return the RMS errors (4, 3) over all runs and steps; noise from NumPy's generator."""
    random = np.random.default_rng(seed)
    wheels = model.to_wheels.shape[0]
    a, b = model.motor_a, model.motor_b
    c = np.array([1.0, 0.0])
    r = np.diag(model.fix_sd**2)
    motors, open_loop, kf_x = (np.zeros((runs, wheels, 2)) for _ in range(3))
    kf_p = np.eye(2)
    truth = np.tile(model.poses[0], (runs, 1))
    x = np.tile(model.poses[0], (4, runs, 1))
    p = np.zeros((2, runs, 3, 3))
    integral = np.zeros((runs, 3))
    square = np.zeros((4, 3))

    for step in range(steps):
        normal = random.standard_normal((runs, NORMALS))
        error = x[3] - model.poses[step]
        surface = error + model.ismc_lambda * integral
        wanted = model.rates[step] - model.ismc_lambda * error - model.ismc_k * np.sign(surface)
        integral += error * model.step_s
        voltage = turned(wanted, -x[3, :, 2]) @ model.to_wheels.T

        open_loop = open_loop @ a.T + voltage[..., None] * b
        motors = motors @ a.T + voltage[..., None] * b
        motors += model.motor_sd * normal[:, MOTOR].reshape(runs, wheels, 2)
        measured = motors[..., 0] + model.measured_sd * normal[:, MEASURED]

        kf_x = kf_x @ a.T + voltage[..., None] * b
        kf_p = a @ kf_p @ a.T + np.diag(model.kf_q)
        gain = kf_p[:, 0] / (kf_p[0, 0] + model.measured_sd**2)
        kf_x += (measured - kf_x[..., 0])[..., None] * gain
        kf_p = (np.eye(2) - np.outer(gain, c)) @ kf_p
        filtered = kf_x[..., 0]

        before = truth
        truth = truth + roll(model, truth[:, 2], motors[..., 0] if model.drive_true else filtered)
        truth += model.pose_sd * normal[:, POSE]
        fix = (before if model.stale else truth) + model.fix_sd * normal[:, FIX]

        raw = measured if model.raw_measured else open_loop[..., 0]
        for number in range(4):
            moved = roll(model, x[number, :, 2], filtered if number % 2 else raw)
            x[number] += moved
            if number >= 2:
                x[number], p[number - 2] = corrected(x[number], p[number - 2], moved, model.ekf_q[number - 2], r, fix)
        square += ((x - truth) ** 2).sum(axis=1)
    return FilterRun(np.sqrt(square / (runs * steps)))


def turned(vectors: Array, angle: Array) -> Array:
    """Return vectors (runs, 3) turned by angles (runs) about z."""
    sine, cosine = np.sin(angle), np.cos(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, vectors[:, 2]], axis=1)


def roll(model: FilterModel, heading: Array, speeds: Array) -> Array:
    """Return the displacements (runs, 3) over a step with the heading of its middle."""
    body = speeds @ model.to_body.T * model.step_s
    return turned(body, heading + 0.5 * body[:, 2])


def corrected(x: Array, p: Array, moved: Array, q: Array, r: Array, fix: Array) -> tuple[Array, Array]:
    """Return state (runs, 3) and covariance (runs, 3, 3) after a move and a fix, eq. 59 to 69."""
    f = np.tile(np.eye(3), (len(x), 1, 1))
    f[:, 0, 2], f[:, 1, 2] = -moved[:, 1], moved[:, 0]
    p = f @ p @ f.transpose(0, 2, 1) + np.diag(q)
    gain = p @ np.linalg.inv(p + r)
    return x + (gain @ (fix - x)[..., None])[..., 0], p - gain @ p
