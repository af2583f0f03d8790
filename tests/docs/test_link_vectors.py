# SPDX-License-Identifier: MIT
"""The page of frames is true: the firmware's parser and pymavlink take and refuse what it says."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.docs.link_vectors import KEY, PAGE, TIME, main, page_with, text, vectors
from tests.firmware.client import mav
from tests.native import ROOT, kept_library

MAX_FRAMES, MAX_PAYLOAD, REFUSED = 8, 255, -1


@cache
def page() -> dict[str, bytes]:
    """Return the bytes of the page's blocks by name."""
    blocks = re.findall(r"```text\n# vector: (\S+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return {name: bytes.fromhex("".join(line for line in body.splitlines() if line[0] != "#")) for name, body in blocks}


@cache
def rows() -> dict[str, tuple[bool, tuple[str, ...]]]:
    """Return by vector: has the receiver the key, which messages are taken."""
    found = re.findall(r"^\| `([\w-]+)` \| (yes|no) \| (.*?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {name: (key == "yes", tuple(re.findall(r"`(\w+)`", taken))) for name, key, taken in found}


@cache
def library() -> ctypes.CDLL:
    app = ROOT / "firmware" / "app"
    names = ("link/codec.cpp", "link/signing.cpp", "storage/record_store.cpp", "link/stops.cpp")
    sources = [app / name for name in names]
    sources.append(Path(__file__).with_name("parser_shim.cpp"))
    loaded = ctypes.CDLL(str(kept_library("parser", sources, flags=["-Wno-address-of-packed-member"])))
    loaded.receiver_new.restype = ctypes.c_void_p
    loaded.receiver_feed.restype = ctypes.c_size_t
    loaded.receiver_encode.restype = ctypes.c_size_t
    return loaded


@contextmanager
def receiver(key: bool) -> Iterator[ctypes.c_void_p]:
    made = ctypes.c_void_p(library().receiver_new(KEY if key else None, ctypes.c_uint64(TIME)))
    try:
        yield made
    finally:
        library().receiver_delete(made)


def by_firmware(data: bytes, key: bool) -> tuple[list[int], list[bytes], int]:
    """Return ids (REFUSED: not admitted) and payloads of the frames that the firmware finds, and its error count."""
    ids = (ctypes.c_int32 * MAX_FRAMES)()
    payloads = (ctypes.c_uint8 * (MAX_PAYLOAD * MAX_FRAMES))()
    with receiver(key) as made:
        count = library().receiver_feed(made, data, ctypes.c_size_t(len(data)), ids, payloads)
        errors = int(library().receiver_errors(made))
    cut = [bytes(payloads[at * MAX_PAYLOAD : (at + 1) * MAX_PAYLOAD]) for at in range(count)]
    return list(ids[:count]), cut, errors


def by_pymavlink(data: bytes, key: bool) -> list[Any]:
    """Return the messages that pymavlink takes, byte after byte."""
    parser = mav.MAVLink(None, srcSystem=1, srcComponent=1)
    parser.robust_parsing = True
    if key:
        parser.signing.secret_key = KEY
        parser.signing.timestamp = TIME
        parser.signing.sign_outgoing = True
    taken = []
    for at in range(len(data)):
        message = parser.parse_char(data[at : at + 1])
        if message is not None and message.get_type() != "BAD_DATA":
            taken.append(message)
    return taken


def payload_of(message: Any) -> bytes:
    """Return a message's payload as MAVLink 2 sends it, encoded anew."""
    packed = bytes(message.pack(mav.MAVLink(None)))
    return packed[10 : 10 + packed[1]]


def test_the_page_is_current() -> None:
    assert main([]) == 0
    assert {vector.name: vector.data for vector in vectors()} == page()
    assert {vector.name: (vector.key, vector.taken) for vector in vectors()} == rows()


def test_a_page_that_is_not_current_is_noticed() -> None:
    content = PAGE.read_text(encoding="utf-8")
    assert page_with(content.replace("fd 09", "fd 0a"), text()) == content


@pytest.mark.parametrize("name", [vector.name for vector in vectors()])
def test_the_firmware_takes_what_the_page_says(name: str) -> None:
    key, taken = rows()[name]
    ids, _, _ = by_firmware(page()[name], key)
    assert [mav.mavlink_map[found].msgname for found in ids if found != REFUSED] == list(taken)


@pytest.mark.parametrize("name", [vector.name for vector in vectors()])
def test_pymavlink_takes_the_same_with_the_same_content(name: str) -> None:
    key, taken = rows()[name]
    messages = by_pymavlink(page()[name], key)
    assert [message.get_type() for message in messages] == list(taken)
    ids, payloads, _ = by_firmware(page()[name], key)
    kept = [payload for found, payload in zip(ids, payloads, strict=True) if found != REFUSED]
    for message, payload in zip(messages, kept, strict=True):
        theirs = payload_of(message)
        assert payload[: len(theirs)].rstrip(b"\0") == theirs.rstrip(b"\0")
        assert not any(payload[len(theirs) :])


@pytest.mark.parametrize("name", ["checksum-wrong", "signed-content-changed", "noise", "flag-unknown"])
def test_what_is_ignored_is_counted(name: str) -> None:
    assert by_firmware(page()[name], rows()[name][0])[2] > 0


@pytest.mark.parametrize("name", ["unsigned", "signature-wrong", "signed-twice"])
def test_what_is_refused_was_understood(name: str) -> None:
    assert REFUSED in by_firmware(page()[name], True)[0]


@pytest.mark.parametrize("key", [False, True])
def test_pymavlink_takes_what_the_firmware_sends(key: bool) -> None:
    heartbeat = bytes([0, 0, 0, 0, mav.MAV_TYPE_GROUND_ROVER, mav.MAV_AUTOPILOT_GENERIC, 0, 3, 3])
    out = (ctypes.c_uint8 * 280)()
    with receiver(key) as made:
        padded = heartbeat.ljust(MAX_PAYLOAD, b"\0")
        length = library().receiver_encode(made, mav.MAVLINK_MSG_ID_HEARTBEAT, padded, out)
    (message,) = by_pymavlink(bytes(out[:length]), key)
    assert message.get_type() == "HEARTBEAT"
    assert payload_of(message) == heartbeat
    assert message.get_signed() == key
