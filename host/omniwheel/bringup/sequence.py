# SPDX-License-Identifier: MIT
"""The checks one after the other, each only once those before it have passed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from omni_schema import Robot as RobotFile
from omniwheel.bringup.drive import check_drive
from omniwheel.bringup.encoders import check_encoders
from omniwheel.bringup.flow import check_flow
from omniwheel.bringup.gyro import check_gyro
from omniwheel.bringup.i2c import check_i2c
from omniwheel.bringup.link import check_link
from omniwheel.bringup.motors import check_motors
from omniwheel.bringup.output_enable import check_output_enable
from omniwheel.bringup.person import Person
from omniwheel.bringup.radio import check_radio
from omniwheel.bringup.result import Result
from omniwheel.bringup.stop_button import check_stop_button
from omniwheel.bringup.stops import check_stops
from omniwheel.limits import RADIO_BAUD
from omniwheel.robot import Robot

CHECKS = ("link", "i2c", "encoders", "gyro", "flow", "motors", "estop", "oe", "button", "drive")
"""In order, by the names of the commands. The radio's needs a second link."""


def bring_up(
    robot: Robot,
    person: Person,
    *,
    file: RobotFile | None = None,
    radio: Robot | None = None,
    baud: int = RADIO_BAUD,
    keep_going: bool = False,
    only: str | None = None,
) -> Iterator[Result]:
    """Yield the results in order; end after the first failure unless ``keep_going``. No ``radio``, no check of it.

    Those of PWM chip, stop button, gyro and floor motion are left out for a robot file without them. ``only`` is the
    one of CHECKS to run, whatever the robot file says.
    """
    checks: dict[str, Callable[[], Result]] = {
        "link": lambda: check_link(robot, file, radio),
        "i2c": lambda: check_i2c(robot),
        "encoders": lambda: check_encoders(robot, person),
        "gyro": lambda: check_gyro(robot, person, file=file),
        "flow": lambda: check_flow(robot, person, file=file),
        "motors": lambda: check_motors(robot, person),
        "estop": lambda: check_stops(robot, person),
        "oe": lambda: check_output_enable(robot, person, file=file),
        "button": lambda: check_stop_button(robot, person, file=file),
        "drive": lambda: check_drive(robot, person),
    }
    if only is not None:
        yield checks[only]()
        return
    if file is not None and file.board.motor_driver.pins:
        del checks["i2c"]
    if not _has_button(file):
        del checks["button"]
    if file is None or file.board.gyro is None:
        del checks["gyro"]
    if file is None or file.board.flow is None:
        del checks["flow"]
    if radio is not None:
        checks["radio"] = lambda: check_radio(radio, baud=baud)
    for check in checks.values():
        result = check()
        yield result
        if not result.ok and not keep_going:
            return


def _has_button(file: RobotFile | None) -> bool:
    """Nothing but the robot file knows: without a button it is never pressed."""
    return file is not None and file.board.stop_button_pin is not None
