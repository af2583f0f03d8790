# SPDX-License-Identifier: MIT
"""The first heartbeat of a robot: selects the robot of a connection, or gives the cause of its absence."""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.connection import Connection
from omniwheel.dialect import Message, is_autopilot, mavlink, tells_time
from omniwheel.errors import LinkTimeoutError, SeveralRobotsError, SigningKeyError
from omniwheel.signing import is_signed

LISTEN_S = 1.1
"""So long a robot that does not tell its time is listened to: its heartbeats, and another's, come once a second."""
ANSWERS_APART_S = 0.05
"""Robots that are asked at the same time answer within this time of each other, beside the line's delay."""
_STOP_AGAIN_S = 0.25
_KEY_HINT = "`omni radio` shows the fingerprint of the robot's key (over USB), with --show-key FILE that of a key file"
_SIGN_HINT = "give its key with --signing-key FILE or OMNI_SIGNING_KEY; over USB none is needed"


def await_robot(connection: Connection, system_id: int | None, timeout_s: float, stop: bool) -> None:
    """Wait for the heartbeat of a robot, of this system if it is not None; the connection is to it from then on.

    If it is None, there must be one robot only: every robot is asked for its time, and heartbeats are listened to until
    this one has answered, and as long again for the others. A connection without heartbeats only looks on: it sends
    nothing, and knows of the others that it has heard by then. Listeners get what the robot has said by then. With
    ``stop`` everybody is told to stop meanwhile. Raises LinkTimeoutError, SigningKeyError, SeveralRobotsError.
    """
    heard: list[Message] = []

    def wanted(message: Message) -> bool:
        return is_autopilot(message) and system_id in (None, message.get_srcSystem())

    with connection.only_listener(heard.append):
        found = _stopping(connection, wanted, system_id, timeout_s) if stop else connection.wait(wanted, timeout_s)
        if found is None and connection.wrongly_signed:
            raise SigningKeyError(f"messages from {connection.link.url} are signed with another key", hint=_KEY_HINT)
        if found is None:
            raise _no_heartbeat(connection, system_id, timeout_s, _robots(heard))
        if connection.signer is None and is_signed(found.get_msgbuf()):
            raise SigningKeyError(f"the robot at {connection.link.url} requires signed messages", hint=_SIGN_HINT)
        if system_id is None and connection.sends_heartbeats:
            _listen_for_others(connection, found)
    robots = _robots(heard)
    if system_id is None and len(robots) > 1:
        raise SeveralRobotsError(connection.link.url, robots)
    connection.target_system = found.get_srcSystem()
    connection.target_component = found.get_srcComponent()
    connection.other_systems |= set(robots) - {connection.target_system}
    for message in filter(connection.is_from_robot, heard):
        connection.hand_out(message)


def _listen_for_others(connection: Connection, robot: Message) -> None:
    """Listen to the line for as long as it takes to hear whether there is another robot than this one."""
    begin_s = connection.clock()
    stamp_ns = round(begin_s * 1e9)
    connection.send(mavlink.MAVLink_timesync_message(0, stamp_ns))

    def answers(message: Message) -> bool:
        return tells_time(message) and message.ts1 == stamp_ns and message.get_srcSystem() == robot.get_srcSystem()

    if connection.wait(answers, LISTEN_S) is not None:
        connection.pump(connection.clock() - begin_s + ANSWERS_APART_S)


def _robots(heard: list[Message]) -> list[int]:
    """Return the system ids of the robots among those that were heard."""
    return sorted({message.get_srcSystem() for message in heard if is_autopilot(message) or tells_time(message)})


def _stopping(
    connection: Connection, wanted: Callable[[Message], bool], system_id: int | None, timeout_s: float
) -> Message | None:
    """Wait as Connection.wait does, and meanwhile tell the robot, or all, to stop: one may hear and not be heard."""
    end_s = connection.clock() + timeout_s
    found = None
    while found is None and connection.clock() < end_s:
        connection.send(
            mavlink.MAVLink_command_long_message(system_id or 0, 0, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1, *[0] * 6)
        )
        found = connection.wait(wanted, min(_STOP_AGAIN_S, max(0.0, end_s - connection.clock())))
    return found


def _no_heartbeat(
    connection: Connection, system_id: int | None, timeout_s: float, others: list[int]
) -> LinkTimeoutError:
    url = connection.link.url
    if connection.rx_bytes == 0:
        message = f"no data from {url} within {timeout_s:g} s"
        return LinkTimeoutError(message, hint="check that the robot is switched on and the port is right")
    if connection.rx_bad_bytes * 2 > connection.rx_bytes:
        message = f"the data from {url} is not MAVLink 2 ({connection.rx_bytes} bytes in {timeout_s:g} s)"
        return LinkTimeoutError(message, hint="check the baud rate, given as PORT,BAUD, and the device")
    who = "a robot" if system_id is None else f"a robot with system id {system_id}"
    hint = f"robots with the system ids {', '.join(map(str, others))} are on this link" if others else ""
    return LinkTimeoutError(f"{url} sends MAVLink, but no heartbeat of {who} within {timeout_s:g} s", hint=hint)
