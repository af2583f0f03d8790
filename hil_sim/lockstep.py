# SPDX-License-Identifier: MIT
"""A link whose other end lives in simulated time: waiting on it makes the world and the robot go on, tick by tick.

Everything of :mod:`omniwheel` that waits for a robot works over it unchanged and deterministically, because the clock
that it waits by is the simulation's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.record import Record
from hil_sim.world import World
from omniwheel._core import ffi, lib
from omniwheel.errors import LinkError, LinkLostError, LinkTimeoutError
from omniwheel.link import FileLink

WORLD_SYSTEM_ID = 254
WORLD_COMPONENT_ID = 1
ANY_WHEEL = 255
RECORD_ROWS = 1000


class LockstepLink:
    """The link to a robot in host-in-the-loop, with the world that its sensors and motors are in.

    ``timeout_s`` is the wall time the robot has for one tick, ``realtime_factor`` 0 runs as fast as it goes, 1 in
    real time. While the world's fault link_silence is active, what is written gets lost.
    """

    def __init__(self, base: FileLink, world: World, *, timeout_s: float = 5.0, realtime_factor: float = 0.0) -> None:
        self.url = base.url
        self.ticks = 0
        self._base = base
        self._world = world
        self._record = Record(RECORD_ROWS)
        self._samples: list[NDArray[Any]] = []
        self._done = ffi.new("uint64_t *")
        self._lockstep = ffi.new("hil_lockstep_t *")
        lib.hil_lockstep_init(self._lockstep, base.fileno(), WORLD_SYSTEM_ID, WORLD_COMPONENT_ID)
        self._lockstep.send_fixes = True
        self._lockstep.timeout_s = timeout_s
        self._lockstep.realtime_factor = realtime_factor

    def clock_s(self) -> float:
        """Return the simulated time."""
        return self.ticks * 1e-3

    @property
    def silent(self) -> bool:
        """Whether the ground station's messages get lost now."""
        return bool(lib.hil_world_fault_active(self._world.c, lib.HIL_FAULT_LINK_SILENCE, ANY_WHEEL))

    def read(self, timeout_s: float) -> bytes:
        """Return what the robot sent; if there is nothing and time is given, after one more tick."""
        data = self._take()
        if not data and timeout_s > 0.0:
            self.run(1)
            data = self._take()
        return data

    def drop_received(self) -> None:
        """Drop what the robot sent, for runs that nobody listens to."""
        self._lockstep.rx_length = 0

    def write(self, data: bytes) -> None:
        """Send to the robot; it arrives before the next tick's sensors."""
        if not self.silent:
            self._base.write(data)

    def close(self) -> None:
        """Close the link."""
        self._base.close()

    def run(self, ticks: int, between: Callable[[], None] | None = None) -> None:
        """Run ticks and keep their samples; ``between`` is called whenever the robot's messages should be taken."""
        end = self.ticks + ticks
        while self.ticks < end:
            if len(self._record) == RECORD_ROWS:
                self._flush()
            step = min(end - self.ticks, RECORD_ROWS - len(self._record))
            result = lib.hil_lockstep_run(self._lockstep, self._world.c, step, self._record.c, self._done)
            self.ticks += int(self._done[0])
            if result != lib.HIL_OK:
                raise self._error(result)
            if self.ticks < end and between is not None:
                between()

    def take_samples(self) -> NDArray[Any]:
        """Return the samples of all ticks since the last call."""
        self._flush()
        samples, self._samples = np.concatenate(self._samples), []
        return samples

    def _flush(self) -> None:
        self._samples.append(self._record.samples.copy())
        self._record.c.count = 0

    def forget_samples(self) -> None:
        """Drop them, for runs without an end."""
        self._samples = []
        self._record.c.count = 0

    def _take(self) -> bytes:
        length = int(self._lockstep.rx_length)
        data = bytes(ffi.buffer(self._lockstep.rx, length)) if length else b""
        self._lockstep.rx_length = 0
        return data

    def _error(self, result: int) -> LinkError:
        after = f"after {self.ticks} ticks"
        if result == lib.HIL_ERR_TIMEOUT:
            message = f"the robot did not answer within {self._lockstep.timeout_s:g} s {after}"
            return LinkTimeoutError(message, hint="is it in host-in-the-loop, and nothing else connected to this link?")
        if result == lib.HIL_ERR_PROTOCOL:
            message = f"the robot's answer does not fit the tick it was asked for, {after}"
            return LinkError(
                message, hint="do firmware and this package have the same version? `omni doctor` shows both"
            )
        return LinkLostError(f"the robot closed the link {after}", hint="did the firmware end or restart?")
