# SPDX-License-Identifier: MIT
"""A link whose other end lives in simulated time: waiting on it makes the world and the robot go on, tick by tick.

Everything of :mod:`omniwheel` that waits for a robot works over it unchanged and deterministically, because the clock
that it waits by is the simulation's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hil_sim.record import Record
from hil_sim.world import World
from omniwheel._core import ffi, lib
from omniwheel.errors import LinkError, LinkLostError, LinkTimeoutError, OutsideLoopError
from omniwheel.link import FileLink

WORLD_SYSTEM_ID = 254
WORLD_COMPONENT_ID = 1
ANY_WHEEL = 255
RECORD_ROWS = 1000
STEP_TICKS = 10
"""How far a read of a :class:`SteppedLink` goes on at most."""
CHILD_TICK_TIMEOUT_S = 60.0
"""Wall time for one tick of firmware that is a child process: a busy computer may take seconds, and its end shows at
once."""
ROBOT_TICK_TIMEOUT_S = 5.0
"""Wall time for one tick of a robot behind a cable."""
PATIENCE_S = 60.0
"""Default simulated time after which a user of a :class:`SteppedLink` gets Ctrl-C."""
LOG_BYTES = 8 * lib.HIL_LOCKSTEP_RX
Waiting = Literal["looking", "asleep", "measured"]
LOOKING: Waiting = "looking"
ASLEEP: Waiting = "asleep"
MEASURED: Waiting = "measured"
_WHY_OUTSIDE = (
    "another program ended it, or an e-stop was received while this computer was late by a second; "
    "release the e-stop if there was one, and restart"
)


@dataclass(frozen=True)
class Served:
    """Frames that were not skipped, one after the other, and log records of all of them."""

    frames: bytes
    records: bytes
    record_count: int


class LockstepLink:
    """The link to a robot in host-in-the-loop, with the world that its sensors and motors are in.

    ``timeout_s`` is the wall time the robot has for one tick, ``realtime_factor`` 0 runs as fast as it goes, 1 in
    real time. While the world's fault link_silence is active, what is written gets lost.

    ``waiting`` says how both ends wait for each other. They sleep at once (ASLEEP), or after LOOKING for a moment.
    Or they take what is MEASURED to be faster while they run. In real time they sleep.
    """

    def __init__(
        self,
        base: FileLink,
        world: World,
        *,
        timeout_s: float = CHILD_TICK_TIMEOUT_S,
        realtime_factor: float = 0.0,
        waiting: Waiting = MEASURED,
    ) -> None:
        self.url = base.url
        self._base = base
        self._world = world
        self._record = Record(RECORD_ROWS)
        self._samples: list[NDArray[Any]] = []
        self.on_samples: Callable[[NDArray[Any]], None] | None = None
        """Called with a view of the samples that are dropped."""
        self._serve_ticks = 0
        self._log: Any = None
        self._done = ffi.new("uint64_t *")
        self._lockstep = ffi.new("hil_lockstep_t *")
        lib.hil_lockstep_init(self._lockstep, base.fileno(), WORLD_SYSTEM_ID, WORLD_COMPONENT_ID)
        self._lockstep.send_fixes = True
        self._lockstep.timeout_s = timeout_s
        self._lockstep.realtime_factor = realtime_factor
        lib.hil_waiting_init(ffi.addressof(self._lockstep, "waiting"), waiting != ASLEEP)
        self._lockstep.waiting.may_change = waiting == MEASURED

    @property
    def ticks(self) -> int:
        """Ticks run so far."""
        return int(self._lockstep.ticks)

    def clock_s(self) -> float:
        """Return the simulated time."""
        return self.ticks * 1e-3

    def set_realtime_factor(self, factor: float) -> None:
        """Change how fast it runs; see the class."""
        self._lockstep.realtime_factor = factor

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
        """Drop the robot's bytes, for runs without a listener."""
        self._lockstep.rx_length = 0

    def serve_every(self, ticks: int, skipped: Sequence[int], log_epoch_us: int | None) -> None:
        """Let :meth:`run_served` look after the robot's messages at every multiple of ``ticks``.

        It passes over those with a number in ``skipped``. With ``log_epoch_us``, what the clock's zero is in a
        telemetry log, it makes log records of all.
        """
        self._serve_ticks = ticks
        self._lockstep.skipped[0 : len(skipped)] = list(skipped)
        self._lockstep.skipped_count = len(skipped)
        if log_epoch_us is not None:
            self._log = ffi.new("uint8_t[]", LOG_BYTES)
            self._lockstep.log = self._log
            self._lockstep.log_capacity = LOG_BYTES
            self._lockstep.log_epoch_us = log_epoch_us

    def run_served(self, ticks: int, take: Callable[[Served], None]) -> None:
        """Run ticks like :meth:`run`; ``take`` gets the watched messages. The rest stays for the next reader."""
        self._lockstep.serve_ticks = self._serve_ticks
        try:
            self.run(ticks, lambda: take(self.serve()))
        finally:
            self._lockstep.serve_ticks = 0
        take(self._take_served())

    def serve(self) -> Served:
        """Look after what has come, now."""
        lib.hil_lockstep_serve(self._lockstep)
        return self._take_served()

    def _take_served(self) -> Served:
        c = self._lockstep
        served, length = int(c.rx_served), int(c.rx_length)
        frames = bytes(ffi.buffer(c.rx, served)) if served else b""
        if served:
            ffi.memmove(c.rx, c.rx + served, length - served)
        c.rx_length, c.rx_served = length - served, 0
        records = bytes(ffi.buffer(c.log, c.log_length)) if c.log_length else b""
        count = int(c.log_frames)
        c.log_length = c.log_frames = 0
        return Served(frames, records, count)

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
            result = self._world.lockstep(self._lockstep, step, self._record.c, self._done)
            if result != lib.HIL_OK:
                raise self._error(result)
            if self.ticks < end and between is not None:
                between()

    def take_samples(self) -> NDArray[Any]:
        """Return the samples of all ticks since the last call."""
        self._flush()
        samples, self._samples = self._samples, []
        return samples[0] if len(samples) == 1 else np.concatenate(samples)

    def _flush(self) -> None:
        self._samples.append(self._record.samples.copy())
        self._record.c.count = 0

    def forget_samples(self) -> None:
        """Drop them, for runs without an end; ``on_samples`` sees them before."""
        if self.on_samples is not None and len(self._record):
            self.on_samples(self._record.samples)
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
            message = f"the robot did not respond within {self._lockstep.timeout_s:g} s {after}"
            return LinkTimeoutError(
                message, hint="check that it is in host-in-the-loop and no other program uses this link"
            )
        if result == lib.HIL_ERR_OUTSIDE:
            return OutsideLoopError(f"the robot has left host-in-the-loop {after}", hint=_WHY_OUTSIDE)
        if result == lib.HIL_ERR_PROTOCOL:
            message = f"the robot's reply does not match the requested tick, {after}"
            return LinkError(
                message, hint="check that firmware and package have equal versions: `omni doctor` shows both"
            )
        return LinkLostError(f"the robot closed the link {after}", hint="check whether the firmware ended or restarted")


class SteppedLink(LockstepLink):
    """A link in simulated time: reading makes robot and world go on, so nothing waits for a real clock.

    Beyond ``end_s`` of simulated time a read raises KeyboardInterrupt.
    """

    end_s = PATIENCE_S

    def read(self, timeout_s: float) -> bytes:
        """Return what the robot sent, after a few ticks if there is nothing yet."""
        data = self._take()
        if not data and timeout_s > 0.0:
            self.run(min(STEP_TICKS, max(1, round(timeout_s * 1e3))))
            self.forget_samples()
            data = self._take()
        if self.clock_s() > self.end_s:
            raise KeyboardInterrupt
        return data
