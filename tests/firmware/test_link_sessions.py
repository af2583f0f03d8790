# SPDX-License-Identifier: MIT
"""What waits to be sent: when a connection ends, and when the answer to a stop overtakes it."""

from __future__ import annotations

import ctypes
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.firmware.client import mav
from tests.native import ROOT, kept_library

ACTIONS = st.lists(st.sampled_from(["beat", "answer"]) | st.integers(0, 60), max_size=60)


@pytest.fixture
def link(tmp_path: Path) -> ctypes.CDLL:
    names = ("link/link", "link/codec", "link/stops", "link/signing", "storage/record_store")
    app = [ROOT / "firmware" / "app" / f"{name}.cpp" for name in names]
    sources = [*app, Path(__file__).parent / "link_shim.cpp"]
    # A copy, so that static objects are new in every test.
    return ctypes.CDLL(str(shutil.copy(kept_library("link", sources), tmp_path)))


@pytest.mark.full
def test_a_new_connection_does_not_get_the_rest_of_the_old_ones_frame(link: ctypes.CDLL) -> None:
    link.link_connect(1)
    link.link_receive()
    assert link.link_send()
    assert link.link_flush(5) == 5  # a frame is cut here
    link.link_connect(2)
    assert link.link_flush(1000) == 0  # another link's tick flushes before this one has looked at its port
    link.link_receive()
    assert link.link_flush(1000) == 0
    assert link.link_send()
    assert link.link_flush(1000) > 8


@pytest.mark.full
def test_a_modem_gets_whole_frames_as_soon_as_they_fit(link: ctypes.CDLL) -> None:
    """It makes a packet of what comes without a pause."""
    link.link_connect(1)
    link.link_receive()
    link.link_modem()
    assert link.link_send()
    assert link.link_send()
    length = len(mav.MAVLink_heartbeat_message(0, 0, 0, 0, 0, 0).pack(mav.MAVLink(None)))
    for room, goes in ((length - 1, 0), (length, length), (length - 1, 0), (2 * length, length), (length, 0)):
        assert link.link_flush(room) == goes


def test_a_link_that_takes_nothing_keeps_the_answers_to_stops_and_gives_up_the_newest_of_the_rest(
    link: ctypes.CDLL,
) -> None:
    """A modem out of reach, or a program that does not read: all waits, but each stop is answered."""
    link.link_bytes.restype = ctypes.c_void_p
    link.link_connect(0)
    link.link_receive()
    link.link_connect(1)
    link.link_receive()
    beats = 0
    while link.link_send():
        beats += 1
    stops = 100
    assert all(link.link_answer(number) for number in range(stops))
    assert not link.link_send(), "who stops does not make room for others"
    heard = mav.MAVLink(None).parse_buffer(bytearray(ctypes.string_at(link.link_bytes(), link.link_flush(8192))))
    kinds = [m.get_type() for m in heard or []]
    assert [m.command for m in (heard or [])[:stops]] == list(range(stops))
    assert set(kinds[stops:]) == {"HEARTBEAT"}
    assert 0 < len(kinds[stops:]) < beats


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(actions=ACTIONS)
def test_answers_to_stops_go_before_all_that_has_not_begun_and_cut_no_frame(
    link: ctypes.CDLL, actions: list[str | int]
) -> None:
    link.link_bytes.restype = ctypes.c_void_p
    link.link_connect(0)
    link.link_receive()
    link.link_connect(1)
    link.link_receive()
    codec = mav.MAVLink(None)
    heard: list[str] = []
    waiting: list[str] = []  # in the order in which it must come
    begun = 0  # whether the first of those is under way
    answers = 0

    def take(room: int) -> None:
        nonlocal begun
        data = ctypes.string_at(link.link_bytes(), link.link_flush(room))
        before = len(heard)
        for message in codec.parse_buffer(bytearray(data)) or []:
            heard.append("beat" if message.get_type() == "HEARTBEAT" else f"answer {message.command}")
        arrived = heard[before:]
        assert arrived == waiting[: len(arrived)]
        del waiting[: len(arrived)]
        begun = int(len(codec.buf) > codec.buf_index)

    for action in actions:
        if action == "beat":
            assert link.link_send()
            waiting.append("beat")
        elif action == "answer":
            answers += 1
            assert link.link_answer(answers)
            at = begun
            while at < len(waiting) and waiting[at].startswith("answer"):
                at += 1
            waiting.insert(at, f"answer {answers}")
        else:
            take(int(action))
    take(8192)
    assert waiting == []
