# SPDX-License-Identifier: MIT
"""The real MAVProxy and pymavlink with signing, against the real firmware: a cable on link 1, a radio on link 2."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from omniwheel import signing
from omniwheel.robots import parameter_table
from tests.firmware.client import Client, Firmware, connect, firmware, mav
from tests.host.test_mavproxy import MavProxy
from tests.waiting import wait_until

PASSPHRASE = "three-wheels-are-enough"
KEY = hashlib.sha256(PASSPHRASE.encode()).digest()
WAIT_S = 30.0


@pytest.fixture
def robot() -> Iterator[Firmware]:
    """A robot without a key."""
    with firmware(links=("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")) as running:
        yield running


def status_over_cable(robot: Firmware) -> Any:
    client: Client = connect(robot, 0)
    assert client.command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_OMNI_SIGNING) == mav.MAV_RESULT_ACCEPTED
    status = client.wait("OMNI_SIGNING")
    client.socket.close()
    return status


def give_key(robot: Firmware) -> None:
    client = connect(robot, 0)
    client.mav.setup_signing_send(1, 1, list(KEY), signing.timestamp(1.8e9))
    client.wait("STATUSTEXT", text=f"signing key 0x{signing.fingerprint(KEY).upper()} set")
    client.socket.close()


@pytest.mark.full
@pytest.mark.timeout(240)  # two MAVProxies, each of which downloads all parameters in real time
@pytest.mark.mavproxy
def test_mavproxy_gives_the_robot_a_key_and_commands_it_over_the_radio(robot: Firmware, tmp_path: Path) -> None:
    received = rf"Received {len(parameter_table())} parameters"
    with MavProxy(robot.links[0], tmp_path) as cable:
        cable.expect(received)
        cable.enter(f"signing setup {PASSPHRASE}")
        cable.expect("Sent secret_key")
        cable.expect("signing key 0x[0-9A-F]+ set")
    status = status_over_cable(robot)
    assert (status.state, f"{status.fingerprint:08x}") == (1, signing.fingerprint(KEY))
    (tmp_path / "radio").mkdir()
    with MavProxy(robot.links[1], tmp_path / "radio") as radio:
        radio.enter(f"signing key {PASSPHRASE}")
        radio.expect(received)
        radio.enter("param set ISMC_LAM_XY 15")
        wait_until(lambda: radio.fetch("ISMC_LAM_XY") == 15.0, "the parameter was not set")


def pymavlink_on_radio(robot: Firmware) -> mavutil.mavfile:
    host, port = robot.address(1)
    return mavutil.mavlink_connection(f"tcp:{host}:{port}", dialect="common")


def estop_answer(link: mavutil.mavfile) -> int | None:
    link.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 0, 1, 0, 0, 0, 0, 0, 0)
    ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=WAIT_S)
    return None if ack is None else int(ack.result)


def test_pymavlink_with_the_key_stops_the_robot_and_its_answers_are_signed(robot: Firmware) -> None:
    give_key(robot)
    link = pymavlink_on_radio(robot)
    link.setup_signing(KEY, sign_outgoing=True)
    assert link.recv_match(type="HEARTBEAT", blocking=True, timeout=WAIT_S).get_signed()
    assert estop_answer(link) == mavutil.mavlink.MAV_RESULT_ACCEPTED
    assert link.mav.signing.badsig_count == 0
    link.close()


@pytest.mark.parametrize("key", [None, hashlib.sha256(b"another").digest()], ids=["unsigned", "another key"])
def test_pymavlink_without_the_key_is_refused(robot: Firmware, key: bytes | None) -> None:
    give_key(robot)
    link = pymavlink_on_radio(robot)
    if key is not None:
        link.setup_signing(key, sign_outgoing=True)
    link.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 0, 1, 0, 0, 0, 0, 0, 0)
    refused = status_over_cable(robot)
    while refused.refused_unsigned + refused.refused_wrong == 0:
        refused = status_over_cable(robot)
    assert (refused.refused_unsigned, refused.refused_wrong) == ((1, 0) if key is None else (0, 1))
    link.close()
