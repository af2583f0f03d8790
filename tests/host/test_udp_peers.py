# SPDX-License-Identifier: MIT
"""Several peers at one UDP port: none takes the commands of another one's robot away, and a stop reaches all."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.dialect import mavlink
from omniwheel.link import FileLink, open_link
from omniwheel.signing import Signer
from omniwheel.udp_peers import FORGET_S, MOST_PEERS, UdpPeers, systems_of

ARM, DISARM = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0), (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
ESTOP, HOLD = (mavlink.MAV_CMD_OMNI_ESTOP, 1.0), (mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0)
KEY = bytes(range(32))
WAIT_S = 5.0


def packed(message: Any, system: int, component: int = 1, *, signed: bool = False, version: int = 2) -> bytes:
    codec = mavlink.MAVLink(None, system, component)
    if signed:
        Signer(KEY).attach(codec)
    return bytes(message.pack(codec, force_mavlink1=version == 1))


def heartbeat(system: int, component: int = 1, **how: Any) -> bytes:
    return packed(mavlink.MAVLink_heartbeat_message(10, 0, 1, 0, 3, 3), system, component, **how)


def command(system: int, what: tuple[int, float], **how: Any) -> bytes:
    return packed(mavlink.MAVLink_command_long_message(system, 1, what[0], 0, what[1], *[0.0] * 6), 255, 190, **how)


def peers(**systems: int) -> UdpPeers:
    known = UdpPeers(lambda: 0.0)
    for address, system in systems.items():
        known.hear(address, heartbeat(system))
    return known


# ---- which systems a peer speaks for


@pytest.mark.parametrize("how", [{}, {"signed": True}, {"version": 1}], ids=["plain", "signed", "MAVLink 1"])
def test_the_systems_of_all_frames_of_a_datagram_are_found(how: dict[str, Any]) -> None:
    assert systems_of(heartbeat(7, **how) + heartbeat(9, **how)) == {7, 9}


@pytest.mark.full
@given(st.binary(max_size=100))
def test_any_datagram_has_a_sender(datagram: bytes) -> None:
    known = UdpPeers(lambda: 0.0)
    known.hear("sender", datagram)
    known.hear("other", b"")
    assert set(known.receivers(datagram)) == {"sender", "other"}
    assert systems_of(datagram) <= set(range(256))


# ---- whom a frame goes to


@pytest.mark.parametrize("how", [{}, {"signed": True}, {"version": 1}], ids=["plain", "signed", "MAVLink 1"])
def test_what_is_for_one_robot_goes_to_its_peer(how: dict[str, Any]) -> None:
    known = peers(first=1, second=2)
    known.hear("stranger", b"hello")
    assert known.receivers(command(1, ARM, **how)) == ["first"]
    assert known.receivers(command(2, ARM, **how)) == ["second"]
    sticks = mavlink.MAVLink_manual_control_message(2, 0, 0, 0, 0, 0)
    assert known.receivers(packed(sticks, 255)) == ["second"]


@pytest.mark.parametrize("stop", [ESTOP, DISARM, HOLD], ids=["e-stop", "disarm", "hold"])
@pytest.mark.parametrize("system", [0, 1, 7])
def test_a_stop_goes_to_all(stop: tuple[int, float], system: int) -> None:
    known = peers(first=1, second=2)
    known.hear("stranger", b"hello")
    assert set(known.receivers(command(system, stop))) == {"first", "second", "stranger"}


@pytest.mark.parametrize(
    "frame",
    [heartbeat(255, 190), command(0, ARM), command(7, ARM), b"no frame", b""],
    ids=["broadcast", "for every robot", "for a robot that is not known", "noise", "nothing"],
)
def test_what_has_no_known_target_goes_to_all(frame: bytes) -> None:
    assert set(peers(first=1, second=2).receivers(frame)) == {"first", "second"}


def test_a_gimbal_of_the_robots_system_takes_no_command_away() -> None:
    known = peers(robot=1)
    for _ in range(100):
        known.hear("gimbal", heartbeat(1, 154))
    assert "robot" in known.receivers(command(1, ARM))


def test_a_router_speaks_for_all_its_robots() -> None:
    known = peers(router=1, other=3)
    known.hear("router", heartbeat(2))
    assert known.receivers(command(1, ARM)) == known.receivers(command(2, ARM)) == ["router"]


# ---- how long a peer is known


def test_a_peer_is_known_until_it_is_silent_for_long_and_the_last_one_for_ever() -> None:
    now_s = [0.0]
    known = UdpPeers(lambda: now_s[0])
    known.hear("robot", heartbeat(1))
    known.hear("other", heartbeat(2))
    now_s[0] = FORGET_S - 1.0
    known.hear("other", heartbeat(2))
    assert set(known.receivers(command(1, ESTOP))) == {"robot", "other"}
    now_s[0] = FORGET_S
    known.hear("other", heartbeat(2))
    assert known.receivers(command(1, ESTOP)) == ["other"]
    now_s[0] = 100.0 * FORGET_S
    assert known.receivers(command(1, ESTOP)) == ["other"]


def test_many_strangers_do_not_push_a_robot_out() -> None:
    now_s = [0.0]
    known = UdpPeers(lambda: now_s[0])
    known.hear("robot", heartbeat(1))
    for number in range(1000):
        now_s[0] += 0.01
        known.hear(number, b"scan")
    everybody = known.receivers(command(1, ESTOP))
    assert "robot" in everybody
    assert len(everybody) <= MOST_PEERS


def test_of_many_systems_those_heard_last_are_known() -> None:
    now_s = [0.0]
    known = UdpPeers(lambda: now_s[0])
    for number in range(1, 101):
        now_s[0] += 0.01
        known.hear(number, heartbeat(number))
    assert known.receivers(command(0, ESTOP)) == list(range(101 - MOST_PEERS, 101))


# ---- sockets


@pytest.fixture
def waiting() -> Iterator[tuple[FileLink, int]]:
    """A link that waits, and its port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    link = open_link(f"udp:127.0.0.1:{port}")
    yield link, port
    link.close()


@pytest.fixture
def robots() -> Iterator[list[socket.socket]]:
    """Sockets of two robots."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for one in sockets:
        one.settimeout(WAIT_S)
    yield sockets
    for one in sockets:
        one.close()


def test_two_robots_at_one_port_each_get_theirs_and_both_get_a_stop(
    waiting: tuple[FileLink, int], robots: list[socket.socket]
) -> None:
    link, port = waiting
    for system, robot in enumerate(robots, 1):
        robot.sendto(heartbeat(system), ("127.0.0.1", port))
        assert link.read(WAIT_S) == heartbeat(system)
    link.write(command(1, ARM))
    link.write(command(2, ARM))
    link.write(command(1, ESTOP))
    for system, robot in enumerate(robots, 1):
        assert robot.recv(1000) == command(system, ARM)
        assert robot.recv(1000) == command(1, ESTOP)


def test_a_link_that_speaks_first_hears_and_answers_nobody_else(robots: list[socket.socket]) -> None:
    robot, stranger = robots
    robot.bind(("127.0.0.1", 0))
    link = open_link(f"udpout:127.0.0.1:{robot.getsockname()[1]}")
    link.write(b"hello")
    _, station = robot.recvfrom(1000)
    stranger.sendto(heartbeat(2), station)
    robot.sendto(heartbeat(1), station)
    assert link.read(WAIT_S) == heartbeat(1)
    link.write(b"again")
    assert robot.recv(1000) == b"again"
    stranger.settimeout(0.0)
    with pytest.raises(BlockingIOError):
        stranger.recv(1000)
    link.close()
