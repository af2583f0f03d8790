# SPDX-License-Identifier: MIT
"""Makes the frames of docs/reference/link-vectors.md with pymavlink.

    python -m tests.docs.link_vectors [--write]

Without ``--write`` it only says whether the page is current.
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tests.firmware.client import REAL32, mav
from tests.native import ROOT

PAGE = ROOT / "docs" / "reference" / "link-vectors.md"
KEY = bytes(range(32))
TIME = 0x0000_0500_0000_0000
"""Of the signed frames, in units of 10 us since 2015."""
BEGIN, END = "<!-- begin: vectors -->", "<!-- end: vectors -->"
WIDTH = 16


@dataclass(frozen=True)
class Vector:
    """Bytes for a receiver that has just been switched on; ``taken`` are the messages that it takes, in order."""

    name: str
    what: str
    data: bytes
    taken: tuple[str, ...]
    must: str
    key: bool = False


class _Sink:
    def __init__(self) -> None:
        self.data = b""

    def write(self, data: bytes) -> None:
        self.data += data


def _frame(fill: Callable[[Any], Any], *, signed: bool = False, version_1: bool = False) -> bytes:
    sink = _Sink()
    sender = mav.MAVLink(sink, srcSystem=255, srcComponent=190)
    if signed:
        sender.signing.secret_key = KEY
        sender.signing.link_id = 7
        sender.signing.timestamp = TIME
        sender.signing.sign_outgoing = True
    message = fill(sender)
    sender.send(message, force_mavlink1=version_1)
    return bytes(sink.data)


def _heartbeat(sender: Any) -> Any:
    return sender.heartbeat_encode(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)


def _parameter(sender: Any) -> Any:
    return sender.param_set_encode(1, 1, b"ISMC_LAM_XY", 15.0, REAL32)


def _command(number: int, value: float) -> Callable[[Any], Any]:
    return lambda sender: sender.command_long_encode(1, 1, number, 0, value, 0, 0, 0, 0, 0, 0)


def _sensors(sender: Any) -> Any:
    return sender.omni_hil_sensors_encode(1000, 1, [100, -200, 300, 0], 12.0, 0b111, 0, 0, [0] * 8)


_estop = _command(mav.MAV_CMD_OMNI_ESTOP, 1.0)


def _changed(data: bytes, at: int) -> bytes:
    """Return the frame with a bit of one byte changed."""
    changed = bytearray(data)
    changed[at] ^= 0x01
    return bytes(changed)


def _with_flag(data: bytes) -> bytes:
    """Return the frame with an incompatibility flag that nobody knows, and a right checksum."""
    body = data[1:2] + b"\x02" + data[3:-2]
    crc: int = mav.x25crc(body + bytes([mav.mavlink_map[mav.MAVLINK_MSG_ID_HEARTBEAT].crc_extra])).crc
    return bytes(data[:1] + body + crc.to_bytes(2, "little"))


def vectors() -> list[Vector]:
    """Return all of them."""
    heartbeat, parameter, stop = _frame(_heartbeat), _frame(_parameter), _frame(_estop)
    signed = _frame(_parameter, signed=True)
    return [
        Vector("heartbeat", "A ground station's sign of life.", heartbeat, ("HEARTBEAT",), "take it"),
        Vector(
            "heartbeat-1", "The same in MAVLink 1.", _frame(_heartbeat, version_1=True), ("HEARTBEAT",), "take it"
        ),
        Vector("parameter-set", "`ISMC_LAM_XY` = 15.", parameter, ("PARAM_SET",), "take it, answer `PARAM_VALUE`"),
        Vector(
            "disarm", "Zeros at the end of the payload are left out.", _frame(_command(400, 0.0)), ("COMMAND_LONG",),
            "take it, answer `COMMAND_ACK`",
        ),
        Vector("emergency-stop", "`OMNI_ESTOP` 1.", stop, ("COMMAND_LONG",), "stop, answer `COMMAND_ACK`"),
        Vector(
            "hil-sensors", "One tick of host-in-the-loop.", _frame(_sensors), ("OMNI_HIL_SENSORS",),
            "take it, answer `OMNI_HIL_ACTUATORS`",
        ),
        Vector("signed", "`parameter-set`, signed.", signed, ("PARAM_SET",), "take it", key=True),
        Vector("signed-without-key", "The same for a receiver without a key.", signed, ("PARAM_SET",), "take it"),
        Vector("unsigned", "`emergency-stop` over a radio with a key.", stop, (), "refuse and count it", key=True),
        Vector(
            "signed-twice", "A recording: the time stamp is not newer.", signed * 2, ("PARAM_SET",),
            "take the first, refuse the second", key=True,
        ),
        Vector("signature-wrong", "One bit of the signature differs.", _changed(signed, -1), (), "refuse it", key=True),
        Vector(
            "signed-content-changed", "One bit of the value differs: the checksum fails first.", _changed(signed, 12),
            (), "ignore it, count an error", key=True,
        ),
        Vector("checksum-wrong", "One bit of the checksum differs.", _changed(stop, -1), (), "ignore it"),
        Vector("flag-unknown", "An incompatibility flag that nobody knows.", _with_flag(heartbeat), (), "ignore it"),
        Vector(
            "noise", "Bytes of another program, then a frame.", b"x=1\r\n\x00\xff" + heartbeat, ("HEARTBEAT",),
            "ignore the noise, take the frame",
        ),
        Vector("cut", "The beginning of a frame, and nothing more.", parameter[:20], (), "wait for the rest"),
        Vector(
            "wrong-then-right", "`checksum-wrong`, then `heartbeat`.", _changed(stop, -1) + heartbeat, ("HEARTBEAT",),
            "ignore the first, take the second",
        ),
    ]  # fmt: skip


def _block(vector: Vector) -> str:
    rows = [vector.data[at : at + WIDTH].hex(" ") for at in range(0, len(vector.data), WIDTH)]
    return "\n".join(["```text", f"# vector: {vector.name}", f"# {vector.what}", *rows, "```", ""])


def text() -> str:
    """Return the generated part of the page."""
    made = vectors()
    lines = ["| Vector | Receiver has the key | Messages taken | A receiver must |", "|---|---|---|---|"]
    for vector in made:
        taken = ", ".join(f"`{name}`" for name in vector.taken) or "none"
        lines.append(f"| `{vector.name}` | {'yes' if vector.key else 'no'} | {taken} | {vector.must} |")
    sha = hashlib.sha256(b"".join(vector.data for vector in made)).hexdigest()[:16]
    lines += ["", f"All bytes in this order have the SHA-256 `{sha}…`.", ""]
    return "\n".join([*lines, *(_block(vector) for vector in made)])


def page_with(content: str, generated: str) -> str:
    """Return the page with its generated part put in place."""
    return re.sub(f"{BEGIN}.*{END}", lambda _: f"{BEGIN}\n\n{generated}\n{END}", content, flags=re.DOTALL)


def main(arguments: list[str]) -> int:
    """Run the command. Return 1 if the page is not current and may not be written."""
    if arguments not in ([], ["--write"]):
        sys.stderr.write(f"what is {' '.join(arguments)!r}? Only --write is known\n")
        return 2
    content = PAGE.read_text(encoding="utf-8")
    new = page_with(content, text())
    if arguments:
        PAGE.write_text(new, encoding="utf-8")
    elif new != content:
        sys.stderr.write(f"{PAGE.name} is not current: python -m tests.docs.link_vectors --write\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
