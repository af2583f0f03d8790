# SPDX-License-Identifier: MIT
"""Why the robot stopped: its reason, the texts of that stop alone, and how long they are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from omni.studio.last_stop import LastStop
from omni.studio.session import Session
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import LinkLostError
from omniwheel.robot import Robot
from omniwheel.telemetry import Status, StatusText
from tests.firmware.client import firmware
from tests.waiting import wait_until

STATES = {"disarmed": 1, "armed": 2, "failsafe": 3, "estop": 4}
CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
ENCODER = ("failsafe: encoder", "wheel 2: given 3 V, turned at 0 rad/s")
CRASH = "restarted after a crash"


def status_of(state: str) -> Any:
    return mavlink.MAVLink_omni_status_message(0, 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, STATES[state], 0)


def text_of(words: str) -> Any:
    return mavlink.MAVLink_statustext_message(CRITICAL, words.encode())


def after(*said: str, stop: LastStop | None = None) -> dict[str, Any] | None:
    """Return what is told after these states and texts."""
    stop = stop or LastStop()
    for words in said:
        if words in STATES:
            stop.update(Status.decoded(status_of(words)))
        else:
            stop.take(StatusText(CRITICAL, words))
    return stop.as_json()


def encoder_stop(state: str = "failsafe") -> dict[str, Any]:
    return {"state": state, "cause": "encoder", "wheel": 2, "values": [ENCODER[1]]}


def test_texts_around_the_stop_explain_it_whether_they_come_before_or_after_the_state() -> None:
    assert after("armed", *ENCODER, "failsafe") == encoder_stop()
    assert after("armed", "failsafe", *ENCODER) == encoder_stop()
    assert after("armed", ENCODER[0], "failsafe", ENCODER[1], "failsafe", "disarmed") == encoder_stop()


def test_texts_of_a_disarmed_robot_explain_no_later_stop() -> None:
    early = ("disarmed", "signing key unreadable, radio closed: set it again", CRASH, "disarmed")
    assert after(*early, "armed", *ENCODER, "failsafe") == encoder_stop()
    assert after(*early, "estop") == {"state": "estop", "cause": "", "wheel": None, "values": []}
    assert after("armed", *ENCODER, "failsafe", "disarmed", CRASH) == encoder_stop()


def test_a_stop_has_no_cause_of_the_one_before() -> None:
    pressed = {"state": "estop", "cause": "", "wheel": None, "values": ["stop button open"]}
    assert after("armed", *ENCODER, "failsafe", "disarmed", "stop button open", "estop") == pressed
    assert after("armed", *ENCODER, "failsafe", "estop") == encoder_stop("estop"), "it was not armed in between"


def test_a_fault_that_joins_is_told_once() -> None:
    found = after("armed", "failsafe", "failsafe: encoder", "failsafe: encoder, stall")
    assert found is not None
    assert found["cause"] == "encoder, stall"


@pytest.mark.parametrize("state", ["failsafe", "disarmed"])
def test_the_texts_of_a_new_connection_explain_no_stop_that_was_known_before(state: str) -> None:
    stop = LastStop()
    after("armed", *ENCODER, "failsafe", stop=stop)
    stop.expect_status()
    assert after(CRASH, state, stop=stop) == encoder_stop()


def test_a_stop_during_long_work_is_noted_though_the_sessions_loop_does_not_turn() -> None:
    """An experiment arms, is stopped and arms again, in one piece of work."""
    session = Session("fed")
    said: list[Message] = [status_of("armed"), text_of("failsafe: stall"), status_of("failsafe"), status_of("disarmed")]
    said += [status_of("armed"), *map(text_of, ENCODER), status_of("failsafe")]
    for message in said:
        session._take(message)
    assert session.last_stop.as_json() == encoder_stop()


def test_the_reason_outlives_a_lost_link_but_not_another_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omni.studio.session.RETRY_S", 0.01)

    def lose_link(_: Robot) -> None:
        raise LinkLostError("planted")

    def reconnect() -> None:
        before = session.connections
        session.do(lose_link).exception(timeout=30.0)
        wait_until(lambda: session.connections > before, "it does not connect again")

    with firmware() as robot:
        session = Session(robot.links[0])
        session.start()
        try:
            wait_until(lambda: session.phase == "connected", lambda: f"no robot: {session.trouble}")
            session.do(Robot.estop).result(timeout=30.0)
            wait_until(lambda: session.last_stop.as_json() is not None, "the stop is not noted")
            session.do(Robot.estop_clear).result(timeout=30.0)
            reconnect()
            stop = session.last_stop.as_json()
            assert stop is not None
            assert stop["state"] == "estop"
            session.history = Path("of another robot")
            reconnect()
            assert session.last_stop.as_json() is None
        finally:
            session.close()
