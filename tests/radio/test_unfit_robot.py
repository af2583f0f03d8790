# SPDX-License-Identifier: MIT
"""An image whose own values make no robot: it comes up, says so, answers, stores, stops; and it does not arm."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from omniwheel.dialect import mavlink
from tests.radio.memory_robot import MemoryRobot
from tests.radio.station import ARM, Station, state_of, usb

STORAGE = mavlink.MAV_CMD_PREFLIGHT_STORAGE
LOAD, STORE, OWN = 0, 1, 2
DENIED, ACCEPTED, FAILED = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
UNFIT = {
    "WHEELS": 0.0,
    "WHEEL_RADIUS": -1.0,
    "WHEEL_DIST": math.nan,
    "ENC_CPR": math.inf,
    "SYS_ID": 255.0,
    "MOT_DRIVER": 77.0,
    "W2_ANGLE": 0.0,  # two wheels on one bearing
    "W3_IN1_CH": 9.0,  # two bridge inputs on one channel of the chip
    "LINK2_BAUD": math.nan,
}
SAID = "own values do not fit: "


@contextmanager
def unfit(**values: float) -> Iterator[tuple[MemoryRobot, Station]]:
    """Start a robot whose image brings these values."""
    with MemoryRobot() as robot:
        for name, value in values.items():
            robot.set_own(name, value)
        robot.reboot()
        yield robot, usb(robot)


def heard(station: Station, ticks: int = 2000) -> list[str]:
    """Let the robot go on and return its status texts."""
    return [message.text for message in station.run(ticks) if message.get_type() == "STATUSTEXT"]


def set_parameter(station: Station, name: str, value: float) -> None:
    station.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
    station.run()


@pytest.mark.parametrize("name", UNFIT)
def test_it_comes_up_disarmed_says_what_is_wrong_and_does_not_arm(name: str) -> None:
    with unfit(**{name: UNFIT[name]}) as (robot, station):
        (told,) = [text for text in heard(station) if text.startswith(SAID)]
        assert name[:2] in told or "W*_ANGLE" in told
        station.heartbeat()
        assert state_of(robot) == "disarmed"
        station.mav.command_long_send(1, 1, ARM, 0, 1.0, 0, 0, 0, 0, 0, 0)
        assert any(text.startswith("cannot arm: own values do not fit") for text in heard(station, 200))
        assert station.command(ARM, 1.0) == DENIED
        assert state_of(robot) == "disarmed"
        assert not robot.driven


def test_nor_does_it_arm_whatever_else_is_set_or_loaded_and_a_stop_is_done() -> None:
    with unfit(WHEELS=math.nan) as (robot, station):
        heard(station)
        set_parameter(station, "ISMC_LAM_XY", 7.0)
        assert station.command(STORAGE, OWN) == FAILED
        assert station.command(STORAGE, LOAD) == FAILED
        station.heartbeat()
        assert station.command(ARM, 1.0) == DENIED
        assert station.command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0) == ACCEPTED
        assert state_of(robot) == "estop"


@pytest.mark.parametrize("restarted", [False, True])
def test_a_stored_set_that_fits_makes_it_a_robot_again(restarted: bool) -> None:
    with unfit(W2_ANGLE=0.0) as (robot, station):
        heard(station)
        for name, value in {"WHEEL_RADIUS": 0.05, "W2_ANGLE": 120.0}.items():
            set_parameter(station, name, value)
        assert station.command(STORAGE, STORE) == ACCEPTED
        if restarted:
            robot.reboot()
            assert not any(text.startswith(SAID) for text in heard(station))
        else:
            assert station.command(STORAGE, LOAD) == ACCEPTED
        station.heartbeat()
        assert station.command(ARM, 1.0) == ACCEPTED
        assert state_of(robot) == "armed"


def test_what_was_stored_before_does_not_keep_it_from_coming_up() -> None:
    """A value that is no number is never equal to itself: the search for what clashes must end all the same."""
    with unfit() as (robot, station):
        heard(station)
        set_parameter(station, "ISMC_LAM_XY", 7.0)
        assert station.command(STORAGE, STORE) == ACCEPTED
        robot.set_own("WHEEL_RADIUS", math.nan)
        robot.reboot()
        assert any(text.startswith(SAID) for text in heard(station))
        assert station.command(ARM, 1.0) == DENIED
        robot.set_own("WHEEL_RADIUS", 0.05)
        robot.reboot()
        assert not any(text.startswith(SAID) for text in heard(station))


def test_a_robot_whose_values_fit_says_nothing_of_the_kind() -> None:
    with unfit(WHEEL_RADIUS=0.05) as (_, station):
        assert not any(text.startswith(SAID) for text in heard(station))
        station.heartbeat()
        assert station.command(ARM, 1.0) == ACCEPTED
