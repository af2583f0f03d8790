# SPDX-License-Identifier: MIT
"""The gyro's driver on a bus with the model of its chip, tick by tick in simulated time."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from tests.native import ROOT, build_library

MODEL = (ROOT / "hil_sim" / "src" / "icm42688.c", ROOT / "hil_sim" / "src" / "random.c")
INCLUDES = (Path(__file__).parent, ROOT / "hil_sim" / "include")
STEP_RAD_S = 2000.0 / 32768.0 * np.pi / 180.0
"""A step of the chip at ±2000 degrees per second."""
START_TICKS = 80
"""By then a chip that is well gives readings."""
NOISE_RAD_S = 1.2e-3


class Cause(IntEnum):
    """omni::GyroCause."""

    NONE, ABSENT, BUS, WRONG_ID, LOST, SILENT, STUCK, SATURATED, NOISY = range(9)


class Faults(ctypes.Structure):
    """hil_icm42688_faults_t."""

    _fields_ = (
        ("absent", ctypes.c_bool),
        ("silent", ctypes.c_bool),
        ("stuck", ctypes.c_bool),
        ("other_id", ctypes.c_uint8),
        ("bit_errors", ctypes.c_double),
        ("seed", ctypes.c_uint64),
    )


@lru_cache
def library() -> Any:
    """Build driver, model and shim."""
    sources = [ROOT / "firmware" / "app" / "icm42688.cpp", *MODEL, Path(__file__).with_name("gyro_shim.cpp")]
    loaded = ctypes.CDLL(str(build_library(Path(mkdtemp(prefix="omni-gyro-")), "gyro", sources, INCLUDES)))
    loaded.gyro_new.restype = ctypes.c_void_p
    loaded.gyro_faults.restype = ctypes.POINTER(Faults)
    return loaded


class Gyro:
    """A driver and its chip. ``valid`` and ``rates`` [rad/s] have a row per tick since the last run()."""

    def __init__(self, axis: int = 3, seed: int = 1) -> None:
        self._lib = library()
        self._c = ctypes.c_void_p(self._lib.gyro_new())
        self._noise = np.random.default_rng(seed)
        self.faults = self._lib.gyro_faults(self._c).contents
        self.valid = np.zeros(0, int)
        self.rates = np.zeros((0, 3))
        self.use_axis(axis)

    def close(self) -> None:
        """Free it."""
        self._lib.gyro_delete(self._c)

    def use_axis(self, axis: int) -> None:
        """Set GYRO_AXIS."""
        self._lib.gyro_use_axis(self._c, axis)

    def run(
        self,
        ticks: int,
        rates: Sequence[float] | Callable[[int], Sequence[float]] = (0.0, 0.0, 0.0),
        step_us: int = 1000,
    ) -> Gyro:
        """Go on by this many ticks; ``rates``: what the chip sees [rad/s], a function of the tick or constant."""
        read = (ctypes.c_float * 3)()
        valid, rows = [], []
        noise = self._noise.normal(0.0, NOISE_RAD_S, (ticks, 3))
        for tick in range(ticks):
            seen = np.asarray(rates(tick) if callable(rates) else rates) + noise[tick]
            valid.append(self._lib.gyro_tick(self._c, step_us, (ctypes.c_double * 3)(*seen), read))
            rows.append(list(read))
        self.valid, self.rates = np.array(valid), np.array(rows)
        return self

    def cause(self) -> Cause:
        """Why there are no readings."""
        return Cause(self._lib.gyro_cause(self._c))

    def call(self, name: str, *arguments: int) -> int:
        """Call one of the shim's functions: starts, batches, recoveries, hold, power_cycle, register, ..."""
        return int(getattr(self._lib, f"gyro_{name}")(self._c, *arguments))
