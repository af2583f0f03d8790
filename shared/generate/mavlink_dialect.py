# SPDX-License-Identifier: MIT
"""Builds the MAVLink dialect for C (trimmed) and Python (with all of common) from one source.

Our own messages come from ``shared/link/omni.xml``; the standard ones are taken by name (``shared/link/standard.toml``)
from the XML inside the installed pymavlink. So no definition is copied, and every checksum agrees with the tools that
people already use. Sensors of ``shared/world.toml`` add their readings to OMNI_HIL_SENSORS.
"""

from __future__ import annotations

import contextlib
import copy
import io
import re
import shutil
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pymavlink
from pymavlink.generator import mavgen, mavparse

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.readings import MESSAGE, add_message_fields
from omni_schema.toml_file import read_toml, refuse_unknown_keys
from omni_schema.world import load_world
from telemetry_source import cpp_header, cpp_reports, python_module
from telemetry_table import TelemetryTable, load_telemetry

DIALECT = "omni"
BASE_FILES = ("minimal.xml", "standard.xml", "common.xml")
FAMILIAR_FILES = (*BASE_FILES, "ardupilotmega.xml")
"""What ground stations send to robots of any make."""


@dataclass
class Definitions:
    """Messages and enums by name; an enum spread over several files is merged."""

    messages: dict[str, ET.Element] = field(default_factory=dict)
    enums: dict[str, ET.Element] = field(default_factory=dict)

    def read(self, path: Path) -> list[str]:
        """Add what the file defines and return the names of its messages."""
        return self.take(path, parse_xml(path))

    def take(self, path: Path, root: ET.Element) -> list[str]:
        """Add what the document defines and return the names of its messages; ``path`` names it in errors."""
        names = []
        for message in root.iter("message"):
            name = message.attrib["name"]
            if name in self.messages:
                raise SchemaError(str(path), name, "this message exists already; rename it")
            self.messages[name] = message
            names.append(name)
        for enum in root.iter("enum"):
            self._merge(enum)
        return names

    def _merge(self, enum: ET.Element) -> None:
        present = self.enums.get(enum.attrib["name"])
        if present is None:
            self.enums[enum.attrib["name"]] = copy.deepcopy(enum)
            return
        known = {entry.get("name") for entry in present.iter("entry")}
        present.extend(entry for entry in enum.iter("entry") if entry.get("name") not in known)


def parse_xml(path: Path) -> ET.Element:
    """Parse a MAVLink XML file; raise SchemaError if it is missing or malformed."""
    try:
        return ET.parse(path).getroot()
    except FileNotFoundError:
        raise SchemaError(str(path), "", "no such file") from None
    except ET.ParseError as error:
        raise SchemaError(str(path), "", f"is not valid XML: {error}") from error


def own_document(link_dir: Path) -> ET.Element:
    """Return our own definitions: ``omni.xml``, and the fields that sensors add to the message of their readings."""
    root = parse_xml(link_dir / f"{DIALECT}.xml")
    for message in root.iter("message"):
        if message.get("name") == MESSAGE:
            world = load_world(link_dir.parent / "world.toml")
            add_message_fields(world.source, message, world.readings)
    return root


def standard_xml_dir() -> Path:
    """Return the folder of the installed pymavlink that holds the standard definitions."""
    folder = Path(pymavlink.__file__).parent / "dialects" / "v20"
    if not (folder / "common.xml").is_file():
        problem = "has no common.xml; install pymavlink from its wheel: pip install --force-reinstall pymavlink"
        raise SchemaError(str(folder), "", problem)
    return folder


def trimmed_dialect(link_dir: Path) -> ET.ElementTree[Any]:
    """Return one self-contained XML document: the listed standard messages, the enums they use, and ours."""
    definitions = Definitions()
    for name in BASE_FILES:
        definitions.read(standard_xml_dir() / name)
    listing = link_dir / "standard.toml"
    wanted = read_toml(listing)
    refuse_unknown_keys(str(listing), "", wanted, ("messages", "enums"))
    for name in wanted["messages"]:
        _require(listing, "messages", name, definitions.messages)
    ours = definitions.take(link_dir / f"{DIALECT}.xml", own_document(link_dir))
    messages = [definitions.messages[name] for name in [*wanted["messages"], *ours]]
    enums = [*wanted.get("enums", []), *_enums_of(messages), *_enums_defined_in(link_dir)]
    for name in enums:
        _require(listing, "enums", name, definitions.enums)
    return _document(
        sorted(messages, key=lambda m: int(m.attrib["id"])),
        [definitions.enums[name] for name in sorted(set(enums))],
    )


def _require(listing: Path, key: str, name: str, known: dict[str, ET.Element]) -> None:
    if name not in known:
        hint = did_you_mean(name, known)
        raise SchemaError(str(listing), key, f"pymavlink's common.xml has no {name}{hint}")


def _enums_of(messages: Iterable[ET.Element]) -> list[str]:
    fields = [f for message in messages for f in message.iter("field")]
    return [f.attrib["enum"] for f in fields if "enum" in f.attrib]


def _enums_defined_in(link_dir: Path) -> list[str]:
    return [enum.attrib["name"] for enum in parse_xml(link_dir / f"{DIALECT}.xml").iter("enum")]


def _document(messages: list[ET.Element], enums: list[ET.Element]) -> ET.ElementTree[Any]:
    root = ET.Element("mavlink")
    ET.SubElement(root, "version").text = "3"
    ET.SubElement(root, "dialect").text = "0"
    ET.SubElement(root, "enums").extend(enums)
    ET.SubElement(root, "messages").extend(messages)
    return ET.ElementTree(root)


def _run_mavgen(xml: Path, output: Path, language: str) -> None:
    options = mavgen.Opts(str(output), mavparse.PROTOCOL_2_0, language=language, validate=False, strict_units=False)
    chatter = io.StringIO()
    try:
        with contextlib.redirect_stdout(chatter):
            done = mavgen.mavgen(options, [str(xml)])
    except SystemExit as error:
        sys.stderr.write(chatter.getvalue())
        raise SchemaError(str(xml), "", "mavgen refused this file; see above") from error
    if not done:
        sys.stderr.write(chatter.getvalue())
        raise SchemaError(str(xml), "", "mavgen refused this file; see above")


def familiar_messages(own: Path | None = None) -> dict[int, tuple[int, int]]:
    """Return checksum seed and length without extensions of every message that ground stations may send, by number.

    ``own`` is a document whose messages are added.
    """
    messages: dict[int, tuple[int, int]] = {}
    files = [*(standard_xml_dir() / name for name in FAMILIAR_FILES), *([] if own is None else [own])]
    with contextlib.redirect_stdout(io.StringIO()):
        for path in files:
            for message in mavparse.MAVXML(str(path), mavparse.PROTOCOL_2_0).message:
                messages[message.id] = (message.crc_extra, message.wire_min_length)
    return messages


def _write_familiar(out: Path) -> None:
    rows = "".join(f"{{{n}, {seed}, {length}}}, " for n, (seed, length) in sorted(familiar_messages().items()))
    (out / "mavlink" / "omni" / "familiar_messages.h").write_text(
        "/* Generated by shared/generate/mavlink_dialect.py from pymavlink's definitions. */\n#pragma once\n"
        "/* Number, checksum seed, length without extensions; in the order of the numbers. */\n"
        f"#define OMNI_FAMILIAR_MESSAGES {{ {rows}}}\n",
        encoding="utf-8",
    )


def telemetry_table(link_dir: Path) -> TelemetryTable:
    """Return ``telemetry.toml``, checked against the definitions of the messages."""
    messages = {message.attrib["name"]: message for message in trimmed_dialect(link_dir).iter("message")}
    return load_telemetry(link_dir / "telemetry.toml", messages)


def generate_c(link_dir: Path, out: Path) -> None:
    """Write the trimmed dialect's C headers to ``out/mavlink``; include ``omni/mavlink.h`` from there.

    ``omni/familiar_messages.h`` is what it takes to tell a frame of any other standard message from noise.
    ``omni/telemetry_gen.h`` and ``omni/reports_gen.h`` are what the robot reports by itself.
    """
    telemetry = telemetry_table(link_dir)
    xml = out / "mavlink_xml" / "c" / f"{DIALECT}.xml"
    xml.parent.mkdir(parents=True, exist_ok=True)
    trimmed_dialect(link_dir).write(xml, encoding="utf-8", xml_declaration=True)
    _run_mavgen(xml, out / "mavlink", "C")
    _write_familiar(out)
    folder = out / "mavlink" / "omni"
    # The date would make every day's headers, and every object that includes them, new ones.
    version = folder / "version.h"
    version.write_text(re.sub(r"#define MAVLINK_BUILD_DATE .*\n", "", version.read_text("utf-8")), encoding="utf-8")
    (folder / "telemetry_gen.h").write_text(cpp_header(telemetry), encoding="utf-8")
    (folder / "reports_gen.h").write_text(cpp_reports(telemetry), encoding="utf-8")


def generate_python(link_dir: Path, out: Path) -> None:
    """Write the Python dialect ``out/dialects/omni.py``: all of common, which mavutil needs, and our messages.

    Its ``familiar_messages`` is what it takes to tell a frame of any of them, or of any standard message, from noise.
    ``out/python/telemetry_gen.py`` are the host's classes for them.
    """
    folder = out / "mavlink_xml" / "python"
    folder.mkdir(parents=True, exist_ok=True)
    for name in BASE_FILES:
        shutil.copyfile(standard_xml_dir() / name, folder / name)
    root = own_document(link_dir)
    for include in root.findall("include"):
        root.remove(include)
    include = ET.Element("include")
    include.text = "common.xml"
    root.insert(0, include)
    xml = folder / f"{DIALECT}.xml"
    ET.ElementTree(root).write(xml, encoding="utf-8", xml_declaration=True)
    module = out / "dialects" / f"{DIALECT}.py"
    module.parent.mkdir(parents=True, exist_ok=True)
    _run_mavgen(xml, module, "Python3")
    with module.open("a", encoding="utf-8") as file:
        file.write(
            f"\n# Number: checksum seed, length without extensions.\nfamiliar_messages = {familiar_messages(xml)!r}\n"
        )
    classes = out / "python" / "telemetry_gen.py"
    classes.parent.mkdir(parents=True, exist_ok=True)
    classes.write_text(python_module(telemetry_table(link_dir)), encoding="utf-8")
