# SPDX-License-Identifier: MIT
"""docs/how-to-add/motor-driver.md, followed word by word, gives a driver that turns motors and lets a stop win."""

from __future__ import annotations

from omni_schema.toml_file import read_toml
from omniwheel.firmware_process import FirmwareProcess
from tests.firmware.client import Client, Firmware, connect, mav
from tests.recipes.drive import ESTOP_AT_5_S, drive, scenario
from tests.recipes.recipe import Scratch

STEPS = 4096
DUTIES = (0.25, -0.5, 0.0)
PINS = [STEPS * 5 // 8, STEPS, STEPS // 4, STEPS, STEPS // 2, STEPS, 0, 0]
"""Of wheels 1 to 4 with DUTIES: the phase input is high for half the period and half the duty. There is no fourth."""


def robot_file(copy: Scratch) -> str:
    """Write the example robot with this driver into the copy; a pin with an enable input needs no PWM."""
    text = (copy.root / "shared/robots/examples/three_wheel_pins.toml").read_text(encoding="utf-8")
    text = text.replace('motor_driver = "in1_in2"', 'motor_driver = "antiphase"')
    text = text.replace("[[10, 11], [14, 15], [22, 23]]", "[[10, 16], [11, 17], [12, 20]]")
    assert "antiphase" in text
    assert "[10, 16]" in text
    path = copy.root / "build" / "antiphase.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def look_at_the_pins(robot: Client, number: int) -> None:
    """Duties come out at the pins, and a stop has them low in its own tick; the driver has this number."""
    assert robot.set("MOT_DRIVER", number) == number
    robot.armed()
    robot.mav.omni_setpoint_duty_send(1, 1, [*DUTIES, 0.0])
    tick = robot.ticks(4)[-1]
    assert list(tick.actuators.motor_pins) == PINS
    assert not tick.i2c
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert list(robot.tick().actuators.motor_pins) == [0] * 8


def check(copy: Scratch) -> None:
    """Look at the pins of the firmware, then drive with it in the simulated world until an emergency stop."""
    drivers = read_toml(copy.root / "shared" / "params.toml")["motor_drivers"]
    program = copy.packages() / "omniwheel" / "bin" / "omni-firmware"
    with FirmwareProcess(lockstep=True, program=program) as firmware:
        robot = connect(Firmware(None, list(firmware.links)))
        try:
            look_at_the_pins(robot, list(drivers).index("antiphase"))
        finally:
            robot.socket.close()
    path = robot_file(copy)
    run = drive(copy, scenario(robot=path), firmware=True)
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
    stopped = drive(copy, scenario(robot=path, more=ESTOP_AT_5_S), firmware=True)
    assert 0.1 < stopped["farthest_m"] < run["farthest_m"]
    assert stopped["last_m"] == 0.0
