# SPDX-License-Identifier: MIT
"""Parameters on trial, from the host's side, on the real firmware in simulated time."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

import omniwheel.robot
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel import FirmwareProcess, Robot
from omniwheel.dialect import TRIAL_BEGIN, mavlink
from omniwheel.errors import CommandRefusedError
from omniwheel.trial import Trial

NAME, BEFORE = "ISMC_LAM_XY", 4.0
SILENCE_MS = 4000


@pytest.fixture
def stepped() -> Iterator[tuple[Robot, SteppedLink]]:
    scenario = load_scenario("demo")
    with FirmwareProcess(parameters=scenario.parameter_values(), links=["tcp:127.0.0.1:0"], lockstep=True) as firmware:
        link = SteppedLink(firmware.open_link(), new_world(scenario))
        link.end_s = math.inf
        with omniwheel.robot.connect(link, clock=link.clock_s) as robot:
            robot.pump(0.5)
            yield robot, link


def fresh(robot: Robot) -> float:
    """Return what the robot says now."""
    return robot.parameters.read(NAME)


def test_what_was_tried_stays_at_the_end(stepped: tuple[Robot, SteppedLink]) -> None:
    robot, link = stepped
    with Trial(robot) as trial:
        trial.set_many({NAME: 5.0})
    link.run(SILENCE_MS, link.drop_received)
    assert fresh(robot) == 5.0


def test_a_program_that_was_silent_may_begin_at_once(stepped: tuple[Robot, SteppedLink]) -> None:
    """Its heartbeat is due, and goes out before its command."""
    robot, link = stepped
    link.run(SILENCE_MS, link.drop_received)
    with Trial(robot) as trial:
        trial.set_many({NAME: 5.0})
    assert fresh(robot) == 5.0


def test_what_the_robot_takes_back_by_itself_is_a_change_like_any_other(stepped: tuple[Robot, SteppedLink]) -> None:
    """Else the history of a try that went back says that it stayed."""
    robot, link = stepped
    seen: list[tuple[float, float]] = []
    robot.parameters.on_change = lambda changes: seen.extend(changes.values())
    with Trial(robot) as trial:
        trial.set_many({NAME: 5.0})
        link.run(SILENCE_MS, link.drop_received)
        trial.set_many({NAME: BEFORE})
    assert seen == [(BEFORE, 5.0), (5.0, BEFORE)]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_after_an_error_the_history_ends_where_it_began(
    error: type[BaseException], stepped: tuple[Robot, SteppedLink]
) -> None:
    robot, _ = stepped
    seen: list[tuple[float, float]] = []
    robot.parameters.on_change = lambda changes: seen.extend(changes.values())

    def fail() -> None:
        with Trial(robot) as trial:
            trial.set_many({NAME: 5.0})
            raise error

    with pytest.raises(error):
        fail()
    assert seen == [(BEFORE, 5.0), (5.0, BEFORE)]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_after_an_error_the_old_values_are_back(error: type[BaseException], stepped: tuple[Robot, SteppedLink]) -> None:
    robot, _ = stepped

    def fail() -> None:
        with Trial(robot) as trial:
            trial.set_many({NAME: 5.0})
            raise error

    with pytest.raises(error):
        fail()
    assert robot.parameters[NAME] == fresh(robot) == BEFORE


def test_a_program_that_was_silent_sends_all_its_values_again(stepped: tuple[Robot, SteppedLink]) -> None:
    """It thinks that the robot has them; the robot has taken them back meanwhile."""
    robot, link = stepped
    trial = Trial(robot).__enter__()
    trial.set_many({NAME: 5.0})
    link.run(SILENCE_MS, link.drop_received)
    trial.set_many({NAME: 5.0})
    assert fresh(robot) == 5.0
    link.run(SILENCE_MS, link.drop_received)
    with pytest.raises(CommandRefusedError):
        trial.__exit__(None, None, None)
    assert fresh(robot) == BEFORE


def test_an_error_after_a_silence_reports_what_the_robot_has_taken_back_by_itself(
    stepped: tuple[Robot, SteppedLink],
) -> None:
    robot, link = stepped
    seen: list[tuple[float, float]] = []
    robot.parameters.on_change = lambda changes: seen.extend(changes.values())

    def fail() -> None:
        with Trial(robot) as trial:
            trial.set_many({NAME: 5.0})
            link.run(SILENCE_MS, link.drop_received)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert robot.parameters[NAME] == BEFORE
    assert seen == [(BEFORE, 5.0), (5.0, BEFORE)]


class Neighbour:
    """Another station on the robot's only link, as on one radio channel: it begins a trial of its own."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._codec = mavlink.MAVLink(None, 254, 190)

    def begins(self) -> None:
        """Send a heartbeat and the command."""
        connection = self._robot.connection
        beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
        begin = mavlink.MAVLink_command_long_message(
            connection.target_system,
            connection.target_component,
            mavlink.MAV_CMD_OMNI_TRIAL,
            0,
            TRIAL_BEGIN,
            *[0.0] * 6,
        )
        for message in (beat, begin):
            connection.link.write(message.pack(self._codec))
        self._robot.pump(0.1)


def test_the_trial_of_another_station_on_the_link_is_not_taken_back(stepped: tuple[Robot, SteppedLink]) -> None:
    robot, _ = stepped
    Neighbour(robot).begins()
    robot.parameters.set_many({NAME: 5.0})
    with pytest.raises(CommandRefusedError), Trial(robot):
        pytest.fail("it began")
    assert fresh(robot) == 5.0


def test_a_program_that_was_killed_leaves_nothing_to_the_next_one(stepped: tuple[Robot, SteppedLink]) -> None:
    robot, _ = stepped
    Trial(robot).__enter__().set_many({NAME: 5.0})
    with Trial(robot) as trial:
        assert robot.parameters[NAME] == BEFORE
        trial.set_many({NAME: 7.0})
    assert fresh(robot) == 7.0


PROGRAM = """
import sys, omniwheel
from omniwheel.trial import Trial
robot = omniwheel.robot.connect(sys.argv[1])
Trial(robot).__enter__().set_many({"ISMC_LAM_XY": 5.0})
print(robot.parameters.read("ISMC_LAM_XY"), flush=True)
robot.pump(600.0)
"""


@pytest.mark.full
def test_the_next_program_finds_the_old_values_although_it_comes_at_once(url: str) -> None:
    """Its heartbeats keep the link alive; but it is another connection."""
    with omniwheel.robot.connect(url) as robot:
        before = fresh(robot)
    with subprocess.Popen([sys.executable, "-c", PROGRAM, url], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline().strip() == "5.0"
        program.kill()
    with omniwheel.robot.connect(url) as robot:
        assert fresh(robot) == before != 5.0


def test_firmware_that_knows_no_trials_is_tuned_as_before(
    stepped: tuple[Robot, SteppedLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, _ = stepped

    def refuse(*_: object, what: str, **__: Any) -> None:
        raise CommandRefusedError(what, "UNSUPPORTED")

    monkeypatch.setattr(robot.commands, "send", refuse)
    with Trial(robot) as trial:
        trial.set_many({NAME: 5.0})
        assert fresh(robot) == 5.0
    assert fresh(robot) == 5.0


def test_an_armed_robot_begins_no_trial(stepped: tuple[Robot, SteppedLink]) -> None:
    robot, _ = stepped
    robot.arm()
    with pytest.raises(CommandRefusedError, match="disarm first"), Trial(robot):
        pytest.fail("it began")
    robot.disarm()
