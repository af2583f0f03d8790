# SPDX-License-Identifier: MIT
"""Why the robot stopped: its reason, the texts of that stop alone, and how long they are kept."""

from __future__ import annotations

from typing import Any

from omni.studio.last_stop import LastStop
from omni.studio.session import Session
from omniwheel.dialect import Message, mavlink
from omniwheel.telemetry import Status, StatusText

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


def test_a_stop_during_long_work_is_noted_though_the_sessions_loop_does_not_turn() -> None:
    """An experiment arms, is stopped and arms again, in one piece of work."""
    session = Session("fed")
    said: list[Message] = [status_of("armed"), text_of("failsafe: stall"), status_of("failsafe"), status_of("disarmed")]
    said += [status_of("armed"), *map(text_of, ENCODER), status_of("failsafe")]
    for message in said:
        session._take(message)
    assert session.last_stop.as_json() == encoder_stop()
