# SPDX-License-Identifier: MIT
"""Run folders made without a robot: a log as a robot would have sent it, quickly and of any length."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from omniwheel.dialect import mavlink

_FRAME = 12
"""Bytes of a MAVLink 2 frame around its payload."""
GAIN = "ISMC_LAM_XY"
RATE_HZ = 50
START_S = 5.0
NONE: Mapping[str, float] = {}


def frames(seconds: float, gain: float = 4.0, rate_hz: float = RATE_HZ) -> Iterator[bytes]:
    """Yield records of a drive: armed after 1 s, the gain raised by 1 in the middle, x(t) = sin(t) with one spike."""
    codec: Any = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_AUTOPILOT1)
    count = round(seconds * rate_hz)
    for number in range(count + 1):
        time_s = START_S + number / rate_hz
        raised = number > count // 2
        said: list[Any] = []
        if number in (0, rate_hz):
            state = 1 if number == 0 else 2
            said.append(mavlink.MAVLink_omni_status_message(round(time_s * 1000), *[0] * 9, state, 0))
        if number in (0, count // 2 + 2):
            value = gain + 1.0 if raised else gain
            said.append(mavlink.MAVLink_param_value_message(GAIN.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))
        x = 1e3 if number == count // 3 else math.sin(number / rate_hz)
        milliseconds = round(time_s * 1000)
        said.append(
            mavlink.MAVLink_omni_tracking_message(milliseconds, [x, 0, 0], [0] * 3, [x, 0, 0], [0.1] * 3, time_s, 0)
        )
        terms = [[0.0] * 3] * 6
        said.append(mavlink.MAVLink_omni_control_message(milliseconds, *terms, 1.0, 0, 0, 8 if raised else 7, 1))
        for message in said:
            yield round(time_s * 1e6).to_bytes(8, "big") + bytes(message.pack(codec))


def write_run(
    folder: Path,
    gain: float,
    seconds: float,
    began: str = "",
    asked: str = "a sine",
    numbers: Mapping[str, float] = NONE,
) -> None:
    """Write a folder as a drive leaves it; ``numbers`` besides its duration."""
    folder.mkdir(parents=True)
    (folder / "telemetry.tlog").write_bytes(b"".join(frames(seconds, gain)))
    (folder / "parameters.toml").write_text(f"[parameters]\n{GAIN} = {gain}\n")
    document = {
        "kind": "drive",
        "asked": asked,
        "began": began,
        "end": "done",
        "link": "tcp:127.0.0.1:5760",
        "numbers": {"duration_s": seconds, **numbers},
    }
    (folder / "drive.json").write_text(json.dumps(document))


def without(log: bytes, begin_s: float, end_s: float) -> bytes:
    """Return a telemetry log without what came between two times after its first record."""
    kept, at = bytearray(), 0
    first_us = int.from_bytes(log[:8], "big")
    while at < len(log):
        size = 8 + _FRAME + log[at + 9]
        time_s = (int.from_bytes(log[at : at + 8], "big") - first_us) / 1e6
        if not begin_s < time_s < end_s:
            kept += log[at : at + size]
        at += size
    return bytes(kept)
