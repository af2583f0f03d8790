# SPDX-License-Identifier: MIT
"""docs/how-to-add/gyro-chip.md, followed word by word, gives a chip that starts, reads and says when it fails."""

from __future__ import annotations

import ctypes
import math
import sys

from tests.firmware.gyro_model import INCLUDES, MODEL, Cause
from tests.native import build_library
from tests.recipes.recipe import Scratch, call

RATES = (0.02, -0.3, 1.5)
STEP_RAD_S = math.radians(2000.0 / 32768.0)

_SHIM = """
#include "app/drivers/mpu6050.h"
#include "app/drivers/register_gyro.h"
#include "gyro_bus.h"
using namespace omni;
static GyroBus bus(HIL_GYRO_MPU6050);
static RegisterGyro driver(bus, bus.chip.address, mpu6050::registers);
static uint64_t time_us = 1000;
extern "C" void use_axis(int axis) { driver.use_axis(static_cast<int8_t>(axis)); }
extern "C" int tick(const double *rates, float *read) {
    const int valid = driver.read(time_us, read);
    time_us += 1000;
    hil_gyro_chip_sense(&bus.chip, time_us, rates);
    return valid;
}
extern "C" int cause() { return static_cast<int>(driver.trouble().cause); }
extern "C" void go_silent() { bus.chip.faults.silent = true; }
extern "C" void lose_power() { hil_gyro_chip_reset(&bus.chip, bus.chip.kind, bus.chip.address); }
"""


def _ticks(chip: ctypes.CDLL, count: int) -> tuple[list[int], list[float]]:
    read, valid = (ctypes.c_float * 3)(), []
    for number in range(count):
        shaken = [rate + (number % 3 - 1) * STEP_RAD_S for rate in RATES]
        valid.append(int(chip.tick((ctypes.c_double * 3)(*shaken), read)))
    return valid, list(read)


def check(copy: Scratch) -> None:
    """The robot file brings it into the image; the driver starts it, reads it, and says when it fails."""
    robot = (copy.root / "shared/robots/three_wheel.toml").read_text(encoding="utf-8")
    file = copy.root / "build" / "mpu.toml"
    file.parent.mkdir(exist_ok=True)
    file.write_text(robot + '\n[gyro]\nchip = "MPU-6050"\naxis = 3\naddress = 0x69\n', encoding="utf-8")
    out = copy.root / "build" / "mpu"
    generator = copy.root / "shared" / "generate" / "generate.py"
    call([sys.executable, str(generator), "--out", str(out), "--part", "wiring", "--robot", str(file)], copy.root)
    header = (out / "include" / "omni" / "gyro_gen.h").read_text(encoding="utf-8")
    assert "gyro_registers = mpu6050::registers;" in header

    shim = copy.root / "build" / "mpu6050_shim.cpp"
    shim.write_text(_SHIM, encoding="utf-8")
    models = [copy.root / "hil_sim" / "src" / path.name for path in MODEL]
    chips = sorted((copy.root / "hil_sim" / "src").glob("mpu605*.c"))  # with the one of somebody else
    sources = [copy.root / "firmware/app/drivers/register_gyro.cpp", *chips, *models, shim]
    folders = [INCLUDES[0], copy.root / "hil_sim" / "include", copy.root / "hil_sim" / "src", copy.root / "firmware"]
    chip = ctypes.CDLL(str(build_library(shim.parent, "mpu6050", sources, folders)))
    chip.use_axis(3)
    valid, rates = _ticks(chip, 250)
    assert valid[-1] == 7
    assert all(math.isclose(rate, wanted, abs_tol=2.5 * STEP_RAD_S) for rate, wanted in zip(rates, RATES, strict=True))
    chip.lose_power()
    valid, _ = _ticks(chip, 20)
    assert Cause(chip.cause()) is Cause.LOST
    assert not any(valid[2:])
    assert _ticks(chip, 700)[0][-1] == 7
    chip.go_silent()
    valid, _ = _ticks(chip, 300)
    assert Cause(chip.cause()) in (Cause.SILENT, Cause.STUCK)
    assert not any(valid[-50:])
