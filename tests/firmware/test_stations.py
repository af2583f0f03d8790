# SPDX-License-Identifier: MIT
"""Two links: whose silence stops the robot, and who may stop it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.firmware.client import Client, connect, firmware, mav
from tests.firmware.test_commands import ARM, ARMED, DISARMED, FAILSAFE, send_velocity

ESTOP = 4
STILL_RAD_S = 0.1


class TwoLinks:
    """A robot in lockstep with the world and a ground station on link 1 and another ground station on link 2."""

    def __init__(self, first: Client, second: Client) -> None:
        self.first = first
        self.second = second
        self.texts: list[str] = []

    def sync(self) -> None:
        """Wait until the robot has read what the second station sent."""
        self.second.mav.ping_send(1, self.first.sequence, 0, 0)
        self.second.wait("PING", seq=self.first.sequence)
        self.second.inbox.clear()

    def run(self, seconds: float, *alive: Client) -> int:
        """Let time pass with heartbeats of some stations; return the safety state at the end."""
        state = 0
        for tick in range(round(seconds * 1000)):
            if tick % 200 == 0:
                for station in alive:
                    station.heartbeat()
                self.sync()
            answer = self.first.tick()
            state = answer.actuators.state
            self.texts += [m.text for m in answer.others if m.get_type() == "STATUSTEXT"]
        return state


@pytest.fixture
def two() -> Iterator[TwoLinks]:
    with firmware("--lockstep", links=("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")) as robot:
        links = TwoLinks(connect(robot, 0), connect(robot, 1))
        links.first.set("SAFE_LINK_TO", 0.5)
        yield links
        links.first.socket.close()
        links.second.socket.close()


def test_only_the_commanding_station_keeps_the_robot_going(two: TwoLinks) -> None:
    two.first.armed()
    assert two.run(0.4, two.first, two.second) == ARMED
    assert two.run(0.8, two.second) == FAILSAFE
    assert "link 1 lost: it had the command" in two.texts
    assert "failsafe: link loss" in two.texts


def test_another_stations_silence_is_only_said(two: TwoLinks) -> None:
    two.first.armed()
    two.run(0.4, two.first, two.second)
    assert two.run(0.8, two.first) == ARMED
    assert "link 2 lost: its ground station is silent" in two.texts
    assert two.run(0.3, two.first, two.second) == ARMED
    assert "link 2 is back" in two.texts


def test_silence_of_both_stops(two: TwoLinks) -> None:
    two.first.armed()
    two.run(0.4, two.first, two.second)
    assert two.run(0.8) == FAILSAFE


def test_a_set_point_hands_the_command_over(two: TwoLinks) -> None:
    two.first.armed()
    two.run(0.4, two.first, two.second)
    send_velocity(two.second, 0.0, 0.0, 0.0)
    two.sync()
    two.second.command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP)
    assert two.run(0.8, two.second) == ARMED
    assert "link 1 lost: its ground station is silent" in two.texts
    assert two.run(0.8, two.first) == FAILSAFE


def test_set_points_without_a_heartbeat_hand_nothing_over(two: TwoLinks) -> None:
    """A program that only streams set-points is not somebody who watches the robot."""
    two.first.armed()
    send_velocity(two.second, 0.0, 0.0, 0.0)
    two.second.command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP)
    assert two.run(0.8, two.first) == ARMED


def test_any_station_can_stop_and_then_take_over(two: TwoLinks) -> None:
    two.first.armed()
    two.run(0.4, two.first, two.second)
    assert two.second.command(mav.MAV_CMD_OMNI_ESTOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert two.first.tick().actuators.state == ESTOP
    assert two.second.command(mav.MAV_CMD_OMNI_ESTOP, 0) == mav.MAV_RESULT_ACCEPTED
    assert two.run(0.1, two.second) == DISARMED
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert two.run(0.8, two.second) == ARMED
    assert two.second.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert two.first.tick().actuators.state == DISARMED


def test_after_a_lost_commander_the_other_station_gets_it_going_again(two: TwoLinks) -> None:
    two.first.armed()
    two.run(0.4, two.first, two.second)
    assert two.run(0.8, two.second) == FAILSAFE
    assert two.second.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert two.run(0.3, two.second) == DISARMED
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert two.run(0.8, two.second) == ARMED


def test_another_robots_heartbeat_is_no_sign_of_a_ground_station(robot: Client) -> None:
    robot.set("SAFE_LINK_TO", 0.5)
    robot.armed()
    state = ARMED
    for _ in range(8):
        robot.mav.heartbeat_send(mav.MAV_TYPE_GROUND_ROVER, mav.MAV_AUTOPILOT_GENERIC, 0, 0, 0)
        state = robot.ticks(100)[-1].actuators.state
    assert state == FAILSAFE


def heartbeats(ticks: list[Any]) -> list[Any]:
    return [m for tick in ticks for m in tick.others if m.get_type() == "HEARTBEAT"]


def test_a_change_of_state_is_told_at_once(robot: Client) -> None:
    robot.armed()
    robot.ticks(50)
    for wanted in (0, mav.MAV_MODE_FLAG_SAFETY_ARMED):
        robot.heartbeat()
        assert robot.command(ARM, int(wanted != 0)) == mav.MAV_RESULT_ACCEPTED
        (beat,) = heartbeats(robot.ticks(3))
        assert beat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED == wanted


def test_arming_right_after_disarming_is_not_mistaken_for_being_armed(robot: Client) -> None:
    robot.armed()
    robot.ticks(10)
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(ARM, 1) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    assert robot.ticks(5)[-1].actuators.state == DISARMED
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.ticks(5)[-1].actuators.state == ARMED


def test_a_fault_that_comes_with_the_arm_command_is_named(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(50)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    ticks = robot.ticks(5, battery_v=float("nan"))
    assert ticks[-1].actuators.state == DISARMED
    texts = [m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT"]
    assert "not armed: not finite" in texts


@pytest.mark.parametrize("value", [1.0, float("nan"), -1.0, 0.3])
def test_only_a_clear_release_releases_the_emergency_stop(robot: Client, value: float) -> None:
    robot.armed()
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, value) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, value) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP


OTHER_COMPONENTS = ("CAMERA", "GIMBAL", "BATTERY", "ONBOARD_CONTROLLER", "GENERIC", "ADSB")


@pytest.mark.parametrize("name", OTHER_COMPONENTS)
def test_a_component_that_is_no_ground_station_keeps_no_trajectory_going(robot: Client, name: str) -> None:
    robot.set("SAFE_LINK_TO", 0.5)
    robot.armed()
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1, -1, 0) == mav.MAV_RESULT_ACCEPTED
    kind = getattr(mav, f"MAV_TYPE_{name}")
    state = ARMED
    for _ in range(8):
        robot.mav.heartbeat_send(kind, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        state = robot.ticks(100)[-1].actuators.state
    assert state == FAILSAFE


def test_an_onlooker_on_the_link_in_command_keeps_nothing_going(robot: Client) -> None:
    """Two stations share a radio: the one that commands falls silent."""
    robot.set("SAFE_LINK_TO", 0.5)
    robot.armed()
    onlooker = mav.MAVLink(robot, srcSystem=254, srcComponent=190)
    texts = []
    state = ARMED
    for _ in range(8):
        onlooker.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        ticks = robot.ticks(100)
        texts += [m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT"]
        state = ticks[-1].actuators.state
    assert state == FAILSAFE
    assert "link 1 lost: it had the command" in texts


def test_a_set_point_on_a_shared_link_hands_the_command_over_to_its_own_sender(robot: Client) -> None:
    robot.set("SAFE_LINK_TO", 0.5)
    robot.armed()
    other = Client(robot.socket)
    other.mav.srcSystem = 254
    other.heartbeat()
    send_velocity(other, 0.0, 0.0, 0.0)
    assert other.command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP) == mav.MAV_RESULT_ACCEPTED
    state = ARMED
    for _ in range(8):
        other.heartbeat()
        state = robot.ticks(100)[-1].actuators.state
    assert state == ARMED
    for _ in range(8):
        robot.heartbeat()
        state = robot.ticks(100)[-1].actuators.state
    assert state == FAILSAFE


def test_a_flood_of_stations_does_not_displace_the_one_in_command(robot: Client) -> None:
    robot.set("SAFE_LINK_TO", 0.5)
    robot.armed()
    for _ in range(4):
        robot.heartbeat()
        for system in range(200, 250):
            mav.MAVLink(robot, srcSystem=system).heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        assert robot.ticks(200)[-1].actuators.state == ARMED
    state = ARMED
    for _ in range(4):
        for system in range(200, 250):
            mav.MAVLink(robot, srcSystem=system).heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        state = robot.ticks(200)[-1].actuators.state
    assert state == FAILSAFE


def drives_on(two: TwoLinks, seconds: float, *alive: Client) -> bool:
    """Let the first station stream a velocity, whatever the robot says; return whether wheels turn at the end."""
    wanted: list[float] = []
    for tick in range(round(seconds * 1000)):
        if tick % 50 == 0:
            send_velocity(two.first, 0.1, 0.0, 0.0)
        if tick % 200 == 0:
            for station in alive:
                station.heartbeat()
            two.sync()
        answer = two.first.tick()
        two.texts += [m.text for m in answer.others if m.get_type() == "STATUSTEXT"]
        wanted = list(answer.actuators.wheel_reference)
    return turn(wanted)


def turn(wheels_rad_s: list[float]) -> bool:
    return max(map(abs, wheels_rad_s)) > STILL_RAD_S


STOP_COMMANDS = {
    "disarm": (ARM, 0.0),
    "hold": (mav.MAV_CMD_OMNI_TRAJECTORY_STOP,),
    "mode hold": (mav.MAV_CMD_DO_SET_MODE, 1.0, 0.0),
}


@pytest.mark.parametrize("name", STOP_COMMANDS)
def test_set_points_of_a_drive_that_another_station_ended_never_move_the_robot_again(two: TwoLinks, name: str) -> None:
    two.first.armed()
    assert drives_on(two, 0.6, two.first, two.second)
    assert two.second.command(*STOP_COMMANDS[name]) == mav.MAV_RESULT_ACCEPTED
    drives_on(two, 0.6, two.first, two.second)
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert not drives_on(two, 1.5, two.first, two.second)
    assert "setpoint refused: its drive has ended" in two.texts
    assert two.first.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert drives_on(two, 0.6, two.first, two.second), "a drive of its own"


@pytest.mark.parametrize("name", STOP_COMMANDS)
def test_a_drive_ends_before_its_first_set_point_too(two: TwoLinks, name: str) -> None:
    two.first.armed()
    assert two.run(0.1, two.first, two.second) == ARMED
    assert two.second.command(*STOP_COMMANDS[name]) == mav.MAV_RESULT_ACCEPTED
    two.run(0.1, two.first, two.second)
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert not drives_on(two, 1.0, two.first, two.second)
    assert "setpoint refused: its drive has ended" in two.texts


def test_offboard_starts_a_new_drive_of_its_station_but_not_before_the_robot_is_armed(two: TwoLinks) -> None:
    offboard = (mav.MAV_CMD_DO_SET_MODE, 1.0, 6.0)
    two.first.armed()
    assert drives_on(two, 0.6, two.first, two.second)
    assert two.second.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    drives_on(two, 0.3, two.first, two.second)
    assert two.first.command(*offboard) == mav.MAV_RESULT_ACCEPTED
    drives_on(two, 0.3, two.first, two.second)
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert not drives_on(two, 0.6, two.first, two.second), "another station armed"
    assert two.first.command(*offboard) == mav.MAV_RESULT_ACCEPTED
    assert drives_on(two, 0.6, two.first, two.second), "a drive of its own"


def test_set_points_end_with_a_failsafe_too(two: TwoLinks) -> None:
    two.first.armed()
    assert drives_on(two, 0.6, two.first, two.second)
    drives_on(two, 0.8, two.second)
    assert two.second.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    drives_on(two, 0.1, two.second)
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert not drives_on(two, 0.8, two.first, two.second)


def test_a_path_that_waits_starts_only_if_the_station_that_asked_for_it_arms(two: TwoLinks) -> None:
    two.run(0.1, two.first, two.second)
    assert two.first.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1, -1, 0) == mav.MAV_RESULT_ACCEPTED
    two.run(0.1, two.first, two.second)
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    two.run(0.5, two.first, two.second)
    assert not turn(two.first.tick().actuators.wheel_reference)
    assert "path not started: another station armed" in two.texts


@pytest.mark.parametrize("stop", ["disarm", "e-stop", "termination"])
def test_who_stops_anothers_drive_is_said(two: TwoLinks, stop: str) -> None:
    commands = {
        "disarm": (mav.MAV_CMD_COMPONENT_ARM_DISARM, 0),
        "e-stop": (mav.MAV_CMD_OMNI_ESTOP, 1),
        "termination": (mav.MAV_CMD_DO_FLIGHTTERMINATION, 1),
    }
    number, first = commands[stop]
    two.first.armed()
    two.run(0.2, two.first, two.second)
    two.second.mav.command_long_send(1, 1, number, 0, first, 0, 0, 0, 0, 0, 0)
    assert two.run(0.2, two.first, two.second) != ARMED
    sender = two.second.mav
    assert f"stopped by station {sender.srcSystem}/{sender.srcComponent} on link 2" in two.texts


@pytest.mark.parametrize("name", ["hold", "mode hold"])
def test_who_holds_the_robot_in_anothers_drive_is_said(two: TwoLinks, name: str) -> None:
    two.first.armed()
    two.run(0.2, two.first, two.second)
    assert two.first.command(*STOP_COMMANDS[name]) == mav.MAV_RESULT_ACCEPTED
    two.run(0.1, two.first, two.second)
    assert not any("held by" in text for text in two.texts), "its own"
    assert two.second.command(*STOP_COMMANDS[name]) == mav.MAV_RESULT_ACCEPTED
    assert two.run(0.2, two.first, two.second) == ARMED
    sender = two.second.mav
    assert f"held by station {sender.srcSystem}/{sender.srcComponent} on link 2" in two.texts


def test_ones_own_stop_is_not(two: TwoLinks) -> None:
    two.first.armed()
    two.run(0.2, two.first, two.second)
    two.first.mav.command_long_send(1, 1, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0)
    assert two.run(0.2, two.first, two.second) == DISARMED
    assert not any("stopped by" in text for text in two.texts)


def crowd(client: Client, systems: range) -> None:
    """Many stations show themselves at the same moment, as behind a hub."""
    for system in systems:
        mav.MAVLink(client, srcSystem=system).heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)


def test_a_crowd_of_stations_does_not_revive_a_drive_that_was_ended(two: TwoLinks) -> None:
    two.first.armed()
    assert drives_on(two, 0.6, two.first, two.second)
    assert two.second.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    drives_on(two, 0.3, two.first, two.second)
    assert two.second.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    for _ in range(3):
        crowd(two.second, range(200, 220))
        two.sync()
        assert not drives_on(two, 0.3, two.first, two.second)


def test_arming_in_the_moment_after_a_disarm_revives_no_drive(two: TwoLinks) -> None:
    two.first.armed()
    assert drives_on(two, 0.6, two.first, two.second)
    assert two.second.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    while two.second.command(ARM, 1) != mav.MAV_RESULT_ACCEPTED:
        send_velocity(two.first, 0.1, 0.0, 0.0)
        two.first.tick()
    assert not drives_on(two, 1.0, two.first, two.second)


@pytest.mark.parametrize("name", STOP_COMMANDS)
def test_of_three_stations_the_one_that_armed_last_drives(two: TwoLinks, name: str) -> None:
    """The third one, on the second's link, stops the second's drive and arms. Both others go on streaming."""
    third = Client(two.second.socket)
    third.mav.srcSystem = 254
    two.first.armed()
    third.heartbeat()
    assert drives_on(two, 0.3, two.first, two.second)
    send_velocity(two.second, 0.1, 0.0, 0.0)
    assert third.command(*STOP_COMMANDS[name]) == mav.MAV_RESULT_ACCEPTED
    drives_on(two, 0.3, two.first, two.second, third)
    assert third.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    for _ in range(10):
        send_velocity(two.second, 0.1, 0.0, 0.0)
        assert not drives_on(two, 0.1, two.first, two.second, third)
    sender = third.mav
    assert any(f"by station {sender.srcSystem}/{sender.srcComponent} on link 2" in text for text in two.texts)
