# SPDX-License-Identifier: MIT
"""A parameter download as ArduPilot's vehicles and older ground stations do it, on a modelled radio: timing only.

*Streamed*: after PARAM_REQUEST_LIST the vehicle sends PARAM_VALUEs within 30 % of the line. A ground station that hears
nothing new for a second asks for what is missing, one at a time. *One at a time*: the ground station asks for each
parameter by its index and waits for the answer, a second at most. Frames have their MAVLink 2 length; contents are a
pattern that a cut or joined frame does not show. Left out, in the peers' favour: everything else that a vehicle sends
(heartbeats, telemetry), and the other 900 parameters of ArduPilot.
"""

from __future__ import annotations

from omniwheel.radio_model import Radio, RadioSettings

VALUE_BYTES = 25 + 12
REQUEST_BYTES = 20 + 12
LIST_BYTES = 2 + 12
SHARE = 0.30
SERVED_S = 0.02
"""The vehicle looks at its links 50 times per second."""
STEP_S = 0.005
RETRY_S = 1.0
GIVE_UP_S = 600.0
_START = 0xFD
_LIST = 0xFFFF


def frame(index: int, length: int) -> bytes:
    """Return a frame of a parameter's index and length."""
    return bytes([_START, length, index & 0xFF, index >> 8]) + bytes([0x80 | index % 101]) * (length - 4)


class Frames:
    """Finds whole frames in a stream that has lost pieces."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def take(self, data: bytes) -> list[int]:
        """Return the indices of the frames that are complete now."""
        self._bytes += data
        found = []
        while len(self._bytes) >= 4:
            index, length = self._bytes[2] | self._bytes[3] << 8, self._bytes[1]
            if self._bytes[0] != _START or length not in (VALUE_BYTES, REQUEST_BYTES, LIST_BYTES):
                del self._bytes[0]
            elif len(self._bytes) < length:
                break
            elif self._bytes[:length] == frame(index, length):
                found.append(index)
                del self._bytes[:length]
            else:
                del self._bytes[0]
        return found


class Vehicle:
    """Answers requests, and streams the list within its share of the line."""

    def __init__(self, parameters: int, radio: Radio) -> None:
        self._parameters = parameters
        self._radio = radio
        self._frames = Frames()
        self._next: int | None = None
        self._allowance = 0.0
        self._asked: list[int] = []

    def step(self, now_s: float) -> None:
        """Serve the link once."""
        for index in self._frames.take(self._radio.up.take(now_s)):
            if index == _LIST:
                self._next = 0
            else:
                self._asked.append(index)
        while self._asked and self._radio.down.waiting_s <= now_s:
            self._send(self._asked.pop(0), now_s)
        if self._next is None:
            return
        self._allowance += SHARE * SERVED_S / self._radio.settings.character_s
        while self._next < self._parameters and self._allowance >= VALUE_BYTES:
            self._allowance -= VALUE_BYTES
            self._send(self._next, now_s)
            self._next += 1

    def _send(self, index: int, now_s: float) -> None:
        self._radio.down.put(frame(index, VALUE_BYTES), now_s)


class Station:
    """Wants all parameters; ``streamed`` says how it begins."""

    def __init__(self, parameters: int, radio: Radio, streamed: bool) -> None:
        self.missing = set(range(parameters))
        self._radio = radio
        self._frames = Frames()
        self._streaming = streamed
        self._asked: int | None = None
        self._since_s = -RETRY_S

    def step(self, now_s: float) -> None:
        """Take what has come, and ask for what is missing when it is time."""
        heard = self.missing & set(self._frames.take(self._radio.down.take(now_s)))
        self.missing -= heard
        if heard:
            self._since_s = now_s
        answered = not self._streaming and self._asked not in self.missing
        if not self.missing or not (answered or now_s - self._since_s >= RETRY_S):
            return
        if self._streaming and self._asked is None:
            self._asked = _LIST
            self._radio.up.put(frame(_LIST, LIST_BYTES), now_s)
        else:
            self._streaming = False
            self._asked = min(self.missing)
            self._radio.up.put(frame(self._asked, REQUEST_BYTES), now_s)
        self._since_s = now_s


def download_s(parameters: int, settings: RadioSettings, streamed: bool, seed: int) -> float:
    """Return how long it takes until the ground station has all parameters [s]; TimeoutError if it never does."""
    radio = Radio(settings, seed)
    vehicle, station = Vehicle(parameters, radio), Station(parameters, radio, streamed)
    steps_per_service = round(SERVED_S / STEP_S)
    for step in range(round(GIVE_UP_S / STEP_S)):
        now_s = step * STEP_S
        station.step(now_s)
        if not station.missing:
            return now_s
        if step % steps_per_service == 0:
            vehicle.step(now_s)
    raise TimeoutError(f"{len(station.missing)} of {parameters} parameters missing after {GIVE_UP_S:g} s")
