# SPDX-License-Identifier: MIT
"""The pages of robot files and scenario files, from the programs that read them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

from hil_sim import dispersion, patches, scenario
from hil_sim.schema import WORLD
from omni_docs.markdown import code, escaped, page, table
from omni_schema import load_parameters
from omni_schema.gyro import KEYS as GYRO_KEYS
from omni_schema.robots import KEYED_SECTIONS, SECTIONS
from omni_schema.wiring import BOARD_KEYS
from omni_schema.world import FaultKind, Quantity

_BY_WHEEL = "list, one per wheel, or one number for all; "
_HEAD = ["Key", "Allowed", "From", "Meaning"]


def _robot_page(root: Path) -> str:
    known = load_parameters(root / "shared" / "params.toml")
    keys: dict[str, list[str]] = {}
    for parameter in known.values():
        if parameter.robot_key and parameter.robot_key not in keys:
            name = parameter.name.replace("1", "n", 1) if parameter.wheel is not None else parameter.name
            per = "list, one per wheel; " if parameter.wheel is not None else ""
            allowed = escaped(per + parameter.allowed)
            keys[parameter.robot_key] = [code(parameter.robot_key), code(name), allowed, escaped(parameter.doc)]
    return page(
        "# Robot file",
        "A TOML file that describes one robot. "
        "[Wiring and the robot file](../../guides/robot-file.md) says how to write one.",
        f"Sections: {', '.join(code(name) for name in SECTIONS)}. An unknown key is an error that names the key.",
        "## Keys that set parameters",
        f"These stand in {', '.join(code(name) for name in KEYED_SECTIONS)}.",
        table(["Key", "Parameter", "Allowed", "Meaning"], [keys[key] for key in sorted(keys)]),
        "## Pins of the processor",
        ", ".join(code(key) for key in BOARD_KEYS)
        + ". They are built into the firmware; [the guide](../../guides/robot-file.md#pins-wiring) explains each.",
        "## Gyro",
        f"The section `[gyro]` has {', '.join(code(key) for key in GYRO_KEYS)}. "
        "[The guide](../../guides/gyro.md#the-chip) explains each. Without the section there is no gyro. Chips:",
        table(
            ["Chip", "From", "Addresses", "Noise [mdps per √Hz]", "Filters' delay [ms]"],
            [
                [
                    code(chip.name),
                    chip.doc,
                    " or ".join(code(f"0x{address:02X}") for address in chip.addresses),
                    f"{1e3 * chip.noise_dps:g}",
                    f"{chip.delay_ms:g}",
                ]
                for chip in known.gyro_chips.values()
            ],
        ),
        "## Everything else",
        "`[parameters]` sets any parameter by its [name](parameters.md). "
        "`[simulation]` is what the simulated world adds: "
        "[the world's numbers](scenario.md#world), and for MuJoCo and exports "
        "[how the wheels are built](../../guides/robot-file.md#rollers).",
    )


def _needs(fault: FaultKind) -> str:
    value = "" if fault.value is None else f"{code('value')}: {escaped(fault.value.allowed)}"
    optional = "" if fault.value is None or fault.default is None else f"; {fault.default:g} if left out"
    return ", ".join(part for part in (code("wheel") if fault.wheel else "", value + optional) if part)


def _comes_from(quantity: Quantity) -> str:
    if quantity.robot_key is not None:
        return code(quantity.robot_key)
    numbers = quantity.default if isinstance(quantity.default, tuple) else (quantity.default or 0.0,)
    return ", ".join(f"{number:g}" for number in numbers)


def _allowed(quantity: Quantity) -> str:
    return (_BY_WHEEL if quantity.list_in_scenario else "") + quantity.allowed


def _number_rows(only: Callable[[Quantity], bool]) -> list[list[str]]:
    return [
        [code(quantity.name), escaped(_allowed(quantity)), _comes_from(quantity), escaped(quantity.doc)]
        for quantity in WORLD.numbers.values()
        if only(quantity)
    ]


def _sensor_rows() -> list[list[str]]:
    rows = []
    for sensor in WORLD.sensors.values():
        reading = sensor.reading
        told = [reading.name, reading.unit, reading.valid] if reading else ["", "", ""]
        rows.append([code(sensor.name), *map(code, told), escaped(sensor.doc)])
    return rows


def _scenario_page() -> str:
    about = inspect.getdoc(scenario) or ""
    spread = inspect.getdoc(dispersion) or ""
    return page(
        "# Scenario file",
        "A TOML file that describes one experiment: a robot, a world, and what happens. "
        f"These come with the package: {', '.join(code(name) for name in scenario.scenario_names())}.",
        f"```text\n{about}\n```",
        "## World",
        "Numbers of `[world]`. What is left out comes from the robot file's key, else it has the number given here.",
        table(_HEAD, _number_rows(lambda quantity: not quantity.robot_only)),
        "These stand in the robot file only; `[dispersion]` makes the first three differ from run to run.",
        table(_HEAD, _number_rows(lambda quantity: quantity.robot_only)),
        "## Plants",
        "`plant` of `[world]` is one of these. Equation numbers are the report's.",
        table(["Plant", "Meaning"], [[code(plant.name), escaped(plant.doc)] for plant in WORLD.plants.values()]),
        "## Sensors",
        "What a sensor tells the robot in each tick is its reading, a member of `omni_inputs_t`. "
        "Those without one reach it in another way.",
        table(["Sensor", "Reading", "Unit", "Valid", "Meaning"], _sensor_rows()),
        "## Faults",
        "`kind` of a `[[fault]]` is one of these.",
        table(
            ["Kind", "Needs", "Meaning"],
            [[code(fault.name), _needs(fault), escaped(fault.doc)] for fault in WORLD.faults.values()],
        ),
        "## Patches",
        f"Each `[[patch]]` is a part of the floor with another friction; at most {patches.MAX_PATCHES}. "
        "Only the plant `full` and MuJoCo have them.",
        f"```text\n{inspect.getdoc(patches) or ''}\n```",
        "## Events",
        f"`command` is one of {', '.join(code(name) for name in scenario.COMMANDS)}.",
        "## Dispersion",
        f"```text\n{spread}\n```",
    )


def pages(root: Path) -> dict[str, str]:
    """Return both pages by their names."""
    return {"robot-file.md": _robot_page(root), "scenario.md": _scenario_page()}
