# SPDX-License-Identifier: MIT
"""Messages that compiled code looks after: logged and passed on as a Python loop would."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim.hil import EPOCH_US, SERVICE_TICKS, STREAM_TICKS, HilLoop
from hil_sim.scenario import Scenario, parse_scenario
from hil_sim.timeline import play
from omniwheel._core import ffi, lib
from omniwheel.dialect import mavlink
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.tlog import TlogWriter
from tests.hil_sim.echo_robot import Bench, EchoRobot


def talkative(robot: EchoRobot, sensors: Any) -> None:
    texts = mavlink.MAVLink_statustext_message(6, f"tick {sensors.sequence}".encode()).pack(robot.mav)
    robot.sock.sendall(robot.heartbeat_bytes() + bytes(texts) + robot.answer_bytes(sensors))


def records(data: bytes) -> list[tuple[int, int]]:
    """Return time stamp and message number of each record."""
    found, at = [], 0
    while at < len(data):
        stamp, frame = int.from_bytes(data[at : at + 8], "big"), data[at + 8 :]
        found.append((stamp, int.from_bytes(frame[7:10], "little")))
        at += 8 + 12 + frame[1]
    return found


def test_frames_are_logged_and_some_are_skipped(bench: Bench, make_world: Any) -> None:
    bench.robot(talkative)
    log = ffi.new("uint8_t[]", 8 * lib.HIL_LOCKSTEP_RX)
    link = bench.link
    link.log, link.log_capacity, link.log_epoch_us = log, len(log), 7_000_000
    link.serve_ticks = 10
    link.skipped[0], link.skipped_count = mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1
    assert bench.run(make_world(), 25) == lib.HIL_OK
    written = records(bytes(ffi.buffer(link.log, link.log_length)))
    assert len(written) == link.log_frames == 40
    assert [stamp for stamp, _ in written] == [7_010_000] * 20 + [7_020_000] * 20
    assert [number for _, number in written[:4]] == [0, 253, 0, 253]
    served = bytes(ffi.buffer(link.rx, link.rx_served))
    assert b"tick 19" in served
    assert b"tick 20" not in served
    rest = bytes(ffi.buffer(link.rx, link.rx_length))[link.rx_served :]
    assert rest.count(b"tick ") == 5
    lib.hil_lockstep_serve(link)
    assert (link.log_frames, link.rx_length) == (50, link.rx_served)


def test_a_run_stops_before_the_log_is_full(bench: Bench, make_world: Any) -> None:
    bench.robot(talkative)
    log = ffi.new("uint8_t[]", 2 * lib.HIL_LOCKSTEP_RX + 300)
    link = bench.link
    link.log, link.log_capacity, link.serve_ticks = log, len(log), 1
    assert bench.run(make_world(), 500) == lib.HIL_OK
    assert 2 <= bench.done[0] < 20
    assert link.lost_frames == 0
    link.log_length = 0
    assert bench.run(make_world(), 2) == lib.HIL_OK
    assert bench.done[0] == 2


class PumpedLoop(HilLoop):
    """The same loop in Python alone: every frame is decoded, logged and handed out one by one."""

    def log_to(self, log: TlogWriter) -> None:
        self.robot.connection.recorder = log.write

    def advance(self, ticks: int) -> NDArray[Any]:
        end = self.link.ticks + ticks
        while self.link.ticks < end:
            self.robot.pump()
            if self._stream is not None and self.link.ticks % STREAM_TICKS < SERVICE_TICKS:
                self._stream()
            stop = (self.link.ticks // SERVICE_TICKS + 1) * SERVICE_TICKS
            self.link.run(max(min(stop, end) - self.link.ticks, 0), self.robot.pump)
        return self.link.take_samples()


def scenario() -> Scenario:
    """Return one with all that is sent: heartbeats, setpoints, a change of parameters, and a link that is silent."""
    document = {
        "scenario": {
            "name": "served",
            "description": "all that is sent",
            "robot": "three_wheel",
            "seed": 3,
            "duration_s": 3.2,
        },
        "event": [
            {"at_s": 0.5, "command": "arm"},
            {"at_s": 0.505, "velocity": [0.1, 0.0, 0.2]},
            {"at_s": 1.203, "set": {"WS_P": 3.0}},
            {"at_s": 1.5, "velocity": [0.0, 0.1, -0.2]},
        ],
        "fault": [{"kind": "link_silence", "start_s": 1.9, "stop_s": 2.2}],
    }
    return parse_scenario(document, "served")


def played(kind: type[HilLoop], path: Path) -> tuple[bytes, NDArray[Any], list[str], bool]:
    run = scenario()
    with FirmwareProcess(parameters=run.parameter_values(), lockstep=True) as firmware:
        base = firmware.open_link()
        with TlogWriter(path, lambda: EPOCH_US + round(loop.link.clock_s() * 1e6)) as log:
            loop = kind(run, base)
            loop.log_to(log)
            record = play(run, loop).record
            texts = [text.text for text in loop.robot.texts.all]
            armed = loop.robot.status.armed
        base.close()
    return path.read_bytes(), record, texts, armed


def test_the_log_is_the_one_that_python_would_write(tmp_path: Path) -> None:
    served, pumped = played(HilLoop, tmp_path / "served"), played(PumpedLoop, tmp_path / "pumped")
    assert served[0] == pumped[0]
    assert np.array_equal(served[1], pumped[1])
    assert served[2:] == pumped[2:]
    assert any("armed" in text for text in served[2])


@pytest.mark.parametrize("every", [7, 10])
def test_what_is_not_looked_after_stays_for_the_next_reader(every: int) -> None:
    run = scenario()
    with FirmwareProcess(parameters=run.parameter_values(), lockstep=True) as firmware:
        base = firmware.open_link()
        loop = HilLoop(run, base)
        loop.advance(every)
        loop.link.run(100)
        assert loop.link.read(0.0), "telemetry of 100 ticks"
        base.close()
