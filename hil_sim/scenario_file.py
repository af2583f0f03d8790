# SPDX-License-Identifier: MIT
"""Writes a checked scenario as a file of its own, which reads back as the same scenario: for runs worth keeping."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import tomli_w

from hil_sim.faults import Fault
from hil_sim.scenario import UNTIL_DONE, Event, Scenario
from hil_sim.schema import WORLD
from omni_schema import Parameter, ParameterTable, Robot
from omniwheel import files
from omniwheel.paths import robots_dir


def scenario_document(scenario: Scenario) -> dict[str, Any]:
    """Return the scenario as plain data: what its file says with ``extends`` resolved; robots by name or path."""
    table = scenario.robot.table
    wheel_lists = {name: list(values) for name, values in scenario.wheel_numbers.items()}
    head: dict[str, Any] = {
        "name": scenario.name,
        "description": scenario.description,
        "robot": robot_reference(scenario.robot),
        "seed": scenario.seed,
        "duration_s": UNTIL_DONE if scenario.duration_s is None else scenario.duration_s,
    }
    if scenario.world_robot is not None:
        head["world_robot"] = robot_reference(scenario.world_robot)
    return {
        "scenario": head,
        "parameters": {name: _value(table, name, value) for name, value in scenario.parameters.items()},
        "world": {"plant": scenario.plant, "start_pose": list(scenario.start_pose), **scenario.world, **wheel_lists},
        "dispersion": {entry.quantity: entry.document() for entry in scenario.dispersion},
        "event": [_event(event, table) for event in scenario.events],
        "fault": [_fault(fault) for fault in scenario.faults],
        "patch": [patch.document() for patch in scenario.patches],
        "compare": dict(scenario.compared),
    }


def robot_reference(robot: Robot) -> str:
    """Return what a scenario calls this robot: the name of a packaged one, the path of any other."""
    path = Path(robot.source)
    return path.stem if path.resolve().parent == robots_dir().resolve() else str(path.resolve())


def write_scenario(scenario: Scenario, path: Path, comment: str) -> None:
    """Write a scenario file; robot files that do not come with the package are copied beside it. Raises OSError."""
    document = scenario_document(scenario)
    for key in ("robot", "world_robot"):
        robot = document["scenario"].get(key, "")
        if os.sep in robot:
            copy = path.with_name(f"{Path(robot).stem}.{key}.toml")
            files.write_bytes(copy, Path(robot).read_bytes())
            document["scenario"][key] = copy.name
    text = f"# {comment}\n{tomli_w.dumps(document)}"
    files.write_text(path, text)


def _value(table: ParameterTable, name: str, value: float) -> Any:
    parameter: Parameter = table[name]
    if parameter.kind == "enum":
        return next(text for text, number in parameter.values.items() if number == value)
    if parameter.kind == "bool":
        return bool(value)
    return int(value) if parameter.kind == "int" else value


def _event(event: Event, table: ParameterTable) -> dict[str, Any]:
    entry: dict[str, Any] = {"at_s": event.at_s} if event.at_s is not None else {"at_progress": event.at_progress}
    if event.settings is not None:
        entry["set"] = {name: _value(table, name, value) for name, value in event.settings.items()}
    elif event.velocity is not None:
        entry["velocity"] = list(event.velocity)
    elif event.duty is not None:
        entry["duty"] = list(event.duty)
    else:
        entry["command"] = event.command
    return entry


def _fault(fault: Fault) -> dict[str, Any]:
    kind = WORLD.faults[fault.name]
    entry: dict[str, Any] = {"kind": fault.name, "start_s": fault.start_s}
    if math.isfinite(fault.stop_s):
        entry["stop_s"] = fault.stop_s
    if kind.wheel:
        entry["wheel"] = fault.wheel + 1
    if kind.value is not None and fault.value != kind.default:
        entry["value"] = fault.value
    return entry
