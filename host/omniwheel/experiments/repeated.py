# SPDX-License-Identifier: MIT
"""Experiments that are repeated with several sets of parameters: the same signal for all, and figures to compare.

An experiment chooses size and speed of its signal from the robot's parameters. Two sets would so get two signals, and
their figures could not be compared. So the signal is chosen for every set first. All get the smallest size and speed
and the widest sweep of these. What any set cannot take is refused before the robot moves.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

from omni_schema import ParameterTable
from omniwheel.experiments.outcome import Outcome
from omniwheel.experiments.position import (
    PositionPlan,
    PushPlan,
    chosen_position,
    chosen_push,
    disturbance,
    position_step,
    position_sweep,
)
from omniwheel.experiments.session import Tell
from omniwheel.experiments.wheel import WheelPlan
from omniwheel.experiments.wheel_experiments import chosen_wheel, wheel_chirp, wheel_step
from omniwheel.robot import Robot
from omniwheel.tuning import Experiment, Trace
from omniwheel.tuning_verdict import KINDS, Kind

Sets = Sequence[Mapping[str, float]]
Use = Callable[[Mapping[str, float]], None]
Plan = Any
"""A WheelPlan, PositionPlan or PushPlan."""

LOOP_KINDS = (
    Kind("rise_s", "rise time", "ms", 1e3, 1),
    Kind("overshoot", "overshoot", "%", 1e2, 1),
    Kind("settling_s", "settling time", "ms", 1e3, 1),
    Kind("duty_noise", "noise of the duty", "%", 1e2, 3),
    Kind("bandwidth_hz", "bandwidth", "Hz", 1.0, 2, better=0),
    Kind("gain_margin", "gain margin", "", 1.0, 2, better=1),
    Kind("phase_margin_rad", "phase margin", "°", math.degrees(1.0), 1, better=1),
    Kind("distance", "distance from -1", "", 1.0, 3, better=1),
    Kind("speed_rad_s", "largest speed of the wheel", "rad/s", 1.0, 3),
    Kind("moved_m", "largest way", "mm", 1e3, 2),
    Kind("turned_rad", "largest turn", "mrad", 1e3, 2),
    Kind("left_m", "position error at the end", "mm", 1e3, 2),
)
"""The figures of loop experiments that say something of gains. A bandwidth is higher or lower, not better or worse."""
_SMALLEST = ("amplitude_rad_s", "amplitude", "amplitude_V", "speed_rad_s")


@dataclass(frozen=True)
class Signal:
    """What a user asks of an experiment; NaN: as the experiment chooses. ``size`` in the experiment's own unit."""

    size: float = math.nan
    duration_s: float = math.nan
    axis: str = "x"
    wheel: int | None = None
    on_stand: bool = False

    def plan(self, kind: type[Plan], **more: Any) -> Plan:
        """Return a plan of an experiment; what is not asked for keeps its default."""
        size = next(field.name for field in fields(kind) if field.name.startswith("amplitude"))
        asked: dict[str, Any] = {size: self.size, **more}
        if math.isfinite(self.duration_s):
            asked["duration_s"] = self.duration_s
        if "wheel" in {field.name for field in fields(kind)} and self.wheel is not None:
            asked["wheel"] = self.wheel
        return kind(**asked)


@dataclass(frozen=True)
class Try:
    """One go with one set: what each experiment saw by the experiment's name, and all figures by their keys [SI]."""

    seen: Mapping[str, Trace | Outcome]
    figures: Mapping[str, float]


def experiments_for(names: Iterable[str], table: ParameterTable) -> list[str]:
    """Return the experiments that show what these parameters do, each once; parameters that do not exist name none."""
    return list(dict.fromkeys(table[name].experiment for name in names if name in table))


class Repeated(ABC):
    """An experiment with one signal for several sets of parameters; ``kinds`` are the figures that it may have."""

    name: str
    kinds: Sequence[Kind]

    def prepare(self, robot: Robot, sets: Sets, use: Use) -> None:  # noqa: B027 - nothing to choose is the usual case
        """Choose the signal; ``use`` sets a set's values. The robot is disarmed. Raises LimitError."""

    @abstractmethod
    def run(self, robot: Robot) -> tuple[Trace | Outcome, Mapping[str, float]]:
        """Drive it with the robot's present values; return what was seen and the figures."""


class Step(Repeated):
    """A pose a little away, and back: the reference moves there within the limits of speed and acceleration."""

    name, kinds = "step", KINDS

    def __init__(self, signal: Signal) -> None:
        self._axis = signal.axis
        self._size = signal.size if math.isfinite(signal.size) else 0.1
        self._duration_s = signal.duration_s if math.isfinite(signal.duration_s) else 3.0

    def run(self, robot: Robot) -> tuple[Trace, Mapping[str, float]]:
        """Step there and back."""
        trace, figures = Experiment(robot).step(self._axis, self._size, self._duration_s)
        return trace, figures.as_dict()


class Trajectory(Repeated):
    """The path on board, once."""

    name, kinds = "trajectory", KINDS

    def __init__(self, signal: Signal) -> None:
        self._timeout_s = signal.duration_s if math.isfinite(signal.duration_s) else 600.0

    def run(self, robot: Robot) -> tuple[Trace, Mapping[str, float]]:
        """Drive the path."""
        trace, figures = Experiment(robot).trajectory(self._timeout_s)
        return trace, figures.as_dict()


class Loop(Repeated):
    """An experiment of ``omni experiment``."""

    kinds = LOOP_KINDS

    def __init__(self, name: str, signal: Signal, room_m: float, tell: Tell) -> None:
        self.name, self._room_m, self._report_progress = name, room_m, tell
        self._plan, self._chosen, self._run = _LOOPS[name](signal)

    def prepare(self, robot: Robot, sets: Sets, use: Use) -> None:
        """Choose one signal for all sets, and check each with it."""
        checks, plans = [], []
        for values in sets:
            use(values)
            plan, check = self._chosen(robot, self._plan)
            plans.append(plan)
            checks.append(check)
        self._plan = common(plans)
        for check in checks:
            check(self._plan, self._room_m)

    def run(self, robot: Robot) -> tuple[Outcome, Mapping[str, float]]:
        """Run it with the common signal."""
        outcome = self._run(robot, self._plan, self._room_m, self._report_progress)
        self._report_progress = _silent  # what it needs is said once
        known = {figure.key: figure.measured for figure in outcome.figures}
        return outcome, {kind.key: known[kind.key] for kind in self.kinds if kind.key in known}


def _silent(_: str) -> None:
    """Report no progress."""


def common(plans: Sequence[Plan]) -> Plan:
    """Return the plan that suits all: smallest size and speed, widest sweep."""
    names = {field.name for field in fields(plans[0])}
    chosen = {name: min((getattr(plan, name) for plan in plans), key=abs) for name in _SMALLEST if name in names}
    if "to_hz" in names:
        chosen["to_hz"] = max(plan.to_hz for plan in plans)
    return replace(plans[0], **chosen)


def _wheel(run: Callable[..., Outcome], sweeps: bool, signal: Signal) -> tuple[Plan, Any, Any]:
    most = {"duration_s": 2.5} if sweeps else {}
    return signal.plan(WheelPlan, on_stand=signal.on_stand, **most), partial(chosen_wheel, sweeps=sweeps), run


def _position(run: Callable[..., Outcome], sweeps: bool, signal: Signal) -> tuple[Plan, Any, Any]:
    most = {"duration_s": 12.0} if sweeps else {}
    return signal.plan(PositionPlan, axis=signal.axis, **most), partial(chosen_position, sweeps=sweeps), run


def _push(signal: Signal) -> tuple[Plan, Any, Any]:
    return signal.plan(PushPlan), chosen_push, disturbance


_LOOPS: dict[str, Callable[[Signal], tuple[Plan, Any, Any]]] = {
    "wheel-step": partial(_wheel, wheel_step, False),
    "wheel-chirp": partial(_wheel, wheel_chirp, True),
    "position-step": partial(_position, position_step, False),
    "position-sweep": partial(_position, position_sweep, True),
    "disturbance": _push,
}


class Series:
    """One experiment or several, one after another. With several, figures bear the experiment's name."""

    def __init__(self, experiments: Sequence[Repeated]) -> None:
        self.experiments = experiments
        self.kinds = [kind for entry in experiments for kind in map(partial(self._named, entry), entry.kinds)]

    def _named(self, experiment: Repeated, kind: Kind) -> Kind:
        if len(self.experiments) == 1:
            return kind
        return replace(kind, key=f"{experiment.name}.{kind.key}", name=f"{experiment.name}: {kind.name}")

    def prepare(self, robot: Robot, sets: Sets, use: Use) -> None:
        """Choose all signals. Raises LimitError for what one of the sets cannot take."""
        for experiment in self.experiments:
            experiment.prepare(robot, sets, use)

    def run(self, robot: Robot) -> Try:
        """Drive all of them with the robot's present values."""
        seen: dict[str, Trace | Outcome] = {}
        figures: dict[str, float] = {}
        for experiment in self.experiments:
            seen[experiment.name], found = experiment.run(robot)
            known = {kind.key: kind for kind in experiment.kinds}
            figures.update({self._named(experiment, known[key]).key: value for key, value in found.items()})
        return Try(seen, figures)
