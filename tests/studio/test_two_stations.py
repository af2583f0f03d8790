# SPDX-License-Identifier: MIT
"""Another station ends the drive of the studio: the page says who it was, and moves the robot no more."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest

from omni.studio.actions import ACTIONS
from omni.studio.session import Session
from omniwheel.dialect import Message
from omniwheel.errors import OmniError, StoppedError
from omniwheel.robot import Robot
from tests.firmware.client import Client, Firmware, connect, firmware, mav
from tests.studio.parts import Opener, running, studio, take_over, until
from tests.waiting import wait_until

LINKS = ("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")
SYSTEM = 254
WHO = f"{SYSTEM}/190"
ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM
STOPS = {"disarm": (ARM, 0.0), "hold": (mav.MAV_CMD_OMNI_TRAJECTORY_STOP,), "e-stop": (mav.MAV_CMD_OMNI_ESTOP, 1.0)}
SETPOINT = "SET_POSITION_TARGET_LOCAL_NED"
STILL = {"vx": 0.0, "vy": 0.0, "wz": 0.0}


def is_armed(message: Any) -> bool:
    return message.get_type() == "HEARTBEAT" and bool(message.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)


def station(robot: Firmware) -> Client:
    """Return another station, on a link of its own."""
    other = connect(robot, 1)
    other.mav.srcSystem = SYSTEM
    other.heartbeat()
    return other


def alive(other: Client) -> bool:
    """Show that the other station is there: a robot that it has in command goes on."""
    other.heartbeat()
    return True


class Page:
    """What a page does to a session, and which messages reached the robot for it."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.sent: list[str] = []
        self.ask("store")  # done by the robot's thread: from here on, nothing else sends
        robot = session.robot
        assert robot is not None
        send = robot.connection.send

        def counted(message: Message) -> None:
            self.sent.append(message.get_type())
            send(message)

        robot.connection.send = counted  # type: ignore[method-assign]

    def begin(self, action: str, **request: Any) -> Future[Any]:
        session = self.session

        def work(robot: Robot) -> Any:
            assert session.edits is not None
            return ACTIONS[action](robot, session.edits, request)

        return session.do(work, is_setpoint=action == "velocity")

    def ask(self, action: str, **request: Any) -> Any:
        return self.begin(action, **request).result(timeout=30.0)

    def drive(self) -> None:
        """Arm, and begin to repeat a velocity."""
        wait_until(self._arms, "the robot does not arm")
        self.ask("velocity", **STILL)

    def _arms(self) -> bool:
        try:
            self.ask("arm")
        except OmniError:
            return False
        return True

    def drive_until_refused(self, other: Client) -> OmniError:
        refusals: list[OmniError] = []

        def refused() -> bool:
            other.heartbeat()
            try:
                self.ask("velocity", **STILL)
            except OmniError as error:
                refusals.append(error)
            return bool(refusals)

        wait_until(refused, "the studio goes on with a drive that another station ended")
        return refusals[0]


@contextmanager
def in_a_world() -> Iterator[Firmware]:
    """A robot whose wheels turn."""
    with running("sitl", *(word for link in LINKS for word in ("--link", link))) as program:
        yield Firmware(None, program.ready["links"])


@contextmanager
def two_stations(robots: AbstractContextManager[Firmware] | None = None) -> Iterator[tuple[Page, Client, Session]]:
    with robots or firmware(links=LINKS) as robot:
        session = Session(robot.links[0])
        session.start()
        try:
            wait_until(lambda: session.phase == "connected", lambda: f"no robot: {session.trouble}")
            yield Page(session), station(robot), session
        finally:
            session.close()


@pytest.mark.parametrize("name", STOPS)
def test_no_setpoint_is_sent_after_another_station_ended_the_drive(name: str) -> None:
    with two_stations() as (page, other, session):
        page.drive()
        other.wait_for(is_armed, "the robot is not armed")
        assert other.command(*STOPS[name]) == mav.MAV_RESULT_ACCEPTED
        refusal = page.drive_until_refused(other)
        assert isinstance(refusal, StoppedError)
        assert WHO in str(refusal)
        wait_until(lambda: WHO in session.drive_ended, "the page is not told who ended its drive")
        page.sent.clear()
        for _ in range(20):
            assert isinstance(page.begin("velocity", **STILL).exception(timeout=30.0), StoppedError)
        assert SETPOINT not in page.sent


def test_a_drive_on_a_path_that_another_station_holds_has_ended_without_a_setpoint() -> None:
    with two_stations(in_a_world()) as (page, other, session):
        page.drive()
        page.ask("start_trajectory", type="circle")
        own = session.robot
        assert own is not None
        wait_until(lambda: own.status.mode == "trajectory", "it follows no path")
        assert session.drive_ended == ""
        assert other.command(*STOPS["hold"]) == mav.MAV_RESULT_ACCEPTED
        wait_until(lambda: alive(other) and WHO in session.drive_ended, "the page is not told who held its robot")
        page.ask("start_trajectory", type="circle")
        wait_until(lambda: not session.drive_ended, "a new drive has not ended")


@pytest.mark.parametrize("name", ["disarm", "hold"])
def test_arming_again_begins_a_new_drive(name: str) -> None:
    with two_stations() as (page, other, session):
        page.drive()
        assert other.command(*STOPS[name]) == mav.MAV_RESULT_ACCEPTED
        page.drive_until_refused(other)
        page.drive()
        wait_until(lambda: not session.drive_ended, "a new drive has not ended")
        page.ask("velocity", **STILL)


def test_a_studio_that_ends_leaves_the_drive_of_another_station_alone() -> None:
    with firmware(links=LINKS) as robot:
        session = Session(robot.links[0])
        session.start()
        try:
            wait_until(lambda: session.phase == "connected", lambda: f"no robot: {session.trouble}")
            other = station(robot)
            Page(session).drive()
            assert other.command(*STOPS["disarm"]) == mav.MAV_RESULT_ACCEPTED
            wait_until(lambda: bool(session.drive_ended), "the end of the drive is not noticed")
            wait_until(lambda: other.command(ARM, 1.0) == mav.MAV_RESULT_ACCEPTED, "the other station cannot arm")
            own = session.robot
            assert own is not None
            wait_until(lambda: alive(other) and own.status.armed, "the studio does not hear that it is armed again")
        finally:
            session.close()
        other.heartbeat()
        other.mav.ping_send(1, 1, 0, 0)
        other.wait("PING")
        other.inbox.clear()  # what the robot said before
        assert is_armed(other.wait("HEARTBEAT"))


@pytest.mark.parametrize("name", STOPS)
def test_the_page_says_who_ended_its_drive_and_lets_go_of_the_controls(name: str, open_page: Opener) -> None:
    with firmware(links=LINKS) as robot, studio("--link", robot.links[0]) as program:
        page = open_page(program.url)
        until(page, "state?.link.phase === 'connected' && robot?.pose")
        take_over(page)
        other = station(robot)
        until(page, "!document.getElementById('arm').disabled")
        page.click("#arm")
        until(page, "robot.armed")
        page.fill("#target-x", "0")
        page.press("#target-x", "Enter")
        until(page, "!document.getElementById('cancel').disabled")
        assert other.command(*STOPS[name]) == mav.MAV_RESULT_ACCEPTED
        until(page, f"document.getElementById('notice').textContent.includes('{WHO}')")
        until(page, "document.getElementById('cancel').disabled")
        if name == "e-stop":
            until(page, "!document.getElementById('release').disabled")
            return
        until(page, "!document.getElementById('arm').disabled")
        if name == "disarm":
            page.click("#arm")
            until(page, "robot.armed && !state.drive_ended")
