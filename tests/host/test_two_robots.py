# SPDX-License-Identifier: MIT
"""Two robots on one line: they are refused and named, and --system chooses. A stop stops both."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner, Result

from omni.cli import app
from omni.cli.group import _options_first
from omni.hub.core import HubSettings
from omniwheel.default_system import default_system
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkTimeoutError, SeveralRobotsError
from omniwheel.frames import Pose
from omniwheel.mocap.bridge import Bridge
from omniwheel.mocap.source import MocapPose
from omniwheel.robot import connect
from tests.host.two_robots import FIRST, SECOND, TwoRobots, everybody_connects_to
from tests.hub.bench import Bench

ARM, ESTOP = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_OMNI_ESTOP
LINK = ("--link", "tcp:127.0.0.1:1")


def omni(line: TwoRobots, *words: str) -> Result:
    with everybody_connects_to(line):
        return CliRunner().invoke(app, [*words, *LINK], env={"COLUMNS": "200"})


@pytest.mark.parametrize("tell_time", [False, True])
@pytest.mark.parametrize("apart_s", [0.0, 0.3, 0.6, 0.99])
def test_two_robots_are_refused_and_named(apart_s: float, tell_time: bool) -> None:
    line = TwoRobots(apart_s=apart_s, tell_time=tell_time)
    with pytest.raises(SeveralRobotsError) as caught:
        connect(line, clock=line.clock)
    assert caught.value.systems == (FIRST, SECOND)
    assert line.commands(ARM) == {FIRST: 0, SECOND: 0}


def test_robots_that_tell_their_time_are_known_without_waiting_for_heartbeats() -> None:
    line = TwoRobots(apart_s=0.9, tell_time=True)
    with pytest.raises(SeveralRobotsError):
        connect(line, clock=line.clock)
    assert line.clock() < 0.2


@pytest.mark.parametrize("system", [FIRST, SECOND])
def test_only_the_chosen_robot_is_commanded(system: int) -> None:
    line = TwoRobots()
    with connect(line, clock=line.clock, system_id=system) as robot:
        robot.arm()
        robot.set_velocity(0.1, 0.0, 0.0)
        assert robot.status.heartbeat is not None
    assert line.commands(ARM) == {FIRST: int(system == FIRST), SECOND: int(system == SECOND)}
    moved = {
        number: any(m.get_type() == "SET_POSITION_TARGET_LOCAL_NED" for m in one.received)
        for number, one in line.robots.items()
    }
    assert moved == {FIRST: system == FIRST, SECOND: system == SECOND}


def test_a_robot_that_is_not_there_is_not_replaced_by_another_one() -> None:
    line = TwoRobots()
    with pytest.raises(LinkTimeoutError) as caught:
        connect(line, clock=line.clock, system_id=8, timeout_s=2.0)
    assert "7, 9" in caught.value.hint


def test_a_robot_that_comes_later_is_said_once_and_not_commanded() -> None:
    line = TwoRobots(apart_s=5.0)
    with connect(line, clock=line.clock) as robot:
        said: list[int] = []
        robot.connection.on_other_robot = said.append
        robot.pump(10.0)
        assert robot.status.heartbeat_age_s < 1.1
        robot.arm()
    assert said == [SECOND]
    assert line.commands(ARM) == {FIRST: 1, SECOND: 0}


@pytest.mark.parametrize(
    "words", ["drive velocity 0.1 0 0 --no-log", "params set WS_P=4", "monitor --once", "autotune", "stop --release"]
)
def test_commands_refuse_and_name_both(words: str) -> None:
    line = TwoRobots()
    refused = omni(line, *words.split(), "--json")
    assert refused.exit_code == 2, refused.output
    assert json.loads(refused.stdout)["error"]["type"] == "SeveralRobotsError"
    sent = {m.get_type() for robot in line.robots.values() for m in robot.received}
    assert sent <= {"HEARTBEAT", "TIMESYNC"}


def test_a_command_finds_its_robot_by_system() -> None:
    line = TwoRobots()
    assert omni(line, "params", "set", "WS_P=4.5", "--system", str(SECOND)).exit_code == 0
    assert (line.robots[FIRST].values["WS_P"], line.robots[SECOND].values["WS_P"]) != (4.5, 4.5)
    assert line.robots[SECOND].values["WS_P"] == 4.5
    assert omni(line, "--system", str(FIRST), "params", "set", "WS_P=5.5").exit_code == 0
    assert (line.robots[FIRST].values["WS_P"], line.robots[SECOND].values["WS_P"]) == (5.5, 4.5)


def pose_fixes(line: TwoRobots) -> dict[int, int]:
    kinds = ("VICON_POSITION_ESTIMATE", "OMNI_POSE_FIX")
    return {number: sum(m.get_type() in kinds for m in one.received) for number, one in line.robots.items()}


def test_a_pose_fix_which_would_reach_both_is_refused() -> None:
    line = TwoRobots(apart_s=5.0)
    with connect(line, clock=line.clock) as robot:
        robot.send_pose_fix(0.1, 0.2, 0.3)
        robot.pump(10.0)
        with pytest.raises(SeveralRobotsError, match="VICON_POSITION_ESTIMATE") as caught:
            robot.send_pose_fix(0.1, 0.2, 0.3)
        assert caught.value.systems == (FIRST, SECOND)
        robot.arm()
        robot.set_pose(0.1, 0.2, 0.3)
    assert pose_fixes(line) == {FIRST: 1, SECOND: 1}


class OnePose:
    """A motion-capture stream of one pose."""

    name = "one pose"

    def __init__(self, line: TwoRobots) -> None:
        self.clock = line.clock
        self.ended = False

    def read(self, timeout_s: float) -> MocapPose | None:
        if self.ended:
            return None
        self.ended = True
        return MocapPose(Pose(1.0, 2.0, 0.5), self.clock(), self.clock(), 1)

    def close(self) -> None:
        """There is nothing to close."""


@pytest.mark.parametrize("system", [FIRST, SECOND])
def test_a_bridge_for_one_robot_moves_no_other_robot(system: int) -> None:
    line = TwoRobots(apart_s=0.7, tell_time=True)
    with Bridge(OnePose(line), line, system_id=system, clock=line.clock) as bridge, pytest.raises(SeveralRobotsError):
        bridge.run(1.0)
    assert pose_fixes(line) == {FIRST: 0, SECOND: 0}


@pytest.mark.parametrize("words", [["stop"], ["stop", "--disarm"]])
def test_a_stop_stops_all_and_each_confirms(words: list[str]) -> None:
    line = TwoRobots()
    stopped = omni(line, *words, "--json")
    assert stopped.exit_code == 0, stopped.output
    assert json.loads(stopped.stdout)["systems"] == [FIRST, SECOND]
    kind = (ESTOP, 1.0) if len(words) == 1 else (ARM, 0.0)
    assert all(kind in robot.commands() for robot in line.robots.values())


def test_a_robot_that_refuses_the_stop_keeps_no_other_one_from_it() -> None:
    line = TwoRobots()
    line.robots[FIRST].command_results[ARM] = mavlink.MAV_RESULT_DENIED
    assert omni(line, "stop", "--disarm").exit_code == 1
    assert (ARM, 0.0) in line.robots[SECOND].commands()


def test_a_stop_with_system_stops_that_one_only() -> None:
    line = TwoRobots()
    assert omni(line, "stop", "--system", str(SECOND)).exit_code == 0
    assert not line.commands(ESTOP)[FIRST]
    assert line.commands(ESTOP)[SECOND]


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (["drive", "--system", "3", "keys"], ["--system", "3", "drive", "keys"]),
        (["drive", "--system=3", "--signing-key", "k"], ["--system=3", "--signing-key", "k", "drive"]),
        (["drive", "--", "--system", "3"], ["drive", "--", "--system", "3"]),
        (["drive", "--system"], ["--system", "drive"]),
    ],
)
def test_the_option_may_stand_anywhere(given: list[str], wanted: list[str]) -> None:
    assert _options_first(given) == wanted


@pytest.mark.parametrize("number", ["0", "255", "-1", "x", "9" * 400])
def test_a_system_id_that_no_robot_has_is_refused(number: str) -> None:
    assert omni(TwoRobots(), "params", "list", f"--system={number}").exit_code == 2
    assert default_system() is None


def test_a_hub_serves_the_chosen_robot() -> None:
    bench = Bench(HubSettings("port", 200_000.0, 20_000.0, system_id=SECOND))
    driver = bench.join("driver")

    def beats(system: int, *, armed: bool) -> None:
        bench.robot_system(system)
        bench.robot_is(armed=armed)

    beats(FIRST, armed=True)
    assert not bench.hub.command.armed
    bench.now_s += 20.0
    beats(FIRST, armed=True)
    assert not bench.hub.command.armed, "another robot, however long the chosen one is silent"
    beats(SECOND, armed=True)
    assert bench.hub.command.armed
    driver.send(mavlink.MAVLink_param_set_message(SECOND, 1, b"SYS_ID", 12.0, 9))
    beats(12, armed=False)
    assert not bench.hub.command.armed, "a new id that was asked for is followed"
