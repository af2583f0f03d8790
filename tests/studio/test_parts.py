# SPDX-License-Identifier: MIT
"""The studio's parts that need no robot: samples, marks, undo, who may reach it."""

from __future__ import annotations

import struct
import threading
from concurrent.futures import Future
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omni.studio.access import Access
from omni.studio.edits import Edits
from omni.studio.marks import Marks
from omni.studio.samples import CAPACITY, SAMPLES_SINCE, SampleStore, Trace, packed, thinned
from omni.studio.server import StudioServer
from omni.studio.session import Session, _Silence
from omni.studio.signals import KINDS, all_signals, signals_of, values
from omni.studio.studio import Studio
from omni.studio.urgent_link import UrgentLink
from omni.studio.work_queue import SETPOINT, STOP, WorkQueue
from omni_schema import load_parameters
from omniwheel.connection import Connection
from omniwheel.errors import LinkError, OtherRobotError, ParameterError
from omniwheel.frames import Pose, Twist
from omniwheel.paths import params_path
from omniwheel.robot import Robot
from omniwheel.telemetry import Battery, GyroState, Tracking, Wheels
from tests.studio.parts import run_async


def tracking(time_s: float, x: float) -> Tracking:
    still = Twist(0.0, 0.0, 0.0)
    return Tracking(time_s, Pose(0.0, 0.0, 0.0), still, Pose(x, 0.0, 0.0), (0.1, 0.1, 0.1), 0.0, "none", 0.0)


SIGNAL_X = next(signal for signal in signals_of(Tracking) if signal.key == "tracking.pose.x")


# ---- signals


def test_every_number_of_telemetry_is_a_signal_with_unit_and_sentence() -> None:
    for kind in KINDS:
        assert signals_of(kind), kind
        own = [field for field in fields(kind) if field.name != "time_s"]
        words = {signal.key.split(".")[1] for signal in signals_of(kind)}
        texts = {"state", "faults", "fault_history", "phase", "reset_cause", "result"}
        assert len(words) == len([field for field in own if field.name not in texts])
    assert SIGNAL_X.unit == "m"
    assert "pose" in SIGNAL_X.doc


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("tracking.pose.theta", "rad"),
        ("tracking.reference_rate.wz", "rad/s"),
        ("wheels.speed.1", "rad/s"),
        ("wheels.current.2", "A"),
        ("wheels.slip.3", "m/s"),
        ("battery.voltage", "V"),
        ("status.tick_us_max", "us"),
        ("control.error.theta", "rad"),
        ("wheels.duty.1", ""),
        ("gyro.rate", "rad/s"),
        ("gyro.bias_sd", "rad/s"),
        ("flow.nis", ""),
        ("flow.x", "m"),
        ("flow.direction_off", "rad"),
    ],
)
def test_units(key: str, unit: str) -> None:
    assert {signal.key: signal.unit for signal in all_signals(4)}[key] == unit


def test_a_signal_is_the_value_that_the_class_has() -> None:
    fours = [(n, n + 1, n + 2, n + 3) for n in (1, 5, 20, 9, 13, 30)]
    speed, reference, duty, current, slip, heat = fours
    message = Wheels(1.0, speed, reference, duty, current, slip, 0.5, 0.6, heat, 0.7)
    row = values(message)
    found = {signal.key: row[signal.column] for signal in signals_of(Wheels)}
    assert found["wheels.reference.3"] == 7
    assert found["wheels.slip.4"] == 16
    assert found["wheels.duty_scale"] == 0.6


def test_three_wheels_have_no_fourth() -> None:
    assert not [signal for signal in all_signals(3) if signal.key.startswith("wheels.") and signal.key.endswith(".4")]
    assert [signal for signal in all_signals(4) if signal.key == "wheels.speed.4"]


def test_what_a_robot_never_sends_is_no_signal_of_it() -> None:
    keys = {signal.key for signal in all_signals(3, [GyroState])}
    assert "flow.nis" in keys
    assert not [key for key in keys if key.startswith("gyro.")]


# ---- samples


@pytest.mark.full
def test_the_store_gives_back_what_came_and_forgets_the_oldest() -> None:
    store = SampleStore()
    for number in range(CAPACITY + 5):
        store.take(tracking(number * 0.01, float(number)))
    trace = store.since(SIGNAL_X, 0)
    assert len(trace.time_s) == CAPACITY
    assert trace.value[0] == 5.0
    assert trace.value[-1] == CAPACITY + 4
    assert store.count(SIGNAL_X) == CAPACITY + 5
    assert list(store.since(SIGNAL_X, CAPACITY + 3).value) == [CAPACITY + 3, CAPACITY + 4]


def test_time_goes_on_when_the_robot_restarts() -> None:
    store = SampleStore()
    store.take(tracking(100.0, 1.0))
    store.take(tracking(0.5, 2.0))
    store.take(tracking(0.6, 3.0))
    times = store.since(SIGNAL_X, 0).time_s
    assert (np.diff(times) > 0).all()
    assert times[2] - times[1] == pytest.approx(0.1)


def test_what_is_no_number_is_no_sample() -> None:
    store = SampleStore()
    store.take(tracking(1.0, 0.0))
    store.take(Battery(float("nan")))
    store.take(Battery(11.5))
    (signal,) = signals_of(Battery)
    assert list(store.since(signal, 0).value) == [11.5]


@given(st.lists(st.floats(-1e6, 1e6, width=32), min_size=1, max_size=400), st.integers(1, 50))
def test_thinning_keeps_the_extremes_the_order_and_the_size(numbers: list[float], width: int) -> None:
    trace = Trace("x", np.arange(len(numbers), dtype=float), np.array(numbers, dtype=np.float32))
    thin = thinned(trace, width)
    assert len(thin.time_s) <= max(2 * width, 1)
    assert thin.value.min() == trace.value.min()
    assert thin.value.max() == trace.value.max()
    assert (np.diff(thin.time_s) > 0).all()
    assert all(trace.value[int(time)] == value for time, value in zip(thin.time_s, thin.value, strict=True))


def test_packed_samples_read_as_the_page_reads_them() -> None:
    trace = Trace(SIGNAL_X.key, np.array([1.0, 2.0, 3.0]), np.array([4, 5, 6], dtype=np.float32))
    data = packed(SAMPLES_SINCE, 1.5, [trace, trace], [SIGNAL_X.key])
    assert len(data) == 16 + 2 * (8 + 24 + 16)
    assert struct.unpack_from("<IId", data) == (SAMPLES_SINCE, 2, 1.5)
    assert struct.unpack_from("<II3d3f", data, 16) == (0, 3, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert struct.unpack_from("<II", data, 16 + 48) == (0, 3)


# ---- marks


def test_a_mark_stands_where_the_robot_used_the_new_set() -> None:
    marks = Marks()
    assert marks.sequence(7, 1.0) is None  # the first one says nothing
    assert marks.changed({"A": (1.0, 2.0)}, 1.02) is None
    assert marks.sequence(7, 1.03) is None
    mark = marks.sequence(8, 1.05)
    assert mark is not None
    assert (mark.time_s, mark.changes) == (1.05, {"A": (1.0, 2.0)})


def test_an_answer_that_comes_after_the_new_set_fills_its_mark() -> None:
    marks = Marks()
    marks.sequence(7, 1.0)
    early = marks.sequence(8, 1.05)
    assert early is not None
    assert marks.changed({"A": (1.0, 2.0)}, 1.07) is early
    assert marks.all() == [early]


def test_a_change_by_another_program_is_a_mark_without_names() -> None:
    marks = Marks()
    marks.sequence(7, 1.0)
    marks.sequence(8, 2.0)
    marks.changed({"A": (1.0, 2.0)}, 3.0)
    assert [mark.changes for mark in marks.all()] == [{}]


def test_a_change_is_marked_without_telemetry_too() -> None:
    marks = Marks()
    marks.changed({"A": (1.0, 2.0)}, 3.0)
    assert marks.overdue(3.2) is None
    mark = marks.overdue(3.6)
    assert mark is not None
    assert (mark.time_s, mark.changes) == (3.0, {"A": (1.0, 2.0)})
    assert marks.overdue(9.0) is None


# ---- undo


class Values(dict[str, float]):
    """Parameters that may refuse."""

    def check(self, _name: str, value: float) -> float:
        return float(value)

    def set_many(self, values: dict[str, float]) -> None:
        if any(value < 0 for value in values.values()):
            raise ParameterError("refused")
        self.update(values)


@given(st.lists(st.tuples(st.sampled_from("ABC"), st.integers(0, 5), st.integers(0, 2)), max_size=30))
def test_undoing_everything_leads_back_and_redoing_forward(steps: list[tuple[str, int, int]]) -> None:
    parameters = Values(A=0.0, B=1.0, C=2.0)
    edits = Edits(parameters)  # type: ignore[arg-type]
    begin = dict(parameters)
    for name, value, step in steps:
        edits.set({name: value}, step or None)
    end = dict(parameters)
    count, _ = edits.steps
    for _ in range(count):
        edits.undo()
    assert dict(parameters) == begin
    with pytest.raises(ParameterError, match="nothing to undo"):
        edits.undo()
    for _ in range(count):
        edits.redo()
    assert dict(parameters) == end


def test_a_drag_is_one_step_and_a_refusal_is_none() -> None:
    parameters = Values(A=0.0)
    edits = Edits(parameters)  # type: ignore[arg-type]
    for value in (1, 2, 3):
        edits.set({"A": value}, step=1)
    edits.set({"A": 4}, step=2)
    with pytest.raises(ParameterError):
        edits.set({"A": -1})
    assert edits.steps == (2, 0)
    assert edits.undo() == {"A": 3.0}
    assert edits.undo() == {"A": 0.0}


def test_the_same_number_from_another_page_is_another_step(tmp_path: Path) -> None:
    """Each page counts its steps from 1, also after a reload."""
    studio = Studio(tmp_path)
    edits = Edits(Values(A=0.0))  # type: ignore[arg-type]
    studio.session = cast("Session", SimpleNamespace(edits=edits, do=lambda work, is_setpoint: work(None)))
    for value in (1.0, 2.0):
        page = studio.open_page()
        studio.take_over(page)
        for more in (0.0, 0.5):
            studio.ask(page, "set", {"values": {"A": value + more}, "step": 1})
    assert edits.steps == (2, 0)
    assert edits.undo() == {"A": 1.5}
    studio.session = None
    studio.close()


# ---- who may reach it


@pytest.mark.parametrize(
    ("host", "headers", "allowed"),
    [
        ("127.0.0.1", {"host": "127.0.0.1:8420"}, True),
        ("127.0.0.1", {"host": "localhost:8420", "origin": "http://localhost:8420"}, True),
        ("127.0.0.1", {"host": "localhost:8420", "origin": "http://evil.example"}, False),
        ("127.0.0.1", {"host": "localhost:8420", "origin": "http://localhost:9999"}, False),
        ("127.0.0.1", {"host": "localhost:8420", "origin": "null"}, False),
        ("127.0.0.1", {"host": "evil.example:8420"}, False),
        ("127.0.0.1", {"host": "[::1"}, False),
        ("127.0.0.1", {}, False),
        ("0.0.0.0", {"host": "192.0.2.7:8420"}, True),
        ("0.0.0.0", {"host": "evil.example:8420"}, False),
        ("robot.example", {"host": "robot.example:8420"}, True),
    ],
)
def test_only_the_studios_own_pages_reach_it(host: str, headers: dict[str, str], allowed: bool) -> None:
    access = Access(host)
    assert (access.problem(headers, access.token) == "") is allowed


def test_beyond_this_computer_a_token_is_needed() -> None:
    assert Access("localhost").token == ""
    access = Access("0.0.0.0")
    assert len(access.token) >= 20
    for wrong in ("", "x", access.token[:-1], "é"):
        assert "token" in access.problem({"host": "192.0.2.7:1"}, wrong)


# ---- a stop waits for nothing


class SilentLink:
    """A link on which nothing comes; remembers what was written, and how long it was read."""

    url = "silent"

    def __init__(self) -> None:
        self.written: list[bytes] = []
        self.longest_s = 0.0
        self.reads = threading.Semaphore(0)

    def read(self, timeout_s: float) -> bytes:
        self.longest_s = max(self.longest_s, timeout_s)
        self.reads.release()
        return b""

    def write(self, data: bytes) -> None:
        self.written.append(data)

    def close(self) -> None:
        pass


def test_what_is_urgent_is_done_between_two_short_reads() -> None:
    inner = SilentLink()
    link = UrgentLink(inner)
    reader = threading.Thread(target=link.read, args=(0.3,))
    reader.start()
    inner.reads.acquire()
    link.interrupt(lambda: link.write(b"stop"))
    reader.join()
    assert inner.written == [b"stop"]
    assert inner.longest_s <= 0.004


def test_a_stop_is_sent_though_a_page_that_asked_for_something_has_gone() -> None:
    inner = SilentLink()
    link = UrgentLink(inner)
    session = Session("silent")
    session.robot = Robot(Connection(link, heartbeat=False), table=load_parameters(params_path()))
    session._link, session.phase = link, "connected"
    left, kept = session.do(Robot.arm), session.do(Robot.arm)
    left.cancel()  # what the server does when the page's socket closes
    assert session.stop_now()
    link.read(0.0)
    assert len(inner.written) == 1
    assert isinstance(kept.exception(timeout=0.0), LinkError)


def test_of_setpoints_only_the_newest_waits_and_the_order_stays() -> None:
    queue = WorkQueue()
    first = queue.put(lambda _: "old", kind=SETPOINT)
    path = queue.put(lambda _: "path")
    newest = queue.put(lambda _: "new", kind=SETPOINT)
    assert first.result(timeout=0.0) is None
    taken = [queue.get(), queue.get(), queue.get()]
    assert [work and work.future for work in taken] == [path, newest, None]


def test_a_stop_that_waits_for_its_confirmation_is_not_dropped() -> None:
    queue = WorkQueue()
    path, stop = queue.put(lambda _: "path"), queue.put(lambda _: "stop", kind=STOP)
    queue.drop()
    assert isinstance(path.exception(timeout=0.0), LinkError)
    taken = queue.get()
    assert taken is not None
    assert taken.future is stop


def test_what_is_urgent_is_done_though_something_before_it_raised() -> None:
    inner = SilentLink()
    link = UrgentLink(inner)

    def raises() -> None:
        raise LinkError("planted")

    link.interrupt(raises)
    link.interrupt(lambda: link.write(b"stop"))
    with pytest.raises(LinkError, match="planted"):
        link.read(0.0)
    link.read(0.0)
    assert inner.written == [b"stop"]


def test_what_moves_is_ended_by_a_stop_between_two_of_its_commands() -> None:
    """Waypoints are sent one by one. A stop in the middle ends that, and nothing starts afterwards."""
    link = UrgentLink(SilentLink())
    session = Session("silent")
    session._link, session.phase = link, "connected"
    session.robot = Robot(Connection(link, heartbeat=False), table=load_parameters(params_path()))
    done: list[int] = []

    def upload(robot: Robot) -> None:
        for number in range(32):
            if number == 3:
                session.stop_now()
            link.read(0.0)
            done.append(number)

    future = session.do_long(upload)
    session._do_next(session.robot)
    assert isinstance(future.exception(timeout=0.0), LinkError)
    assert done == [0, 1, 2]


def test_an_error_of_its_own_does_not_end_the_robots_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    opened = threading.Semaphore(0)

    def broken(*_: object, **__: object) -> None:
        opened.release()
        raise ZeroDivisionError("planted")

    monkeypatch.setattr("omni.studio.session.open_shared", broken)
    monkeypatch.setattr("omni.studio.session.RETRY_S", 0.01)
    session = Session("nowhere")
    session.start()
    for _ in range(3):
        assert opened.acquire(timeout=30.0), "it tries again"
    assert session.phase == "lost"
    assert session.trouble == "internal error: ZeroDivisionError: planted"
    session.close()
    assert session.phase == "closed"


# ---- a robot that is silent


def test_silence_is_what_was_listened_to_since_the_last_heartbeat() -> None:
    silence = _Silence()
    times = np.arange(80) / 10
    heard = [silence.seconds(time_s, time_s % 4.0) for time_s in times]
    assert heard == pytest.approx([time_s % 4.0 for time_s in times], abs=0.11)


def test_a_computer_that_stood_still_has_heard_nobody() -> None:
    """As a suspended laptop does. Its robot is lost only after a silence that it has listened to."""
    silence = _Silence()
    silence.seconds(10.0, 0.2)
    assert silence.seconds(3600.0, 3590.2) <= 0.5
    goes_on = [silence.seconds(3600.0 + n / 10, 3590.2 + n / 10) for n in range(1, 101)]
    assert goes_on[-1] == pytest.approx(10.5, abs=0.1)
    assert silence.seconds(3610.1, 0.1) <= 0.1


def test_the_page_loads_no_file_of_another_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    table = load_parameters(params_path())
    asked: list[Any] = []
    parameters = SimpleNamespace(known=table.defaults())
    session = SimpleNamespace(robot=SimpleNamespace(table=table, parameters=parameters))

    def ask(_page: object, action: str, request: object) -> Future[None]:
        asked.append((action, request))
        future: Future[None] = Future()
        future.set_result(None)
        return future

    server: Any = SimpleNamespace(studio=SimpleNamespace(session=session, ask=ask))
    page: Any = None

    def load(text: str) -> None:
        run_async(StudioServer._load(server, page, {"text": f"[parameters]\n{text}\n"}))

    with pytest.raises(OtherRobotError):
        load("WHEELS = 4\nISMC_LAM_XY = 9")
    assert not asked
    load("ISMC_LAM_XY = 9")
    assert len(asked) == 1
