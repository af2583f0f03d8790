# SPDX-License-Identifier: MIT
"""The world at the pins of the emulated board: in step with the processor's own time, not with a host-in-the-loop tick.

The firmware ticks by its timer interrupt. In each tick it hands out what its pins did and takes what they see, and
meanwhile the emulated time stands still. So a run is deterministic and as fast as this computer makes it.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable

from hil_sim.lockstep import WORLD_COMPONENT_ID, WORLD_SYSTEM_ID
from hil_sim.world import World
from omniwheel._core import lib
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkLostError
from omniwheel.frames import Pose
from omniwheel.setpoints import compact_fix_message

BYTES_PER_TICK = 12
"""What 115200 baud carry in a millisecond."""

_OUT = struct.Struct(f"<QBBB{BYTES_PER_TICK}s129s")
_IN = struct.Struct(f"<4ifBB8sB{BYTES_PER_TICK}sB")


class PinsLink:
    """The robot's first serial line, at 115200 baud; waiting on it makes the processor and the world go on.

    ``on_tick`` is called with the robot's time [us] after each tick. ``ticks`` counts them, ``waiting`` the bytes that
    the line has not carried yet.
    """

    url = "pins"

    def __init__(self, pins: socket.socket, world: World, on_tick: Callable[[int], None] | None = None) -> None:
        self.ticks = 0
        self.time_us = 0
        self._pins = pins
        self._world = world
        self._on_tick = on_tick
        self._to_robot = bytearray()
        self._from_robot = bytearray()
        self._fixes = mavlink.MAVLink(None, WORLD_SYSTEM_ID, WORLD_COMPONENT_ID)

    @property
    def waiting(self) -> int:
        """Bytes on their way to the robot."""
        return len(self._to_robot)

    def clock_s(self) -> float:
        """Return the robot's time."""
        return self.time_us * 1e-6

    def read(self, timeout_s: float) -> bytes:
        """Return what the robot sent; if there is nothing and time is given, after one more tick."""
        if not self._from_robot and timeout_s > 0.0:
            self.advance(1)
        data, self._from_robot = bytes(self._from_robot), bytearray()
        return data

    def write(self, data: bytes) -> None:
        """Put bytes on the line."""
        self._to_robot += data

    def close(self) -> None:
        """Pull the plug; the emulator ends."""
        self._pins.close()

    def advance(self, ticks: int) -> None:
        """Let the processor run some ticks. Raises LinkLostError if it has ended."""
        for _ in range(ticks):
            self._tick()

    def _tick(self) -> None:
        time_us, enabled, i2c_length, sent_length, sent, i2c = _OUT.unpack(self._take())
        self._from_robot += sent[:sent_length]
        lib.hil_world_output_enable(self._world.c, enabled)
        self._world.i2c(i2c[:i2c_length])
        if self.ticks > 0:
            self._world.step(1, time_us - self.time_us)
        self.time_us = time_us
        self.ticks += 1
        sensors = self._world.sense()
        if sensors.has_fix:
            self._send_fix(sensors.fix)
        received = bytes(self._to_robot[:BYTES_PER_TICK])
        del self._to_robot[:BYTES_PER_TICK]
        read = bytes(sensors.i2c_read)
        head = (*sensors.counts, sensors.battery_V, sensors.counts_valid, sensors.i2c_status, read)
        try:
            self._pins.sendall(_IN.pack(*head, len(received), received, sensors.stop_button))
        except OSError as error:
            raise self._lost() from error
        if self._on_tick is not None:
            self._on_tick(time_us)

    def _take(self) -> bytes:
        data = b""
        while len(data) < _OUT.size:
            try:
                piece = self._pins.recv(_OUT.size - len(data))
            except OSError as error:
                raise self._lost() from error
            if not piece:
                raise self._lost()
            data += piece
        return data

    def _send_fix(self, fix: object) -> None:
        x, y, theta = fix.pose  # type: ignore[attr-defined]
        # The world's time began with the first tick, the robot's with its boot.
        age_us = self._world_time_us() - fix.taken_us  # type: ignore[attr-defined]
        message = compact_fix_message(Pose(x, y, theta), self.time_us - age_us)
        self.write(bytes(message.pack(self._fixes)))

    def _world_time_us(self) -> int:
        return int(self._world.c.time_us)

    def _lost(self) -> LinkLostError:
        return LinkLostError(f"the emulated firmware ended after {self.ticks} ticks")
