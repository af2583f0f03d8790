# SPDX-License-Identifier: MIT
"""What a page wants to plot: a signal that comes later begins then, and a key that no signal has is an error."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from omni.studio import reading
from omni.studio.access import Access
from omni.studio.actions import BadRequestError
from omni.studio.outbox import Outbox
from omni.studio.recorded_log import RecordedLog
from omni.studio.server import StudioServer
from omni.studio.session import Session
from omni.studio.signals import UnknownSignalError, all_signals, possible_signals, require_possible
from omni.studio.simulated_log import LOG_SIGNALS
from omni.studio.spectra import TooFewSamplesError
from omni.studio.studio import Page, Studio
from omniwheel.sensor_quality import GYRO, SENSORS
from omniwheel.telemetry import GyroState, Tracking
from tests.studio.parts import run_async
from tests.studio.recorded import write_run
from tests.studio.test_parts import tracking

RATE, X, MISSPELT = "gyro.rate", "tracking.pose.x", "gyro.rat"
HEADER, BLOCK = struct.Struct("<HHId"), struct.Struct("<II")


def gyro(time_s: float) -> GyroState:
    return GyroState(time_s, 0.5, 0.0, 0.01, True)


def counts(data: bytes) -> dict[int, int]:
    """Return the number of samples in a packed message by the signal's place."""
    found, at = {}, HEADER.size
    for _ in range(HEADER.unpack_from(data)[2] if data else 0):
        place, count = BLOCK.unpack_from(data, at)
        found[place] = count
        at += BLOCK.size + 8 * count + 8 * math.ceil(count / 2)
    return found


class Fed:
    """A studio whose robot does what a test says. Its thread does not run."""

    def __init__(self, folder: Path) -> None:
        self.studio = Studio(folder)
        self.page: Page = self.studio.open_page()
        self.time_s = 0.0

    def connect(self, wheels: float = 3.0) -> Session:
        """Connect to a robot that has been heard and has not told its parameters."""
        self.studio.session = session = Session("fed")
        self.hear(session, wheels)
        return session

    def hear(self, session: Session, wheels: float = 3.0) -> None:
        session.robot = cast("Any", SimpleNamespace(parameters=SimpleNamespace(known={"WHEELS": wheels})))

    def take(self, *messages: Any) -> None:
        """Receive these classes' messages, the next ones on the robot's clock."""
        assert self.studio.session is not None
        for message in messages:
            self.time_s += 0.01
            self.studio.session.store.take(message(self.time_s))

    def new(self) -> dict[int, int]:
        return counts(self.studio.new_samples(self.page))


@pytest.fixture
def fed(tmp_path: Path) -> Any:
    found = Fed(tmp_path)
    yield found
    found.studio.session = None
    found.studio.close()


def position(time_s: float) -> Tracking:
    return tracking(time_s, 1.0)


def test_a_signal_begins_when_the_robot_has_told_of_its_sensor(fed: Fed) -> None:
    session = fed.connect()
    fed.studio.show(fed.page, [RATE, X], 10.0)
    fed.take(position)
    assert fed.new() == {1: 1}, "the second of the list, although the first does not exist"
    session.sensors = (GYRO,)
    fed.take(gyro, gyro, position)
    assert fed.new() == {0: 2, 1: 1}


def test_a_signal_that_was_wanted_without_a_robot_begins_with_one(fed: Fed) -> None:
    assert fed.studio.show(fed.page, [RATE], 10.0) == b""
    session = fed.connect()
    assert fed.new() == {}
    session.sensors = (GYRO,)
    fed.take(gyro)
    assert fed.new() == {0: 1}


def test_a_signal_goes_on_after_a_reconnect_to_a_robot_that_had_no_sensor_before(fed: Fed) -> None:
    session = fed.connect()
    fed.studio.show(fed.page, [RATE], 10.0)
    session.robot = None
    assert fed.new() == {}
    fed.hear(session)
    session.sensors = (GYRO,)
    fed.take(gyro, gyro)
    assert fed.new() == {0: 2}


def test_another_connection_begins_at_its_first_sample(fed: Fed) -> None:
    fed.connect().sensors = (GYRO,)
    fed.take(gyro, gyro, gyro)
    fed.studio.show(fed.page, [RATE], 10.0)
    fed.connect().sensors = (GYRO,)
    fed.take(gyro)
    assert fed.new() == {0: 1}


def test_no_sample_comes_twice_when_a_sensor_is_switched_off_and_on(fed: Fed) -> None:
    session = fed.connect()
    session.sensors = (GYRO,)
    fed.take(gyro, gyro)
    assert counts(fed.studio.show(fed.page, [RATE], 10.0)) == {0: 2}
    session.sensors = ()
    assert fed.new() == {}
    assert counts(fed.studio.window(fed.page, 0.0, 10.0, 100)) == {}
    session.sensors = (GYRO,)
    fed.take(gyro)
    assert fed.new() == {0: 1}
    assert counts(fed.studio.window(fed.page, 0.0, 10.0, 100)) == {0: 3}


def test_a_wheel_that_the_robot_does_not_have_waits_for_one_that_has_it(fed: Fed) -> None:
    fed.connect(wheels=3.0)
    fed.studio.show(fed.page, ["wheels.speed.4"], 10.0)
    assert counts(fed.studio.window(fed.page, 0.0, 1.0, 100)) == {}
    fed.connect(wheels=4.0)
    assert counts(fed.studio.window(fed.page, 0.0, 1.0, 100)) == {0: 0}


def test_a_page_gets_new_tables_when_the_robot_gets_a_sensor_or_a_wheel(
    fed: Fed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fed.studio, "tables", lambda robot: {})
    monkeypatch.setattr(fed.studio, "state", lambda page: {})
    session = fed.connect()
    session.phase = "connected"

    def again() -> Any:
        return fed.studio.news(fed.page).get("tables", {}).get("again")

    assert [again(), again()] == [False, None]
    session.sensors = (GYRO,)
    assert [again(), again()] == [True, None]
    fed.hear(session, wheels=4.0)
    assert [again(), again()] == [True, None]


def test_a_key_that_no_signal_has_is_an_error_and_what_was_shown_stays(fed: Fed) -> None:
    fed.connect().sensors = SENSORS
    fed.studio.show(fed.page, [X], 10.0)
    with pytest.raises(UnknownSignalError) as error:
        fed.studio.show(fed.page, [X, MISSPELT], 10.0)
    assert MISSPELT in error.value.message
    assert RATE in error.value.hint
    assert fed.page.keys == [X]
    with pytest.raises(UnknownSignalError):
        fed.studio.spectra([MISSPELT], 0.0, 1.0)


def test_a_spectrum_that_cannot_be_is_an_error(fed: Fed) -> None:
    with pytest.raises(BadRequestError):
        fed.studio.spectra([X], 0.0, 1.0)
    fed.connect()
    with pytest.raises(TooFewSamplesError):
        fed.studio.spectra([RATE], 0.0, 1.0)


def test_a_view_keeps_what_the_robot_does_not_have_and_refuses_what_none_has(fed: Fed, tmp_path: Path) -> None:
    fed.connect().history = tmp_path / "history" / "robot.jsonl"
    view = {"plots": [{"keys": [RATE, X], "xy": True}], "span_s": 10.0}
    fed.studio.save_view(fed.page, view)
    kept = tmp_path / "views" / "robot.json"
    before = kept.read_bytes()
    with pytest.raises(UnknownSignalError):
        fed.studio.save_view(fed.page, {**view, "plots": [{"keys": [MISSPELT], "xy": False}]})
    assert kept.read_bytes() == before


def test_the_page_is_told_of_its_misspelt_signal(fed: Fed, tmp_path: Path) -> None:
    server = StudioServer(fed.studio, Access("localhost"), tmp_path, dict)

    async def answer(key: str) -> Any:
        outbox = Outbox()
        await server._answered(fed.page, "show", {"id": 7, "signals": [key]}, outbox)
        return json.loads(outbox.pop() or "")

    found = [run_async(answer(key)) for key in (RATE, MISSPELT)]
    assert [(one["answer"], "error" in one) for one in found] == [(7, False), (7, True)]
    assert MISSPELT in found[1]["error"]


def test_a_log_has_nothing_of_what_it_does_not_hold_and_refuses_what_none_holds(tmp_path: Path) -> None:
    write_run(tmp_path / "run", gain=4.0, seconds=2.0)
    path = reading.run_log(tmp_path, "run")
    possible = sorted(LOG_SIGNALS)
    data = reading.window(path, possible, 0.0, 10.0, 100)
    held = {signal.key for signal in RecordedLog(path).signals()}
    assert {possible[place] for place in counts(data)} == held
    assert X in held
    assert {signal["key"] for signal in reading.opened(path)["signals"] if not signal["absent"]} == held
    assert reading.spectra(path, [RATE, "truth.pose.x"], 0.0, 1.0) == []
    for refused in (MISSPELT, "truth.pose.z"):
        with pytest.raises(UnknownSignalError):
            reading.window(path, [X, refused], 0.0, 1.0, 100)
        with pytest.raises(UnknownSignalError):
            reading.spectra(path, [refused], 0.0, 1.0)


def test_every_signal_of_some_robot_is_possible() -> None:
    for wheels in (3, 4):
        assert {signal.key for signal in all_signals(wheels)} <= set(possible_signals())
    with pytest.raises(UnknownSignalError):
        require_possible(["x" * 1_000_000], possible_signals())
