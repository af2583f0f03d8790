# SPDX-License-Identifier: MIT
"""What the studio keeps over hours of telemetry: it stays the same from the first minutes on."""

from __future__ import annotations

import ctypes
import mmap
import sys
from pathlib import Path

import numpy as np
import pytest

from omni.studio.edits import Edits
from omni.studio.link_quality import LinkQuality
from omni.studio.samples import SampleStore
from omni.studio.session import Session
from omni.studio.signals import KINDS
from omni.studio.studio import Studio
from omni_schema import load_parameters
from omniwheel.connection import Connection
from omniwheel.paths import params_path
from omniwheel.robot import Robot
from omniwheel.telemetry import decode
from tests.long_lines import ROUND_S, SilentLink, blank, growth

HOURS = 1.0
LARGEST_GROWTH_BYTES = 32 * 1024


@pytest.mark.nightly
def test_hours_of_telemetry_leave_the_server_as_large_as_it_was(tmp_path: Path) -> None:
    now_s = 0.0
    studio, session = Studio(tmp_path), Session("a line")
    robot = Robot(Connection(SilentLink(), clock=lambda: now_s), table=load_parameters(params_path()))
    robot.connection.add_listener(session._take)
    session.robot, session.edits, session.phase, session.connections = robot, Edits(robot.parameters), "connected", 1
    session.quality = quality = LinkQuality(robot)
    studio.session = session
    page = studio.open_page()
    # What stays the same while one robot is connected needs all of its parameters, and this one tells none.
    page.session, page.connection = session, session.connections
    studio.show(page, ["tracking.pose.x", "control.error.x", "health.stack_free"], 10.0)
    shown = texts = 0

    def take(piece: bytes) -> None:
        nonlocal now_s, shown, texts
        now_s += ROUND_S
        robot.connection.feed(piece)
        quality.serve()
        shown += len(studio.new_samples(page)) > 0
        texts += len(studio.news(page).get("texts", []))

    rounds = round(HOURS * 3600 / ROUND_S)
    assert growth(take, rounds) < LARGEST_GROWTH_BYTES
    assert shown == texts >= rounds  # the page was told of every round
    assert robot.connection.rx_bad_bytes == 0
    studio.session = None
    studio.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="mincore is asked as on Linux")
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_the_first_sample_takes_the_memory_of_all_that_follow(kind: type) -> None:
    store = SampleStore()
    telemetry = decode(kind, blank(kind.message))  # type: ignore[attr-defined]
    assert telemetry is not None
    store.take(telemetry)
    (ring,) = store._rings.values()
    assert [share_in_memory(ring.time_s), share_in_memory(ring.value)] == [1.0, 1.0]


def share_in_memory(array: np.ndarray) -> float:
    """Return how much of an array's memory is really there, and not only promised by the system."""
    begin = array.ctypes.data // mmap.PAGESIZE * mmap.PAGESIZE
    pages = -(-(array.ctypes.data + array.nbytes - begin) // mmap.PAGESIZE)
    there = (ctypes.c_ubyte * pages)()
    library = ctypes.CDLL(None, use_errno=True)
    if library.mincore(ctypes.c_void_p(begin), ctypes.c_size_t(pages * mmap.PAGESIZE), there) != 0:
        raise OSError(ctypes.get_errno(), "mincore")
    return sum(page & 1 for page in there) / pages
