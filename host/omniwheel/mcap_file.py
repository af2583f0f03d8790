# SPDX-License-Identifier: MIT
"""Telemetry in MCAP files (https://mcap.dev), which Foxglove and the packages ``mcap`` and ``rosbags`` read.

Each kind of MAVLink message is a channel of its own: topic and schema have the message's name, the encoding is JSON.
An object holds the message's fields, ``source_system`` and ``source_component``; the schema describes them with units.
NaN is ``null``, infinities are ``"Infinity"`` and ``"-Infinity"``. The robot's texts are in the channel ``/log`` too,
as ``foxglove.Log``. Times are those of the record. The metadata ``parameters`` are the robot's, the attachment
``robot.toml`` is its robot file.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import import_module
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple
from xml.etree import ElementTree as ET

from omniwheel.dialect import Message, mavlink
from omniwheel.errors import LogError, MissingPackageError
from omniwheel.paths import dialect_dir

ENDING = ".mcap"
MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a whole file."""
RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length, before the content of each record."""
DATA_END = 0x0F
"""Opcode of the last record before the index, and the highest one that is defined."""
_END = RECORD_HEAD.pack(0x02, 20) + bytes(20) + MAGIC
"""A footer and the last bytes, at which the library ends."""
CHUNK_BYTES = 1 << 16
"""Messages are compressed in pieces of this many bytes. A file that was cut ends with its last whole piece."""
LOG_TOPIC = "/log"
PARAMETERS = "parameters"
ROBOT_FILE = "robot.toml"
_SOURCE = {"source_system": "System id of the sender", "source_component": "Component id of the sender"}
_TOML_TYPE = "application/toml"
_LOG_LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)
"""``foxglove.Log`` levels, 1 debug to 5 fatal, of MAVLink's severities 0 emergency to 7 debug."""
_LOG_SCHEMA = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "level": {"type": "integer", "description": "1 debug, 2 info, 3 warning, 4 error, 5 fatal"},
        "message": {"type": "string"},
        "name": {"type": "string", "description": "Sender"},
        "file": {"type": "string"},
        "line": {"type": "integer"},
    },
}


class McapLog(NamedTuple):
    """What an MCAP file of this project holds: the telemetry log as bytes of a .tlog, parameters, the robot file."""

    records: bytes
    parameters: dict[str, float]
    robot_file: bytes


def write_mcap(
    file: IO[bytes], messages: Iterable[Message], parameters: Mapping[str, float], robot_file: bytes
) -> None:
    """Write messages of a telemetry log (.tlog) in their order.

    Messages of another dialect are left out. Raises MissingPackageError, OSError.
    """
    library = _library("writer")
    writer = library.Writer(file, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
    writer.start(profile="", library="omniwheel")
    channels: dict[str, int] = {}

    def channel(topic: str, schema: Mapping[str, Any]) -> int:
        if topic not in channels:
            number = writer.register_schema(str(schema["title"]), "jsonschema", json.dumps(schema).encode())
            channels[topic] = writer.register_channel(topic, "json", number)
        return channels[topic]

    def add(number: int, time_ns: int, sequence: int, content: Mapping[str, Any]) -> None:
        writer.add_message(
            number, time_ns, json.dumps(content, allow_nan=False).encode(), publish_time=time_ns, sequence=sequence
        )

    if robot_file:
        writer.add_attachment(0, 0, ROBOT_FILE, _TOML_TYPE, robot_file)
    if parameters:
        writer.add_metadata(PARAMETERS, {name: repr(float(value)) for name, value in sorted(parameters.items())})
    for message in messages:
        kind = message.get_type()
        if kind not in _messages():
            continue
        time_ns = round(vars(message)["_timestamp"] * 1e6) * 1000
        sequence = int(vars(message)["_header"].seq)
        add(channel(f"/{kind}", schema_of(kind)), time_ns, sequence, _content(message))
        if kind == "STATUSTEXT":
            add(channel(LOG_TOPIC, _LOG_SCHEMA), time_ns, sequence, _log_entry(time_ns, message))
    writer.finish()


def read_mcap(path: Path) -> McapLog:
    """Read a file that :func:`write_mcap` wrote; of one that was cut, everything up to there.

    Raises MissingPackageError, OSError, and LogError if it is no MCAP file, is damaged or holds no MAVLink messages.
    """
    kinds: dict[int, str] = {}
    records = bytearray()
    parameters: dict[str, float] = {}
    robot_file = b""
    try:
        for record in _readable(path):
            kind = type(record).__name__
            if kind == "Channel" and record.topic[1:] in _messages():
                kinds[record.id] = record.topic[1:]
            elif kind == "Message" and record.channel_id in kinds:
                frame = _frame(kinds[record.channel_id], json.loads(record.data), record.sequence)
                records += (record.log_time // 1000).to_bytes(8, "big") + frame
            elif kind == "Metadata" and record.name == PARAMETERS:
                parameters = {name: float(value) for name, value in record.metadata.items()}
            elif kind == "Attachment" and record.name == ROBOT_FILE:
                robot_file = bytes(record.data)
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, struct.error) as error:
        if isinstance(error, LogError):
            raise
        raise LogError(f"{path}: its messages are not as Run.save writes them: {error!r}") from error
    if not records:
        raise LogError(f"{path} holds no MAVLink messages", hint="give a file that Run.save wrote")
    return McapLog(bytes(records), parameters, robot_file)


def _readable(path: Path) -> Iterator[Any]:
    """Give the records of a file up to the end of its data, or to where it was cut.

    Raises what :func:`read_mcap` does.
    """
    with path.open("rb") as file:
        whole = _is_whole(file)
        at, size, checksum = len(MAGIC), path.stat().st_size, zlib.crc32(MAGIC)
        file.seek(at)
        while at < size or whole:
            record = file.read(RECORD_HEAD.size)
            opcode, length = RECORD_HEAD.unpack(record) if len(record) == RECORD_HEAD.size else (0, size)
            record += file.read(min(length, size))
            if not whole and RECORD_HEAD.size + length > size - at:
                return  # cut here
            if not whole and opcode == 0 and not any(record + file.read()):
                return  # zeros, which a power cut leaves
            try:
                found = _parsed(opcode, length, record, checksum)
            except MissingPackageError:
                raise
            except Exception as error:  # decompressors raise what they like
                raise LogError(
                    f"{path} is damaged: {size - at} of its {size} bytes, from byte {at} on, cannot be read: {error!r}",
                    hint=f"copy what is whole into another file: mcap recover {path.name} -o recovered{ENDING}",
                ) from error
            yield from found
            if opcode == DATA_END:  # an index follows, which nothing here needs
                return
            at += len(record)
            file.seek(at)
            checksum = zlib.crc32(record, checksum)


def _is_whole(file: IO[bytes]) -> bool:
    """Say whether an MCAP file ends as one that was written to its end. Raises LogError if it does not begin as one."""
    if file.read(len(MAGIC)) != MAGIC:
        raise LogError(f"{file.name} is no MCAP file", hint="give a file that Run.save wrote")
    file.seek(-len(MAGIC), SEEK_END)
    return file.tell() > 0 and file.read() == MAGIC


def _parsed(opcode: int, length: int, record: bytes, checksum: int) -> list[Any]:
    """Return a record, or those in a chunk of them. Raises what the library and the decompressors do."""
    if not 0 < opcode <= DATA_END:
        raise ValueError(f"there is no record of type {opcode}")
    if len(record) != RECORD_HEAD.size + length:
        raise ValueError(f"a record of {length} bytes ends after the file")
    reader = _library("stream_reader").StreamReader(BytesIO(record + _END), skip_magic=True, validate_crcs=True)
    found: list[Any] = list(reader.records)[:-1]
    if opcode == DATA_END and found[0].data_section_crc not in (0, checksum):
        raise ValueError("the checksum of all its data is another")
    return found


@cache
def schema_of(kind: str) -> dict[str, Any]:
    """Return the JSON schema of a kind of message: its fields with their meaning and unit."""
    message = _messages()[kind]
    texts = _descriptions().get(kind, {})
    fields = {name: {"type": "integer", "description": text} for name, text in _SOURCE.items()}
    for name, number_type in zip(message.fieldnames, message.fieldtypes, strict=True):
        unit = message.fieldunits_by_name.get(name, "")
        enum = message.fieldenums_by_name.get(name, "")
        parts = (texts.get(name, ""), f"[{unit}]" if unit else "", f"({enum})" if enum else "")
        scalar: dict[str, Any] = {"type": _JSON_TYPES.get(number_type, "integer")}
        is_array = number_type != "char" and _array_length(message, name) > 0
        field: dict[str, Any] = {"type": "array", "items": scalar} if is_array else scalar
        fields[name] = {**field, "description": " ".join(part for part in parts if part)}
    return {"title": kind, "description": texts.get("", ""), "type": "object", "properties": fields}


_JSON_TYPES: dict[str, str | list[str]] = {
    "char": "string",
    "float": ["number", "string", "null"],
    "double": ["number", "string", "null"],
}
_INFINITIES = {math.inf: "Infinity", -math.inf: "-Infinity"}
"""As protobuf writes them into JSON, which has no numbers for them."""


def _array_length(message: Any, name: str) -> int:
    return int(message.array_lengths[message.ordered_fieldnames.index(name)])


@cache
def _messages() -> dict[str, Any]:
    """Return the dialect's message classes by name."""
    return {message.msgname: message for message in mavlink.mavlink_map.values()}


@cache
def _descriptions() -> dict[str, dict[str, str]]:
    """Return what the dialect's own messages and their fields are; "" is the message itself."""
    found: dict[str, dict[str, str]] = {}
    for message in ET.parse(dialect_dir() / "omni.xml").iter("message"):
        texts = {field.get("name", ""): field.text or "" for field in message.iter("field")}
        found[message.get("name", "")] = {**texts, "": message.findtext("description", "")}
    return found


def _content(message: Message) -> dict[str, Any]:
    fields = {name: _as_json(getattr(message, name)) for name in message.fieldnames}
    return {"source_system": message.get_srcSystem(), "source_component": message.get_srcComponent(), **fields}


def _as_json(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_as_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return _INFINITIES.get(value)
    return value


def _frame(kind: str, content: dict[str, Any], sequence: int) -> bytes:
    """Return the message of a JSON object as a frame of MAVLink 2."""
    message = _messages()[kind]
    types = zip(message.fieldnames, message.fieldtypes, strict=True)
    values = [_from_json(content[name], number_type) for name, number_type in types]
    codec = mavlink.MAVLink(None, content["source_system"], content["source_component"])
    codec.seq = sequence & 0xFF
    return bytes(message(*values).pack(codec))


def _from_json(value: Any, number_type: str) -> Any:
    if isinstance(value, list):
        return [_from_json(item, number_type) for item in value]
    if number_type == "char":
        return value.encode()
    if value is None:
        return math.nan
    return float(value) if value in _INFINITIES.values() else value


def _log_entry(time_ns: int, message: Message) -> dict[str, Any]:
    return {
        "timestamp": {"sec": time_ns // 10**9, "nsec": time_ns % 10**9},
        "level": _LOG_LEVELS[min(message.severity, len(_LOG_LEVELS) - 1)],
        "message": message.text,
        "name": f"{message.get_srcSystem()}/{message.get_srcComponent()}",
        "file": "",
        "line": 0,
    }


def _library(module: str) -> Any:
    try:
        return import_module(f"mcap.{module}")
    except ImportError as error:
        hint = "pip install 'omniwheel[mcap]', or in a clone: make setup"
        raise MissingPackageError(f"MCAP files need the package mcap: {error}", hint=hint) from error
