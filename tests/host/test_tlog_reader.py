# SPDX-License-Identifier: MIT
"""Logs with restarts, gaps, another robot and what is no frame: read in parts, and what was left out is said."""

from __future__ import annotations

import json
import math
import re
import shutil
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni.studio.log_frames import record_starts
from omni.studio.recorded_log import RecordedLog
from omni.studio.samples import SampleStore
from omni.studio.spectra import TooFewSamplesError, spectrum
from omniwheel.dialect import mavlink
from omniwheel.errors import LogError
from omniwheel.identification.sources import read_dataset
from omniwheel.log_sources import open_log, read_tlog
from omniwheel.replay import replay
from omniwheel.robots import read_robot
from omniwheel.telemetry import Tracking, decode
from omniwheel.telemetry_record import read_record, record_of
from omniwheel.tlog_reader import STAMP, RobotClock, TlogReader

ROBOT = read_robot("three_wheel")
DRIVE = 120
"""Telemetry messages of each kind in a drive, one each 50 ms."""
SPEED_M_S = 0.1


def packed(message: Any, system: int = 1, component: int = 1, version: int = 2) -> bytes:
    data = message.pack(mavlink.MAVLink(None, system, component), force_mavlink1=version == 1)
    return bytes((1_700_000_000_000_000).to_bytes(8, "big") + data)


def tracking(ms: int, x: float, theta: float = 0.0) -> Any:
    turned = math.remainder(theta, math.tau)
    return mavlink.MAVLink_omni_tracking_message(
        ms % 2**32, [x, 0, turned], [0, 0, 0], [x, 0, turned], [1e-3] * 3, 0.0, 2
    )


def wheels(ms: int, speed: float) -> Any:
    four = [0.0] * 4
    turned = [speed, 0.0, -speed, 0.0]
    return mavlink.MAVLink_omni_wheels_message(ms % 2**32, turned, turned, four, four, four, 1.0, 1.0, four, 0)


def drive(start_ms: int = 3000, begin_m: float = 0.0, theta: float = 0.0, system: int = 1, rows: int = DRIVE) -> bytes:
    """A drive along x with SPEED_M_S, as the robot reports it."""
    records = []
    for row in range(rows):
        ms, x = start_ms + 50 * row, begin_m + SPEED_M_S * 0.05 * row
        records += [packed(wheels(ms, 2.0), system), packed(tracking(ms, x, theta), system)]
    return b"".join(records)


def later(records: bytes, seconds: float) -> bytes:
    """The same records, recorded later by the recorder's clock."""
    moved = bytearray(records)
    for at in record_starts(records)[0]:
        stamp_us = int.from_bytes(records[at : at + STAMP], "big") + round(1e6 * seconds)
        moved[at : at + STAMP] = stamp_us.to_bytes(STAMP, "big")
    return bytes(moved)


def log_of(path: Path, *parts: bytes) -> Path:
    path.write_bytes(b"".join(parts))
    return path


def log(folder: Path, *parts: bytes) -> Path:
    return log_of(folder / "x.tlog", *parts)


@pytest.mark.parametrize(
    "second",
    [
        drive(2000, -3.0, 3.0),
        drive(3000, 50.0),
        drive(3000 + 50 * DRIVE + 60_000, 50.0, 9.0),
        drive(500, 7.0) + drive(500, 7.0),
        later(drive(3000 + 50 * DRIVE + 1000, 9.0), 30.0),
        later(drive(3000 + 50 * DRIVE - 900, 9.0), 30.0),
        later(drive(3000 + 50 * DRIVE + 1000, 9.0), -30.0),
        later(drive(3000 + 50 * DRIVE - 900, 9.0), -30.0),
    ],
    ids=[
        "restart",
        "same clock",
        "silent for a minute",
        "two restarts",
        "a little ahead",
        "a little behind",
        "a little ahead, recorded before",
        "a little behind, recorded before",
    ],
)
def test_no_number_is_taken_across_a_restart_or_a_gap(tmp_path: Path, second: bytes) -> None:
    record = read_record(log(tmp_path, drive(), second))
    drives = 1 + len(second) // len(drive())
    numbers = record.numbers()
    assert numbers["way_m"] == pytest.approx(drives * SPEED_M_S * 0.05 * (DRIVE - 1), rel=1e-4)
    assert numbers["duration_s"] == pytest.approx(drives * 0.05 * (DRIVE - 1))
    assert numbers["top_speed_m_s"] == pytest.approx(SPEED_M_S, rel=1e-2)
    assert numbers["heading_rmse_rad"] == pytest.approx(0.0, abs=1e-6)
    assert len(record.starts) == len(record.notes) == drives - 1
    assert [time_s for time_s, _ in record.events] == list(record.starts)
    assert all(len(record.borders(times)) == drives - 1 for times in (record.time_s, record.wheel_time_s))
    assert len(record.time_s) == len(record.wheel_time_s) == drives * DRIVE


def test_a_clock_of_milliseconds_goes_on_where_it_wraps(tmp_path: Path) -> None:
    record = read_record(log(tmp_path, drive(2**32 - 2000)))
    assert record.starts == ()
    assert record.numbers()["duration_s"] == pytest.approx(0.05 * (DRIVE - 1))


def test_a_simulated_robot_that_was_paused_has_not_restarted(tmp_path: Path) -> None:
    paused = later(drive(3000 + 50 * DRIVE, SPEED_M_S * 0.05 * DRIVE), 30.0)
    record = read_record(log(tmp_path, drive(), paused))
    assert record.starts == ()
    assert record.numbers()["way_m"] == pytest.approx(SPEED_M_S * 0.05 * (2 * DRIVE - 1), rel=1e-4)


@pytest.mark.parametrize("stamps_s", [(None,) * 4, (50.0, 50.9, 50.91, 51.0), (0.0,) * 4])
def test_what_a_radio_brings_late_is_no_restart(stamps_s: tuple[float | None, ...]) -> None:
    clock = RobotClock()
    times_s = (5.0, 5.9, 5.1, 6.0)
    assert [clock.follow(*times) for times in zip(times_s, stamps_s, strict=True)] == list(times_s)
    assert clock.starts == ()


def recorded_live(ms: list[int], began_s: float, x_m: float) -> bytes:
    """Poses of a robot that started at ``began_s`` of the recorder's clock and stands at x_m."""
    return b"".join(later(packed(tracking(at, x_m)), began_s + 1e-3 * at) for at in ms)


@pytest.mark.parametrize("up_ms", [300, 600, 950])
def test_a_robot_that_restarts_soon_after_its_start_has_restarted(tmp_path: Path, up_ms: int) -> None:
    """Its clock went back by less than a late message's would; the recorder's went on by the new start-up."""
    first = recorded_live(list(range(50, up_ms, 50)), 0.0, 1.0)
    second = recorded_live(list(range(75, 5000, 50)), 1e-3 * up_ms, 0.0)
    path = log(tmp_path, first, second)
    record = read_record(path)
    assert len(record.starts) == 1
    assert record.numbers()["way_m"] == pytest.approx(0.0, abs=1e-6)
    opened = RecordedLog(path)
    try:
        assert len(opened.marks()) == 1
    finally:
        opened.close()


def test_live_samples_are_not_joined_across_a_restart_that_brings_the_clock_near_the_old_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    store, now_s = SampleStore(), [100.0]
    monkeypatch.setattr("omni.studio.samples.time.monotonic", lambda: now_s[0])
    times_s = []
    for robot_ms, went_s in ((3000, 0.0), (3050, 0.05), (3900, 10.0), (3950, 0.05)):
        now_s[0] += went_s
        telemetry = decode(Tracking, tracking(robot_ms, 0.0))
        assert telemetry is not None
        times_s.append(store.take(telemetry))
    assert times_s == pytest.approx([3.0, 3.05, 4.05, 4.1])


def test_a_replay_is_that_of_the_longest_part(tmp_path: Path) -> None:
    alone = replay(read_tlog(log(tmp_path, drive()), ROBOT), ROBOT)
    both = read_tlog(log(tmp_path, drive(5000, rows=40), drive()), ROBOT)
    assert replay(both, ROBOT).pose == pytest.approx(alone.pose)
    assert both.truth is not None
    assert both.truth.xy[0] == pytest.approx([0.0, 0.0])
    assert "part 2 of 2" in both.name


def test_another_part_can_be_chosen(tmp_path: Path) -> None:
    path = log(tmp_path, drive(5000, 3.0, rows=40), drive())
    short = log_of(tmp_path / "short.tlog", drive(5000, 3.0, rows=40))
    assert replay(read_tlog(path, ROBOT, 1), ROBOT).pose == pytest.approx(replay(read_tlog(short, ROBOT), ROBOT).pose)
    assert read_record(path, 1).numbers() == read_record(short).numbers()
    assert read_record(path, 2).numbers()["duration_s"] == pytest.approx(0.05 * (DRIVE - 1))
    words = ["replay", str(path), "--robot", "three_wheel", "--json", "--part"]
    chosen = [CliRunner().invoke(app, [*words, number]) for number in ("1", "2")]
    assert [json.loads(result.stdout)["rows"] for result in chosen] == [40, DRIVE]
    plotted = CliRunner().invoke(app, ["plot", str(path), "--out", str(tmp_path / "a.png"), "--part", "1", "--json"])
    assert json.loads(plotted.stdout)["numbers"]["duration_s"] == pytest.approx(0.05 * 39)


@pytest.mark.parametrize("words", ["replay x.tlog --robot three_wheel", "plot x.tlog", "identify telemetry x.tlog"])
@pytest.mark.parametrize("part", ["0", "3", "-1", "x"])
def test_a_part_that_is_not_there_is_refused(tmp_path: Path, words: str, part: str) -> None:
    path = log(tmp_path, drive(5000, 3.0, rows=40), drive())
    asked = words.replace("x.tlog", str(path)).split()
    result = CliRunner().invoke(app, [*asked, "--part", part])
    assert result.exit_code not in (0, 1), result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert not (tmp_path / "x.png").exists()


@pytest.mark.parametrize("name", ["log.npz", "log.csv"])
def test_a_log_without_parts_has_none_to_choose(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(LogError, match="part"):
        open_log(tmp_path / name, ROBOT, part=1)


def test_no_part_goes_across_the_wrap_of_the_clock(tmp_path: Path) -> None:
    read = read_tlog(log(tmp_path, drive(2**32 - 4000)), ROBOT)
    assert len(read.time_s) == 80
    assert read.time_s[-1] - read.time_s[0] == pytest.approx(0.05 * 79)


def test_a_dataset_is_that_of_the_longest_part(tmp_path: Path) -> None:
    def samples(start_ms: int, rows: int, counts: int) -> bytes:
        four = [0] * 4
        made = [
            mavlink.MAVLink_omni_sample_message(
                1000 * (start_ms + 20 * row), [counts + 40 * row] * 3 + [0], four, 12.0, [0.0] * 3, 0
            )
            for row in range(rows)
        ]
        return b"".join(packed(one) for one in made)

    values = ROBOT.parameter_values()
    alone = read_dataset(log(tmp_path, samples(1000, 300, 0)), values)
    both = read_dataset(log(tmp_path, samples(9000, 100, 5000), samples(1000, 300, 0)), values)
    assert both.wheel_rad_s == pytest.approx(alone.wheel_rad_s)
    assert "part 2 of 2" in both.name


def test_another_robots_telemetry_is_left_out_and_that_is_said(tmp_path: Path) -> None:
    mixed = [
        packed(tracking(100_000 * (system - 1) + 50 * row, 0.005 * row + 9.0 * system), system)
        for row in range(40)
        for system in (1, 2)
    ]
    record = read_record(log(tmp_path, *mixed))
    assert record.numbers()["way_m"] == pytest.approx(0.005 * 39, rel=1e-3)
    assert [note for note in record.notes if "robot 2" in note]
    assert record.starts == ()


@pytest.mark.parametrize(
    ("between", "skipped"),
    [
        (packed(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), 255, 190, version=1), 0),
        (bytes(4096), 4096),
        (b"\xfd" * 57, 57),
        (bytes(range(57)), 57),
        (drive(rows=1)[3:60], 57),
    ],
    ids=["MAVLink 1", "NUL", "markers", "other bytes", "a piece of a frame"],
)
@pytest.mark.parametrize("at_the_end", [False, True])
def test_what_is_no_frame_is_passed_over_and_counted(
    tmp_path: Path, between: bytes, skipped: int, at_the_end: bool
) -> None:
    parts = (drive(), between) if at_the_end else (drive(rows=60), between, drive(6000, 0.3, rows=60))
    path = log(tmp_path, *parts)
    reader = TlogReader(path)
    assert len([one for one in reader if one.get_type().startswith("OMNI_")]) == 2 * DRIVE
    assert reader.skipped == skipped
    record = read_record(path)
    assert record.numbers()["way_m"] == pytest.approx(SPEED_M_S * 0.05 * (DRIVE - 1), rel=1e-3)
    assert len(record.notes) == (skipped > 0)
    assert len(read_tlog(path, ROBOT).time_s) == DRIVE


def test_a_damaged_frame_costs_no_other(tmp_path: Path) -> None:
    data = bytearray(drive())
    data[len(drive(rows=30)) + 20] ^= 0xFF
    reader = TlogReader(log(tmp_path, bytes(data)))
    assert len(list(reader)) == 2 * DRIVE - 1
    assert reader.skipped == len(packed(wheels(3000 + 50 * 30, 2.0)))


@pytest.mark.parametrize("data", [b"", bytes(5000), b"\xfd" * 5000, b"time,x\n1,2\n" * 99])
def test_a_file_without_frames_is_no_log(tmp_path: Path, data: bytes) -> None:
    path = log(tmp_path, data)
    with pytest.raises(LogError, match=re.escape(str(path))):
        read_record(path)


def test_the_folder_of_a_drive_is_a_log(tmp_path: Path) -> None:
    folder = tmp_path / "drive-pose"
    folder.mkdir()
    (folder / "drive.json").write_text("{}")
    shutil.move(log(tmp_path, drive()), folder / "telemetry.tlog")
    assert open_log(folder, ROBOT).time_s == pytest.approx(open_log(folder / "telemetry.tlog", ROBOT).time_s)
    result = CliRunner().invoke(app, ["replay", str(folder), "--robot", "three_wheel", "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["rows"] == DRIVE


def test_a_record_is_that_of_its_messages_without_the_file(tmp_path: Path) -> None:
    path = log(tmp_path, drive())
    assert record_of(list(TlogReader(path))).numbers() == read_record(path).numbers()


@pytest.mark.full
def test_memory_does_not_hold_the_messages(tmp_path: Path) -> None:
    """What is kept of a longer log is its numbers. Messages as objects would take 20 bytes for each of the file's."""

    def peak(rows: int) -> tuple[int, int]:
        path = log(tmp_path, drive(rows=rows))
        tracemalloc.start()
        try:
            read_record(path)
            return tracemalloc.get_traced_memory()[1], path.stat().st_size
        finally:
            tracemalloc.stop()

    (less, small), (more, large) = peak(6000), peak(12000)
    assert more - less < 5 * (large - small)


@pytest.mark.parametrize(
    "second", [drive(2000), later(drive(3000 + 50 * DRIVE + 1000, 9.0), 30.0)], ids=["restart", "a little ahead"]
)
def test_a_log_in_the_studio_marks_a_restart(tmp_path: Path, second: bytes) -> None:
    opened = RecordedLog(log(tmp_path, drive(), second))
    try:
        marks = opened.marks()
        assert [mark["time_s"] for mark in marks] == pytest.approx([0.05 * (DRIVE - 1) + 0.5])
        (trace,) = opened.samples(["tracking.pose.x"], 0.0, 1e3)
        with pytest.raises(TooFewSamplesError, match="gap"):
            spectrum(trace)
    finally:
        opened.close()
