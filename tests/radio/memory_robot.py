# SPDX-License-Identifier: MIT
"""The firmware on a board made of memory, and links to it whose clock is the simulation's."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from tests.firmware.gyro_model import INCLUDES, MODEL, Faults
from tests.native import app_archive, core_archive, kept_library

STORAGE_BYTES = 1080
ERASED = b"\xff" * STORAGE_BYTES
USB, RADIO = 0, 1
TICK_S = 1e-3


@lru_cache
def library() -> Any:
    """Link the firmware's program, the core and the shim into one library."""
    sources = [*MODEL, Path(__file__).with_name("app_shim.cpp")]
    loaded = ctypes.CDLL(str(kept_library("radio", sources, INCLUDES, archives=[app_archive(), core_archive()])))
    loaded.robot_new.restype = ctypes.c_void_p
    loaded.robot_gyro_faults.restype = ctypes.POINTER(Faults)
    return loaded


class MemoryRobot:
    """A robot to be run tick by tick; ``image`` is what its memory holds at first, ``radio`` its last port."""

    def __init__(self, image: bytes = ERASED, *, lockstep: bool = False, radio: int = RADIO) -> None:
        self._lib = library()
        self._c = ctypes.c_void_p(self._lib.robot_new(image, int(lockstep), radio))
        self.ticks = 0

    def close(self) -> None:
        """Free it."""
        self._lib.robot_delete(self._c)

    def __enter__(self) -> MemoryRobot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, ticks: int) -> None:
        """Go on by this many milliseconds."""
        self._lib.robot_run(self._c, ticks)
        self.ticks += ticks

    def background(self) -> None:
        """Serve the links without time going on."""
        self._lib.robot_background(self._c)

    def set_own(self, name: str, value: float) -> None:
        """Change a value that the robot has from its image; it counts from the next start on."""
        assert self._lib.robot_set_own(self._c, name.encode(), ctypes.c_float(value)), name

    def add_gyro(self, axis: int) -> Faults:
        """Put a gyro's chip on the board and start anew; return what can be wrong with it."""
        self._lib.robot_add_gyro(self._c)
        self.set_own("GYRO_AXIS", axis)
        self.reboot()
        faults: Faults = self._lib.robot_gyro_faults(self._c).contents
        return faults

    def turn_gyro(self, *rates: float) -> None:
        """Let the chip turn at these rates about its axes [rad/s]; the wheels stand."""
        self._lib.robot_turn_gyro(self._c, (ctypes.c_double * 3)(*rates))

    def hold_gyro(self, held: bool) -> None:
        """Hold a line of the gyro's bus low, or let it go."""
        self._lib.robot_hold_gyro(self._c, int(held))

    def reboot(self) -> None:
        """Power off and on."""
        self._lib.robot_reboot(self._c)

    def write(self, port: int, data: bytes) -> None:
        """Put bytes into what the robot will read."""
        self._lib.robot_write(self._c, port, data, len(data))

    def read(self, port: int) -> bytes:
        """Take what the robot has sent."""
        buffer = ctypes.create_string_buffer(65536)
        data = b""
        while count := self._lib.robot_read(self._c, port, buffer, len(buffer)):
            data += buffer.raw[:count]
        return data

    @property
    def driven(self) -> bool:
        """Whether any motor has a duty, as the PWM chip was told."""
        return bool(self._lib.robot_driven(self._c))

    @property
    def baud(self) -> int:
        """Speed of the radio's line."""
        return int(self._lib.robot_baud(self._c))

    def break_storage(self, broken: bool = True) -> None:
        """Let the memory refuse writes."""
        self._lib.robot_break_storage(self._c, int(broken))

    def storage(self) -> tuple[bytes, list[int], int]:
        """Return the memory's bytes, how often each has changed, and how many writes there were."""
        image = ctypes.create_string_buffer(STORAGE_BYTES)
        writes = (ctypes.c_uint32 * STORAGE_BYTES)()
        calls = int(self._lib.robot_storage(self._c, image, writes))
        return image.raw, list(writes), calls


class MemoryLink:
    """A link to a port of a MemoryRobot; waiting on it makes the robot go on, in steps of ``step_ticks``."""

    def __init__(
        self, robot: MemoryRobot, port: int, *, step_ticks: int = 5, between: Callable[[], None] | None = None
    ) -> None:
        self.url = f"memory:{port}"
        self._robot = robot
        self._port = port
        self._step_ticks = step_ticks
        self._between = between

    def clock_s(self) -> float:
        """Return the simulated time."""
        return self._robot.ticks * TICK_S

    def read(self, timeout_s: float) -> bytes:
        """Return what the robot has sent; if there is nothing and time is given, after one more step."""
        data = self._robot.read(self._port)
        if not data and timeout_s > 0.0:
            self._robot.run(self._step_ticks)
            if self._between is not None:
                self._between()
            data = self._robot.read(self._port)
        return data

    def write(self, data: bytes) -> None:
        """Send to the robot."""
        self._robot.write(self._port, data)

    def close(self) -> None:
        """Nothing to close."""
