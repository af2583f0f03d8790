# SPDX-License-Identifier: MIT
"""Robot files: the numbers that make the general firmware one particular robot."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni_schema.errors import SchemaError
from omni_schema.flow import flow_values, parse_flow
from omni_schema.gyro import gyro_values, parse_gyro
from omni_schema.parameters import Parameter, ParameterTable
from omni_schema.toml_file import (
    read_toml,
    refuse_misplaced_parameters,
    refuse_unknown_keys,
    take_number,
    take_table,
    take_text,
)
from omni_schema.wiring import BOARD_KEYS, BoardWiring, parse_board_wiring

SECTIONS = (
    "robot",
    "geometry",
    "encoder",
    "motor",
    "wiring",
    "gyro",
    "flow",
    "parameters",
    "simulation",
)
KEYED_SECTIONS = ("geometry", "encoder", "motor", "wiring", "simulation")
WHEELS_KEY = "geometry.wheels"

_ROBOT_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")


@dataclass(frozen=True)
class Robot:
    """One robot file, checked against the parameter table.

    ``geometry``, ``encoder``, ``motor`` and ``wiring`` are the file's sections (units are in the key names),
    ``simulation`` what the simulated world adds, ``board`` the processor's pins.
    """

    source: str
    name: str
    description: str
    wheels: int
    geometry: Mapping[str, Any]
    encoder: Mapping[str, Any]
    motor: Mapping[str, Any]
    wiring: Mapping[str, Any]
    simulation: Mapping[str, float | list[float]]
    board: BoardWiring
    overrides: Mapping[str, float]
    table: ParameterTable

    def parameter_values(self) -> dict[str, float]:
        """Return every parameter of the table by name: the file's numbers, defaults for the rest."""
        return {**self.table.defaults(), **self.overrides}


def load_robot(path: Path | str, table: ParameterTable) -> Robot:
    """Read and check a robot file; raise SchemaError if anything in it is wrong."""
    return parse_robot(read_toml(Path(path)), table, str(path))


def parse_robot(document: Mapping[str, Any], table: ParameterTable, source: str) -> Robot:
    """Build a robot from a parsed document; ``source`` names it in errors."""
    refuse_misplaced_parameters(source, document)
    refuse_unknown_keys(source, "", document, SECTIONS)
    sections = {name: copy.deepcopy(take_table(source, name, document.get(name, {}))) for name in SECTIONS}
    name, description = _identity(source, sections["robot"])
    wheels = _wheel_count(source, sections, table)
    _refuse_unknown_section_keys(source, sections, table)
    overrides = _keyed_values(source, sections, table, wheels)
    given = {name: sections[name] if name in document else None for name in ("gyro", "flow")}
    gyro = parse_gyro(source, given["gyro"], sections["parameters"], table.gyro_chips)
    flow = parse_flow(source, given["flow"], sections["parameters"], table.flow_chips)
    if gyro is not None:
        overrides.update({name: table[name].parse(source, "gyro", value) for name, value in gyro_values(gyro).items()})
    if flow is not None:
        overrides.update({name: table[name].parse(source, "flow", value) for name, value in flow_values(flow).items()})
    overrides.update(_named_values(source, sections["parameters"], table))
    return Robot(
        source=source,
        name=name,
        description=description,
        wheels=wheels,
        geometry=sections["geometry"],
        encoder=sections["encoder"],
        motor=sections["motor"],
        wiring=sections["wiring"],
        simulation=_simulation(source, sections["simulation"]),
        board=parse_board_wiring(source, sections["wiring"], wheels, table.motor_drivers, gyro, flow),
        overrides=overrides,
        table=table,
    )


def _identity(source: str, section: dict[str, Any]) -> tuple[str, str]:
    refuse_unknown_keys(source, "robot.", section, ("name", "description"))
    if "name" not in section:
        raise SchemaError(source, "robot.name", "is missing; give the robot a name")
    name = take_text(source, "robot.name", section["name"])
    if not _ROBOT_NAME.fullmatch(name):
        problem = f"is {name!r}; a letter, then up to 31 of a-z 0-9 _"
        raise SchemaError(source, "robot.name", problem)
    description = section.get("description", "")
    return name, take_text(source, "robot.description", description)


def _parameters_by_key(table: ParameterTable) -> dict[str, list[Parameter]]:
    by_key: dict[str, list[Parameter]] = {}
    for parameter in table.parameters:
        if parameter.robot_key is not None:
            by_key.setdefault(parameter.robot_key, []).append(parameter)
    return by_key


def _wheel_count(source: str, sections: dict[str, dict[str, Any]], table: ParameterTable) -> int:
    parameters = _parameters_by_key(table).get(WHEELS_KEY)
    if parameters is None:
        raise SchemaError(table.source, WHEELS_KEY, "no parameter has this robot_key")
    if "wheels" not in sections["geometry"]:
        allowed = parameters[0].allowed
        raise SchemaError(source, WHEELS_KEY, f"is missing; say how many wheels: {allowed}")
    return int(parameters[0].parse(source, WHEELS_KEY, sections["geometry"]["wheels"]))


def _refuse_unknown_section_keys(source: str, sections: dict[str, dict[str, Any]], table: ParameterTable) -> None:
    known: dict[str, list[str]] = {name: [] for name in KEYED_SECTIONS}
    for key in [*_parameters_by_key(table), *BOARD_KEYS]:
        section, _, leaf = key.partition(".")
        if section not in known:
            raise SchemaError(table.source, key, f"robot_key must start with one of {list(known)}")
        known[section].append(leaf)
    for section, leaves in known.items():
        if section == "simulation":
            continue  # the world reads more of it than the robot does
        refuse_unknown_keys(source, f"{section}.", sections[section], leaves)


def _keyed_values(
    source: str, sections: dict[str, dict[str, Any]], table: ParameterTable, wheels: int
) -> dict[str, float]:
    values: dict[str, float] = {}
    for key, parameters in _parameters_by_key(table).items():
        section, _, leaf = key.partition(".")
        if leaf not in sections[section]:
            continue
        given = sections[section][leaf]
        if parameters[0].wheel is None:
            values[parameters[0].name] = parameters[0].parse(source, key, given)
            continue
        if not isinstance(given, list) or len(given) != wheels:
            raise SchemaError(source, key, f"is {given!r}; a list of {wheels} numbers is needed, one per wheel")
        for parameter, number in zip(parameters, given, strict=False):
            item = f"{key}[{parameter.wheel}]"
            values[parameter.name] = parameter.parse(source, item, number)
    return values


def _named_values(source: str, section: dict[str, Any], table: ParameterTable) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, given in section.items():
        key = f"parameters.{name}"
        parameter = table.find(source, key, name)
        if parameter.robot_key is not None:
            problem = f"is set by the key {parameter.robot_key}; give the number there"
            raise SchemaError(source, key, problem)
        values[name] = parameter.parse(source, key, given)
    return values


def _simulation(source: str, section: dict[str, Any]) -> dict[str, float | list[float]]:
    checked: dict[str, float | list[float]] = {}
    for name, given in section.items():
        key = f"simulation.{name}"
        if isinstance(given, list):
            checked[name] = [take_number(source, f"{key}[{i}]", item) for i, item in enumerate(given)]
        else:
            checked[name] = take_number(source, key, given)
    return checked
