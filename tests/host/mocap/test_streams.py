# SPDX-License-Identifier: MIT
"""Recorded and simulated streams, in simulated time."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omniwheel.errors import MocapSourceError
from omniwheel.frames import Pose
from omniwheel.mocap.recorded import COLUMNS, SD_COLUMNS, RecordedSource, RecordingWriter, read_recording
from omniwheel.mocap.simulated import Cameras, SimulatedSource, circle
from omniwheel.mocap.source import MocapPose, MocapSource, newest


class Time:
    """A clock that only sleeping advances."""

    def __init__(self, now_s: float = 50.0) -> None:
        self.now_s = now_s

    def clock(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now_s += seconds


def simulated(time: Time, seed: int = 1, **cameras: float) -> SimulatedSource:
    return SimulatedSource(cameras=Cameras(**cameras), seed=seed, clock=time.clock, sleep=time.sleep)


def take(source: MocapSource, count: int) -> list[MocapPose]:
    found: list[MocapPose] = []
    while len(found) < count:
        measured = source.read(0.5)
        if measured is not None:
            found.append(measured)
    return found


def test_the_simulated_stream_has_the_rate_latency_and_noise_it_is_told() -> None:
    time = Time()
    source = simulated(time, rate_Hz=100.0, latency_s=0.03, sd_xy_m=0.002, sd_theta_rad=0.004)
    seen = take(source, 2000)
    assert np.diff([pose.taken_s for pose in seen]) == pytest.approx(0.01)
    assert all(pose.arrived_s == pytest.approx(pose.taken_s + 0.03) for pose in seen)
    assert seen[-1].arrived_s == pytest.approx(time.now_s)
    truth = np.array([circle(pose.taken_s - 50.0) for pose in seen])
    error = np.array([pose.pose for pose in seen]) - truth
    error[:, 2] = np.arctan2(np.sin(error[:, 2]), np.cos(error[:, 2]))
    assert error.std(axis=0) == pytest.approx([0.002, 0.002, 0.004], rel=0.06)
    assert np.abs(error.mean(axis=0)).max() < 3e-4


def test_drop_outs_leave_gaps_and_do_not_change_the_other_frames() -> None:
    whole = {pose.frame: pose.pose for pose in take(simulated(Time()), 300)}
    holes = take(simulated(Time(), drop_probability=0.3), 200)
    assert 0.6 < 200 / (holes[-1].frame + 1) < 0.8
    assert all(whole[pose.frame] == pose.pose for pose in holes if pose.frame in whole)


def test_the_same_seed_gives_the_same_stream() -> None:
    first, again, other = (take(simulated(Time(), seed), 20) for seed in (1, 1, 2))
    assert first == again
    assert first != other


@pytest.mark.parametrize(
    "bad", [{"rate_Hz": 0.0}, {"latency_s": -1.0}, {"drop_probability": 1.1}, {"sd_xy_m": math.nan}]
)
def test_impossible_cameras_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(MocapSourceError, match="cannot be simulated"):
        Cameras(**bad)


def test_a_recording_replays_with_its_own_stamps(tmp_path: Path) -> None:
    path = tmp_path / "lap.csv"
    original = take(simulated(Time(), drop_probability=0.2, latency_s=0.02), 50)
    with RecordingWriter(path) as writer:
        for measured in original:
            writer.write(measured)
    time = Time(1000.0)
    source = RecordedSource(path, clock=time.clock, sleep=time.sleep)
    replayed = take(source, 50)
    shift_s = 1000.0 - original[0].arrived_s
    for old, new in zip(original, replayed, strict=True):
        assert new.pose == pytest.approx(old.pose, abs=1e-6)
        assert (new.taken_s, new.arrived_s) == pytest.approx((old.taken_s + shift_s, old.arrived_s + shift_s), abs=2e-6)
        assert new.frame == old.frame
    assert time.now_s == pytest.approx(original[-1].arrived_s + shift_s, abs=1e-5)
    assert source.ended
    assert source.read(1.0) is None


def test_a_recording_keeps_how_good_each_pose_is_and_one_of_before_does_not_say_it(tmp_path: Path) -> None:
    told = [replace(pose, sd_xy_m=0.001 * pose.frame, sd_theta_rad=0.002) for pose in take(simulated(Time()), 5)]
    with RecordingWriter(tmp_path / "told.csv") as writer:
        for pose in told:
            writer.write(pose)
    read = read_recording(tmp_path / "told.csv")
    assert [(pose.sd_xy_m, pose.sd_theta_rad) for pose in read] == [(p.sd_xy_m, p.sd_theta_rad) for p in told]
    (tmp_path / "old.csv").write_text(",".join(COLUMNS) + "\n0,0,0,0,0,7\n", encoding="ascii")
    assert read_recording(tmp_path / "old.csv")[0].sd_xy_m == 0.0
    (tmp_path / "bad.csv").write_text(",".join((*COLUMNS, *SD_COLUMNS)) + "\n0,0,0,0,0,0,-1,0\n", encoding="ascii")
    with pytest.raises(MocapSourceError, match="negative"):
        read_recording(tmp_path / "bad.csv")


def test_newest_drains_what_waits(tmp_path: Path) -> None:
    time = Time()
    source = simulated(time, rate_Hz=50.0, latency_s=0.0)
    time.now_s += 0.1
    latest, overtaken = newest(source, 0.0)
    assert latest is not None
    assert (latest.frame, overtaken) == (5, 5)
    assert newest(source, 0.001) == (None, 0)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("0,0,1,0,0", "5 cells beside 6 columns"),
        ("0,0,1,0,nan,0", "y_m is not finite"),
        ("0,0,1,0,0,left", "theta_rad is 'left'"),
        ("2,1,1,0,0,0", "is before taken_s"),
        ("-9,-1,2,0,0,0", "comes before the line above"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, line: str, problem: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(",".join(COLUMNS) + "\n0,0,0,0,0,0\n" + line + "\n", encoding="ascii")
    with pytest.raises(MocapSourceError, match=problem) as caught:
        read_recording(path)
    assert f"{path}:3" in str(caught.value)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("text", ["", "x,y\n1,2\n", ",".join(COLUMNS) + "\n", "\x00\n", "\xff\xfe"])
def test_a_file_that_is_no_recording_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(MocapSourceError) as caught:
        read_recording(path)
    assert "taken_s,arrived_s" in caught.value.hint


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MocapSourceError, match=r"none\.csv: .*No such file"):
        RecordedSource(tmp_path / "none.csv")


def test_headings_are_wrapped(tmp_path: Path) -> None:
    path = tmp_path / "turns.csv"
    path.write_text(",".join(COLUMNS) + "\n0,0,0,0,0,7\n", encoding="ascii")
    assert read_recording(path)[0].pose == pytest.approx(Pose(0.0, 0.0, 7.0 - math.tau))


@pytest.mark.parametrize("heading", [None, COLUMNS, tuple(reversed(COLUMNS)), (*SD_COLUMNS, *COLUMNS)])
def test_the_heading_line_says_which_column_is_what(tmp_path: Path, heading: tuple[str, ...] | None) -> None:
    path = tmp_path / "turned.csv"
    values = dict(zip((*COLUMNS, *SD_COLUMNS), (1.0, 1.5, 3, 0.25, 0.5, 0.75, 0.0, 0.0), strict=True))
    row = ",".join(str(values[name]) for name in heading or COLUMNS)
    lines = [row] if heading is None else [",".join(heading), row]
    path.write_text("\n".join([*lines, "", ""]), encoding="utf-8-sig")
    (read,) = read_recording(path)
    assert (read.taken_s, read.arrived_s, read.frame, *read.pose) == (1.0, 1.5, 3, 0.25, 0.5, 0.75)


@pytest.mark.parametrize("names", [(*COLUMNS, "z_m"), (*COLUMNS[:-1], "x_m"), (*COLUMNS, SD_COLUMNS[0], "frame")])
def test_unknown_and_doubled_columns_are_refused(tmp_path: Path, names: tuple[str, ...]) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(",".join(names) + "\n" + ",".join("0" * len(names)) + "\n", encoding="ascii")
    with pytest.raises(MocapSourceError, match=f":1: .*{names[-1]}"):
        read_recording(path)
