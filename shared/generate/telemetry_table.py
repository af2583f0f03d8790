# SPDX-License-Identifier: MIT
"""Reads shared/link/telemetry.toml: what the robot reports by itself, and how the host shows it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.toml_file import read_toml, refuse_unknown_keys, take_number, take_table, take_text

GROUPS = ("always", "state", "wheels", "status", "asked")
SHOWN_AS = ("pose", "twist", "bool", "faults", "state", "hex")
"""How a class may show a field, besides the tables of names."""
_TYPE = re.compile(r"(\w+?)(?:_mavlink_version)?(?:\[(\d+)\])?$")
_KEY = re.compile(r"(\w+)(?:\[(\d+)\])?$")


@dataclass(frozen=True)
class Field:
    """One field of a message, or one element of it: what the robot puts there, and what the host's class calls it."""

    name: str
    index: int | None
    source: str
    """C++ expression."""
    host: str
    """Attribute of the host's class; "" if it has none."""
    scale: float | None
    shown_as: str
    type: str
    """The element's type as MAVLink names it."""
    length: int
    """0: a single value."""
    doc: str
    unit: str


@dataclass(frozen=True)
class Report:
    """One message that the robot sends by itself."""

    name: str
    group: str
    reply: bool
    class_name: str
    doc: str
    fields: tuple[Field, ...]


@dataclass(frozen=True)
class TelemetryTable:
    """All of the file, reports in the order of their importance."""

    reports: tuple[Report, ...]
    sources: Mapping[str, str]
    names: Mapping[str, tuple[str, ...]]


def load_telemetry(path: Path, messages: Mapping[str, ET.Element]) -> TelemetryTable:
    """Read the table; ``messages`` are the definitions by name. Raises SchemaError, which names the key."""
    return _Reader(str(path), read_toml(path), messages).table()


class _Reader:
    def __init__(self, file: str, document: dict[str, Any], messages: Mapping[str, ET.Element]) -> None:
        self._file = file
        self._messages = messages
        refuse_unknown_keys(file, "", document, ("names", "usual", "sources", "messages"))
        self._document = document
        self._names = {key: self._list_of_names(key, value) for key, value in self._part("names").items()}

    def _part(self, key: str) -> dict[str, Any]:
        return take_table(self._file, key, self._document.get(key, {}))

    def _list_of_names(self, key: str, value: object) -> tuple[str, ...]:
        if not isinstance(value, list) or not value:
            raise SchemaError(self._file, f"names.{key}", f"is {value!r}; a list of names is needed here")
        return tuple(take_text(self._file, f"names.{key}", name) for name in value)

    def table(self) -> TelemetryTable:
        sources = {name: take_text(self._file, f"sources.{name}", text) for name, text in self._part("sources").items()}
        reports = tuple(self._report(name, value) for name, value in self._part("messages").items())
        if not reports:
            raise SchemaError(self._file, "messages", "is empty; the robot would never say anything")
        return TelemetryTable(reports, sources, self._names)

    def _report(self, name: str, value: object) -> Report:
        key = f"messages.{name}"
        entry = take_table(self._file, key, value)
        refuse_unknown_keys(self._file, f"{key}.", entry, ("group", "reply", "class", "doc", "fields"))
        if name not in self._messages:
            problem = f"there is no such message{did_you_mean(name, self._messages)}; declare it in omni.xml"
            raise SchemaError(self._file, key, problem)
        group = self._text(key, entry, "group")
        if group not in GROUPS:
            hint = did_you_mean(group, GROUPS)
            raise SchemaError(self._file, f"{key}.group", f"is {group!r}{hint}; one of {', '.join(GROUPS)}")
        class_name, doc = self._text(key, entry, "class"), self._text(key, entry, "doc")
        if bool(class_name) != bool(doc):
            raise SchemaError(self._file, key, "has one of `class` and `doc`; a class needs both")
        fields = self._fields(name, take_table(self._file, f"{key}.fields", entry.get("fields", {})))
        shown = [field.host for field in fields if field.host]
        if class_name and (twice := next((host for host in shown if shown.count(host) > 1), "")):
            raise SchemaError(self._file, f"{key}.fields", f"two fields are called {twice} in the class")
        return Report(name, group, entry.get("reply", False) is True, class_name, doc, fields)

    def _text(self, key: str, entry: dict[str, Any], what: str) -> str:
        return take_text(self._file, f"{key}.{what}", entry.get(what, ""))

    def _fields(self, message: str, given: dict[str, Any]) -> tuple[Field, ...]:
        declared = {field.attrib["name"]: field for field in self._messages[message].iter("field")}
        named = {key.split("[")[0] for key in given}
        usual = {name: entry for name, entry in self._part("usual").items() if name in declared and name not in named}
        fields = tuple(self._field(message, declared, name, entry) for name, entry in {**usual, **given}.items())
        missing = [name for name in declared if name not in named and name not in usual]
        if missing and message.startswith("OMNI_"):
            raise SchemaError(self._file, f"messages.{message}.fields", f"says nothing about {', '.join(missing)}")
        return fields

    def _field(self, message: str, declared: dict[str, ET.Element], key: str, entry: object) -> Field:
        where = f"messages.{message}.fields.{key}"
        parts = _KEY.fullmatch(key)
        if parts is None or parts[1] not in declared:
            hint = did_you_mean(key, declared)
            raise SchemaError(self._file, where, f"the message has no such field{hint}")
        wanted = {"from": entry} if isinstance(entry, str) else take_table(self._file, where, entry)
        refuse_unknown_keys(self._file, f"{where}.", wanted, ("from", "host", "scale", "as", "doc"))
        element = declared[parts[1]]
        kind = _TYPE.fullmatch(element.attrib["type"])
        assert kind is not None, element.attrib["type"]
        shown_as = self._text(where, wanted, "as")
        if shown_as and shown_as not in (*SHOWN_AS, *self._names):
            known = (*SHOWN_AS, *self._names)
            problem = f"is {shown_as!r}{did_you_mean(shown_as, known)}; one of {', '.join(known)}"
            raise SchemaError(self._file, f"{where}.as", problem)
        if not self._text(where, wanted, "from"):
            raise SchemaError(self._file, f"{where}.from", "is missing: what does the robot put there?")
        return Field(
            name=parts[1],
            index=None if parts[2] is None else self._index(where, int(parts[2]), int(kind[2] or 0)),
            source=wanted["from"],
            host=take_text(self._file, f"{where}.host", wanted.get("host", parts[1])),
            scale=take_number(self._file, f"{where}.scale", wanted["scale"]) if "scale" in wanted else None,
            shown_as=shown_as,
            type=kind[1],
            length=int(kind[2] or 0),
            doc=self._text(where, wanted, "doc") or " ".join("".join(element.itertext()).split()),
            unit=element.get("units", ""),
        )

    def _index(self, where: str, index: int, length: int) -> int:
        if index >= length:
            raise SchemaError(self._file, where, f"the field has {length} elements, counted from 0")
        return index
