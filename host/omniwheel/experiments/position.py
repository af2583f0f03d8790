# SPDX-License-Identifier: MIT
"""Experiments with the position loop: a step or a sweep of the wanted pose, and a push of a wheel's voltage.

The robot holds the pose at which it stands. What is added passes no ramp, so it has to be small. The sliding mode is
linear within its boundary layer only, and the wheels must not come to their limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omniwheel.burst import Burst
from omniwheel.errors import LimitError
from omniwheel.experiments.outcome import Figure, Line, Outcome, Panel, bode, margin_figures
from omniwheel.experiments.response import Response, Sweep, Value, bandwidth, measured_margins, modelled_bandwidth
from omniwheel.experiments.session import (
    Claims,
    Excitation,
    Procedure,
    Tell,
    require_duty,
    require_room,
    run_excitation,
)
from omniwheel.experiments.wheel import DUTY_SHARE, MARGIN_M, READ, modelled_loop
from omniwheel.robot import Robot
from omniwheel.telemetry import Tracking
from omniwheel.tuning import AXES, UNITS, ExperimentError, step_response
from omniwheel.wheel_loop import Motor, loaded, margins, motor_of, position_open

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_Plan = TypeVar("_Plan")

GAINS = ("CTL_MODE", "ISMC_SWITCH", *(f"ISMC_{name}_{axis}" for name in ("LAM", "K", "PHI") for axis in ("XY", "TH")))
LIMITS = ("SAFE_ERR_XY", "SAFE_ERR_TH")
ISMC, BOUNDARY = 1, 1
LAYER_SHARE = 0.4
"""Of the boundary layer: so much of it is used where nothing is said."""
ERROR_SHARE = 0.5
OVERSHOOT = 1.5
EVERY = 4
SETTLE_S, TRACKING_TIMEOUT_S = 1.0, 5.0
NO_MODEL = "no prediction: the model needs CTL_MODE = ismc, ISMC_SWITCH = boundary, KF_MODE = angle and WS_D = 0"
PUSH_SHARE = 0.25
SMOOTHED_HZ, LOWEST_SWEPT_HZ, SWEPT_BANDWIDTHS = 0.4, 0.1, 2.5
LEAST_HZ, MOST_HZ = 2.0, 20.0
SIGNALS = ("pose", "pose_reference", "voltage")
PUSH_SIGNALS = (*SIGNALS, "wheel_speed")


@dataclass(frozen=True)
class PositionPlan:
    """A step (``to_hz`` 0) or a sweep of the wanted pose along an axis of the world [m or rad]; NaN: chosen."""

    axis: str = "x"
    amplitude: float = math.nan
    duration_s: float = 1.0
    from_hz: float = 0.0
    to_hz: float = 0.0


@dataclass(frozen=True)
class PushPlan:
    """A voltage [V] added to a wheel from 1 while the pose is held; NaN: a share of the supply."""

    wheel: int = 1
    amplitude_V: float = math.nan
    duration_s: float = 0.1


class PositionSetup:
    """A robot that holds its pose: what its parameters say of the position loop."""

    def __init__(self, robot: Robot) -> None:
        self.values = {name: robot.parameters[name] for name in (*READ, *GAINS, *LIMITS)}
        self.model = robot.drive_model()
        self.here = robot.wait_for(Tracking, TRACKING_TIMEOUT_S).pose

    def gains(self, axis: str) -> tuple[float, float]:
        """Return lambda and k / phi of an axis [1/s]."""
        name = "TH" if axis == "theta" else "XY"
        return self.values[f"ISMC_LAM_{name}"], self.values[f"ISMC_K_{name}"] / self.values[f"ISMC_PHI_{name}"]

    def rims(self, axis: str) -> float:
        """Return the fastest wheel [rad/s] per m/s or rad/s along an axis, whatever the heading is."""
        rows, radius = self.model.rows, float(np.mean(self.model.radius_m))
        across = float(np.max(np.abs(rows[:, 2]))) if axis == "theta" else 1.0
        return across / radius

    def filled(self, plan: PositionPlan) -> PositionPlan:
        """Choose the size where it was left open. Raises LimitError for one that the robot refuses."""
        name = "TH" if plan.axis == "theta" else "XY"
        size = plan.amplitude
        if not math.isfinite(size):
            size = min(LAYER_SHARE * self.values[f"ISMC_PHI_{name}"], self._largest(plan.axis))
        limit = ERROR_SHARE * self.values[f"SAFE_ERR_{name}"]
        if size == 0.0 or abs(size) > limit:
            hint = f"--amplitude up to {limit:g}, and not 0"
            raise LimitError(f"an amplitude of {size:g} {UNITS[plan.axis]} is invalid", hint=hint)
        return replace(plan, amplitude=size)

    def _largest(self, axis: str) -> float:
        """Return the step whose first voltages are within the supply."""
        per_size = self._volts(self.rims(axis) * sum(self.gains(axis)))
        return 0.9 * DUTY_SHARE * self.model.duty_limit * self.model.supply_V / per_size

    def _volts(self, wheel_rad_s: float) -> float:
        """Return what a sudden wheel speed takes at first."""
        return (self.values["WS_FF"] * motor_of(self.values).speed_gain + self.values["WS_P"]) * wheel_rad_s

    def claims(self, plan: PositionPlan) -> Claims:
        """What it will use."""
        moved = 0.0 if plan.axis == "theta" else OVERSHOOT * abs(plan.amplitude)
        speed = sum(self.gains(plan.axis)) * abs(plan.amplitude)
        wheel = self.rims(plan.axis) * speed
        turn = speed if plan.axis == "theta" else 0.0
        return self._claims(moved, wheel, turn, self._volts(wheel) / self.model.supply_V)

    def _claims(self, moved_m: float, wheel_rad_s: float, turn_rad_s: float, duty: float) -> Claims:
        room = 2.0 * (self.values["WHEEL_DIST"] + MARGIN_M + moved_m)
        rim = wheel_rad_s * float(np.mean(self.model.radius_m))
        return Claims(room, moved_m, wheel_rad_s, rim, turn_rad_s, duty)

    def push_claims(self, plan: PushPlan) -> Claims:
        """What a push will use: at most the speed that its voltage gives, for as long as it lasts."""
        wheel = abs(plan.amplitude_V) / motor_of(self.values).speed_gain
        moved = wheel * float(np.mean(self.model.radius_m)) * plan.duration_s
        return self._claims(moved, wheel, 0.0, abs(plan.amplitude_V) / self.model.supply_V)

    def motor(self, axis: str) -> Motor:
        """Return the motor of a wheel with its share of the body that moves along an axis."""
        motor, model = motor_of(self.values), self.model
        body = np.zeros(3)
        body[AXES.index(axis)] = 1.0
        mass = model.body_inertia_kg_m2 if axis == "theta" else model.mass_kg
        share = mass / float(np.sum((model.rows @ body) ** 2))
        return loaded(motor, motor.inertia + float(np.mean(model.radius_m)) ** 2 * share)

    def open_loop(self, axis: str, frequency_hz: Array) -> Complex | None:
        """Return the open position loop as the parameters describe it; None where the model does not reach."""
        values = self.values
        loop = modelled_loop(values, self.motor(axis), frequency_hz)
        if loop is None or round(values["CTL_MODE"]) != ISMC or round(values["ISMC_SWITCH"]) != BOUNDARY:
            return None
        forward = values["WS_FF"] * motor_of(values).speed_gain
        inner = loop.closed(values["WS_P"], values["WS_I"], forward)
        return position_open(loop, inner, *self.gains(axis))

    def procedure(self, robot: Robot, excitation: Excitation, claims: Claims, signals: tuple[str, ...]) -> Procedure:
        """Return what is to be run: the pose is held around it."""
        every = EVERY if excitation.duration_s > 1.0 else 1

        def hold() -> None:
            robot.set_pose(*self.here)

        return Procedure(excitation, hold, hold, "pose", SETTLE_S, signals, (), claims, every)


def position_step(robot: Robot, plan: PositionPlan, room_m: float, tell: Tell) -> Outcome:
    """Step the wanted pose, past all ramps. The robot is disarmed at the end. Raises LimitError first."""
    setup = PositionSetup(robot)
    plan = setup.filled(plan)
    burst, claims = _run(robot, setup, plan, room_m, tell)
    pose, reference = _along(burst, plan.axis)
    pushed = burst.time_s < plan.duration_s
    rise_s, overshoot, settling_s = step_response(burst.time_s[pushed], pose[pushed], 0.0, plan.amplitude)
    figures = [
        Figure("rise_s", "rise time", "s", rise_s),
        Figure("overshoot", "overshoot", "", overshoot),
        Figure("settling_s", "settling time", "s", settling_s),
    ]
    return Outcome("position-step", claims, asdict(plan), figures, _panels(burst, plan.axis, pose, reference), burst)


def position_sweep(robot: Robot, plan: PositionPlan, room_m: float, tell: Tell) -> Outcome:
    """Sweep the wanted pose: bandwidth and margins of the position loop, as measured and modelled."""
    setup = PositionSetup(robot)
    plan = _sweeping(setup, setup.filled(plan))
    burst, claims = _run(robot, setup, plan, room_m, tell)
    pose, reference = _along(burst, plan.axis)
    sweep = Sweep(reference, burst.period_s, plan.from_hz, plan.to_hz, SMOOTHED_HZ)
    answer = sweep.response(pose)
    if not answer.credible.any():
        raise ExperimentError("the response is below the noise", hint="use a larger --amplitude or --time")
    opened = sweep.response(pose, reference - pose)
    model = setup.open_loop(plan.axis, answer.frequency_hz)
    closed = None if model is None else np.asarray(model / (1.0 + model), dtype=np.complex128)
    figures = _sweep_figures(answer, opened, closed, model)
    coherence = [Line("measured", answer.frequency_hz, answer.coherence)]
    panels = [
        *bode("pose per wanted pose", answer, closed),
        *bode("open loop", opened, model),
        Panel("coherence", "frequency [Hz]", "", coherence, logarithmic=True),
        *_panels(burst, plan.axis, pose, reference)[:1],
    ]
    remarks = () if model is not None else (NO_MODEL,)
    return Outcome("position-sweep", claims, asdict(plan), figures, panels, burst, remarks)


def disturbance(robot: Robot, plan: PushPlan, room_m: float, tell: Tell) -> Outcome:
    """Push a wheel by a voltage while the robot holds its pose: how far it gives way, and how it comes back."""
    setup = PositionSetup(robot)
    plan = _filled_push(setup, plan)
    claims = setup.push_claims(plan)
    _check(setup, claims, room_m, tell)
    excitation = Excitation("voltage", plan.wheel, plan.amplitude_V, plan.duration_s)
    burst = run_excitation(robot, setup.procedure(robot, excitation, claims, PUSH_SIGNALS))
    moved = np.hypot(*(burst["pose"][:, :2] - burst["pose_reference"][:, :2]).T)
    turned = np.unwrap(burst["pose"][:, 2]) - np.unwrap(burst["pose_reference"][:, 2])
    speed = burst.wheel("wheel_speed", plan.wheel - 1)
    figures = [
        Figure("speed_rad_s", "largest speed of the wheel", "rad/s", float(np.max(np.abs(speed)))),
        Figure("moved_m", "largest way", "m", float(np.max(moved))),
        Figure("turned_rad", "largest turn", "rad", float(np.max(np.abs(turned)))),
        Figure("left_m", "position error at the end", "m", float(moved[-1])),
    ]
    panels = [
        Panel("wheel speed", "time [s]", "[rad/s]", [Line("measured", burst.time_s, speed)]),
        Panel("voltage", "time [s]", "[V]", [Line("given", burst.time_s, burst.wheel("voltage", plan.wheel - 1))]),
        Panel("way", "time [s]", "[m]", [Line("measured", burst.time_s, moved)]),
        Panel("turn", "time [s]", "[rad]", [Line("measured", burst.time_s, turned)]),
    ]
    return Outcome("disturbance", claims, asdict(plan), figures, panels, burst)


Check = Callable[[_Plan, float], None]
"""Raises LimitError for a plan that does not fit, in a room of a side in metres."""


def chosen_position(robot: Robot, plan: PositionPlan, *, sweeps: bool) -> tuple[PositionPlan, Check[PositionPlan]]:
    """Return the plan as the robot's present values fill it, and a check of another plan with these values."""
    setup = PositionSetup(robot)
    filled = setup.filled(plan)
    return (
        _sweeping(setup, filled) if sweeps else filled,
        lambda other, room_m: _check(setup, setup.claims(setup.filled(other)), room_m, _silent),
    )


def chosen_push(robot: Robot, plan: PushPlan) -> tuple[PushPlan, Check[PushPlan]]:
    """Return the push as the robot's present values fill it, and a check of another push with these values."""
    setup = PositionSetup(robot)
    return (
        _filled_push(setup, plan),
        lambda other, room_m: _check(setup, setup.push_claims(other), room_m, _silent),
    )


def _silent(_: str) -> None:
    """Report no progress."""


def _sweeping(setup: PositionSetup, plan: PositionPlan) -> PositionPlan:
    """Return the plan with frequencies up to a few bandwidths of the modelled loop, where it has none."""
    if plan.to_hz > 0.0:
        return plan
    return replace(plan, from_hz=LOWEST_SWEPT_HZ, to_hz=_reach_hz(setup, plan.axis))


def _filled_push(setup: PositionSetup, plan: PushPlan) -> PushPlan:
    if not 1 <= plan.wheel <= setup.model.wheels:
        raise LimitError(f"unknown wheel {plan.wheel}", hint=f"1 to {setup.model.wheels}")
    if math.isfinite(plan.amplitude_V):
        return plan
    return replace(plan, amplitude_V=PUSH_SHARE * setup.model.duty_limit * setup.model.supply_V)


def _check(setup: PositionSetup, claims: Claims, room_m: float, tell: Tell) -> None:
    limit = setup.model.wheel_limit_rad_s
    if claims.wheel_rad_s > limit:
        message = f"wheels would turn at {claims.wheel_rad_s:.3g} rad/s; LIM_WHEEL is {limit:.3g}"
        raise LimitError(message, hint="use a smaller --amplitude")
    require_duty(claims, DUTY_SHARE * setup.model.duty_limit)
    require_room(claims, room_m)
    tell(claims.sentence())


def _run(robot: Robot, setup: PositionSetup, plan: PositionPlan, room_m: float, tell: Tell) -> tuple[Burst, Claims]:
    claims = setup.claims(plan)
    _check(setup, claims, room_m, tell)
    which = AXES.index(plan.axis)
    excitation = Excitation("pose", which, plan.amplitude, plan.duration_s, plan.from_hz, plan.to_hz)
    return run_excitation(robot, setup.procedure(robot, excitation, claims, SIGNALS)), claims


def _along(burst: Burst, axis: str) -> tuple[Array, Array]:
    """Return pose and reference along an axis, from where the robot was held."""
    column = AXES.index(axis)
    pose, reference = burst["pose"][:, column], burst["pose_reference"][:, column]
    if axis == "theta":
        pose, reference = np.unwrap(pose), np.unwrap(reference)
        pose = pose + 2.0 * math.pi * np.round((reference[0] - pose[0]) / (2.0 * math.pi))
    return pose - reference[-1], reference - reference[-1]


def _reach_hz(setup: PositionSetup, axis: str) -> float:
    """Return a few bandwidths of the modelled loop, so that the sweep shows all of it."""
    frequency = np.arange(0.1, 50.0, 0.1, dtype=np.float64)
    model = setup.open_loop(axis, frequency)
    found = None if model is None else modelled_bandwidth(frequency, model / (1.0 + model))
    return MOST_HZ if found is None else min(MOST_HZ, max(LEAST_HZ, SWEPT_BANDWIDTHS * found.value))


def _sweep_figures(answer: Response, opened: Response, closed: Complex | None, model: Complex | None) -> list[Figure]:
    found = bandwidth(answer) or Value(math.nan, math.nan)
    predicted = None if closed is None else modelled_bandwidth(answer.frequency_hz, closed)
    whole = None if model is None else margins(model)
    seen = measured_margins(opened)
    return [
        Figure(
            "bandwidth_hz",
            "bandwidth (-3 dB)",
            "Hz",
            found.value,
            found.half_width,
            math.nan if predicted is None else predicted.value,
        ),
        *margin_figures(seen, whole),
        Figure("coherence", "least coherence", "", float(np.min(answer.coherence))),
    ]


def _panels(burst: Burst, axis: str, pose: Array, reference: Array) -> list[Panel]:
    unit = f"[{UNITS[axis]}]"
    time_s = burst.time_s
    volts = [Line(f"wheel {n + 1}", time_s, burst.wheel("voltage", n)) for n in burst.wheels]
    return [
        Panel(axis, "time [s]", unit, [Line("wanted", time_s, reference), Line("measured", time_s, pose)]),
        Panel("error", "time [s]", unit, [Line("wanted - measured", time_s, reference - pose)]),
        Panel("voltage", "time [s]", "[V]", volts),
    ]
