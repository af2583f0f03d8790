# SPDX-License-Identifier: MIT
"""The driver of a sensor of motion over the floor on a bus with the sensor's model, tick by tick in simulated time."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.native import ROOT, kept_library

MODEL = tuple(ROOT / "hil_sim" / "src" / f"{name}.c" for name in ("flow_pins", "otos", "pinpoint"))
INCLUDES = (ROOT / "hil_sim" / "include", ROOT / "hil_sim" / "src")
PERIOD_TICKS = 20
"""Between two readings."""
RETRY_TICKS = 200
STEPS_PER_MM, X_WHEEL_MM, Y_WHEEL_MM = 13.25, 84.0, -168.0
"""What the shim's settings say of a Pinpoint's wheels; y counts the other way."""


@dataclass(frozen=True)
class Chip:
    """``start_ticks``: by then one that is well gives readings. ``step_m``, ``step_rad``: of its counters."""

    name: str
    number: int
    start_ticks: int
    step_m: float
    step_rad: float


OTOS = Chip("OTOS", 0, 730, 10.0 / 32768.0, float(np.pi) / 32768.0)
PINPOINT = Chip("Pinpoint", 1, 390, 1e-6, 1e-6)
CHIPS = (OTOS, PINPOINT)


class Cause(IntEnum):
    """omni::FlowCause."""

    NONE, ABSENT, BUS, WRONG_ID, BLIND, UNPLUGGED, BROKEN, RESTARTED, JUMPED = range(9)


class Faults(ctypes.Structure):
    """hil_flow_faults_t."""

    _fields_ = (
        ("absent", ctypes.c_bool),
        ("blind", ctypes.c_bool),
        ("unplugged", ctypes.c_bool),
        ("tilted", ctypes.c_bool),
        ("broken", ctypes.c_bool),
        ("other_id", ctypes.c_uint8),
    )


@lru_cache
def library() -> Any:
    """Build driver, models, shim and what of the core the driver calls."""
    here = Path(__file__)
    sources = [
        ROOT / "firmware/app/drivers/register_flow.cpp",
        ROOT / "shared" / "core" / "src" / "math" / "math.c",
        *MODEL,
        here.with_name("flow_shim.cpp"),
    ]
    loaded = ctypes.CDLL(str(kept_library("flow", sources, INCLUDES)))
    loaded.flow_new.restype = ctypes.c_void_p
    loaded.flow_faults.restype = ctypes.POINTER(Faults)
    loaded.flow_pose.restype = ctypes.c_double
    return loaded


class Flow:
    """A driver and its sensor. ``valid`` and ``moved`` (x, y [m], turn [rad]) have a row per tick since run()."""

    def __init__(self, chip: Chip) -> None:
        self.chip = chip
        self._lib = library()
        self._c = ctypes.c_void_p(self._lib.flow_new(chip.number))
        self.faults = self._lib.flow_faults(self._c).contents
        self.wheels()
        self.valid = np.zeros(0, int)
        self.moved = np.zeros((0, 3))
        self.use(True)

    def close(self) -> None:
        """Free it."""
        self._lib.flow_delete(self._c)

    def use(self, wanted: bool) -> None:
        """Set FLOW_MODE."""
        self._lib.flow_use(self._c, int(wanted))

    def rest(self, rests: bool) -> None:
        """Say whether the robot has stood still for a while."""
        self._lib.flow_rest(self._c, int(rests))

    def wheels(
        self,
        steps: float = STEPS_PER_MM,
        x_mm: float = X_WHEEL_MM,
        y_mm: float = Y_WHEEL_MM,
        reversed_axes: tuple[bool, bool] = (False, True),
    ) -> None:
        """Say how a Pinpoint's wheels really are."""
        place = (ctypes.c_double(steps), ctypes.c_double(x_mm), ctypes.c_double(y_mm))
        self._lib.flow_wheels(self._c, *place, *(int(one) for one in reversed_axes))

    def run(self, ticks: int, speed: Sequence[float] | Callable[[int], Sequence[float]] = (0.0, 0.0, 0.0)) -> Flow:
        """Go on by this many ticks. ``speed``: x, y [m/s] in the sensor's axes, turn rate [rad/s]; or by tick."""
        read = (ctypes.c_float * 3)()
        valid, rows = [], []
        for tick in range(ticks):
            way = np.asarray(speed(tick) if callable(speed) else speed, float) * 1e-3
            valid.append(self._lib.flow_tick(self._c, (ctypes.c_double * 3)(*way), read))
            rows.append(list(read))
        self.valid, self.moved = np.array(valid), np.array(rows)
        return self

    def start(self) -> Flow:
        """Go on, at rest, until it gives readings."""
        return self.run(self.chip.start_ticks)

    def sum(self) -> np.ndarray[Any, Any]:
        """Return what the readings since run() add up to: x, y [m] in the axes of the first, turn [rad]."""
        pose = np.zeros(3)
        for x, y, turn in self.moved[self.valid == WHOLE]:
            heading = pose[2] + turn / 2
            pose += [np.cos(heading) * x - np.sin(heading) * y, np.sin(heading) * x + np.cos(heading) * y, turn]
        return pose

    def cause(self) -> Cause:
        """Why there are no readings."""
        return Cause(self._lib.flow_cause(self._c))

    def call(self, name: str, *arguments: int) -> int:
        """Call one of the shim's functions: starts, batches, recoveries, calibrations, hold, lose, power_cycle, ..."""
        return int(getattr(self._lib, f"flow_{name}")(self._c, *arguments))

    def pose(self) -> list[float]:
        """Return what the sensor has counted."""
        return [float(self._lib.flow_pose(self._c, axis)) for axis in range(3)]

    def put(self, x: float, y: float, heading: float) -> None:
        """Set what the sensor has counted."""
        self._lib.flow_put(self._c, *(ctypes.c_double(value) for value in (x, y, heading)))


WHOLE, CAME, TURN = 15, 8, 4
"""Bits of a reading that is good, of one that only came, and of the turn."""
