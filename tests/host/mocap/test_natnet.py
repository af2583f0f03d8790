# SPDX-License-Identifier: MIT
"""NatNet: the real library, in its process, against a server on this computer that sends what Motive sends."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from omniwheel.errors import MocapLibraryError, MocapLostError, MocapSourceError
from omniwheel.mocap import natnet
from omniwheel.mocap.natnet import NatNetSource, NatNetStream, TickLength, load_library
from omniwheel.mocap.quaternion import tilt
from omniwheel.mocap.source import MocapPose, MocapSource
from omniwheel.mocap.streams import open_source
from tests.host.mocap.natnet_server import LATENCY_S, Body, Server

TURNED = Rotation.from_euler("z", 2.0).as_quat()


@contextmanager
def opened(server: Server, subject: str = "robot") -> Iterator[MocapSource]:
    source = open_source(f"natnet:127.0.0.1:{server.port}/{subject}")
    try:
        yield source
    finally:
        source.close()


def take(source: MocapSource, count: int = 1) -> list[MocapPose]:
    found: list[MocapPose] = []
    while len(found) < count:
        measured = source.read(20.0)
        assert measured is not None
        found.append(measured)
    return found


@pytest.mark.parametrize("version", [(4, 1), (3, 1)])
def test_a_pose_has_place_heading_and_the_time_at_which_it_was_seen(version: tuple[int, int]) -> None:
    with Server(version) as server:
        server.bodies = [Body(3), Body(7, (1.5, -0.25, 0.1), tuple(TURNED))]
        with opened(server) as source:
            for measured in take(source, 20):
                assert measured.pose == pytest.approx((1.5, -0.25, 2.0), abs=1e-6)
                assert measured.arrived_s - measured.taken_s == pytest.approx(LATENCY_S, rel=1e-3)
                assert measured.arrived_s <= source.clock()
            frames = [measured.frame for measured in take(source, 20)]
        assert np.diff(frames).min() > 0


@contextmanager
def connected(server: Server) -> Iterator[NatNetStream]:
    stream = NatNetStream("127.0.0.1", server.port, "robot", library=load_library())
    stream.connect()
    try:
        yield stream
    finally:
        stream.close()


def read_many(stream: NatNetStream, count: int) -> None:
    for _ in range(count):
        stream.read()


def test_frames_for_a_group_are_found() -> None:
    with Server(multicast=True) as server, connected(server) as stream:
        while stream.read() is None:
            pass
        assert stream.multicast


def test_a_server_that_sends_to_each_client_gets_the_signs_of_life_it_wants() -> None:
    """At first it may send without them, so that it looks like one that sends to a group."""
    with Server(patience_s=1.0) as server, connected(server) as stream:
        with pytest.raises(MocapLostError, match="silent"):
            read_many(stream, 10_000)
        stream.connect()
        assert not stream.multicast
        read_many(stream, 500)
        assert time.monotonic() - server.heard_s < 1.0, "it has given signs of life for 2.5 s"


def test_what_the_cameras_do_not_see_gives_no_pose() -> None:
    with Server() as server, opened(server) as source:
        take(source)
        server.bodies = [Body(3), Body(7, seen=False)]
        while source.read(0.2) is not None:
            pass
        server.bodies = [Body(3)]
        assert source.read(0.2) is None, "a body that is not in the frame"
        server.bodies = [Body(7, (2.0, 0.0, 0.0))]
        assert take(source)[0].pose.x == 2.0


def test_a_server_that_falls_silent_is_connected_to_again() -> None:
    with Server() as server, opened(server) as source:
        take(source)
        server.sends = False
        while source.read(0.5) is not None:
            pass
        server.sends = True
        assert take(source, 5)[-1].frame > 0


def test_an_object_that_is_renamed_is_noticed() -> None:
    with Server() as server, opened(server) as source:
        take(source)
        server.names = {"cart": 7}
        server.changed = True
        with pytest.raises(MocapSourceError, match="no rigid body 'robot'") as caught:
            take(source, 100_000)
    assert "cart" in caught.value.hint


def test_an_unknown_object_is_named_with_those_there_are() -> None:
    with Server() as server, opened(server, "robt") as source:
        with pytest.raises(MocapSourceError, match="'robt'") as caught:
            take(source)
        assert "robot, wand" in caught.value.hint


def test_axes_with_y_up_are_noticed_as_soon_as_the_robot_has_turned() -> None:
    with Server() as server, opened(server) as source:
        take(source)
        server.bodies = [Body(7, rotation=tuple(Rotation.from_euler("y", 1.0).as_quat()))]
        with pytest.raises(MocapSourceError, match="lies on its side, 57 degrees") as caught:
            take(source, 100_000)
        assert "Up Axis" in caught.value.hint


def test_a_server_that_is_not_there_or_says_nothing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(natnet, "_ANSWER_S", 0.2)
    library = load_library()
    with Server() as server:
        stream = NatNetStream("127.0.0.1", server.port, "robot", library=library)
        server.sends = False
        with pytest.raises(MocapLostError, match="answers, but sends no frames"):
            stream.connect()
        server.answers = False
        with pytest.raises(MocapLostError, match="no NatNet stream"):
            stream.connect()
    with pytest.raises(MocapLostError, match="no NatNet stream"):
        NatNetStream("no.such.host.invalid", 1510, "robot", library=library).connect()


def test_a_port_is_part_of_the_host(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    monkeypatch.setattr(NatNetSource, "__init__", lambda _self, *place, **more: made.append((place, more["port"])))
    open_source("natnet:motive.local:2510/robot")
    assert made == [(("motive.local", "robot"), 2510)]


@pytest.mark.parametrize("name", ["natnet:", "natnet:host", "natnet:/robot", "natnet:host:x/robot", "natnet::1/robot"])
def test_a_stream_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(MocapSourceError) as caught:
        open_source(name)
    assert "natnet:HOST/OBJECT" in caught.value.hint


def test_without_the_library_the_error_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, natnet.LIBRARY, None)
    with pytest.raises(MocapLibraryError, match="not usable") as caught:
        load_library()
    assert "omniwheel[natnet]" in caught.value.hint


def suffix(stamp_s: float, ticks: int | None, sent: int | None) -> SimpleNamespace:
    return SimpleNamespace(timestamp=stamp_s, stamp_camera_mid_exposure=ticks, stamp_transmit=sent)


@pytest.mark.parametrize("per_s", [2_441_406, 10_000_000, 3_579_545])
def test_the_length_of_a_tick_is_measured(per_s: int) -> None:
    ticks = TickLength()
    assert ticks.latency(suffix(100.0, 5 * per_s, 5 * per_s + per_s // 100)) is None
    assert ticks.latency(suffix(100.1, 5 * per_s + per_s // 10, 0)) is None, "too near to measure"
    later = 5 * per_s + per_s // 2
    assert ticks.latency(suffix(100.5, later, later + per_s // 50)) == pytest.approx(0.02, rel=1e-3)


def test_times_that_cannot_be_are_not_believed() -> None:
    ticks = TickLength()
    assert ticks.latency(suffix(1.0, None, None)) == 0.0, "before NatNet 3"
    assert ticks.latency(suffix(1.0, 0, 0)) == 0.0
    assert ticks.latency(suffix(1.0, 10**9, 10**9)) is None
    assert ticks.latency(suffix(0.5, 10**8, 10**8)) is None, "a take that begins anew"
    assert ticks.latency(suffix(1.0, 10**8 + 5, 10**8)) is None, "ten ticks a second are no clock"
    assert ticks.latency(suffix(2.0, 2 * 10**8 + 5, 10**8)) == 0.0, "sent before it was seen"
    assert ticks.latency(suffix(2.0, 10**8, 10**10)) == 0.0, "99 seconds late"


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_tilt_is_the_angle_of_z(quaternion: list[float]) -> None:
    w, x, y, z = quaternion
    expected = math.acos(np.clip(Rotation.from_quat([x, y, z, w]).as_matrix()[2, 2], -1.0, 1.0))
    assert abs(math.cos(tilt(quaternion)) - math.cos(expected)) < 1e-9


def test_a_quaternion_without_direction_has_no_tilt() -> None:
    assert math.isnan(tilt((0.0,) * 4))
