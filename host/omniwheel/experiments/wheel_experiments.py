# SPDX-License-Identifier: MIT
"""``wheel_step`` and ``wheel_chirp``: run them, and say what the burst shows beside what the model predicts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from omniwheel.burst import Burst
from omniwheel.experiments.outcome import Figure, Line, Outcome, Panel, bode, margin_figures
from omniwheel.experiments.response import (
    Response,
    Sweep,
    Value,
    bandwidth,
    crossover_hz,
    delay_s,
    measured_margins,
    modelled_bandwidth,
)
from omniwheel.experiments.session import Claims, Tell, run_excitation
from omniwheel.experiments.wheel import WheelPlan, WheelSetup, WheelSignals, signals_of
from omniwheel.robot import Robot
from omniwheel.tuning import ExperimentError, step_response
from omniwheel.wheel_loop import TICK_S, WheelLoop, margins

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

NO_MODEL = "no prediction: the model needs KF_MODE = angle and WS_D = 0"
CUT = "duties reached their limit: repeat it with a smaller --amplitude"
LOWEST_HZ = 0.5
SWEPT_BANDWIDTHS = 2.0
MOST_HZ, LEAST_HZ = 250.0, 20.0


def wheel_step(robot: Robot, plan: WheelPlan, room_m: float, tell: Tell) -> Outcome:
    """Step the wanted speed of a wheel, or of all. The robot is disarmed at the end. Raises LimitError first."""
    setup = WheelSetup(robot, plan)
    burst = _run(robot, setup, room_m, tell)
    seen = signals_of(burst)
    size, speed = setup.plan.amplitude_rad_s, float(seen.speed[0])  # as it was before the step, not as planned
    pushed = seen.time_s < setup.plan.duration_s
    rise_s, overshoot, settling_s = step_response(seen.time_s[pushed], seen.speed[pushed], speed, speed + size)
    settled = pushed & (seen.time_s > 0.5 * setup.plan.duration_s)
    noise = float(np.std(seen.voltage[settled])) / setup.values["BAT_V_NOM"]
    model = _modelled_step(setup, seen, setup.plan.duration_s)
    modelled = (math.nan, math.nan, math.nan) if model is None else _step_of(seen.time_s[pushed], model[pushed])
    figures = [
        Figure("rise_s", "rise time", "s", rise_s, model=modelled[0]),
        Figure("overshoot", "overshoot", "", overshoot, model=modelled[1]),
        Figure("settling_s", "settling time", "s", settling_s, model=modelled[2]),
        Figure("duty_noise", "noise of the duty, once settled", "", noise),
    ]
    lines = [Line("wanted", seen.time_s, seen.wanted), Line("measured", seen.time_s, seen.speed)]
    if model is not None:
        lines.append(Line("model", seen.time_s, speed + size * model, modelled=True))
    panels = [Panel("speed", "time [s]", "[rad/s]", lines), *_panels(seen)]
    return _outcome("wheel-step", setup, burst, figures, panels)


def wheel_chirp(robot: Robot, plan: WheelPlan, room_m: float, tell: Tell) -> Outcome:
    """Sweep the wanted speed of a wheel, or of all: bandwidth, margins and delay of its loop, as measured and modelled.

    The robot is disarmed at the end. Raises LimitError before it arms, ExperimentError for an answer that says nothing.
    """
    setup = _sweeping(robot, plan)
    burst = _run(robot, setup, room_m, tell)
    seen = signals_of(burst)
    sweep = Sweep(seen.wanted, TICK_S, setup.plan.from_hz, setup.plan.to_hz)
    answer = sweep.response(seen.counted)
    if not answer.credible.any():
        raise ExperimentError("the response is below the noise", hint="use a larger --amplitude or --duration")
    loop = setup.loop(sweep.frequency_hz)
    figures, panels = [], []
    if loop is None:
        figures = [_bandwidth_figure(answer, None)]
        panels = bode("speed per wanted speed", answer, None)
    else:
        gains = setup.gains
        closed = loop.counted(*gains, setup.feed_forward)
        motor = sweep.response(seen.counted, seen.voltage)
        opened = opened_loop(motor, loop, gains)
        figures = _loop_figures(answer, closed, opened, loop, gains)
        figures.append(_value_figure("delay_s", "delay beyond the model's", "s", delay_s(motor, loop.counted_per_volt)))
        panels = bode("speed per wanted speed", answer, closed) + bode("open loop", opened, loop.open(*gains))
    hz = answer.frequency_hz
    panels.append(Panel("coherence", "frequency [Hz]", "", [Line("measured", hz, answer.coherence)], logarithmic=True))
    return _outcome("wheel-chirp", setup, burst, figures, [*panels, *_panels(seen)[1:]])


def chosen_wheel(
    robot: Robot, plan: WheelPlan, *, sweeps: bool
) -> tuple[WheelPlan, Callable[[WheelPlan, float], None]]:
    """Return the plan as the robot's present values fill it, and a check of another plan in a room with these values.

    Both raise LimitError.
    """
    setup = _sweeping(robot, plan) if sweeps else WheelSetup(robot, plan)

    def check(other: WheelPlan, room_m: float) -> None:
        setup.plan = other
        setup.check(room_m)

    return setup.plan, check


def _sweeping(robot: Robot, plan: WheelPlan) -> WheelSetup:
    """Return the set-up of a sweep; where the plan has no frequencies, up to some bandwidths of the modelled loop."""
    setup = WheelSetup(robot, plan)
    if not plan.sweeps:
        setup.plan = replace(setup.plan, from_hz=LOWEST_HZ, to_hz=_reach_hz(setup))
    return setup


def opened_loop(motor: Response, loop: WheelLoop, gains: tuple[float, float]) -> Response:
    """Return the open loop: the motor as measured, filter and controller as the robot computes them."""
    cut = loop.feedback(*gains) / loop.difference
    return replace(motor, value=np.asarray(cut * motor.value, dtype=np.complex128))


def _run(robot: Robot, setup: WheelSetup, room_m: float, tell: Tell) -> Burst:
    claims = setup.check(room_m)
    tell(claims.sentence())
    return run_excitation(robot, setup.procedure(robot))


def _reach_hz(setup: WheelSetup) -> float:
    """Return twice the bandwidth of the modelled loop, so that the sweep shows all of it."""
    frequency = np.arange(1.0, 450.0, dtype=np.float64)
    loop = setup.loop(frequency)
    if loop is None:
        return MOST_HZ
    found = modelled_bandwidth(frequency, loop.counted(*setup.gains, setup.feed_forward))
    return MOST_HZ if found is None else min(MOST_HZ, max(LEAST_HZ, SWEPT_BANDWIDTHS * found.value))


def _loop_figures(
    answer: Response, closed: Complex, opened: Response, loop: WheelLoop, gains: tuple[float, float]
) -> list[Figure]:
    whole, measured = margins(loop.open(*gains)), measured_margins(opened)
    crossing = crossover_hz(opened)
    return [
        _bandwidth_figure(answer, closed),
        Figure(
            "crossover_hz",
            "open loop falls below 1",
            "Hz",
            math.nan if crossing is None else crossing,
            model=loop.bandwidth_hz(*gains),
        ),
        *margin_figures(measured, whole),
        Figure("coherence", "least coherence up to the bandwidth", "", _least_coherence(answer)),
    ]


def _bandwidth_figure(answer: Response, closed: Complex | None) -> Figure:
    found = bandwidth(answer)
    model = None if closed is None else modelled_bandwidth(answer.frequency_hz, closed)
    figure = _value_figure("bandwidth_hz", "bandwidth (-3 dB)", "Hz", found or Value(math.nan, math.nan))
    return replace(figure, model=math.nan if model is None else model.value)


def _value_figure(key: str, name: str, unit: str, found: Value) -> Figure:
    return Figure(key, name, unit, found.value, found.half_width)


def _least_coherence(answer: Response) -> float:
    found = bandwidth(answer)
    up_to = answer.frequency_hz <= (math.inf if found is None else found.value)
    return float(np.min(answer.coherence[up_to]))


def _modelled_step(setup: WheelSetup, seen: WheelSignals, duration_s: float) -> Array | None:
    """Return the model's answer to a pulse of 1, tick by tick: by its response at the record's own frequencies.

    The record is padded, so that the answer has died away when it begins anew.
    """
    size = 4 * len(seen.time_s)
    frequency = np.asarray(np.fft.rfftfreq(size, TICK_S), dtype=np.float64)
    loop = setup.loop(frequency[1:-1])
    if loop is None:
        return None
    response = np.concatenate(([1.0], loop.estimated(*setup.gains, setup.feed_forward), [0.0]))
    pulse = (np.arange(size) * TICK_S < duration_s).astype(np.float64)
    return np.asarray(np.fft.irfft(response * np.fft.rfft(pulse), size)[: len(seen.time_s)], dtype=np.float64)


def _step_of(time_s: Array, answer: Array) -> tuple[float, float, float]:
    return step_response(time_s, answer, 0.0, 1.0)


def _panels(seen: WheelSignals) -> list[Panel]:
    error = Line("wanted - measured", seen.time_s, seen.wanted - seen.speed)
    return [
        Panel("error", "time [s]", "[rad/s]", [error]),
        Panel("voltage", "time [s]", "[V]", [Line("given", seen.time_s, seen.voltage)]),
    ]


def _outcome(name: str, setup: WheelSetup, burst: Burst, figures: list[Figure], panels: list[Panel]) -> Outcome:
    remarks = []
    claims: Claims = setup.claims
    limit_V = setup.values["LIM_DUTY"] * setup.values["BAT_V_NOM"]
    if float(np.max(np.abs(burst["voltage"]))) > 0.98 * limit_V:
        remarks.append(CUT)
    if setup.loop(np.array([1.0])) is None:
        remarks.append(NO_MODEL)
    return Outcome(name, claims, asdict(setup.plan), figures, panels, burst, remarks)
