# SPDX-License-Identifier: MIT
"""How well the filters of the study can do at best: covariances along a path, without their code.

Independent of the control core on purpose: nothing here is what the filters themselves compute. Poses are rows
x [m], y [m], theta [rad]; ``moves`` are the true displacements per step in the world frame.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def steady_motor_filter(a: Array, believed_q: Array, r: float) -> tuple[Array, Array]:
    """Return gain (2) and predicted covariance (2 x 2) of the motor filter at rest (eq. 53, 55, 56)."""
    p = np.eye(2)
    for _ in range(100_000):
        predicted = a @ p @ a.T + np.diag(believed_q)
        gain = predicted[:, 0] / (predicted[0, 0] + r)
        corrected = predicted - np.outer(gain, predicted[0])
        if np.allclose(corrected, p, rtol=1e-13, atol=0.0):
            break
        p = corrected
    return gain, predicted


def long_run_wheel_variance(a: Array, true_q: Array, believed_q: Array, r: float) -> float:
    """Return the variance [(rad/s)^2] of the white noise that adds up like the motor filter's error.

    The filter's speed error e is correlated in time. A sum of n errors grows in variance like n times this number.
    The error follows e' = Phi e + (I - K C) w - K v with Phi = (I - K C) A. So its spectral density at zero is
    c G S G^T c^T with G = (I - Phi)^-1.
    """
    gain, _ = steady_motor_filter(a, believed_q, r)
    keep = np.eye(2) - np.outer(gain, [1.0, 0.0])
    noise = keep @ np.diag(true_q) @ keep.T + np.outer(gain, gain) * r
    sum_up = np.linalg.inv(np.eye(2) - keep @ a)[0]
    return float(sum_up @ noise @ sum_up)


def pose_variances(moves: Array, q: Array, r: Array, late: bool) -> Array:
    """Return the variances (n, 3) of the best estimate of a pose that moves by known steps plus white noise.

    ``moves`` (n, 3); ``q`` (3) variances per step, ``r`` (3) of a fix. ``late``: the fix is of the step before.
    """
    p = np.zeros((3, 3))
    out = np.empty((len(moves), 3))
    f = np.eye(3)
    for step, (dx, dy, _) in enumerate(moves):
        f[0, 2], f[1, 2] = -dy, dx
        if late:
            p = _corrected(p, np.eye(3), r)
        p = f @ p @ f.T + np.diag(q)
        if not late:
            p = _corrected(p, np.eye(3), r)
        out[step] = np.diag(p)
    return out


def _corrected(p: Array, h: Array, r: Array) -> Array:
    gain = np.linalg.solve(h @ p @ h.T + np.diag(r), h @ p).T
    return p - gain @ h @ p


def joint_variances(
    moves: Array,
    headings: Array,
    to_body: Array,
    motor: tuple[Array, Array, float],
    pose: tuple[Array, Array],
    step_s: float,
    late: bool,
) -> Array:
    """Return the variances (n, 3) of the best estimate of the pose from wheel speeds and fixes together.

    The state is that of all motors and the pose, (w_1, i_1, .., w_n, i_n, x, y, theta): the joint form of eq. 47, which
    knows that the errors of the wheel speeds are correlated in time. ``headings`` (n) at mid-step [rad], ``to_body``
    (3, wheels) from wheel speed [rad/s] to body twist. ``motor`` its A, variances per step and that of a measured
    speed. ``pose`` variances per step (3) and of a fix (3).
    """
    a, motor_q, speed_r = motor
    pose_q, fix_r = pose
    wheels = to_body.shape[1]
    size = 2 * wheels + 3
    advance = np.eye(size)
    advance[: 2 * wheels, : 2 * wheels] = np.kron(np.eye(wheels), a)
    q_motors = np.diag(np.concatenate([np.tile(motor_q, wheels), np.zeros(3)]))
    q_pose = np.diag(np.concatenate([np.zeros(2 * wheels), pose_q]))
    speeds = np.zeros((wheels, size))
    speeds[np.arange(wheels), 2 * np.arange(wheels)] = 1.0
    fixes = np.hstack([np.zeros((3, 2 * wheels)), np.eye(3)])
    speed_r_all = np.full(wheels, speed_r)
    move = np.eye(size)
    p = np.zeros((size, size))
    out = np.empty((len(moves), 3))
    for step, ((dx, dy, _), heading) in enumerate(zip(moves, headings, strict=True)):
        if late:
            p = _corrected(p, fixes, fix_r)
        p = advance @ p @ advance.T + q_motors
        p = _corrected(p, speeds, speed_r_all)
        c, s = np.cos(heading), np.sin(heading)
        turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ to_body * step_s
        turned[:2] += 0.5 * np.outer([-dy, dx], turned[2])  # the heading of mid-step turns with half the step's turn
        move[-3:, : 2 * wheels : 2] = turned
        move[-3, -1], move[-2, -1] = -dy, dx
        p = move @ p @ move.T + q_pose
        if not late:
            p = _corrected(p, fixes, fix_r)
        out[step] = np.diag(p)[-3:]
    return out


def dead_reckoning_covariance(poses: Array, q: Array, points: int) -> Array:
    """Return the covariance (3, points, points) of the errors of x, y, theta by dead reckoning.

    ``poses`` (n, 3) after each step, ``q`` (3) variances per step; ``points`` of the steps are taken. The error of
    theta is a random walk. Those of x and y have their own. They also turn with theta's, about where the robot was
    when it arose: e_x(t) = w_x(t) - sum (y(t) - y(u)) w_theta(u).
    """
    every = max(1, len(poses) // points)
    index = np.arange(every // 2, len(poses), every)
    first = np.minimum.outer(index, index)
    passed = first + 1.0
    out = np.empty((3, len(index), len(index)))
    out[2] = q[2] * passed
    for axis, other in ((0, 1), (1, 0)):
        value = poses[:, other] - poses[0, other]
        then = value[index]
        sums = [np.cumsum(power)[first] for power in (value, value**2)]
        lever = passed * np.outer(then, then) - np.add.outer(then, then) * sums[0] + sums[1]
        out[axis] = q[axis] * passed + q[2] * lever
    return out


def mean_rms(covariance: Array) -> float:
    """Return the expectation of sqrt(mean of e^2) for Gaussian errors e with this covariance (n, n).

    mean e^2 is a weighted sum of chi-squares with the eigenvalues as weights. With its Laplace transform phi,
    E sqrt(X) = 1 / (2 sqrt(pi)) int_0^inf (1 - phi(s)) s^(-3/2) ds, here over s = exp(u).
    """
    weights = np.clip(np.linalg.eigvalsh(covariance / len(covariance)), 0.0, None)
    weights = weights[weights > 1e-9 * weights.sum()]
    scale = weights.sum()
    u = np.linspace(-40.0, 40.0, 801)
    s = np.exp(u) / scale
    log_phi = -0.5 * np.log1p(2.0 * np.outer(s, weights)).sum(axis=1)
    integrand = -np.expm1(log_phi) * np.exp(-0.5 * u)
    return float(np.sqrt(scale) * integrand.sum() * (u[1] - u[0]) / (2.0 * np.sqrt(np.pi)))


def chi_square_band(degrees: float, share: float = 0.95) -> tuple[float, float]:
    """Return the band that holds ``share`` of a chi-square variable (Wilson and Hilferty: for 30 degrees or more)."""
    z = NormalDist().inv_cdf(0.5 + 0.5 * share)
    spread = 2.0 / (9.0 * degrees)
    low, high = (degrees * (1.0 - spread + sign * z * spread**0.5) ** 3 for sign in (-1.0, 1.0))
    return low, high
