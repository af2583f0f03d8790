# SPDX-License-Identifier: MIT
"""Scenario files: one experiment with one robot in one world, written down so that it can be repeated.

A scenario is a TOML file::

    [scenario]
    name = "demo"                 # a-z 0-9 _
    description = "what it shows"
    extends = "demo"              # optional: start from another scenario; tables are merged, lists replaced
    robot = "three_wheel"         # a robot of the package, or the path of a robot file
    seed = 1
    duration_s = "until_done"     # seconds, or until the trajectory is done

    [parameters]                  # set before arming, over the robot file
    [world]                       # numbers of world.toml, over those of the robot file
    plant = "full"                # what stands in for the robot: one of PLANTS
    [dispersion]                  # what differs from run to run: see dispersion.py
    [[event]]                     # at_s, or at_progress (share of the path); and one of set, command, velocity, duty
    [[fault]]                     # kind, start_s, and where they apply stop_s, wheel (from 1), value
    [[patch]]                     # of the floor, with another friction: see patches.py
    [compare]                     # scenarios to run beside this one, with a heading each; not inherited
    no_slip = "no slip"

Every mistake in a scenario is a SchemaError, one in its robot file a RobotFileError; both name file, key, value and
what is allowed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from hil_sim.dispersion import Dispersion, parse_dispersion
from hil_sim.faults import Fault
from hil_sim.limits import MAX_DURATION_S, MAX_SEED
from hil_sim.patches import FloorPatch, parse_patches
from hil_sim.schema import WORLD, WORLD_LISTS, WORLD_NUMBERS
from hil_sim.world import DEFAULT_PLANT, PLANTS
from omni_schema import ParameterTable, Robot, SchemaError
from omni_schema.errors import did_you_mean
from omni_schema.toml_file import (
    read_toml,
    refuse_misplaced_parameters,
    refuse_unknown_keys,
    take_number,
    take_table,
    take_text,
)
from omni_schema.world import FaultKind
from omniwheel.robots import read_robot

UNTIL_DONE: Literal["until_done"] = "until_done"
COMMANDS = ("arm", "disarm", "estop", "trajectory_start", "trajectory_stop")

START_POSE = WORLD.numbers["start_pose"]
_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
_SECTIONS = ("scenario", "parameters", "world", "dispersion", "event", "fault", "patch", "compare")
_MERGED = ("scenario", "parameters", "world", "dispersion")
_ACTIONS = ("set", "command", "velocity", "duty")
_HEAD = ("name", "description", "extends", "robot", "world_robot", "seed", "duration_s")


@dataclass(frozen=True)
class Event:
    """Something that is done to the robot at a time [s], or at a share of the path. Exactly one of the two is given.

    ``settings`` are parameter values, ``command`` one of COMMANDS. ``velocity`` is a body twist (m/s, m/s, rad/s) and
    ``duty`` open-loop duties -1..1 (one per wheel), asked for from then on. Exactly one of the four is given.
    """

    at_s: float | None = None
    at_progress: float | None = None
    settings: Mapping[str, float] | None = None
    command: str | None = None
    velocity: tuple[float, float, float] | None = None
    duty: tuple[float, ...] | None = None

    def describe(self) -> str:
        """Return the event in a few words, for tables and plots."""
        if self.settings is not None:
            return ", ".join(f"{name} = {value:g}" for name, value in self.settings.items())
        if self.velocity is not None:
            return "velocity " + ", ".join(f"{value:g}" for value in self.velocity)
        if self.duty is not None:
            return "duty " + ", ".join(f"{value:g}" for value in self.duty)
        return str(self.command).replace("_", " ")


@dataclass(frozen=True)
class Scenario:
    """A checked scenario. ``duration_s`` None means until the trajectory is done.

    ``world_robot`` is the robot that is really there where that is another one than the firmware believes: crossed
    wires, turned motors, another encoder. None: the firmware is right. ``wheel_numbers`` are those of ``[world]`` of
    which each wheel has its own. ``compared`` has the scenarios to run beside this one, with a heading each.
    """

    source: str
    name: str
    description: str
    robot: Robot
    seed: int
    duration_s: float | None
    parameters: Mapping[str, float]
    world: Mapping[str, float]
    start_pose: tuple[float, float, float]
    events: tuple[Event, ...]
    faults: tuple[Fault, ...]
    plant: str = DEFAULT_PLANT
    world_robot: Robot | None = None
    dispersion: tuple[Dispersion, ...] = ()
    wheel_numbers: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    patches: tuple[FloorPatch, ...] = ()
    compared: Mapping[str, str] = field(default_factory=dict)

    def parameter_values(self) -> dict[str, float]:
        """Return every parameter the run starts with: defaults, robot file, scenario."""
        return {**self.robot.parameter_values(), **self.parameters}

    def with_seed(self, seed: int | None) -> Scenario:
        """Return the same scenario with another seed; None keeps its own."""
        if seed is None:
            return self
        if not 0 <= seed <= MAX_SEED:
            raise SchemaError(self.source, "scenario.seed", f"is {seed}; must be a whole number from 0 to {MAX_SEED}")
        return replace(self, seed=seed)

    def with_plant(self, plant: str | None) -> Scenario:
        """Return the same scenario with another plant; None keeps its own."""
        return self if plant is None else replace(self, plant=_plant(self.source, plant))

    def with_parameters(self, values: Mapping[str, float]) -> Scenario:
        """Return the same scenario with other parameters; its events leave them alone."""
        events = tuple(kept for event in self.events if (kept := _without_settings(event, values)) is not None)
        return replace(self, parameters={**self.parameters, **values}, events=events)

    def with_world(self, values: Mapping[str, float]) -> Scenario:
        """Return the same scenario with other numbers of the world, by their names in ``[world]``; SchemaError."""
        return replace(self, world={**self.world, **_world(self.source, values)})

    def with_duration(self, duration_s: float | None) -> Scenario:
        """Return the same scenario with another end [s]; None keeps its own."""
        return self if duration_s is None else replace(self, duration_s=_duration(self.source, duration_s))

    def first_setting(self) -> Event | None:
        """Return the first event that changes parameters, the one that before and after are told apart by."""
        return next((event for event in self.events if event.settings is not None), None)


def _without_settings(event: Event, names: Mapping[str, float]) -> Event | None:
    if event.settings is None:
        return event
    left = {name: value for name, value in event.settings.items() if name not in names}
    return replace(event, settings=left) if left else None


def scenario_dir() -> Path:
    """Return the folder of the scenarios that come with the package."""
    return Path(__file__).resolve().parent / "scenarios"


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package."""
    return sorted(path.stem for path in scenario_dir().glob("*.toml"))


def find_scenario(name_or_path: str) -> Path:
    """Return the file of a packaged scenario, or the path itself if it is one; SchemaError if there is none."""
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    path = scenario_dir() / f"{name_or_path}.toml"
    if not path.is_file():
        names = scenario_names()
        guess = did_you_mean(name_or_path, names)
        raise SchemaError(
            name_or_path,
            "",
            f"unknown scenario{guess}; known are {', '.join(names)}",
            hint="give one of these names, or a .toml file of your own; `omni run --list` describes them",
        )
    return path


def load_scenario(name_or_path: str | Path, robot: str | None = None, world_robot: str | None = None) -> Scenario:
    """Read and check a scenario; ``robot`` and ``world_robot`` replace the file's."""
    path = find_scenario(str(name_or_path))
    document = _with_base(path, read_toml(path), ())
    for key, name in (("robot", robot), ("world_robot", world_robot)):
        if name is not None:
            document["scenario"] = {**take_table(str(path), "scenario", document.get("scenario", {})), key: name}
    return parse_scenario(document, str(path))


def parse_scenario(document: Mapping[str, Any], source: str) -> Scenario:
    """Build a scenario from a parsed document (``extends`` already resolved); ``source`` names it in errors."""
    refuse_misplaced_parameters(source, document)
    refuse_unknown_keys(source, "", document, _SECTIONS)
    head = take_table(source, "scenario", document.get("scenario", {}))
    refuse_unknown_keys(source, "scenario.", head, _HEAD)
    robot = _robot(source, _text(source, head, "robot"))
    table = robot.table
    world = dict(take_table(source, "world", document.get("world", {})))
    plant = _plant(source, world.pop("plant", DEFAULT_PLANT))
    start_pose = _start_pose(source, world.pop("start_pose", START_POSE.default))
    lists = {name: world.pop(name) for name in WORLD_LISTS if name in world}
    return Scenario(
        source=source,
        name=_name(source, head),
        description=_text(source, head, "description"),
        robot=robot,
        seed=_seed(source, head.get("seed", 1)),
        duration_s=_duration(source, head.get("duration_s", UNTIL_DONE)),
        parameters=_parameters(source, "parameters", document.get("parameters", {}), table),
        world=_world(source, world),
        start_pose=start_pose,
        events=tuple(
            _event(source, f"event[{i + 1}]", entry, robot)
            for i, entry in enumerate(_entries(source, "event", document.get("event", [])))
        ),
        faults=tuple(
            _fault(source, f"fault[{i + 1}]", entry, robot.wheels)
            for i, entry in enumerate(_entries(source, "fault", document.get("fault", [])))
        ),
        plant=plant,
        world_robot=_world_robot(source, head, robot),
        dispersion=parse_dispersion(source, document.get("dispersion", {})),
        wheel_numbers={name: _per_wheel(source, name, value, robot.wheels) for name, value in lists.items()},
        patches=_patches(source, plant, document.get("patch", [])),
        compared=_compared(source, document.get("compare", {})),
    )


def _compared(source: str, value: object) -> dict[str, str]:
    entries = take_table(source, "compare", value)
    for name in entries:
        find_scenario(name)
    return {name: take_text(source, f"compare.{name}", heading) for name, heading in entries.items()}


def _world_robot(source: str, head: Mapping[str, Any], robot: Robot) -> Robot | None:
    if "world_robot" not in head:
        return None
    found = _robot(source, _text(source, head, "world_robot"))
    if found.wheels != robot.wheels:
        problem = f"has {found.wheels} wheels; the firmware's robot has {robot.wheels}"
        raise SchemaError(source, "scenario.world_robot", problem)
    return found


def _with_base(path: Path, document: dict[str, Any], seen: tuple[Path, ...]) -> dict[str, Any]:
    head = dict(take_table(str(path), "scenario", document.get("scenario", {})))
    base_name = head.pop("extends", None)
    if base_name is None:
        return document
    base_text = take_text(str(path), "scenario.extends", base_name)
    base_path = find_scenario(base_text if "/" not in base_text else str(path.parent / base_text))
    if base_path.resolve() in (*seen, path.resolve()):
        raise SchemaError(str(path), "scenario.extends", f"is {base_text!r}, which refers back to this file")
    base = _with_base(base_path, read_toml(base_path), (*seen, path.resolve()))
    merged = {key: value for key, value in base.items() if key != "compare"}
    merged.update({key: value for key, value in document.items() if key not in _MERGED})
    for key in _MERGED:
        own = head if key == "scenario" else document.get(key, {})
        merged[key] = {**base.get(key, {}), **take_table(str(path), key, own)}
    return merged


def _robot(source: str, name_or_path: str) -> Robot:
    """Read a robot by name, or by a path that is relative to the scenario file or to the working folder."""
    beside = Path(source).parent / name_or_path
    return read_robot(beside if name_or_path.endswith(".toml") and beside.is_file() else name_or_path)


def _text(source: str, head: Mapping[str, Any], key: str) -> str:
    if key not in head:
        raise SchemaError(source, f"scenario.{key}", "is missing; must be a string")
    return take_text(source, f"scenario.{key}", head[key])


def _name(source: str, head: Mapping[str, Any]) -> str:
    name = _text(source, head, "name")
    if not _NAME.fullmatch(name):
        raise SchemaError(source, "scenario.name", f"is {name!r}; must be a letter, then up to 63 of a-z 0-9 _")
    return name


def _seed(source: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MAX_SEED:
        raise SchemaError(source, "scenario.seed", f"is {value!r}; must be a whole number from 0 to {MAX_SEED}")
    return value


def _duration(source: str, value: object) -> float | None:
    if value == UNTIL_DONE:
        return None
    allowed = f'must be "{UNTIL_DONE}" or seconds from 0.1 to {MAX_DURATION_S:g}'
    if isinstance(value, str):
        raise SchemaError(source, "scenario.duration_s", f"is {value!r}; {allowed}")
    return _in_range(source, "scenario.duration_s", value, 0.1, MAX_DURATION_S)


def _in_range(source: str, key: str, value: object, low: float, high: float) -> float:
    number = take_number(source, key, value)
    if not low <= number <= high:
        raise SchemaError(source, key, f"is {number:g}; must be a number from {low:g} to {high:g}")
    return number


def _vector(source: str, key: str, value: object) -> tuple[float, float, float]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 3:
        raise SchemaError(source, key, f"is {value!r}; must be a list of three numbers")
    x, y, theta = (take_number(source, f"{key}[{i + 1}]", item) for i, item in enumerate(value))
    return x, y, theta


def _start_pose(source: str, value: object) -> tuple[float, float, float]:
    x, y, theta = _vector(source, "world.start_pose", value)
    for number, item in enumerate((x, y, theta)):
        START_POSE.parse(source, f"world.start_pose[{number + 1}]", item)
    return x, y, theta


def _parameters(source: str, key: str, value: object, table: ParameterTable) -> dict[str, float]:
    values = {}
    for name, given in take_table(source, key, value).items():
        values[name] = table.find(source, f"{key}.{name}", name).parse(source, f"{key}.{name}", given)
    return values


def _plant(source: str, value: object) -> str:
    name = take_text(source, "world.plant", value)
    if name not in PLANTS:
        hint = did_you_mean(name, PLANTS)
        raise SchemaError(source, "world.plant", f"is {name!r}{hint}; must be one of {', '.join(PLANTS)}")
    return name


def _world(source: str, world: Mapping[str, Any]) -> dict[str, float]:
    refuse_unknown_keys(source, "world.", world, (*WORLD_NUMBERS, *WORLD_LISTS, "plant", "start_pose"))
    return {name: WORLD_NUMBERS[name].parse(source, f"world.{name}", value) for name, value in world.items()}


def _per_wheel(source: str, name: str, value: object, wheels: int) -> tuple[float, ...]:
    key = f"world.{name}"
    if not isinstance(value, list):
        return (WORLD_LISTS[name].parse(source, key, value),) * wheels
    if len(value) != wheels:
        problem = f"has {len(value)} numbers; {wheels} are needed, one per wheel, or one number for all"
        raise SchemaError(source, key, problem)
    return tuple(WORLD_LISTS[name].parse(source, f"{key}[{i + 1}]", item) for i, item in enumerate(value))


def _patches(source: str, plant: str, value: object) -> tuple[FloorPatch, ...]:
    patches = parse_patches(source, _entries(source, "patch", value))
    if patches and plant != DEFAULT_PLANT:
        raise SchemaError(source, "patch", f"the plant {plant} has no floor with patches; only {DEFAULT_PLANT} has")
    return patches


def _entries(source: str, key: str, value: object) -> list[dict[str, Any]]:
    if not isinstance(value, list):
        raise SchemaError(source, key, f"is {value!r}; write each as a table [[{key}]]")
    return [take_table(source, f"{key}[{i + 1}]", entry) for i, entry in enumerate(value)]


def _exactly_one(source: str, key: str, entry: Mapping[str, Any], names: Sequence[str]) -> str:
    given = [name for name in names if name in entry]
    if len(given) != 1:
        raise SchemaError(source, key, f"has {' and '.join(given) or 'none'} of {', '.join(names)}; give exactly one")
    return given[0]


def _event(source: str, key: str, entry: dict[str, Any], robot: Robot) -> Event:
    refuse_unknown_keys(source, f"{key}.", entry, ("at_s", "at_progress", *_ACTIONS))
    when = _exactly_one(source, key, entry, ("at_s", "at_progress"))
    limit = MAX_DURATION_S if when == "at_s" else 1.0
    moment = _in_range(source, f"{key}.{when}", entry[when], 0.0, limit)
    at_s, at_progress = (moment, None) if when == "at_s" else (None, moment)
    what = _exactly_one(source, key, entry, _ACTIONS)
    if what == "set":
        return Event(at_s, at_progress, settings=_parameters(source, f"{key}.set", entry["set"], robot.table))
    if what == "duty":
        return Event(at_s, at_progress, duty=_duty(source, f"{key}.duty", entry["duty"], robot.wheels))
    if what == "velocity":
        return Event(at_s, at_progress, velocity=_vector(source, f"{key}.velocity", entry["velocity"]))
    command = take_text(source, f"{key}.command", entry["command"])
    if command not in COMMANDS:
        hint = did_you_mean(command, COMMANDS)
        raise SchemaError(source, f"{key}.command", f"is {command!r}{hint}; must be one of {', '.join(COMMANDS)}")
    return Event(at_s, at_progress, command=command)


def _duty(source: str, key: str, value: object, wheels: int) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != wheels:
        raise SchemaError(source, key, f"is {value!r}; must be a list of {wheels} numbers, one per wheel")
    return tuple(_in_range(source, f"{key}[{i + 1}]", item, -1.0, 1.0) for i, item in enumerate(value))


def _fault(source: str, key: str, entry: dict[str, Any], wheels: int) -> Fault:
    refuse_unknown_keys(source, f"{key}.", entry, ("kind", "wheel", "start_s", "stop_s", "value"))
    name = take_text(source, f"{key}.kind", entry.get("kind"))
    if name not in WORLD.faults:
        hint = did_you_mean(name, WORLD.faults)
        raise SchemaError(source, f"{key}.kind", f"is {name!r}{hint}; must be one of {', '.join(WORLD.faults)}")
    kind = WORLD.faults[name]
    if ("wheel" in entry) != kind.wheel:
        raise SchemaError(source, f"{key}.wheel", f"{'is needed' if kind.wheel else 'does not apply'} for {name}")
    start_s = _in_range(source, f"{key}.start_s", entry.get("start_s"), 0.0, MAX_DURATION_S)
    stop_s = entry.get("stop_s")
    return Fault(
        name=name,
        start_s=start_s,
        stop_s=math.inf if stop_s is None else _in_range(source, f"{key}.stop_s", stop_s, start_s, MAX_DURATION_S),
        wheel=int(_in_range(source, f"{key}.wheel", entry.get("wheel", 1), 1, wheels)) - 1,
        value=_fault_value(source, f"{key}.value", entry.get("value"), kind),
    )


def _fault_value(source: str, key: str, value: object, kind: FaultKind) -> float:
    if value is None:
        if kind.default is None:
            raise SchemaError(source, key, f"is needed for {kind.name}")
        return kind.default
    if kind.value is None:
        raise SchemaError(source, key, f"does not apply to {kind.name}")
    return kind.value.parse(source, key, value)
