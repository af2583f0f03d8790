# SPDX-License-Identifier: MIT
"""NatNet: the real library, in its process, against a server on this computer that sends what Motive sends."""

from __future__ import annotations

import math
import struct
import sys
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
from omniwheel.mocap.reader import ProcessSource
from omniwheel.mocap.source import MocapPose, MocapSource
from omniwheel.mocap.streams import open_source
from omniwheel.quaternion import tilt
from tests.host.mocap.natnet_server import LATENCY_S, Body, Server, frame, model
from tests.waiting import Deadline, wait_until

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
    deadline = Deadline("too few poses")
    while len(found) < count:
        measured = source.read(deadline.left_s())
        assert measured is not None
        found.append(measured)
    return found


@contextmanager
def connected(server: Server) -> Iterator[NatNetStream]:
    stream = NatNetStream("127.0.0.1", server.port, "robot", library=load_library())
    stream.connect()
    try:
        yield stream
    finally:
        stream.close()


def read_many(stream: NatNetStream, count: int) -> list[MocapPose]:
    return [pose for pose in (stream.read() for _ in range(count)) if pose is not None]


class Offline:
    """A stream that was connected, and gets frames as the library unpacks them, without a network. A frame is 10 ms."""

    def __init__(self, version: tuple[int, int] = (4, 1)) -> None:
        self.library = load_library()
        self.now_s = 500.0
        self.version = version
        self.number = 0
        self.asked: list[int] = []
        self.stream = NatNetStream("motive.local", 1510, "robot", library=self.library, clock=lambda: self.now_s)
        self.stream._client = SimpleNamespace(
            NAT_KEEPALIVE=10, send_request=self.asked.append, request_modeldef=lambda: self.asked.append(4)
        )
        self.describe({"robot": 7, "wand": 3})

    def describe(self, names: dict[str, int]) -> None:
        buffer = self.library.nat_net_client.PacketBuffer(model(self.version, names)[4:])
        unpacked = self.library.DataDescriptions.read_from_buffer(buffer, self.library.Version(*self.version))
        self.stream._on_description(unpacked)

    def frame(self, *bodies: Body, changed: bool = False, stands: bool = False) -> MocapPose | None:
        self.now_s += 0.01
        self.number += 1
        packed = frame(self.version, self.number, 1.0 if stands else self.now_s - LATENCY_S, list(bodies), changed)
        buffer = self.library.nat_net_client.PacketBuffer(packed[4:])
        self.stream._on_frame(self.library.DataFrame.read_from_buffer(buffer, self.library.Version(*self.version)))
        return self.stream.read()

    def frames(self, count: int, body: Body, stands: bool = False) -> None:
        """Many frames; ``stands``: with the same times of exposure."""
        for _ in range(count):
            self.frame(body, stands=stands)

    def settle(self) -> None:
        """As many frames as the length of a tick takes."""
        self.frames(30, Body(7))


@pytest.mark.full
@pytest.mark.parametrize("version", [(4, 1), (3, 1)])
def test_a_pose_has_place_heading_and_the_time_at_which_it_was_seen(version: tuple[int, int]) -> None:
    bodies = [Body(3), Body(7, rotation=tuple(TURNED))]
    with Server(version, bodies=bodies, moving=True) as server, opened(server) as source:
        seen = take(source, 40)
    for measured in seen:
        assert measured.pose[1:] == pytest.approx((0.0, 2.0), abs=1e-6)
        assert measured.arrived_s - measured.taken_s == pytest.approx(LATENCY_S, rel=1e-3)
    late_s = np.array([math.remainder(measured.taken_s - measured.pose.x, 1.0) for measured in seen])
    assert late_s.min() > -1e-3
    assert late_s.min() < 0.02, "on a busy computer some arrive late, but not all"
    assert np.diff([measured.frame for measured in seen]).min() > 0


def test_frames_for_a_group_are_found() -> None:
    with Server(multicast=True) as server, connected(server) as stream:
        wait_until(stream.read, "no pose")
        assert stream.multicast


def test_frames_from_before_the_answer_are_not_taken_for_new() -> None:
    with Server(multicast=True, delay=100) as server, connected(server) as stream:
        assert read_many(stream, 100)[0].frame > server.answered_at


def test_a_server_that_sends_to_each_client_gets_the_signs_of_life_it_wants() -> None:
    with Server(patience=300) as server, connected(server) as stream:
        assert len(read_many(stream, 500)) > 300, "the server goes on for a client that it hears"
        assert stream.connections == 1


def test_a_server_that_falls_silent_is_connected_to_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(natnet, "SILENCE_S", 0.3)
    with Server() as server, connected(server) as stream:
        server.sends = False
        with pytest.raises(MocapLostError, match="silent"):
            read_many(stream, 10_000)
        server.sends = True
        stream.connect()
        assert stream.connections == 2
        assert read_many(stream, 100)


def test_what_the_cameras_do_not_see_gives_no_pose() -> None:
    offline = Offline()
    offline.settle()
    assert offline.frame(Body(3), Body(7, (2.0, 1.0, 0.0))) is not None
    assert offline.frame(Body(7, seen=False)) is None
    assert offline.frame(Body(3)) is None, "a body that is not in the frame"
    assert offline.frame(Body(7, (math.nan, 0.0, 0.0))) is None
    assert offline.stream.occluded == 3
    pose = offline.frame(Body(7, (2.0, 1.0, 0.0), tuple(TURNED)))
    assert pose is not None
    assert pose.pose == pytest.approx((2.0, 1.0, 2.0), abs=1e-6)
    assert (pose.arrived_s, pose.taken_s) == pytest.approx((offline.now_s, offline.now_s - LATENCY_S), abs=1e-6)


def test_an_object_that_is_renamed_is_noticed() -> None:
    offline = Offline()
    offline.settle()
    offline.frame(Body(7), changed=True)
    offline.now_s += 1.0
    offline.frame(Body(7), changed=True)
    assert 4 in offline.asked
    offline.describe({"cart": 7})
    with pytest.raises(MocapSourceError, match="no rigid body 'robot'") as caught:
        offline.frame(Body(7))
    assert "cart" in caught.value.hint


def test_an_unknown_object_is_named_with_those_there_are() -> None:
    with Server() as server, opened(server, "robt") as source:
        with pytest.raises(MocapSourceError, match="'robt'") as caught:
            take(source)
        assert "robot, wand" in caught.value.hint
        with pytest.raises(MocapLostError, match="ended"):
            take(source)


def test_axes_with_y_up_are_noticed_as_soon_as_the_robot_has_turned() -> None:
    offline = Offline()
    offline.settle()
    over = Body(7, rotation=tuple(Rotation.from_euler("y", 1.0).as_quat()))
    assert [offline.frame(over) for _ in range(90)] == [None] * 90, "it may be carried"
    assert offline.frame(Body(7)) is not None
    with pytest.raises(MocapSourceError, match="is tilted, 57 degrees") as caught:
        offline.frames(150, over)
    assert "Up Axis" in caught.value.hint


def test_frames_without_times_are_no_stream() -> None:
    offline = Offline()
    with pytest.raises(MocapSourceError, match="times in the frames"):
        offline.frames(400, Body(7), stands=True)


def test_a_library_that_fails_is_an_error_of_the_stream() -> None:
    offline = Offline()
    offline.settle()
    offline.stream.on_thread_error(SimpleNamespace(exc_type=ValueError, exc_value=ValueError("a bad\npacket")))
    with pytest.raises(MocapLostError, match="ValueError: a bad packet"):
        offline.frame(Body(7))
    assert offline.frame(Body(7)) is not None, "after that it goes on"


def broken() -> NatNetStream:
    raise RuntimeError("no\nluck")


@pytest.mark.full
def test_whatever_a_library_raises_reaches_the_program() -> None:
    with pytest.raises(MocapLostError, match="the library failed: RuntimeError: no luck"):
        ProcessSource("broken", broken)


def test_a_server_that_is_not_there_or_says_nothing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(natnet, "_ANSWER_S", 0.2)
    library = load_library()
    with Server() as server:
        stream = NatNetStream("127.0.0.1", server.port, "robot", library=library)
        server.sends = False
        with pytest.raises(MocapLostError, match="responds, but sends no frames"):
            stream.connect()
        server.answers = False
        with pytest.raises(MocapLostError, match="no NatNet stream"):
            stream.connect()
    for host in ("no.such.host.invalid", "a..b"):
        with pytest.raises(MocapLostError, match="no NatNet stream"):
            NatNetStream(host, 1510, "robot", library=library).connect()


def test_an_old_server_is_refused() -> None:
    with Server((2, 10)) as server, pytest.raises(MocapSourceError, match=r"has NatNet 2\.10"):
        NatNetStream("127.0.0.1", server.port, "robot", library=load_library()).connect()


def test_computers_whose_long_has_four_bytes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(struct, "calcsize", lambda kind: 4 if kind == "L" else 8)
    with pytest.raises(MocapLibraryError, match="misreads the times"):
        load_library()


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


def suffix(stamp_s: float, ticks: int, sent: int) -> SimpleNamespace:
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
    assert ticks.latency(suffix(1.0, 10**9, 10**9)) is None
    assert ticks.latency(suffix(0.5, 10**8, 10**8)) is None, "a take that begins anew"
    assert ticks.latency(suffix(1.0, 10**8 + 5, 10**8)) is None, "ten ticks a second are no clock"
    assert ticks.latency(suffix(2.0, 2 * 10**8 + 5, 10**8)) is None, "sent before it was seen"
    assert ticks.seconds == pytest.approx(1e-8)
    assert ticks.latency(suffix(2.0, 10**8, 10**10)) is None, "99 seconds late"
    assert ticks.latency(suffix(2.0, 10**8, 10**8 + 10**6)) == pytest.approx(0.01)


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_tilt_is_the_angle_of_z(quaternion: list[float]) -> None:
    w, x, y, z = quaternion
    expected = math.acos(np.clip(Rotation.from_quat([x, y, z, w]).as_matrix()[2, 2], -1.0, 1.0))
    assert abs(math.cos(tilt(quaternion)) - math.cos(expected)) < 1e-9


def test_a_quaternion_without_direction_has_no_tilt() -> None:
    assert math.isnan(tilt((0.0,) * 4))
