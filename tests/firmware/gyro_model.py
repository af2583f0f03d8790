# SPDX-License-Identifier: MIT
"""The gyro's driver on a bus with the model of its chip, tick by tick in simulated time."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.native import ROOT, kept_library

MODEL = tuple(
    ROOT / "hil_sim" / "src" / f"{name}.c" for name in ("gyro_pins", "icm42688", "lsm6dso", "bmi270", "random")
)
INCLUDES = (Path(__file__).parent, ROOT / "hil_sim" / "include", ROOT / "hil_sim" / "src")
RETRY_TICKS = 200
GOOD_TICKS = 110
"""After these a trouble that has gone is no longer shown: 100 good readings, and looks at the settings between."""
NOISE_RAD_S = 1.3e-3
"""Of each axis: a step of the coarsest chip, so that two readings are rarely equal."""
OFFSET_RAD_S = (0.02, -0.015, 0.01)
"""What a gyro at rest says: 0 in all three axes at once is rare."""
STEP_US = 1000


@dataclass(frozen=True)
class Chip:
    """What the tests know of a chip from its data sheet and from its driver's promises.

    ``start_ticks``: by then a chip that is well gives readings; ``quiet_ticks``: before, there can be none.
    ``settings``: register by (bank, number). ``changes``: settings to disturb. ``looks``: reads of settings in turn.
    ``data``: first register of a reading. ``power_register``: what switches the gyro on.
    """

    name: str
    number: int
    identity: int
    start_ticks: int
    quiet_ticks: int
    step_mdps: float
    range_dps: float
    settings: Mapping[tuple[int, int], int]
    changes: Sequence[tuple[int, int]]
    looks: int
    data: int
    power_register: int

    @property
    def step_rad_s(self) -> float:
        """A step of a reading."""
        return float(np.radians(self.step_mdps * 1e-3))


_ST_SETTINGS = {0x10: 0x00, 0x11: 0x8C, 0x12: 0x44, 0x13: 0x0A, 0x14: 0x00, 0x15: 0x03, 0x16: 0x00, 0x18: 0xE2}
_ST = {
    "start_ticks": 110,
    "quiet_ticks": 70,
    "step_mdps": 70.0,
    "range_dps": 2000.0,
    "settings": {(0, reg): value for reg, value in _ST_SETTINGS.items()},
    "changes": [(0x11, 0x88), (0x12, 0x04), (0x13, 0x00), (0x15, 0x00)],
    "looks": 2,
    "data": 0x22,
    "power_register": 0x11,
}
ICM42688 = Chip(
    name="ICM-42688-P",
    number=0,
    identity=0x47,
    start_ticks=80,
    quiet_ticks=60,
    step_mdps=2000.0 / 32.768,
    range_dps=2000.0,
    settings={(0, reg): value for reg, value in {0x4D: 0x51, 0x4E: 0x0C, 0x4F: 0x06, 0x51: 0x12, 0x52: 0x10}.items()}
    | {(0, 0x50): 0x06, (0, 0x76): 0, (1, 0x0B): 0xA0, (1, 0x0C): 11, (1, 0x0D): 122, (1, 0x0E): 0x80},
    changes=[(0x4F, 0x26), (0x51, 0x16), (0x52, 0x11), (0x4D, 0x91)],
    looks=1,
    data=0x25,
    power_register=0x4E,
)
BMI270 = Chip(
    name="BMI270",
    number=3,
    identity=0x24,
    start_ticks=370,
    quiet_ticks=256 + 20 + 45,
    step_mdps=2000.0 / 32.768,
    range_dps=2000.0,
    settings={(0, 0x42): 0xDD, (0, 0x43): 0x00, (0, 0x7C): 0x00, (0, 0x7D): 0x02, (0, 0x21): 0x01},
    changes=[(0x42, 0xA9), (0x43, 0x01), (0x7C, 0x02)],
    looks=4,
    data=0x12,
    power_register=0x7D,
)
CHIPS = (
    ICM42688,
    Chip(name="LSM6DSO", number=1, identity=0x6C, **_ST),  # type: ignore[arg-type]
    Chip(name="ISM330DHCX", number=2, identity=0x6B, **_ST),  # type: ignore[arg-type]
    BMI270,
)


class Cause(IntEnum):
    """omni::GyroCause."""

    NONE, ABSENT, BUS, WRONG_ID, LOST, SILENT, STUCK, SATURATED, NOISY, CONFIGURATION = range(10)


class Faults(ctypes.Structure):
    """hil_gyro_faults_t."""

    _fields_ = (
        ("absent", ctypes.c_bool),
        ("silent", ctypes.c_bool),
        ("stuck", ctypes.c_bool),
        ("refuses", ctypes.c_bool),
        ("other_id", ctypes.c_uint8),
        ("bit_errors", ctypes.c_double),
        ("seed", ctypes.c_uint64),
    )


@lru_cache
def library() -> Any:
    """Build driver, model and shim."""
    sources = [ROOT / "firmware/app/drivers/register_gyro.cpp", *MODEL, Path(__file__).with_name("gyro_shim.cpp")]
    loaded = ctypes.CDLL(str(kept_library("gyro", sources, INCLUDES)))
    loaded.gyro_new.restype = ctypes.c_void_p
    loaded.gyro_faults.restype = ctypes.POINTER(Faults)
    return loaded


class Gyro:
    """A driver and its chip. ``valid`` and ``rates`` [rad/s] have a row per tick since the last run()."""

    def __init__(self, chip: Chip = ICM42688, axis: int = 3, seed: int = 1) -> None:
        self.chip = chip
        self._lib = library()
        self._c = ctypes.c_void_p(self._lib.gyro_new(chip.number))
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
        rates: Sequence[float] | Callable[[int], Sequence[float]] = OFFSET_RAD_S,
        step_us: int = STEP_US,
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

    def start(self, rates: Sequence[float] = OFFSET_RAD_S) -> Gyro:
        """Go on until the chip gives readings."""
        return self.run(self.chip.start_ticks, rates)

    def restart(self) -> Gyro:
        """Go on for as long as the driver waits, a start takes, and a trouble that is over goes on showing."""
        return self.run(RETRY_TICKS + self.chip.start_ticks + GOOD_TICKS)

    def cause(self) -> Cause:
        """Why there are no readings."""
        return Cause(self._lib.gyro_cause(self._c))

    def call(self, name: str, *arguments: int) -> int:
        """Call one of the shim's functions: starts, batches, recoveries, hold, power_cycle, register, ..."""
        return int(getattr(self._lib, f"gyro_{name}")(self._c, *arguments))

    def read_across(self, before: int, rates: Sequence[float]) -> np.ndarray[Any, Any]:
        """Read with the world changing after so many bytes; return the bytes."""
        data = (ctypes.c_uint8 * 6)()
        self._lib.gyro_read_across(self._c, self.chip.data, before, (ctypes.c_double * 3)(*rates), data)
        return np.array(list(data))

    def sense(self, *rates: float) -> None:
        """Let the chip see these rates for a moment, without the driver."""
        self._lib.gyro_sense(self._c, 2000, (ctypes.c_double * 3)(*rates))

    def write(self, reg: int, *values: int) -> bool:
        """Write registers without the driver; return whether the chip acknowledged."""
        return bool(self._lib.gyro_talk(self._c, reg, (ctypes.c_uint8 * len(values))(*values), len(values), 0))

    def read(self, reg: int, count: int = 1) -> list[int]:
        """Read registers without the driver; empty if the chip did not acknowledge."""
        data = (ctypes.c_uint8 * count)()
        return list(data) if self._lib.gyro_talk(self._c, reg, data, count, 1) else []
