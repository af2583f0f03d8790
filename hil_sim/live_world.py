# SPDX-License-Identifier: MIT
"""Commands for a world that runs in real time: faults on and off, and how fast it runs.

A command is one line with a JSON object, one of::

    {"fault": "encoder_stuck", "wheel": 1, "on": true}     wheel from 1, where the fault is one wheel's
    {"fault": "battery_sag", "on": true, "value": 7.5}     value may be left out; "on": false ends it
    {"fault": "wheel_turned", "wheel": 1, "on": true, "duration_s": 2}     it ends by itself, in simulated time
    {"mend": true}                                         end all faults that are on
    {"speed": 0.25}                                        times real time, one of SPEEDS
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hil_sim.external import REFUSED_FAULTS, OutsideWorld
from hil_sim.faults import MAX_FAULTS, Fault
from hil_sim.live_faults import ICE, LIVE_FAULTS, LiveFault
from hil_sim.lockstep import LockstepLink
from hil_sim.scenario import Scenario
from hil_sim.schema import WORLD, WORLD_NUMBERS
from hil_sim.world import World
from omni_schema import SchemaError
from omni_schema.errors import did_you_mean
from omni_schema.toml_file import refuse_unknown_keys
from omni_schema.world import Range
from omniwheel.errors import OmniError

SPEEDS = (0.25, 0.5, 1.0, 2.0)
"""Times real time. Programs beat once per second of their own clock: beyond 2 a robot takes them for lost."""
MOST_CHARACTERS = 1000
_ICY_PLANTS = ("full", "slip")
"""Those in which a wheel holds on to the floor by friction."""
_KINDS = ("fault", "mend", "speed")
_BELOW_LIMIT = 0.9


class CommandLineError(OmniError):
    """A line is no command; the message says why. Nothing was changed."""

    exit_code = 2


@dataclass(frozen=True)
class _Switch:
    """A fault to be switched; ``wheel`` from 0, None where it has none."""

    name: str
    wheel: int | None
    on: bool
    value: float
    duration_s: float = math.inf


class LiveWorld:
    """What is broken now in a world under way, and how fast it runs. For the thread that runs the world."""

    def __init__(self, scenario: Scenario, link: LockstepLink, world: World) -> None:
        self.speed = 1.0
        self._link, self._world = link, world
        self._faults = list(scenario.faults)
        self._friction = float(world.c.config.friction_coefficient)
        self._icy = False
        gyro = world.c.config.gyro_rate_Hz > 0.0 and scenario.parameter_values()["GYRO_AXIS"] != 0.0
        flow = world.c.config.flow_rate_Hz > 0.0 and scenario.parameter_values()["FLOW_MODE"] != 0.0
        fixes, plant_slips = world.c.config.fix_rate_Hz > 0.0, scenario.plant in _ICY_PLANTS
        self._known = {
            fault.name: fault
            for fault in LIVE_FAULTS
            if (fixes or not fault.needs_fixes)
            and (gyro or not fault.needs_gyro)
            and (flow or not fault.needs_flow)
            and (plant_slips or fault.name != ICE)
            and not (isinstance(world, OutsideWorld) and fault.name in (ICE, *REFUSED_FAULTS))
        }
        self._least_supply_V = scenario.parameter_values()["BAT_V_MIN"]

    def catalogue(self) -> dict[str, Any]:
        """Return what there is to choose, in words, as plain data: ``faults``, and ``speeds`` times real time.

        A fault's ``wheels`` are numbers from 1, or none.
        """
        wheels = list(range(1, self._world.wheels + 1))
        return {
            "speeds": list(SPEEDS),
            "faults": [
                {
                    "name": fault.name,
                    "group": fault.group,
                    "words": fault.words,
                    "reaction": fault.reaction,
                    "wheels": wheels if _has_wheel(fault.name) else [],
                }
                for fault in self._known.values()
            ],
        }

    def state(self) -> dict[str, Any]:
        """Return what is on now, the scenario's own faults, too, and the speed, as plain data."""
        now_s = self._world.time_s
        active = [fault for fault in self._faults if fault.start_s <= now_s < fault.stop_s]
        on: list[dict[str, Any]] = [
            {"fault": fault.name, "wheel": fault.wheel + 1 if _has_wheel(fault.name) else None} for fault in active
        ]
        if self._icy:
            on.append({"fault": ICE, "wheel": None})
        return {"on": on, "speed": self.speed}

    def apply_command(self, line: str) -> None:
        """Do what one line asks for. Raises CommandLineError; then nothing has changed."""
        try:
            self._do(_parsed(line))
        except SchemaError as error:
            raise CommandLineError(f"{error}. No fault or speed was changed") from error

    def _do(self, command: Mapping[str, Any]) -> None:
        kind = next(iter(kind for kind in _KINDS if kind in command), None)
        if kind == "fault":
            self._switch(self._parse_switch(command))
        elif kind == "speed":
            refuse_unknown_keys("command", "", command, ["speed"])
            self._set_speed(command["speed"])
        elif kind == "mend":
            refuse_unknown_keys("command", "", command, ["mend"])
            if command["mend"] is not True:
                raise SchemaError("command", "mend", f"is {command['mend']!r}; must be true")
            self._clear_faults()
        else:
            raise SchemaError("command", "", f"has none of {', '.join(_KINDS)}")

    def _set_speed(self, speed: object) -> None:
        if isinstance(speed, bool) or not isinstance(speed, int | float) or speed not in SPEEDS:
            allowed = ", ".join(f"{one:g}" for one in SPEEDS)
            raise SchemaError("command", "speed", f"is {speed!r}; must be one of {allowed}")
        self.speed = float(speed)
        self._link.set_realtime_factor(self.speed)

    def _clear_faults(self) -> None:
        now_s = self._world.time_s
        self._set_faults([fault for fault in self._faults if fault.start_s > now_s])
        self._set_icy(False)

    def _switch(self, switch: _Switch) -> None:
        if switch.name == ICE:
            self._set_icy(switch.on, switch.value)
            return
        now_s, wheel = self._world.time_s, switch.wheel or 0
        faults = [
            fault
            for fault in self._faults
            if fault.start_s > now_s or (fault.stop_s > now_s and (fault.name, fault.wheel) != (switch.name, wheel))
        ]
        if switch.on:
            faults.append(Fault(switch.name, now_s, now_s + switch.duration_s, wheel=wheel, value=switch.value))
        self._set_faults(faults)

    def _set_faults(self, faults: Sequence[Fault]) -> None:
        if len(faults) > MAX_FAULTS:
            raise SchemaError("command", "fault", f"is one too many: at most {MAX_FAULTS} can be active")
        self._world.set_faults(faults)
        self._faults = list(faults)

    def _set_icy(self, icy: bool, friction: float = 0.0) -> None:
        self._world.set_friction(friction if icy else self._friction)
        self._icy = icy

    def _parse_switch(self, command: Mapping[str, Any]) -> _Switch:
        refuse_unknown_keys("command", "", command, ["fault", "wheel", "on", "value", "duration_s"])
        name, on, wheel = command["fault"], command.get("on"), command.get("wheel")
        if not isinstance(name, str) or name not in self._known:
            hint = did_you_mean(name, self._known) if isinstance(name, str) else ""
            raise SchemaError("command", "fault", f"is {name!r}{hint}; must be one of {', '.join(self._known)}")
        if not isinstance(on, bool):
            raise SchemaError("command", "on", f"is {on!r}; must be true or false")
        duration_s = _duration_s(name, on, command.get("duration_s"))
        if not _has_wheel(name):
            if wheel is not None:
                raise SchemaError("command", "wheel", f"does not apply to {name}")
            return _Switch(name, None, on, self._value(self._known[name], command.get("value")), duration_s)
        if isinstance(wheel, bool) or not isinstance(wheel, int) or not 1 <= wheel <= self._world.wheels:
            raise SchemaError("command", "wheel", f"is {wheel!r}; must be a wheel from 1 to {self._world.wheels}")
        return _Switch(name, wheel - 1, on, self._value(self._known[name], command.get("value")), duration_s)

    def _value(self, fault: LiveFault, value: object) -> float:
        allowed = _allowed(fault.name)
        if value is not None:
            if allowed is None:
                raise SchemaError("command", "value", f"does not apply to {fault.name}")
            return allowed.parse("command", "value", value)
        if fault.name == "battery_sag" and self._least_supply_V > 0.0 and fault.value is not None:
            return min(fault.value, _BELOW_LIMIT * self._least_supply_V)
        default = None if fault.name == ICE else WORLD.faults[fault.name].default
        return fault.value if fault.value is not None else default or 0.0


def _has_wheel(name: str) -> bool:
    return name != ICE and WORLD.faults[name].wheel


def _duration_s(name: str, on: bool, value: object) -> float:
    """Return how long a fault lasts [s]; without a value until it is switched off."""
    if value is None:
        return math.inf
    if name == ICE or not on:
        raise SchemaError("command", "duration_s", f"does not apply to {ICE if on else 'a fault that is switched off'}")
    if isinstance(value, bool) or not isinstance(value, int | float) or value <= 0.0:
        raise SchemaError("command", "duration_s", f"is {value!r}; must be a number above 0")
    return float(value)


def _allowed(name: str) -> Range | None:
    return WORLD_NUMBERS["friction_coefficient"] if name == ICE else WORLD.faults[name].value


def _parsed(line: str) -> Mapping[str, Any]:
    if len(line) > MOST_CHARACTERS:
        raise SchemaError("command", "", f"is longer than {MOST_CHARACTERS} characters")
    try:
        command = json.loads(line)
    except (ValueError, RecursionError) as error:
        shown = line if len(line) <= 60 else f"{line[:60]} ..."
        raise SchemaError("command", "", f"{shown.strip()!r} is not JSON") from error
    if not isinstance(command, dict):
        raise SchemaError("command", "", "is not a JSON object")
    if any(isinstance(value, float) and not math.isfinite(value) for value in command.values()):
        raise SchemaError("command", "", "has a number that is not finite")
    if sum(kind in command for kind in _KINDS) > 1:
        raise SchemaError("command", "", f"has more than one of {', '.join(_KINDS)}")
    return command
