# SPDX-License-Identifier: MIT
"""The page of parameters, from shared/params.toml."""

from __future__ import annotations

import re
from pathlib import Path

from omni_docs.markdown import code, escaped, page, table
from omni_schema import Parameter, ParameterTable, load_parameters
from omni_schema.parameters import STEP

_SECTION = re.compile(r"^# -{8,} (.+)$")
_ENTRY = re.compile(r'^"?([A-Z][A-Z0-9_{}n]*)"? = \{')


def sections(text: str) -> dict[str, list[str]]:
    """Return the names in the file, in its order, below the comment that heads them."""
    found: dict[str, list[str]] = {}
    title = "General"
    for line in text.splitlines():
        if head := _SECTION.match(line):
            title = head[1]
        elif entry := _ENTRY.match(line):
            found.setdefault(title, []).append(entry[1])
    return found


def _first(written: str) -> str:
    return written.replace("{n}", "1")


def _range(parameter: Parameter) -> str:
    if parameter.values:
        return ", ".join(f"`{name}` ({number})" for name, number in parameter.values.items())
    if parameter.kind == "bool":
        return "0 or 1"
    return f"{parameter.shown(parameter.minimum)} to {parameter.shown(parameter.maximum)}"


def _default(parameter: Parameter) -> str:
    named = [name for name, number in parameter.values.items() if number == parameter.default]
    return code(named[0]) if named else parameter.shown(parameter.default)


def _row(written: str, parameter: Parameter) -> list[str]:
    notes = [escaped(parameter.doc)]
    if parameter.disarmed_only:
        notes.append("Only while disarmed.")
    if parameter.experiment != STEP:
        notes.append(f"Shown by {code(f'omni tune -e {parameter.experiment}')}.")
    if parameter.robot_key:
        notes.append(f"Robot file: {code(parameter.robot_key)}.")
    meaning = " ".join(note if note.endswith(".") else f"{note}." for note in notes)
    return [
        code(written.replace("{n}", "n")),
        code(parameter.unit),
        _range(parameter),
        _default(parameter),
        meaning,
    ]


_DRIVER_HEAD = ["Name", "Number", "What leads to each motor", "Pins per wheel", "Stopped, it"]


def _driver_rows(known: ParameterTable) -> list[list[str]]:
    return [
        [
            code(driver.name),
            str(driver.number),
            escaped(driver.doc),
            ", ".join(driver.pins),
            f"{driver.bridge[0]}s",
        ]
        for driver in known.motor_drivers.values()
    ]


def pages(root: Path) -> dict[str, str]:
    """Return the page by its name."""
    source = root / "shared" / "params.toml"
    known = load_parameters(source)
    head = ["Name", "Unit", "Allowed", "Default", "Meaning"]
    parts = [
        "# Parameters",
        f"All {len(known)} parameters of the robot. `n` in a name is the number of a wheel or a link, from 1.",
        "`omni params list` shows the values of a robot. [Tuning](../../guides/tuning.md) says how to choose them.",
    ]
    for title, names in sections(source.read_text(encoding="utf-8")).items():
        rows = [_row(written, known[_first(written)]) for written in names]
        parts += [f"## {escaped(title[0].upper() + title[1:])}", table(head, rows)]
    parts += ["Motor drivers, by their name in the robot file:", table(_DRIVER_HEAD, _driver_rows(known))]
    return {"parameters.md": page(*parts)}
