# SPDX-License-Identifier: MIT
"""Wheel-speed experiments: a step or a sweep of a wheel's wanted speed, while the robot turns on the spot.

It turns so that no wheel reverses: dry friction then is a constant, and the loop is linear. What moves beside the wheel
is computed from the parameters. On a stand that is nothing, on the floor the share of the body that goes along::

    J_i = MOT_J + r^2 g^T diag(m, m, I) g,    g = (J^+) e, the body's motion per rim speed pattern e

with e = one wheel, or all of them alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from omniwheel.burst import Burst
from omniwheel.capability.drive_model import DriveModel
from omniwheel.errors import LimitError
from omniwheel.experiments.session import Claims, Excitation, Procedure, require_duty, require_room
from omniwheel.robot import Robot
from omniwheel.wheel_loop import ANGLE_FILTER, PARAMETERS, TICK_S, Motor, WheelLoop, loaded, loop_of, motor_of

Array = NDArray[np.float64]

READ = (*PARAMETERS, "KF_MODE", "WS_P", "WS_I", "WS_D", "WS_FF", "LIM_A", "LIM_DUTY", "BAT_V_NOM", "WHEEL_DIST")
SIGNALS = ("wheel_reference", "wheel_speed", "voltage", "wheel_angle")
SPEED_SHARE, AMPLITUDE_SHARE = 0.3, 0.5
"""What is used of LIM_WHEEL, and of that for the excitation, where nothing is said."""
DUTY_SHARE = 0.9
"""Of LIM_DUTY and BAT_V_NOM: a battery is seldom full."""
CHOSEN_DUTY_SHARE = 0.7
"""Of the same, where nothing is said: the ripple of real wheels needs some, too."""
MARGIN_M = 0.03
SETTLE_S = 1.0
ALL = 0


@dataclass(frozen=True)
class WheelPlan:
    """A step (``to_hz`` 0) or a sweep of the wanted speed of a wheel from 1, or of all alike (0).

    ``speed_rad_s`` is what all wheels turn at meanwhile, ``amplitude_rad_s`` what is added; NaN: as the robot allows.
    """

    wheel: int = ALL
    speed_rad_s: float = math.nan
    amplitude_rad_s: float = math.nan
    duration_s: float = 0.5
    from_hz: float = 0.0
    to_hz: float = 0.0
    on_stand: bool = False

    @property
    def sweeps(self) -> bool:
        """Whether it is a sweep."""
        return self.to_hz > 0.0


class WheelSetup:
    """A plan on a certain robot: speeds that it can follow, claims, and the loop that its parameters describe."""

    def __init__(self, robot: Robot, plan: WheelPlan) -> None:
        self.values = {name: robot.parameters[name] for name in READ}
        self.model = robot.drive_model()
        if not 0 <= plan.wheel <= self.model.wheels:
            hint = f"1 to {self.model.wheels}, or 0 for all wheels"
            raise LimitError(f"unknown wheel {plan.wheel}", hint=hint)
        self.plan = plan
        self.wheels = list(range(self.model.wheels)) if plan.wheel == ALL else [plan.wheel - 1]
        self._volts = self._volts_per_wanted()
        self.plan = _filled(plan, self.model, self.values, self._volts)

    @property
    def claims(self) -> Claims:
        """What it will use."""
        plan, model = self.plan, self.model
        radius = float(np.mean(model.radius_m))
        peak = plan.speed_rad_s + abs(plan.amplitude_rad_s)
        volts = motor_of(self.values).speed_gain * plan.speed_rad_s + self._volts * abs(plan.amplitude_rad_s)
        travel = 0.0 if plan.on_stand else self._travel_m(radius)
        room = 0.0 if plan.on_stand else 2.0 * (self.values["WHEEL_DIST"] + MARGIN_M + travel)
        turn = radius * float(np.linalg.norm(self._motion(np.ones(model.wheels))[2]))
        return Claims(room, travel, peak, radius * peak, turn * peak, volts / model.supply_V)

    def _motion(self, pattern: Array) -> Array:
        """Return the body's motion (vx, vy, wz) per rim speed of these wheels."""
        return np.asarray(np.linalg.pinv(self.model.rows) @ pattern, dtype=np.float64)

    def _pattern(self) -> Array:
        pattern = np.zeros(self.model.wheels)
        pattern[self.wheels] = 1.0
        return pattern

    def _travel_m(self, radius: float) -> float:
        """Return how far the centre goes at most: a step goes on, a sweep swings back within half a period."""
        plan = self.plan
        speed = radius * abs(plan.amplitude_rad_s) * float(np.linalg.norm(self._motion(self._pattern())[:2]))
        time_s = min(plan.duration_s, 1.0 / (math.pi * max(plan.from_hz, 0.2))) if plan.sweeps else plan.duration_s
        return speed * time_s

    def motor(self) -> Motor:
        """Return the motor with all that it moves, from the parameters alone."""
        motor = motor_of(self.values)
        if self.plan.on_stand:
            return motor
        model, pattern = self.model, self._pattern()
        motion = self._motion(pattern)
        mass = np.array([model.mass_kg, model.mass_kg, model.body_inertia_kg_m2])
        body = float(np.mean(model.radius_m)) ** 2 * float(motion @ (mass * motion)) / float(np.sum(pattern))
        return loaded(motor, motor.inertia + body)

    def _volts_per_wanted(self) -> float:
        """Return the most volts per added rad/s: at once after a jump, or where the loop swings most."""
        forward = self.feed_forward
        at_once = forward + self.values["WS_P"]
        loop = self.loop(np.geomspace(0.5, 450.0, 200))
        return at_once if loop is None else max(at_once, float(np.max(np.abs(loop.volts(*self.gains, forward)))))

    @property
    def gains(self) -> tuple[float, float]:
        """WS_P and WS_I."""
        return self.values["WS_P"], self.values["WS_I"]

    @property
    def feed_forward(self) -> float:
        """Volts per wanted rad/s that go past the controller."""
        return self.values["WS_FF"] * motor_of(self.values).speed_gain

    def loop(self, frequency_hz: Array) -> WheelLoop | None:
        """Return the loop as the parameters describe it; None if it has a part that the model does not know."""
        return modelled_loop(self.values, self.motor(), frequency_hz)

    def check(self, room_m: float) -> Claims:
        """Raise LimitError if the robot cannot, or has not the room."""
        model, claims = self.model, self.claims
        if claims.wheel_rad_s > model.wheel_limit_rad_s:
            message = f"wheels would turn at {claims.wheel_rad_s:.3g} rad/s; LIM_WHEEL is {model.wheel_limit_rad_s:.3g}"
            raise LimitError(message, hint="use a smaller --speed or --amplitude")
        if claims.turn_rad_s > model.turn_limit_rad_s:
            message = f"the robot would turn at {claims.turn_rad_s:.3g} rad/s; LIM_W is {model.turn_limit_rad_s:.3g}"
            raise LimitError(message, hint="use a smaller --speed or --amplitude")
        require_duty(claims, DUTY_SHARE * model.duty_limit)
        require_room(claims, room_m)
        return claims

    def procedure(self, robot: Robot) -> Procedure:
        """Return what is to be run."""
        plan = self.plan
        radius = float(np.mean(self.model.radius_m))
        turn = plan.speed_rad_s * radius * float(self._motion(np.ones(self.model.wheels))[2])
        ramp_s = plan.speed_rad_s * radius / self.values["LIM_A"]
        excitation = Excitation(
            "wheel", plan.wheel, plan.amplitude_rad_s, plan.duration_s, from_hz=plan.from_hz, to_hz=plan.to_hz
        )
        return Procedure(
            excitation,
            keep=lambda: robot.set_velocity(0.0, 0.0, turn),
            stop=lambda: robot.set_velocity(0.0, 0.0, 0.0),
            mode="velocity",
            settle_s=SETTLE_S + ramp_s,
            signals=SIGNALS,
            wheels=self.wheels,
            claims=self.claims,
        )


def modelled_loop(values: Mapping[str, float], motor: Motor, frequency_hz: Array) -> WheelLoop | None:
    """Return a wheel's loop around a motor; None if it has a part that the model does not know."""
    if round(values["KF_MODE"]) != ANGLE_FILTER or values["WS_D"] != 0.0:
        return None
    return loop_of(values, motor, frequency_hz)


def _filled(plan: WheelPlan, model: DriveModel, values: Mapping[str, float], volts_per_wanted: float) -> WheelPlan:
    """Choose what was left open: a share of the limits, and no more than the supply gives."""
    gain = motor_of(values).speed_gain
    volts = DUTY_SHARE * model.duty_limit * model.supply_V
    turning = float(np.mean(model.rows[:, 2])) / float(np.mean(model.radius_m))
    speed = plan.speed_rad_s
    if not math.isfinite(speed):
        fastest = min(model.wheel_limit_rad_s, model.turn_limit_rad_s * turning)
        speed = min(SPEED_SHARE * fastest, 0.4 * volts / gain)
    amplitude = plan.amplitude_rad_s
    if not math.isfinite(amplitude):
        left = max(0.0, CHOSEN_DUTY_SHARE * model.duty_limit * model.supply_V - gain * speed)
        amplitude = min(AMPLITUDE_SHARE * speed, 0.95 * left / volts_per_wanted)
    if speed <= 0.0 or amplitude == 0.0 or abs(amplitude) > speed:
        raise LimitError(
            f"{amplitude:g} rad/s on {speed:g} rad/s: a wheel would stop or reverse",
            hint="--amplitude must be smaller than --speed, and neither 0",
        )
    return replace(plan, speed_rad_s=speed, amplitude_rad_s=amplitude)


@dataclass(frozen=True)
class WheelSignals:
    """What a burst shows, the mean over the excited wheels: what was wanted, measured, given, and seen by encoders.

    ``counted`` is the mean speed over the tick that begins with each sample. The last one repeats the one before.
    """

    time_s: Array
    wanted: Array
    speed: Array
    voltage: Array
    counted: Array


def signals_of(burst: Burst) -> WheelSignals:
    """Return the signals of the recorded wheels."""
    angle = np.mean(burst["wheel_angle"], axis=1)
    counted = np.diff(angle) / TICK_S
    return WheelSignals(
        burst.time_s,
        np.mean(burst["wheel_reference"], axis=1),
        np.mean(burst["wheel_speed"], axis=1),
        np.mean(burst["voltage"], axis=1),
        np.append(counted, counted[-1]),
    )
