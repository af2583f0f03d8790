# SPDX-License-Identifier: MIT
"""Readings: what a sensor tells the robot in each tick, as its row of [sensors] in ``shared/world.toml`` says."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.toml_file import refuse_unknown_keys, take_text

MESSAGE = "OMNI_HIL_SENSORS"
"""The message that carries the readings of a simulated world."""
MAX_PAYLOAD = 255
"""Bytes that a MAVLink message may have."""
WHEELS = 4
"""Elements of a reading that has one per wheel."""

_KINDS: Mapping[str, str] = {"real": "float", "int": "int32_t"}
_SIZES = {"char": 1, "8": 1, "16": 2, "32": 4, "64": 8, "float": 4, "double": 8}
_KEYS = ("reading", "kind", "unit", "each", "channels", "valid", "message_field", "boards")
_NAME = re.compile(r"[a-z][a-zA-Z0-9_]*")
_MAX_CHANNELS = 8


@dataclass(frozen=True)
class Reading:
    """A member of the tick's input, of the simulated sensors and of the message, with the flag that belongs to it.

    ``count``: elements, 0 where it is one number. ``channels``: their names, empty where there is one per wheel.
    ``valid``: name of the member with a bit per element that is fresh and can be trusted; "" where 0 means "none".
    ``boards``: folders of firmware/boards whose driver reads it through the table.
    """

    sensor: str
    name: str
    kind: str
    unit: str
    doc: str
    count: int
    channels: tuple[str, ...]
    valid: str
    message_field: str
    boards: tuple[str, ...]

    @property
    def wire_type(self) -> str:
        """The type of one element on the link."""
        return _KINDS[self.kind]

    @property
    def meaning(self) -> str:
        """The documentation of the member, with its channels and its unit."""
        channels = f": {', '.join(self.channels)}" if self.channels else ""
        return f"{self.doc}{channels}" + (f" [{self.unit}]" if self.unit else "")

    @property
    def valid_meaning(self) -> str:
        """The documentation of the flag."""
        if not self.count:
            return f"1: {self.name} is of this tick and can be trusted"
        return f"{self.name}: bit per {'channel' if self.channels else 'wheel'} that can be trusted"


def parse_reading(source: str, sensor: str, row: Mapping[str, Any], doc: str) -> Reading | None:
    """Return what the row of a sensor says about its reading, None if it says nothing. Raises SchemaError."""
    key = f"sensors.{sensor}"
    refuse_unknown_keys(source, f"{key}.", row, ("doc", *_KEYS))
    if "reading" not in row:
        if row.keys() & set(_KEYS):
            raise SchemaError(source, f"{key}.reading", "is missing; only a sensor with a reading has the other keys")
        return None
    kind = take_text(source, f"{key}.kind", row.get("kind", "real"))
    if kind not in _KINDS:
        raise SchemaError(source, f"{key}.kind", f"is {kind!r}{did_you_mean(kind, _KINDS)}; one of {', '.join(_KINDS)}")
    name = _name(source, f"{key}.reading", row["reading"])
    channels = _names(source, f"{key}.channels", row.get("channels", []))
    reading = Reading(
        sensor=sensor,
        name=name,
        kind=kind,
        unit=take_text(source, f"{key}.unit", row["unit"]) if "unit" in row else "",
        doc=doc,
        count=_count(source, key, row.get("each"), channels),
        channels=channels,
        valid=_name(source, f"{key}.valid", row["valid"]) if "valid" in row else "",
        message_field=_name(source, f"{key}.message_field", row.get("message_field", name)),
        boards=_names(source, f"{key}.boards", row.get("boards", [])),
    )
    if reading.boards and not reading.valid:
        raise SchemaError(source, f"{key}.valid", "is missing; a driver says with it whether it has a value")
    return reading


def _name(source: str, key: str, value: object) -> str:
    name = take_text(source, key, value)
    if not _NAME.fullmatch(name):
        raise SchemaError(source, key, f"is {name!r}, which is no name; it must match {_NAME.pattern}")
    return name


def _names(source: str, key: str, value: object) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise SchemaError(source, key, f"is {value!r}; a list of names is needed")
    names = tuple(_name(source, f"{key}[{number}]", item) for number, item in enumerate(value, 1))
    if len(set(names)) != len(names) or len(names) > _MAX_CHANNELS:
        raise SchemaError(source, key, f"is {value!r}; at most {_MAX_CHANNELS} different names are allowed")
    return names


def _count(source: str, key: str, each: object, channels: tuple[str, ...]) -> int:
    if each not in (None, "wheel"):
        raise SchemaError(source, f"{key}.each", f'is {each!r}; only "wheel" is allowed')
    if each and channels:
        raise SchemaError(source, f"{key}.channels", 'and each = "wheel" do not go together')
    return WHEELS if each else len(channels)


def refuse_equal_names(source: str, readings: Iterable[Reading]) -> None:
    """Raise SchemaError if two members of the tick's input would have one name."""
    seen: dict[str, str] = {}
    for reading in readings:
        for name in filter(None, (reading.name, reading.valid)):
            if name in seen:
                raise SchemaError(source, f"sensors.{reading.sensor}", f"has {name!r}, which {seen[name]} has already")
            seen[name] = f"sensors.{reading.sensor}"


def add_message_fields(source: str, message: ET.Element, readings: Iterable[Reading]) -> None:
    """Append to ``MESSAGE`` the fields that it does not have yet, as extensions, which old programs read as zeros.

    Raises SchemaError if a field is there with another type, if 0 could be taken for a value, or if it gets too long.
    """
    present = {field.get("name"): field.get("type") for field in message.iter("field")}
    for reading in readings:
        length = f"[{reading.count}]" if reading.count else ""
        wanted = [(reading.message_field, f"{reading.wire_type}{length}", reading.doc, reading.unit)]
        if reading.valid:
            wanted.append((reading.valid, "uint8_t", reading.valid_meaning, ""))
        for name, kind, doc, unit in wanted:
            if name not in present:
                _add_field(source, message, reading, (name, kind, doc, unit))
            elif present[name] != kind:
                key = f"sensors.{reading.sensor}"
                raise SchemaError(source, key, f"needs {MESSAGE}.{name} as {kind}; omni.xml has {present[name]}")
    payload = sum(_size(field.get("type", "")) for field in message.iter("field"))
    if payload > MAX_PAYLOAD:
        raise SchemaError(source, "sensors", f"makes {MESSAGE} {payload} bytes long; at most {MAX_PAYLOAD} fit")


def _add_field(source: str, message: ET.Element, reading: Reading, row: tuple[str, str, str, str]) -> None:
    name, kind, doc, unit = row
    if not reading.valid:
        problem = f"is missing: a robot that gets no {name} reads 0, and needs to know that this is no value"
        raise SchemaError(source, f"sensors.{reading.sensor}.valid", problem)
    if message.find("extensions") is None:
        ET.SubElement(message, "extensions")
    field = ET.SubElement(message, "field", {"type": kind, "name": name} | ({"units": unit} if unit else {}))
    field.text = doc


def _size(kind: str) -> int:
    element, _, length = kind.rstrip("]").partition("[")
    return _SIZES[re.sub(r"^u?int(\d+)_t$", r"\1", element)] * int(length or 1)
