# SPDX-License-Identifier: MIT
"""The page of messages and commands, from shared/link."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from omni_docs.markdown import code, escaped, page, table
from omni_schema.readings import MESSAGE, add_message_fields
from omni_schema.toml_file import read_toml
from omni_schema.world import load_world

_RATES = {
    "always": "once a second",
    "state": "at the rate `SRn_STATE`",
    "wheels": "at the rate `SRn_WHEELS`",
    "status": "at the rate `SRn_STATUS`",
    "asked": "only if it is asked for by name",
}


def _text(element: ET.Element, tag: str = "description") -> str:
    found = element.find(tag)
    return escaped(" ".join((found.text or "").split())) if found is not None else ""


def _fields(message: ET.Element) -> str:
    rows = []
    for field in message.iter("field"):
        note = escaped(" ".join("".join(field.itertext()).split()))
        shown = field.get("enum", "")
        rows.append(
            [code(field.get("name", "")), code(field.get("type", "")), code(field.get("units", "")), code(shown), note]
        )
    return table(["Field", "Type", "Unit", "Enum", "Meaning"], rows)


def _sent(message: ET.Element, telemetry: dict[str, Any]) -> str:
    """Say when the robot sends it by itself, and which class the host has for it."""
    report = telemetry.get(message.get("name", ""))
    if report is None:
        return ""
    said = [f"The robot sends it {_RATES[report['group']]}."]
    if "class" in report:
        said.append(f"In Python: {code('omniwheel.telemetry.' + report['class'])}.")
    return " ".join(said)


def _entry_parts(entry: ET.Element) -> Iterator[str]:
    yield f"### {code(entry.get('name', ''))} ({entry.get('value')})"
    yield _text(entry)
    rows = [
        [entry_parameter.get("index", ""), code(entry_parameter.get("units", "")), escaped(entry_parameter.text or "")]
        for entry_parameter in entry.iter("param")
        if (entry_parameter.text or "").strip() not in ("", "Empty")
    ]
    if rows:
        yield table(["Parameter", "Unit", "Meaning"], rows)


def _enum_parts(enum: ET.Element) -> Iterator[str]:
    yield f"### {code(enum.get('name', ''))}"
    yield _text(enum)
    rows = [[entry.get("value", ""), code(entry.get("name", "")), _text(entry)] for entry in enum.iter("entry")]
    yield table(["Value", "Name", "Meaning"], rows)


def pages(root: Path) -> dict[str, str]:
    """Return the page by its name."""
    link = root / "shared" / "link"
    document = ET.parse(link / "omni.xml").getroot()
    world = load_world(root / "shared" / "world.toml")
    for message in document.iter("message"):
        if message.get("name") == MESSAGE:
            add_message_fields(world.source, message, world.readings)
    enums = list(document.iter("enum"))
    telemetry = read_toml(link / "telemetry.toml")["messages"]
    parts = [
        "# Messages and commands",
        "What this project adds to MAVLink. [The link protocol](../protocol.md) says how they are used.",
        "All values are SI, in the world frame: x and y on the floor, theta counter-clockwise.",
        "## Messages",
    ]
    for message in document.iter("message"):
        head = f"### {code(message.get('name', ''))} ({message.get('id')})"
        parts += [head, _text(message), _sent(message, telemetry), _fields(message)]
    parts.append("## Commands")
    for enum in enums:
        if enum.get("name") == "MAV_CMD":
            for entry in enum.iter("entry"):
                parts += _entry_parts(entry)
    parts.append("## Enums")
    for enum in enums:
        if enum.get("name") != "MAV_CMD":
            parts += _enum_parts(enum)
    standard = read_toml(link / "standard.toml")
    names = ", ".join(code(str(name)) for name in standard["messages"])
    parts += ["## Standard messages", "Defined by MAVLink's common dialect; the robot speaks or answers these.", names]
    rows = [[code(name), _RATES[report["group"]]] for name, report in telemetry.items()]
    order = "The most important first: when a link's bytes are scarce, the first ones get them."
    parts += ["## What the robot sends by itself", order, table(["Message", "When"], rows)]
    return {"messages.md": page(*parts)}
