# SPDX-License-Identifier: MIT
"""The pages of robot files and scenario files, from the programs that read them."""

from __future__ import annotations

import inspect
from pathlib import Path

from hil_sim import dispersion, faults, scenario
from hil_sim.world import PLANTS
from omni_docs.markdown import code, escaped, page, table
from omni_schema import load_parameters
from omni_schema.robots import KEYED_SECTIONS, SECTIONS
from omni_schema.wiring import BOARD_KEYS


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
        "## Everything else",
        "`[parameters]` sets any parameter by its [name](parameters.md). "
        "`[simulation]` is what the simulated world adds: "
        "[the world's numbers](scenario.md#world).",
    )


def _needs(fault: str) -> str:
    needs = [("wheel", scenario.WHEEL_FAULTS), ("value", scenario.VALUE_FAULTS)]
    return ", ".join(code(key) for key, kinds in needs if fault in kinds)


def _scenario_page() -> str:
    ranges = [[code(name), f"{low:g}", f"{high:g}"] for name, (low, high) in scenario.WORLD_NUMBERS.items()]
    about = inspect.getdoc(scenario) or ""
    spread = inspect.getdoc(dispersion) or ""
    return page(
        "# Scenario file",
        "A TOML file that describes one experiment: a robot, a world, and what happens. "
        f"These come with the package: {', '.join(code(name) for name in scenario.scenario_names())}.",
        f"```text\n{about}\n```",
        "## World",
        "Numbers of `[world]`; the unit is the end of the name. "
        "What is left out comes from the robot file's `[simulation]`.",
        table(["Key", "Smallest", "Largest"], ranges),
        f"`plant` is one of {', '.join(code(name) for name in PLANTS)}. `start_pose` is a list: x, y, theta.",
        "## Faults",
        "`kind` of a `[[fault]]` is one of these. "
        "Those of encoders, motors and wheels need `wheel`; some need `value`.",
        table(["Kind", "Needs"], [[code(name), _needs(name)] for name in faults.KINDS]),
        "## Events",
        f"`command` is one of {', '.join(code(name) for name in scenario.COMMANDS)}.",
        "## Dispersion",
        f"```text\n{spread}\n```",
    )


def pages(root: Path) -> dict[str, str]:
    """Return both pages by their names."""
    return {"robot-file.md": _robot_page(root), "scenario.md": _scenario_page()}
