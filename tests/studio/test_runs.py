# SPDX-License-Identifier: MIT
"""Runs on the server's side: logs of any length and in any state, paths, the worker process, recordings."""

from __future__ import annotations

import math
import os
import resource
import signal
import struct
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from omni.studio import reading, recorded_log
from omni.studio import recording as recording_module
from omni.studio.log_frames import AS_ARRAYS, Clock, read_piece
from omni.studio.recorded_log import Overview, RecordedLog
from omni.studio.recording import NOT_ENDED, Recorder, Recording
from omni.studio.samples import SAMPLES_WINDOW
from omni.studio.session import Session
from omni.studio.signals import KINDS, values
from omni.studio.urgent_link import UrgentLink
from omni.studio.worker import MOST_WAITING, Worker
from omni_schema import load_parameters
from omniwheel.connection import Connection
from omniwheel.drive_log.listing import list_runs
from omniwheel.errors import LinkLostError, LogError, OmniError, OutputFileError
from omniwheel.identification.sources import read_messages
from omniwheel.paths import params_path
from omniwheel.robot import Robot
from omniwheel.telemetry import decode
from tests.studio.recorded import GAIN, RATE_HZ, START_S, frames, write_run
from tests.waiting import pass_time, wait_until

X = "tracking.pose.x"
FULL_BYTES = 200_000


def log_of(path: Path, seconds: float = 20.0) -> Path:
    path.write_bytes(b"".join(frames(seconds)))
    return path


# ---- logs


def test_arrays_hold_what_the_messages_hold(tmp_path: Path) -> None:
    path = log_of(tmp_path / "x.tlog")
    piece = read_piece(path.read_bytes(), Clock())
    messages = read_messages(path)
    for kind in KINDS:
        wanted = [telemetry for message in messages if (telemetry := decode(kind, message)) is not None]
        if not wanted:
            assert kind not in piece.rows
            continue
        time_s, rows = piece.rows[kind]
        assert np.array_equal(rows.T, np.array([values(one) for one in wanted], dtype=np.float32)), kind
        assert time_s == pytest.approx([getattr(one, "time_s", START_S) for one in wanted])
    assert set(AS_ARRAYS) & set(piece.rows)
    assert (piece.lost, piece.bad) == (0, 0)


def test_a_log_begins_at_zero_and_has_its_changes_and_events_as_marks(tmp_path: Path) -> None:
    write_run(tmp_path / "run", gain=4.0, seconds=20.0)
    log = RecordedLog(tmp_path / "run" / "telemetry.tlog")
    assert log.end_s - log.start_s == pytest.approx(20.0)
    (trace,) = log.window([X], 0.0, math.inf, 10_000)
    assert trace.time_s[0] == 0.0
    assert trace.value[RATE_HZ] == pytest.approx(math.sin(1.0))
    marks = log.marks()
    assert [(mark["changes"], round(mark["time_s"])) for mark in marks if mark["changes"]] == [({GAIN: [4.0, 5.0]}, 10)]
    texts = [(mark["text"], round(mark["time_s"], 1)) for mark in marks if "text" in mark]
    assert texts[0] == ("state armed", 1.0)
    assert len(texts) == 3, "the log's spike is a jump of the pose there and one back"
    assert all("jumped" in text and time_s == 6.7 for text, time_s in texts[1:])


def test_a_spike_is_never_lost_however_little_of_a_long_log_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorded_log, "PIECE_BYTES", 20_000)
    monkeypatch.setattr(recorded_log, "MOST_PIECES", 2)
    monkeypatch.setattr(recorded_log, "MOST_BINS", 64)
    log = RecordedLog(log_of(tmp_path / "x.tlog", seconds=100.0))
    (whole,) = log.window([X], 0.0, math.inf, 200)
    assert len(whole.time_s) <= 2 * 64 + 2
    assert whole.value.max() == 1000.0
    assert whole.time_s[np.argmax(whole.value)] == pytest.approx(100.0 / 3, abs=0.03)
    (part,) = log.window([X], 50.0, 51.0, 2000)
    assert len(part.time_s) == pytest.approx(RATE_HZ, abs=2)
    assert part.value == pytest.approx(np.sin(part.time_s), abs=1e-3)


@given(st.integers(1, 40), st.integers(1, 9))
def test_the_overview_keeps_extremes_and_its_size(parts: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    overview, before = Overview(), recorded_log.MOST_BINS
    try:
        recorded_log.MOST_BINS = 16
        pieces = [draw.normal(size=(2, draw.integers(1, 30))).astype(np.float32) for _ in range(parts)]
        for number, piece in enumerate(pieces):
            overview.add(number + np.arange(piece.shape[1]) / 100, piece)
    finally:
        recorded_log.MOST_BINS = before
    time_s, value = overview.all()
    whole = np.concatenate(pieces, axis=1)
    assert value.shape[1] <= 32
    assert np.array_equal(value.min(axis=1), whole.min(axis=1))
    assert np.array_equal(value.max(axis=1), whole.max(axis=1))
    assert (np.diff(time_s) >= 0.0).all()


def test_time_goes_on_when_the_robot_restarts() -> None:
    clock = Clock()
    assert list(clock.follow_all(np.array([5.0, 6.0]), np.array([5.0, 6.0]))) == [5.0, 6.0]
    went_on = clock.follow_all(np.array([6.5, 0.1, 0.2]), np.array([6.5, 7.0, 7.1]))
    assert list(went_on) == pytest.approx([6.5, 7.5, 7.6])
    assert list(clock.follow_all(np.array([0.3]), np.array([7.2]))) == pytest.approx([7.7])


@pytest.mark.full
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_log_is_read_as_far_as_it_can_be_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "x.tlog"
    content = bytearray(b"".join(frames(2.0)))
    for _ in range(data.draw(st.integers(0, 5))):
        at = data.draw(st.integers(0, len(content)))
        content[at : at + data.draw(st.integers(0, 50))] = data.draw(st.binary(max_size=50))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        log = RecordedLog(path)
    except LogError:
        return
    for trace in log.window([one.key for one in log.signals()], 0.0, math.inf, 100):
        assert np.isfinite(trace.value).all()
        assert (np.diff(trace.time_s) > 0.0).all()
    log.close()


def test_a_hole_costs_what_was_in_it_and_is_counted(tmp_path: Path) -> None:
    path = log_of(tmp_path / "x.tlog")
    content = path.read_bytes()
    path.write_bytes(content[:10_000] + b"\0" * 100 + content[10_100:])
    log = RecordedLog(path)
    assert 0 < log.lost_bytes + log.bad_frames < 1000
    (trace,) = log.window([X], 0.0, math.inf, 10_000)
    assert 20 * RATE_HZ - 5 <= len(trace.time_s) <= 20 * RATE_HZ


# ---- runs and paths


OUTSIDE = [
    "",
    ".",
    "..",
    "../secret",
    "/etc",
    "a/../../secret",
    "link",
    "inner",
    "a\0b",
    "x" * 5000,
    "good/..",
    "good/",
]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    write_run(tmp_path / "secret", gain=4.0, seconds=2.0)
    found = tmp_path / "runs"
    write_run(found / "good", gain=4.0, seconds=2.0)
    (found / "link").symlink_to(tmp_path / "secret")
    write_run(found / "inner", gain=4.0, seconds=2.0)
    (found / "inner" / "telemetry.tlog").unlink()
    (found / "inner" / "telemetry.tlog").symlink_to(tmp_path / "secret" / "telemetry.tlog")
    return found


@pytest.mark.parametrize("name", [*OUTSIDE, "ABSOLUTE"])
def test_no_name_leads_outside_the_runs(root: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root.parent)
    wanted = str(root.parent / "secret") if name == "ABSOLUTE" else name
    with pytest.raises(LogError):
        reading.run_log(root, wanted)
    with pytest.raises(LogError):
        reading.comparison(root, wanted, "good")


def test_only_runs_inside_are_listed_newest_first(root: Path) -> None:
    write_run(root / "newer", gain=4.0, seconds=2.0)
    os.utime(root / "good", (1, 1))
    found = reading.listing(root, "")
    assert [run["name"] for run in found["runs"]] == ["newer", "good"]
    assert found["runs"][0]["figures"] == "duration 2 s"
    assert reading.listing(root, "new")["runs"] == found["runs"][:1]
    assert reading.listing(root / "none", "")["runs"] == []


def test_a_runs_folder_that_is_itself_a_link_works(root: Path) -> None:
    (root.parent / "other").symlink_to(root)
    assert reading.run_log(root.parent / "other", "good").is_file()


def test_a_window_reads_as_the_page_reads_it_and_a_run_that_grew_is_read_again(root: Path) -> None:
    path = reading.run_log(root, "good")
    assert reading.opened(path)["duration_s"] == pytest.approx(2.0)
    data = reading.window(path, ["gyro.rate", X], 0.0, 1e9, 1000)
    assert struct.unpack_from("<IIdII", data) == (SAMPLES_WINDOW, 1, 0.0, 1, 2 * RATE_HZ + 1)
    path.write_bytes(b"".join(frames(3.0)))
    assert reading.opened(path)["duration_s"] == pytest.approx(3.0)


# ---- the worker


def test_the_worker_answers_says_errors_and_comes_back_after_its_end() -> None:
    worker = Worker()
    try:
        assert worker.ask(math.sqrt, 9.0).result(timeout=120) == 3.0
        with pytest.raises(LogError, match="math domain"):
            worker.ask(math.sqrt, -1.0).result(timeout=120)
        with pytest.raises(LogError, match="has ended"):
            worker.ask(os._exit, 1).result(timeout=120)
        assert worker.ask(math.sqrt, 4.0).result(timeout=120) == 2.0
    finally:
        worker.close()


def test_a_flood_of_questions_is_refused_and_an_end_waits_for_none_of_them() -> None:
    worker = Worker()
    first = worker.ask(signal.pause)
    for _ in range(MOST_WAITING - 1):
        worker.ask(math.sqrt, 1.0)
    with pytest.raises(LogError, match="too many"):
        worker.ask(math.sqrt, 1.0)
    worker.close()
    with pytest.raises(OmniError):
        first.result(timeout=120)


# ---- recordings


class FedLink:
    """A link on which a robot's frames come again and again."""

    url = "tcp:127.0.0.1:5760"

    def __init__(self) -> None:
        self._bytes = b"".join(record[8:] for record in frames(1.0))
        self.written: list[bytes] = []

    def read(self, timeout_s: float) -> bytes:
        pass_time(min(timeout_s, 0.001))
        return self._bytes

    def write(self, data: bytes) -> None:
        self.written.append(data)

    def close(self) -> None:
        pass


class Fed:
    """A session whose robot sends, without a connection's beginning; its thread is this object's."""

    def __init__(self) -> None:
        self.inner = FedLink()
        link = UrgentLink(self.inner)
        self.session = Session("fed")
        self.robot = Robot(Connection(link, heartbeat=False), table=load_parameters(params_path()))
        self.session.robot, self.session._link, self.session.phase = self.robot, link, "connected"
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.is_set():
            self.robot.pump(0.0)

    def close(self) -> None:
        self._end.set()
        self._thread.join()


@pytest.fixture
def fed() -> Any:
    found = Fed()
    yield found
    found.close()


@pytest.mark.full
def test_a_recording_becomes_a_run(tmp_path: Path, fed: Fed) -> None:
    worker = Worker()
    recorder = Recorder(tmp_path, worker)
    folder = Path(recorder.start(fed.session))
    assert recorder.start(fed.session) == str(folder)  # it is on already
    assert recorder.state()["on"]
    wait_until(lambda: (folder / "telemetry.tlog").stat().st_size > 1000, "nothing was written")
    assert list_runs(tmp_path)[0].end == NOT_ENDED  # what a kill leaves is listed, too
    recorder.stop()
    wait_until(lambda: recorder.state()["completed"] == 1, "the figures were not made")
    recorder.close()
    worker.close()
    assert not recorder.state()["on"]
    assert recorder.state()["trouble"] == ""
    (run,) = list_runs(tmp_path)
    assert (run.name, run.end, run.robot) == ("studio", "done", fed.inner.url)
    assert run.numbers["duration_s"] == pytest.approx(1.0)
    assert (folder / "run.png").is_file()
    assert RecordedLog(folder / "telemetry.tlog").bad_frames == 0


@pytest.mark.full
def test_a_lost_link_ends_a_recording_cleanly(tmp_path: Path, fed: Fed) -> None:
    ended: list[str] = []
    recording = Recording(tmp_path, fed.session, lambda _recording, drive: ended.append(drive.end))
    fed.session.robot = None
    wait_until(lambda: not recording.on, "the recording goes on without a link")
    assert ended == ["the link was lost"]
    assert list_runs(tmp_path)[0].end == "the link was lost"


@pytest.mark.full
def test_a_full_disk_is_said_and_a_stop_is_sent_all_the_same(tmp_path: Path, fed: Fed) -> None:
    """The disk is full by a limit of the system on the size of files."""
    before_limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (FULL_BYTES, before_limit[1]))
    try:
        recording = Recording(tmp_path, fed.session, lambda _recording, _drive: None)
        wait_until(lambda: not recording.on, "the recording goes on")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before_limit)
    assert "ulimit" in recording.trouble
    (run,) = list_runs(tmp_path)
    assert run.end in recording.trouble
    log = RecordedLog(recording.folder / "telemetry.tlog")
    assert (log.bad_frames, log.lost_bytes) == (0, 0)  # whole records to the end
    before = len(fed.inner.written)
    assert fed.session.stop_now()
    wait_until(lambda: len(fed.inner.written) > before, "the stop was not sent")


def test_a_disk_that_hangs_keeps_neither_control_nor_a_stop(
    tmp_path: Path, fed: Fed, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs, goes_on = threading.Event(), threading.Event()

    def hanging(*_: object) -> None:
        hangs.set()
        goes_on.wait(120.0)

    recording = Recording(tmp_path, fed.session, lambda _recording, _drive: None)
    monkeypatch.setattr(recording._writer, "write_records", hanging)
    assert hangs.wait(120.0)
    before = len(fed.inner.written)
    assert fed.session.stop_now()
    wait_until(lambda: len(fed.inner.written) > before, "the stop waits for the disk")
    recording.end()
    goes_on.set()
    recording.wait()
    assert not recording.on


def test_what_waits_for_a_disk_has_an_end(tmp_path: Path, fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_module, "MOST_WAITING", 100)
    goes_on = threading.Event()
    recording = Recording(tmp_path, fed.session, lambda _recording, _drive: None)
    monkeypatch.setattr(recording._writer, "write_records", lambda *_: goes_on.wait(120.0))
    wait_until(lambda: recording._overflown, "frames pile up without end")
    assert recording._frames.qsize() <= 101
    goes_on.set()
    wait_until(lambda: not recording.on, "the recording goes on")
    assert "too slow" in recording.trouble


def test_without_a_robot_or_a_folder_nothing_is_left_behind(tmp_path: Path, fed: Fed) -> None:
    recorder = Recorder(tmp_path / "runs", SimpleNamespace())  # type: ignore[arg-type]
    with pytest.raises(LinkLostError):
        recorder.start(Session("none"))
    assert list((tmp_path / "runs").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputFileError):
        Recorder(tmp_path / "file", SimpleNamespace()).start(fed.session)  # type: ignore[arg-type]
