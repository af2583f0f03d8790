# SPDX-License-Identifier: MIT
"""The processor hangs while the robot drives and its watchdog resets it: the PWM chip drives on until it is stopped.

The world goes on while there is no firmware. A reset lets go of the output-enable pin, and the pull-up switches the
chip's outputs off; without the pin the first thing the new firmware writes does.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from hil_sim.fault_bench import Firmware, command, fault_scenario, firmware_loop, start_driving
from hil_sim.fault_cases import TURN, FaultCase
from hil_sim.runs import new_world
from omniwheel import FirmwareProcess
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from tests.arm import need_emulator

FIRMWARES: dict[str, Firmware] = {"pc": FirmwareProcess, "cortex-m7": partial(EmulatedFirmware, links=[DIRECT])}
ON_EACH = ["pc", pytest.param("cortex-m7", marks=pytest.mark.nightly)]
"""Before a merge the image that is flashed does the same: its checks `watchdog` and `never-arms`."""
DRIVE_TICKS = 500
WATCHDOG_TICKS = 200
BOOT_TICKS = 300
"""A Teensy 4.0 is back after about 300 ms."""
DISARMED = 1


PINS = {
    "pin": {"output_enable_wired": 1.0},
    "no-pin": {"output_enable_wired": 0.0},
    "weak-pull-up": {"output_enable_wired": 1.0, "output_enable_rest_V": 1.65},  # 10 kOhm against the board's 10 kOhm
}


@pytest.mark.parametrize("pin", PINS)
@pytest.mark.parametrize("name", ON_EACH)
def test_the_motors_stop_with_the_reset_or_with_the_first_write(name: str, pin: str) -> None:
    if name == "cortex-m7":
        need_emulator()
    scenario = fault_scenario(FaultCase("reset", "reset in motion", (), world=PINS[pin]))
    world = new_world(scenario)
    with firmware_loop(scenario, FIRMWARES[name], world) as loop:
        start_driving(loop, TURN)
        loop.advance(DRIVE_TICKS)
    assert np.abs(world.wheel_rad_s).min() > 1.0
    world.step(WATCHDOG_TICKS)
    assert np.abs(world.wheel_rad_s).min() > 1.0, "nobody tells the chip that the processor hangs"

    world.release_output_enable()  # the reset
    world.step(BOOT_TICKS)
    driven = bool(np.abs(list(world.c.voltage_V)).max() > 0.0)
    assert driven == (pin != "pin")

    with firmware_loop(scenario, FIRMWARES[name], world) as loop:
        first = loop.link.take_samples()
        assert first["state"][0] == DISARMED
        assert not first["duty"].any(), "the new firmware switches everything off before it does anything else"
        assert not np.any(list(world.c.voltage_V))
        loop.advance(50)
        assert not loop.robot.status.armed, "it does not start driving by itself"
        start_driving(loop, TURN)
        again = loop.advance(400)
        assert np.abs(again["duty"][-1]).max() > 0.05
        command(loop, "disarm")
