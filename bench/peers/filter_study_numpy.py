# SPDX-License-Identifier: MIT
"""The filter study as a plain script: Python with NumPy matrices, one step after the other.

The joint eight-state motor filter and two EKFs with ``numpy.linalg.inv``, in double precision, as the report's
equations read. Left out: checks of the inputs, late fixes, gates, wrapped angles (the path does not need them).
"""

from __future__ import annotations

import numpy as np

from bench.filter_model import FIX, MEASURED, MOTOR, POSE, Array, FilterModel, FilterRun, rms


def run(model: FilterModel, normals: Array) -> FilterRun:
    """Run ``len(normals)`` steps with these standard normals (steps, NORMALS)."""
    t = model.step_s
    wheels = model.to_wheels.shape[0]
    every = np.eye(wheels)
    a, b, c = np.kron(every, model.motor_a), np.kron(every, model.motor_b[:, None]), np.kron(every, [[1.0, 0.0]])
    motor_q, motor_r = np.diag(np.tile(model.kf_q, wheels)), model.measured_sd**2 * every
    motor_sd = np.tile(model.motor_sd, wheels)
    r = np.diag(model.fix_sd**2)

    motors, open_loop, kf_x = (np.zeros(2 * wheels) for _ in range(3))
    kf_p = np.eye(2 * wheels)
    truth = model.poses[0].copy()
    x = np.tile(truth, (4, 1))
    p = np.zeros((2, 3, 3))
    integral = np.zeros(3)
    truths, estimates = np.empty((len(normals), 3)), np.empty((len(normals), 4, 3))

    for step, normal in enumerate(normals):
        # controller, eq. 39 to 43, on KF + EKF
        error = x[3] - model.poses[step]
        surface = error + model.ismc_lambda * integral
        wanted = model.rates[step] - model.ismc_lambda * error - model.ismc_k * np.sign(surface)
        integral += error * t
        voltage = model.to_wheels @ rotation(x[3, 2]).T @ wanted

        # motors, eq. 45 and 46
        open_loop = a @ open_loop + b @ voltage
        motors = a @ motors + b @ voltage + motor_sd * normal[MOTOR]
        measured = c @ motors + model.measured_sd * normal[MEASURED]

        # motor filter, eq. 52 to 56
        kf_x = a @ kf_x + b @ voltage
        kf_p = a @ kf_p @ a.T + motor_q
        gain = kf_p @ c.T @ np.linalg.inv(c @ kf_p @ c.T + motor_r)
        kf_x = kf_x + gain @ (measured - c @ kf_x)
        kf_p = (np.eye(2 * wheels) - gain @ c) @ kf_p
        filtered = c @ kf_x

        # the true pose and its fix, eq. 57 and 58
        before = truth
        moved, _ = roll(model, truth[2], c @ motors if model.drive_true else filtered)
        truth = truth + moved + model.pose_sd * normal[POSE]
        fix = (before if model.stale else truth) + model.fix_sd * normal[FIX]

        # the four estimates, eq. 59 to 69
        raw = measured if model.raw_measured else c @ open_loop
        for number in range(4):
            moved, f = roll(model, x[number, 2], filtered if number % 2 else raw)
            x[number] += moved
            if number >= 2:
                source = number - 2
                p[source] = f @ p[source] @ f.T + np.diag(model.ekf_q[source])
                k = p[source] @ np.linalg.inv(p[source] + r)
                x[number] += k @ (fix - x[number])
                p[source] = (np.eye(3) - k) @ p[source]
        truths[step], estimates[step] = truth, x
    return FilterRun(rms(truths, estimates), truths, estimates)


def rotation(theta: float) -> Array:
    """Return the matrix from body to world."""
    sine, cosine = np.sin(theta), np.cos(theta)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def roll(model: FilterModel, heading: float, speeds: Array) -> tuple[Array, Array]:
    """Return the displacement (3) over a step with the heading of its middle, and the Jacobian (3, 3)."""
    body = model.to_body @ speeds * model.step_s
    moved = rotation(heading + 0.5 * body[2]) @ body
    return moved, np.array([[1.0, 0.0, -moved[1]], [0.0, 1.0, moved[0]], [0.0, 0.0, 1.0]])
