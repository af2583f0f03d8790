# SPDX-License-Identifier: MIT
"""What waits to be sent when a connection ends."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from tests.native import ROOT, build_library


@pytest.fixture
def link(tmp_path: Path) -> ctypes.CDLL:
    app = [ROOT / "firmware" / "app" / f"{name}.cpp" for name in ("link", "codec", "stops", "signing", "record_store")]
    sources = [*app, Path(__file__).parent / "link_shim.cpp"]
    return ctypes.CDLL(str(build_library(tmp_path, "link", sources)))


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
