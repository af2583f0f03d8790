# SPDX-License-Identifier: MIT
"""Until a robot is heard for the first time: whom a connection is to, and why nobody is there."""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.connection import Connection
from omniwheel.dialect import Message, is_autopilot, mavlink
from omniwheel.errors import LinkTimeoutError, SigningKeyError
from omniwheel.signing import is_signed

_STOP_AGAIN_S = 0.25
_KEY_HINT = "`omni radio key show` tells the fingerprints of the robot's key (over USB) and of a file's"
_SIGN_HINT = "give its key with --signing-key FILE or OMNI_SIGNING_KEY; over USB none is needed"


def await_robot(connection: Connection, system_id: int | None, timeout_s: float, stop: bool) -> list[Message]:
    """Wait for the heartbeat of a robot, of this system if it is not None; the connection is to it from then on.

    Returns what the robot has said by then. With ``stop`` everybody is told to stop meanwhile. Raises LinkTimeoutError,
    SigningKeyError.
    """
    heard: list[Message] = []

    def wanted(message: Message) -> bool:
        return is_autopilot(message) and system_id in (None, message.get_srcSystem())

    end_listening = connection.add_listener(heard.append)
    try:
        found = _stopping(connection, wanted, timeout_s) if stop else connection.wait(wanted, timeout_s)
    finally:
        end_listening()
    if found is None and connection.wrongly_signed:
        raise SigningKeyError(f"what comes from {connection.link.url} is signed with another key", hint=_KEY_HINT)
    if found is None:
        raise _no_heartbeat(connection, system_id, timeout_s)
    if connection.signer is None and is_signed(found.get_msgbuf()):
        raise SigningKeyError(f"the robot at {connection.link.url} wants signed messages", hint=_SIGN_HINT)
    connection.target_system = found.get_srcSystem()
    connection.target_component = found.get_srcComponent()
    return list(filter(connection.is_from_robot, heard))


def _stopping(connection: Connection, wanted: Callable[[Message], bool], timeout_s: float) -> Message | None:
    """Wait as Connection.wait does, and meanwhile tell everybody to stop: a robot may hear and not be heard."""
    end_s = connection.clock() + timeout_s
    found = None
    while found is None and connection.clock() < end_s:
        connection.send(mavlink.MAVLink_command_long_message(0, 0, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1, *[0] * 6))
        found = connection.wait(wanted, min(_STOP_AGAIN_S, max(0.0, end_s - connection.clock())))
    return found


def _no_heartbeat(connection: Connection, system_id: int | None, timeout_s: float) -> LinkTimeoutError:
    url = connection.link.url
    if connection.rx_bytes == 0:
        message = f"nothing came from {url} within {timeout_s:g} s"
        return LinkTimeoutError(message, hint="is the robot switched on, and this the right port?")
    if connection.rx_bad_bytes * 2 > connection.rx_bytes:
        message = f"what comes from {url} is not MAVLink 2 ({connection.rx_bytes} bytes in {timeout_s:g} s)"
        return LinkTimeoutError(message, hint="wrong baud rate, or another device? give the rate as PORT,BAUD")
    who = "a robot" if system_id is None else f"a robot with system id {system_id}"
    return LinkTimeoutError(f"{url} speaks MAVLink, but no heartbeat of {who} came within {timeout_s:g} s")
