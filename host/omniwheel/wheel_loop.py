# SPDX-License-Identifier: MIT
"""A wheel's speed loop as the robot computes it, tick by tick: motor, Kalman filter and PI controller.

The loop is cut where the voltage reaches the motor. The filter goes on seeing the voltage that was commanded, as on the
robot. So the margins say what the loop bears of a motor that is stronger or slower than the model::

    x(k+1) = A x(k) + B u(k),  y = angle              the motor, u held for a tick
    z(k)   = (I - L C)(Am z(k-1) + Bm v(k-1)) + L y(k)  the filter with its steady gain L, model Am, Bm
    v(k)   = -P w(k) - I T (w(0) + ... + w(k)),  w = z[1]

Units: rad/s, V, s. The voltage of a tick acts from its own beginning to the next one's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from omniwheel.identification.estimate import require_scipy

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TICK_S = 1e-3
LOWEST_HZ, POINTS = 0.05, 600
QUANTISATION = 1.0 / math.sqrt(12.0)
"""Standard deviation of a rounded angle [counts]."""
PARAMETERS = ("MOT_J", "MOT_B", "MOT_K", "MOT_R", "MOT_L", "ENC_CPR", "KF_J", "KF_Q_W", "KF_Q_I", "KF_R_CNT")
ANGLE_FILTER = 2


@dataclass(frozen=True)
class Motor:
    """Motor and gear as seen at the wheel, as in the core's motor.h. ``inertia`` [kg m^2] is all that a wheel moves."""

    inertia: float
    viscous: float
    constant: float
    resistance: float
    inductance: float

    def discrete(self) -> tuple[Array, Array]:
        """Return A (3, 3), B (3,) of state (angle, speed, current) over one tick."""
        linalg = require_scipy("linalg")
        j, b, k = self.inertia, self.viscous, self.constant
        r, inductance = self.resistance, self.inductance
        system = np.zeros((4, 4))
        system[0, 1] = 1.0
        system[1, 1:3] = -b / j, k / j
        system[2, 1:] = -k / inductance, -r / inductance, 1.0 / inductance
        both = linalg.expm(system * TICK_S)
        return both[:3, :3], both[:3, 3]

    @property
    def speed_gain(self) -> float:
        """Volts per rad/s in steady state."""
        return self.constant + self.resistance * self.viscous / self.constant

    @property
    def time_constant_s(self) -> float:
        """How long the motor takes to 63 % of a new speed."""
        return self.resistance * self.inertia / self.constant / self.speed_gain


@dataclass(frozen=True)
class Filter:
    """The robot's filter of a wheel: the motor that it believes in, and its noise levels per tick."""

    model: Motor
    count_rad: float
    speed_variance: float
    current_variance: float
    count_sd: float

    def gain(self) -> Array:
        """Return the steady Kalman gain (3,)."""
        linalg = require_scipy("linalg")
        a, _ = self.model.discrete()
        noise = (self.count_sd * self.count_rad) ** 2
        spread = np.diag([1e-18, self.speed_variance, self.current_variance])
        row = np.array([[1.0, 0.0, 0.0]])
        # In counts, so that the equation is well scaled.
        scale = np.diag([1.0 / self.count_rad, 1.0, 1.0])
        back = np.diag([self.count_rad, 1.0, 1.0])
        before = linalg.solve_discrete_are(
            (scale @ a @ back).T,
            row.T,
            scale @ spread @ scale,
            np.array([[noise / self.count_rad**2]]),
        )
        before = back @ before @ back
        return np.asarray(before[:, 0] / (before[0, 0] + noise), dtype=np.float64)


@dataclass(frozen=True)
class Margins:
    """What a loop bears: ``gain`` (factor up), ``phase_rad``, and ``distance``: how near it comes to -1 (1: far)."""

    gain: float
    phase_rad: float
    distance: float

    @property
    def stable(self) -> bool:
        """Whether the loop is stable at all."""
        return self.distance > 0.0


class WheelLoop:
    """A motor behind a filter that may believe in another one; margins and noise of any gains."""

    def __init__(self, motor: Motor, kalman: Filter, frequency_hz: Array | None = None) -> None:
        self.motor, self.filter = motor, kalman
        spread = np.geomspace(LOWEST_HZ, 0.499 / TICK_S, POINTS)
        self.frequency_hz = spread if frequency_hz is None else frequency_hz
        self._z = np.exp(2j * np.pi * self.frequency_hz * TICK_S)
        a, b = motor.discrete()
        self._motor = (a, b)
        model, volts = kalman.model.discrete()
        gain = kalman.gain()
        keep = np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])
        self._filter = (keep @ model, keep @ volts, gain)
        eye = np.eye(3)
        answer = _response(self._z, a, b)
        self._angle, self._speed = answer[:, 0], answer[:, 1]
        inside = self._z[:, None, None] * eye - keep @ model
        # z(k) = F z(k-1) + G v(k-1) + L y(k): from v and from y to the speed at the same tick.
        column = (len(self._z), 3, 1)
        self._from_volts = np.linalg.solve(inside, np.broadcast_to((keep @ volts)[:, None], column))[:, 1, 0]
        self._from_angle = self._z * np.linalg.solve(inside, np.broadcast_to(gain[:, None], column))[:, 1, 0]

    def _controller(self, proportional: float, integral: float) -> Complex:
        return np.asarray(proportional + integral * TICK_S * self._z / (self._z - 1.0), dtype=np.complex128)

    def feedback(self, proportional: float, integral: float) -> Complex:
        """Return the volts that filter and controller answer per rad of the wheel's angle, sign turned."""
        pi = self._controller(proportional, integral)
        return np.asarray(pi * self._from_angle / (1.0 + pi * self._from_volts), dtype=np.complex128)

    def open(self, proportional: float, integral: float) -> Complex:
        """Return the open loop."""
        return np.asarray(self.feedback(proportional, integral) * self._angle, dtype=np.complex128)

    def margins(self, proportional: float, integral: float) -> Margins:
        """Return the margins of gains [V s/rad], [V/rad]; all 0 if the closed loop is unstable."""
        if self.growth(proportional, integral) >= 1.0:
            return Margins(0.0, 0.0, 0.0)
        return margins(self.open(proportional, integral))

    def growth(self, proportional: float, integral: float) -> float:
        """Return the factor by which the slowest mode changes per tick: below 1 the loop is stable."""
        (a, b), (model, volts, gain) = self._motor, self._filter
        # State: motor (3), filter of the last tick (3), the integral, the last voltage.
        step = integral * TICK_S
        speed = np.concatenate((gain[1] * np.array([1.0, 0.0, 0.0]), model[1], [0.0, volts[1]]))
        out = -(proportional + step) * speed
        out[6] -= 1.0
        whole = np.zeros((8, 8))
        whole[:3, :3] = a
        whole[:3] += np.outer(b, out)
        whole[3:6, :3] = np.outer(gain, [1.0, 0.0, 0.0])
        whole[3:6, 3:6] = model
        whole[3:6, 7] = volts
        whole[6] = step * speed
        whole[6, 6] += 1.0
        whole[7] = out
        return _slowest_of_interest(whole)

    def closed(self, proportional: float, integral: float, feed_forward: float = 0.0) -> Complex:
        """Return the wheel's speed per wanted speed; ``feed_forward`` [V s/rad] goes past the controller."""
        pi, angle = self._controller(proportional, integral), self._angle
        own = 1.0 + pi * self._from_volts
        return np.asarray(
            self._speed * (pi + feed_forward) / (own + pi * self._from_angle * angle), dtype=np.complex128
        )

    def counted(self, proportional: float, integral: float, feed_forward: float = 0.0) -> Complex:
        """Return the same as an encoder shows it: the mean speed over the tick that begins with the wanted one."""
        whole = self.closed(proportional, integral, feed_forward)
        return np.asarray(whole / self._speed * self.counted_per_volt, dtype=np.complex128)

    def estimated(self, proportional: float, integral: float, feed_forward: float = 0.0) -> Complex:
        """Return the same as the wheel filter estimates it: what the robot itself believes."""
        seen = self._from_volts + self._from_angle * self._angle
        return np.asarray(seen * self.volts(proportional, integral, feed_forward), dtype=np.complex128)

    def volts(self, proportional: float, integral: float, feed_forward: float = 0.0) -> Complex:
        """Return the voltage per wanted speed [V s/rad]. Near the loop's own frequency it is largest."""
        pi, seen = self._controller(proportional, integral), self._from_volts + self._from_angle * self._angle
        return np.asarray((pi + feed_forward) / (1.0 + pi * seen), dtype=np.complex128)

    @property
    def counted_per_volt(self) -> Complex:
        """The motor alone: mean speed over a tick per volt that acts from its beginning on."""
        return np.asarray(self._angle * self.difference, dtype=np.complex128)

    @property
    def difference(self) -> Complex:
        """What makes a mean speed over the next tick of an angle."""
        return np.asarray((self._z - 1.0) / TICK_S, dtype=np.complex128)

    def bandwidth_hz(self, proportional: float, integral: float) -> float:
        """Return up to which frequency errors of the wheel are made smaller: where the open loop falls below 1."""
        size = np.abs(self.open(proportional, integral))
        above = np.flatnonzero(size >= 1.0)
        return float(self.frequency_hz[above[-1]]) if len(above) else 0.0

    def compliance(self, proportional: float, integral: float, low_hz: float, high_hz: float) -> float:
        """Return the wheel's speed per disturbing volt [rad/s/V]: RMS over the frequencies between two."""
        among = (self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz)
        moved = self._speed[among] / (1.0 + self.open(proportional, integral)[among])
        return float(np.sqrt(np.mean(np.abs(moved) ** 2)))

    def noise_V(self, proportional: float, integral: float) -> float:
        """Return the standard deviation of the voltage that the encoder's rounding alone makes [V]."""
        feedback = self.feedback(proportional, integral)
        per_angle = np.abs(feedback / (1.0 + feedback * self._angle)) ** 2
        # White noise of variance s^2 per tick has the one-sided density 2 T s^2.
        steps = np.diff(self.frequency_hz)
        power = np.sum(0.5 * steps * (per_angle[:-1] + per_angle[1:]))
        return QUANTISATION * self.filter.count_rad * math.sqrt(2.0 * TICK_S * float(power))


def _response(z: Complex, a: Array, b: Array) -> Complex:
    inside = z[:, None, None] * np.eye(3) - a
    found = np.linalg.solve(inside, np.broadcast_to(b[:, None], (len(z), 3, 1)))[:, :, 0]
    return np.asarray(found, dtype=np.complex128)


def _slowest_of_interest(whole: Array) -> float:
    """Return the largest |eigenvalue|, without the one at 1 that the angle itself is: nothing asks where a wheel is."""
    sizes = np.linalg.eigvals(whole)
    at_one = int(np.argmin(np.abs(sizes - 1.0)))
    return float(np.max(np.abs(np.delete(sizes, at_one))))


def turns_around(loop: Complex) -> bool:
    """Whether an open loop, stable but for integrators, goes around -1 as frequencies rise: unstable when closed.

    Nyquist's criterion: left of -1 it crosses the real axis as often upwards as downwards, or else it goes around.
    """
    left = np.real(loop[:-1]) < 0.0
    far = left & (np.real(loop[1:]) < 0.0) & (np.abs(loop[:-1]) > 1.0)
    below = np.imag(loop) < 0.0
    crossings = below[:-1].astype(int) - below[1:].astype(int)
    return bool(np.sum(crossings[far]) != 0)


def margins(loop: Complex) -> Margins:
    """Return the margins of a stable closed loop from its open one, at rising frequencies."""
    size, phase = np.abs(loop), np.angle(loop)
    falls = (size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0
    phases = np.abs(np.pi - np.abs(phase[:-1][falls]))
    around = (np.imag(loop[:-1]) * np.imag(loop[1:]) < 0.0) & (np.real(loop[:-1]) < 0.0) & (np.real(loop[1:]) < 0.0)
    gains = 1.0 / size[:-1][around]
    up = gains[gains > 1.0]
    return Margins(
        gain=float(np.min(up)) if len(up) else math.inf,
        phase_rad=float(np.min(phases)) if len(phases) else math.pi,
        distance=float(np.min(np.abs(1.0 + loop))),
    )


def position_open(loop: WheelLoop, inner: Complex, lam: float, stiffness_1_s: float) -> Complex:
    """Return the open position loop: an integrator behind the wheel loop ``inner``, PI by lambda and k / phi."""
    s = loop.difference
    return np.asarray(inner * (lam + stiffness_1_s + lam * stiffness_1_s / s) / s, dtype=np.complex128)


def loop_of(values: Mapping[str, float], motor: Motor | None = None, frequency_hz: Array | None = None) -> WheelLoop:
    """Return the loop of a robot with these PARAMETERS, KF_MODE angle; ``motor`` is the one that is really there."""
    believed = motor_of(values)
    if values["KF_J"] > 0.0:
        believed = loaded(believed, values["KF_J"])
    kalman = Filter(
        model=believed,
        count_rad=2.0 * math.pi / values["ENC_CPR"],
        speed_variance=values["KF_Q_W"] ** 2 * TICK_S,
        current_variance=values["KF_Q_I"] ** 2 * TICK_S,
        count_sd=values["KF_R_CNT"],
    )
    return WheelLoop(motor or believed, kalman, frequency_hz)


def motor_of(values: Mapping[str, float]) -> Motor:
    """Return the motor that parameters describe."""
    return Motor(values["MOT_J"], values["MOT_B"], values["MOT_K"], values["MOT_R"], values["MOT_L"])


def loaded(motor: Motor, inertia: float) -> Motor:
    """Return the motor with another inertia at the wheel [kg m^2]."""
    return replace(motor, inertia=inertia)
