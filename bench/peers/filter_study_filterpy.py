# SPDX-License-Identifier: MIT
"""The filter study with FilterPy: its KalmanFilter for the motors, its ExtendedKalmanFilter for the pose.

What a Python user would reach for; the robot around the filters is NumPy, step by step. Left out: checks of the inputs,
late fixes, gates, wrapped angles. FilterPy keeps more than asked for (copies of prior and posterior, residuals).
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter

from bench.filter_model import FIX, MEASURED, MOTOR, POSE, Array, FilterModel, FilterRun, rms
from bench.peers.filter_study_numpy import roll, rotation

_IDENTITY = np.eye(3)


def run(model: FilterModel, normals: Array) -> FilterRun:
    """Run ``len(normals)`` steps with these standard normals (steps, NORMALS)."""
    wheels = model.to_wheels.shape[0]
    kf = _motor_filter(model, wheels)
    ekfs = [_pose_filter(model, source) for source in range(2)]
    motor_sd = np.tile(model.motor_sd, wheels)
    motors, open_loop = np.zeros(2 * wheels), np.zeros(2 * wheels)
    truth = model.poses[0].copy()
    rolled = np.tile(truth, (2, 1))
    integral = np.zeros(3)
    truths, estimates = np.empty((len(normals), 3)), np.empty((len(normals), 4, 3))

    for step, normal in enumerate(normals):
        estimate = ekfs[1].x
        error = estimate - model.poses[step]
        surface = error + model.ismc_lambda * integral
        wanted = model.rates[step] - model.ismc_lambda * error - model.ismc_k * np.sign(surface)
        integral += error * model.step_s
        voltage = model.to_wheels @ rotation(estimate[2]).T @ wanted

        open_loop = kf.F @ open_loop + kf.B @ voltage
        motors = kf.F @ motors + kf.B @ voltage + motor_sd * normal[MOTOR]
        measured = motors[::2] + model.measured_sd * normal[MEASURED]
        kf.predict(u=voltage[:, None])
        kf.update(measured[:, None])
        filtered = kf.x[::2, 0]

        before = truth
        truth = truth + roll(model, truth[2], motors[::2] if model.drive_true else filtered)[0]
        truth = truth + model.pose_sd * normal[POSE]
        fix = (before if model.stale else truth) + model.fix_sd * normal[FIX]

        for source, speeds in enumerate((measured if model.raw_measured else open_loop[::2], filtered)):
            rolled[source] += roll(model, rolled[source, 2], speeds)[0]
            ekf = ekfs[source]
            moved, ekf.F = roll(model, ekf.x[2], speeds)
            ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
            ekf.x = ekf.x + moved
            ekf.update(fix, HJacobian=lambda _: _IDENTITY, Hx=lambda x: x)
        truths[step] = truth
        estimates[step] = rolled[0], rolled[1], ekfs[0].x, ekfs[1].x
    return FilterRun(rms(truths, estimates), truths, estimates)


def _motor_filter(model: FilterModel, wheels: int) -> KalmanFilter:
    """Return the joint filter of all motors, at rest."""
    every = np.eye(wheels)
    kf = KalmanFilter(dim_x=2 * wheels, dim_z=wheels, dim_u=wheels)
    kf.F, kf.B = np.kron(every, model.motor_a), np.kron(every, model.motor_b[:, None])
    kf.H = np.kron(every, [[1.0, 0.0]])
    kf.Q, kf.R = np.diag(np.tile(model.kf_q, wheels)), model.measured_sd**2 * every
    return kf


def _pose_filter(model: FilterModel, source: int) -> ExtendedKalmanFilter:
    """Return a filter that knows where it starts."""
    ekf = ExtendedKalmanFilter(dim_x=3, dim_z=3)
    ekf.x, ekf.P = model.poses[0].copy(), np.zeros((3, 3))
    ekf.Q, ekf.R = np.diag(model.ekf_q[source]), np.diag(model.fix_sd**2)
    return ekf
