# SPDX-License-Identifier: MIT
"""What a program keeps that listens to a robot for hours and records it, while the robot's line never pauses."""

from __future__ import annotations

from pathlib import Path

import pytest

from omni_schema import load_parameters
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink, take_bytes
from omniwheel.paths import params_path
from omniwheel.robot import Robot
from omniwheel.tlog import TlogWriter
from tests.long_lines import ROUND_S, SPOKEN, NeverPausing, SilentLink, growth

ROUNDS = 600
LARGEST_GROWTH_BYTES = 32 * 1024
LONGEST_FRAME = 10 + 255 + 2 + 13
"""Header, payload, checksum, signature."""


@pytest.mark.full
def test_hours_of_a_recorded_robot_leave_a_program_as_large_as_it_was(tmp_path: Path) -> None:
    now_s = 0.0
    with TlogWriter(tmp_path / "hours.tlog") as log:
        connection = Connection(SilentLink(), clock=lambda: now_s, recorder=log.write)
        robot = Robot(connection, table=load_parameters(params_path()))

        def take(piece: bytes) -> None:
            nonlocal now_s
            now_s += ROUND_S
            connection.feed(piece)
            connection.beat()
            log._file.flush()  # by itself it waits for this computer's clock

        assert growth(take, ROUNDS) < LARGEST_GROWTH_BYTES
        assert log.frames > len(SPOKEN) * ROUNDS
        assert robot.status.tracking is not None


def test_a_parser_keeps_only_what_is_unfinished() -> None:
    line = NeverPausing()
    ours, pymavlinks = mavlink.MAVLink(None), mavlink.MAVLink(None)
    for _ in range(100):
        piece = line.piece()
        assert len(take_bytes(ours, piece)) == len(pymavlinks.parse_buffer(piece) or [])
    assert 0 < len(ours.buf) < LONGEST_FRAME
    assert len(pymavlinks.buf) == line.sent_bytes  # why take_bytes is there: if this fails, it may go
