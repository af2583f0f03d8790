# SPDX-License-Identifier: MIT
"""The Vicon adapter against a module with the library's classes: units, heading, time, occlusion, reconnecting."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from omniwheel.errors import MocapLibraryError, MocapLostError, MocapSourceError
from omniwheel.mocap.streams import open_source
from omniwheel.mocap.vicon import LIBRARY, ViconSource, ViconStream, load_library
from omniwheel.quaternion import heading
from tests.waiting import Deadline

FAKE = Path(__file__).with_name("fake_vicon")


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The fake library where Python finds the real one, in this process and in those it starts."""
    monkeypatch.syspath_prepend(str(FAKE))
    yield load_library()
    sys.modules.pop(LIBRARY, None)


def stream(library: ModuleType, frames: list[object], subject: str = "robot") -> ViconStream:
    library.PyViconDatastream.script = frames
    made = ViconStream("vicon.local", subject, library=library, clock=lambda: 100.0)
    made.connect()
    return made


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_heading_is_that_of_the_rotation_matrix_for_any_quaternion(quaternion: list[float]) -> None:
    w, x, y, z = quaternion
    matrix = Rotation.from_quat([x, y, z, w]).as_matrix()
    if math.hypot(matrix[0, 0], matrix[1, 0]) < 1e-3:
        return
    expected = math.atan2(matrix[1, 0], matrix[0, 0])
    assert abs(math.remainder(heading(quaternion) - expected, math.tau)) < 1e-9


@pytest.mark.parametrize("quaternion", [(0.0,) * 4, (math.nan, 0.0, 0.0, 0.0), (math.inf, 0.0, 0.0, 0.0)])
def test_a_quaternion_without_direction_is_nan(quaternion: tuple[float, ...]) -> None:
    assert math.isnan(heading(quaternion))


def test_millimetres_become_metres_and_latency_a_time_stamp(library: ModuleType) -> None:
    reader = stream(library, [library.turned(7, 1500.0, -250.0, 2.0, 0.031)])
    measured = reader.read()
    assert measured is not None
    assert measured.pose == pytest.approx((1.5, -0.25, 2.0))
    assert (measured.arrived_s, measured.frame) == (100.0, 7)
    assert measured.taken_s == pytest.approx(99.969)


@pytest.mark.parametrize("latency", [0.0, -1.0, math.nan, math.inf])
def test_a_latency_that_is_none_counts_as_zero(library: ModuleType, latency: float) -> None:
    measured = stream(library, [library.turned(1, 0.0, 0.0, 0.0, latency)]).read()
    assert measured is not None
    assert measured.taken_s == 100.0


def test_the_stream_is_pushed_with_z_up(library: ModuleType) -> None:
    reader = stream(library, [])
    assert reader._client.calls == ["connect vicon.local", "mode ServerPush", "axes Forward Left Up"]


def test_occluded_bad_and_repeated_frames_give_no_pose(library: ModuleType) -> None:
    frames = [
        library.turned(1, 1.0, 0.0, 0.0),
        library.Frame(2, None),
        library.Frame(3, (1.0, 1.0, 1.0), None),
        library.Frame(4, (math.nan, 1.0, 1.0)),
        library.Frame(5, result=library.Result.NoFrame),
        library.turned(6, 2.0, 0.0, 0.0),
    ]
    reader = stream(library, frames)
    seen = [reader.read() for _ in range(8)]  # the last two time out: the library repeats the old frame
    assert [None if pose is None else pose.frame for pose in seen] == [1, None, None, None, None, 6, None, None]
    assert reader.occluded == 3


def test_an_unknown_object_is_named_with_those_there_are(library: ModuleType) -> None:
    reader = stream(library, [library.turned(1, 0.0, 0.0, 0.0)], "robt")
    with pytest.raises(MocapSourceError, match="'robt'") as caught:
        reader.read()
    assert "robot, wand" in caught.value.hint


def test_a_server_that_is_not_there_or_goes_away_is_an_error(library: ModuleType) -> None:
    library.PyViconDatastream.script = [library.Frame(1, result=library.Result.NotConnected)]
    with pytest.raises(MocapLostError, match="ClientConnectionFailed"):
        ViconStream("nowhere", "robot", library=library).connect()
    with pytest.raises(MocapLostError, match="closed"):
        stream(library, [library.Frame(1, result=library.Result.NotConnected)]).read()


def test_without_the_library_the_error_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, LIBRARY, None)
    with pytest.raises(MocapLibraryError, match="not usable") as caught:
        load_library()
    assert "omniwheel[vicon]" in caught.value.hint


def poses(source: ViconSource, count: int) -> list[int]:
    found: list[int] = []
    deadline = Deadline("too few poses")
    while len(found) < count:
        measured = source.read(deadline.left_s())
        assert measured is not None
        assert measured.pose.x == pytest.approx(0.01 * measured.frame)
        assert measured.taken_s <= measured.arrived_s <= source.clock()
        found.append(measured.frame)
    return found


@pytest.mark.full
def test_the_reader_process_connects_again_after_a_loss(library: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FAKE_VICON", "lossy")
    source = open_source("vicon:vicon.local/robot")
    assert isinstance(source, ViconSource)
    try:
        assert poses(source, 10) == [1, 2, 4, 5, 7, 8, 11, 13, 14, 16]
    finally:
        source.close()
    assert not source._process.is_alive()


@pytest.mark.full
def test_the_reader_process_reports_its_errors(library: ModuleType) -> None:
    with pytest.raises(MocapLostError, match="no Vicon DataStream at nowhere"):
        ViconSource("nowhere", "robot")


@pytest.mark.full
def test_a_reader_process_that_dies_is_noticed(library: ModuleType) -> None:
    source = ViconSource("vicon.local", "robot")
    try:
        poses(source, 1)
        source._process.kill()
        source._process.join(20.0)
        with pytest.raises(MocapLostError, match="ended"):
            poses(source, 100_000)
    finally:
        source.close()


@pytest.mark.parametrize("name", ["vicon:", "vicon:host", "vicon:/robot", "vicon:host/", "recorded:", "optitrack", ""])
def test_a_stream_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(MocapSourceError) as caught:
        open_source(name)
    assert "vicon:HOST/OBJECT" in caught.value.hint
