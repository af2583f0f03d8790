# SPDX-License-Identifier: MIT
"""Anybody's simulator as the world around the real firmware: what it has to offer, and how it is found and checked.

The other simulator has motors, wheels, body and floor. The electronics between it and the robot stay this package's.
They are the PWM chip, bridges, encoder counters and the scenario's pose sensor, with their faults. The whole exchange
is in docs/guides/external-worlds.md.
"""

from __future__ import annotations

import importlib
import math
import operator
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from hil_sim.c_scenario import scenario_world
from hil_sim.scenario import Scenario
from hil_sim.world import DEFAULT_PLANT, TICK_US, World
from omni_schema.errors import did_you_mean
from omniwheel._core import ffi, lib
from omniwheel.errors import OmniError

Result = TypeVar("Result")

METHODS = ("sense", "apply", "step")
SHORT_NAMES = {"mujoco": "hil_sim.mujoco_world:MujocoWorld"}
"""Worlds that come with the package. ``NAME:FILE`` gives their class a second argument, the path of a file."""
REFUSED_FAULTS = ("battery_sag", "motor_stalled", "tick_late", "wheel_turned")
"""Faults of what the other simulator has: it cannot be told to have them."""
_OWN_NUMBERS = ("fix_", "pca9685_", "i2c_", "output_enable_")
"""Beginnings of the world's numbers that are about the electronics."""
_COUNTS_MAX = 2**53
_LARGEST = 1e6
"""Of any other number that a world gives: no robot is a thousand kilometres away."""
_UNKNOWN = math.nan


@dataclass(frozen=True)
class Fix:
    """A pose as the world's own motion capture measured it at ``taken_s`` [s, simulated time], which arrives now.

    World frame: x, y [m], theta [rad, counter-clockwise].
    """

    taken_s: float
    x_m: float
    y_m: float
    theta_rad: float


@dataclass(frozen=True)
class Sensed:
    """What a world says of one time.

    ``counts`` are whole numbers, one per wheel: edges that the wheel's encoder has passed since the start, with
    ``counts_per_revolution`` of the robot file. They rise when the wheel drives the body counter-clockwise. They need
    not begin at 0 and do not wrap; how the encoder is wired is not the world's matter.
    ``supply_V`` is the supply voltage [V] under load; 0: not measured. ``pose`` is the true x, y [m] and theta [rad] in
    the world frame, for accuracy and for the scenario's pose sensor. ``fix`` is one that arrives now, of a pose sensor
    that is the world's own; the scenario's is off then (``world.fix_rate_Hz`` 0).
    ``wheel_rad_s`` [rad/s] and ``current_A`` [A] are the truth per wheel, counter-clockwise, for the record only.
    """

    counts: Sequence[int]
    supply_V: float
    pose: Sequence[float]
    fix: Fix | None = None
    wheel_rad_s: Sequence[float] | None = None
    current_A: Sequence[float] | None = None


class ExternalWorld(Protocol):
    """Motors, wheels, body and floor of an external simulator.

    Time begins at 0. One tick is: :meth:`sense`, the robot's own tick, :meth:`apply`, :meth:`step`. After the last
    step comes one more :meth:`sense`. However a run ends, the last call is :meth:`apply` with all motors coasting.

    A world may have a method ``ahead``, without arguments. It is called between :meth:`sense` and :meth:`apply`, while
    the robot computes its tick. There it may do what of its step needs no motors.
    """

    def sense(self) -> Sensed:
        """Return what there is now. Called once per time, before the step from there."""
        ...

    def apply(self, duty: tuple[float, ...], coast: tuple[float, ...]) -> None:
        """Set the motors for the next step; one number per wheel.

        ``duty`` -1..1 is the mean bridge voltage over the supply's, positive: it drives the body counter-clockwise.
        ``coast`` 0..1 is the share of a PWM period in which the winding is open. While the bridge neither drives nor
        coasts, it shorts the winding. The firmware's driver has coast 0 (``V = duty * supply``) or 1 (no current).
        """
        ...

    def step(self) -> None:
        """Go on by exactly 1 ms."""
        ...


class ExternalWorldError(OmniError):
    """The world raised, or said what cannot be; the message says when, in which method and why."""


class ExternalWorldInputError(ExternalWorldError):
    """The world cannot be found or made, or the scenario asks for what it cannot do."""

    exit_code = 2


def check_scenario(scenario: Scenario, world: ExternalWorld) -> None:
    """Raise ExternalWorldInputError if the scenario asks for something that only our own world can do.

    A world with a member ``knows_patches`` that is true has the scenario's patches of the floor by itself.
    """
    asked = [f"fault {fault.name}" for fault in scenario.faults if fault.name in REFUSED_FAULTS]
    asked += [
        f"dispersion of {entry.quantity}"
        for entry in scenario.dispersion
        if not entry.quantity.startswith(_OWN_NUMBERS)
    ]
    asked += ["[[patch]]"] if scenario.patches and not getattr(world, "knows_patches", False) else []
    asked += [f"plant {scenario.plant}"] if scenario.plant != DEFAULT_PLANT else []
    if asked:
        raise ExternalWorldInputError(
            f"{scenario.source}: {', '.join(asked)}: not possible with an external world, which models motors, "
            "wheels and floor itself",
            hint="remove it from the scenario, or simulate it in your world",
        )


def load_world(place: str, scenario: Scenario) -> ExternalWorld:
    """Make the world ``module:Class`` for a scenario: ``Class(scenario)``. Raises ExternalWorldInputError.

    Modules are looked for in the current folder first. ``mujoco`` and ``mujoco:FLOOR.toml`` are SHORT_NAMES; what
    such a world says of the robot or the file comes as it is: OmniError, SchemaError.
    """
    short, colon, file = place.partition(":")
    if short in SHORT_NAMES and colon and not file:
        raise ExternalWorldInputError(
            f"--world {place}: the file name after the colon is missing", hint=f"or write {short}"
        )
    module_name, _, class_name = SHORT_NAMES.get(short, place).partition(":")
    if not module_name or not class_name.isidentifier():
        known = ", ".join(SHORT_NAMES)
        raise ExternalWorldInputError(f"--world {place}: write MODULE:CLASS, as my_simulator:MyWorld, or {known}")
    kind = _class_of(place, _module(place, module_name), class_name)
    missing = [name for name in METHODS if not callable(getattr(kind, name, None))]
    if missing:
        raise ExternalWorldInputError(
            f"--world {place}: {class_name} has no method {', '.join(missing)}",
            hint=f"a world has {', '.join(METHODS)}; docs/guides/external-worlds.md describes them",
        )
    if short in SHORT_NAMES:
        packaged: ExternalWorld = kind(scenario, Path(file)) if file else kind(scenario)
        return packaged
    try:
        world: ExternalWorld = kind(scenario)
    except (Exception, SystemExit) as error:
        raise ExternalWorldInputError(
            f"--world {place}: {class_name}(scenario) failed: {_said(error)}", hint=_where(error, kind.__init__)
        ) from error
    notes = getattr(world, "notes", ())
    if isinstance(notes, str) or not isinstance(notes, Iterable) or not all(isinstance(line, str) for line in notes):
        raise ExternalWorldInputError(
            f"--world {place}: {class_name}.notes is {notes!r}; must be a list of sentences, or none"
        )
    return world


def finish_world(world: ExternalWorld, folder: Path) -> None:
    """Let a world that has ``finish(folder)`` write its files into a run's folder. Raises ExternalWorldError."""
    finish = getattr(world, "finish", None)
    if finish is None:
        return
    try:
        finish(folder)
    except OmniError:
        raise
    except (Exception, SystemExit) as error:
        raise ExternalWorldError(
            f"{_name_of(world)}.finish failed: {_said(error)}", hint=_where(error, finish)
        ) from error


def _module(place: str, name: str) -> Any:
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
            message, hint = f"unknown module {name}", "give the module's import name, and run the command in its folder"
        else:
            message, hint = f"importing {name} failed: {_said(error)}", _where(error)
        raise ExternalWorldInputError(f"--world {place}: {message}", hint=hint) from error


def _class_of(place: str, module: Any, name: str) -> Any:
    kind = getattr(module, name, None)
    if not callable(kind):
        known = [word for word, value in vars(module).items() if isinstance(value, type)]
        raise ExternalWorldInputError(
            f"--world {place}: {module.__name__} has no class {name}{did_you_mean(name, known)}"
        )
    return kind


def _name_of(world: ExternalWorld) -> str:
    return f"{type(world).__module__}:{type(world).__qualname__}"


def _said(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".removesuffix(": ")


def _where(error: BaseException, function: Any = None) -> str:
    """Return the innermost line of the user's code that raised; where ``function`` begins if it was not even called."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"in {error.filename}, line {error.lineno}"
    found, trace = "", error.__traceback__
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if file != __file__ and not file.startswith("<frozen "):
            found = f"raised in {file}, line {trace.tb_lineno}"
        trace = trace.tb_next
    code = getattr(function, "__code__", None)
    if not found and code is not None:
        found = f"see {code.co_filename}, line {code.co_firstlineno}"
    return found


class OutsideWorld(World):
    """The electronics around an :class:`ExternalWorld`; takes a :class:`World`'s place in a lockstep link.

    Raises ExternalWorldError whenever the other one raises or says what cannot be.
    """

    def __init__(self, config: Any, external: ExternalWorld) -> None:
        super().__init__(config)
        self._external = external
        self._ahead: Callable[[], None] | None = getattr(external, "ahead", None)
        self._count = self.wheels  # asked for several times in every step
        self._outside = ffi.new("hil_external_state_t *")
        self._motors = ffi.new("double[]", lib.HIL_MAX_WHEELS), ffi.new("double[]", lib.HIL_MAX_WHEELS)
        self._begun = False
        self._now_s = 0.0

    @property
    def name(self) -> str:
        """Module and class of the other world."""
        return _name_of(self._external)

    def lockstep(self, link: Any, ticks: int, record: Any, done: Any) -> int:
        """Run ticks with the robot behind a ``hil_lockstep_t``; see :meth:`World.lockstep`."""
        if not self._begun:
            self._begun = True
            self._sense()
            self._set_twist(list(self._outside.pose))
            lib.hil_external_start(self.c, self._outside)
        asked, ok, world = ffi.new("bool *"), lib.HIL_OK, self.c
        for number in range(ticks):
            done[0] = number
            result = lib.hil_lockstep_send_sensors(link, world, asked)
            if result != ok or not asked[0]:
                return int(result)
            try:
                if self._ahead is not None:
                    self._call("ahead", self._ahead)
            finally:  # an answer left behind would be taken for that of a later tick
                result = lib.hil_lockstep_apply_actuators(link, world, record)
            if result != ok:
                return int(result)
            done[0] = number + 1
            self._step()
        return int(ok)

    def release(self) -> None:
        """Let every motor coast, whatever state the other world is in."""
        with suppress(Exception):
            self._external.apply((0.0,) * self.wheels, (1.0,) * self.wheels)

    def step(self, ticks: int = 1, step_us: int = TICK_US) -> None:
        """Refuse: it steps in lockstep only."""
        raise NotImplementedError("an external world needs a robot in lockstep")

    def _step(self) -> None:
        duty, coast = self._motors
        lib.hil_external_get_drive(self.c, duty, coast)
        wheels = self._count
        motors = tuple(ffi.unpack(duty, wheels)), tuple(ffi.unpack(coast, wheels))
        self._call("apply", self._external.apply, *motors)
        self._call("step", self._external.step)
        before = list(self._outside.pose)
        self._now_s = self.time_s + TICK_US * 1e-6
        self._sense()
        self._set_twist(before)
        lib.hil_external_update(self.c, self._outside, TICK_US)

    def _set_twist(self, before: Sequence[float]) -> None:
        moved = [now - then for now, then in zip(self._outside.pose, before, strict=True)]
        moved[2] = math.remainder(moved[2], 2.0 * math.pi)
        self._outside.twist = [step * 1e6 / TICK_US for step in moved]

    def _sense(self) -> None:
        """Take over what the other world says now; the time is still that of the step's start."""
        sensed = self._call("sense", self._external.sense)
        if not isinstance(sensed, Sensed):
            raise self._wrong(f"gave {type(sensed).__name__}; it returns a hil_sim.external.Sensed")
        outside = self._outside
        wheels = self._count
        outside.edges[0:wheels] = self._counts(sensed.counts)
        outside.pose = self._numbers("pose", sensed.pose, 3)
        (outside.supply_V,) = self._numbers("supply_V", (sensed.supply_V,), 1)
        if outside.supply_V < 0.0:
            raise self._wrong(f"gave supply_V {sensed.supply_V}; must be 0 (not measured) or more")
        for field in ("wheel_rad_s", "current_A"):
            values = getattr(sensed, field)
            told = [_UNKNOWN] * wheels if values is None else self._numbers(field, values, wheels)
            getattr(outside, field)[0:wheels] = told
        self._take_fix(sensed.fix)

    def _take_fix(self, fix: Fix | None) -> None:
        self._outside.has_fix = fix is not None
        if fix is None:
            return
        if self.c.config.fix_rate_Hz > 0.0:
            message = "gave a fix, but the scenario has a pose sensor, too (world.fix_rate_Hz)"
            raise self._wrong(message, hint="use one of them: --set world.fix_rate_Hz=0, or no fixes from the world")
        taken_s, *pose = self._numbers("fix", [fix.taken_s, fix.x_m, fix.y_m, fix.theta_rad], 4)
        if not 0.0 <= taken_s <= self._now_s + 1e-9:
            raise self._wrong(f"gave a fix taken at {taken_s:g} s; must be 0 to now, {self._now_s:g} s")
        self._outside.fix_taken_us = round(taken_s * 1e6)
        self._outside.fix = pose

    def _counts(self, counts: Any) -> list[float]:
        values = self._call("sense", _listed, counts)
        if len(values) != self._count:
            raise self._wrong(f"gave {len(values)} counts; the robot has {self._count} wheels")
        try:
            whole = list(map(operator.index, values))
        except TypeError:
            raise self._wrong(f"gave counts {values}; must be of type int") from None
        if max(map(abs, whole)) > _COUNTS_MAX:
            raise self._wrong(f"gave counts {whole}; must be at most 2^53")
        return list(map(float, whole))

    def _numbers(self, what: str, given: Any, count: int) -> list[float]:
        values = self._call("sense", _floats, given)
        if len(values) != count:
            raise self._wrong(f"gave {len(values)} numbers as {what}; {count} are needed")
        if not all(map(math.isfinite, values)):
            raise self._wrong(f"gave {what} {', '.join(map(str, values))}; all numbers must be finite")
        if max(map(abs, values)) > _LARGEST:
            raise self._wrong(f"gave {what} {', '.join(map(str, values))}; must be at most {_LARGEST:g}")
        return values

    def _wrong(self, message: str, hint: str = "") -> ExternalWorldError:
        return ExternalWorldError(f"{self.name}.sense {message}; at {self._now_s:.3f} s", hint=hint)

    def _call(self, method: str, function: Callable[..., Result], *arguments: Any) -> Result:
        try:
            return function(*arguments)
        except (Exception, SystemExit) as error:
            message = f"{self.name}.{method} failed at {self._now_s:.3f} s: {_said(error)}"
            raise ExternalWorldError(message, hint=_where(error, function)) from error


def _listed(given: Any) -> list[Any]:
    return list(given)


def _floats(given: Any) -> list[float]:
    return list(map(float, given))


def outside_world(scenario: Scenario, world: ExternalWorld) -> OutsideWorld:
    """Return the electronics of a scenario around a world; ExternalWorldInputError if it asks for what that lacks."""
    check_scenario(scenario, world)
    return OutsideWorld(scenario_world(scenario), world)
