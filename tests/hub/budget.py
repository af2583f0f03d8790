# SPDX-License-Identifier: MIT
"""Three programs at a hub that ask for more than a 9600-baud radio carries: ``python -m tests.hub.budget``.

One drives at 20 setpoints a second, one asks for parameters without end, one sends pose fixes at 50 Hz. A fourth one
stops the robot at random moments. The line is simulated, and so is the time.
"""

from __future__ import annotations

import random
import sys
from dataclasses import dataclass

from omni.hub.addresses import SHARE, radio_budget
from omni.hub.core import HubSettings
from omniwheel.dialect import mavlink
from omniwheel.radio_model import BITS_PER_BYTE, RadioDirection, RadioSettings
from omniwheel.signing import Signer
from tests.hub.bench import ARM, Bench, beat, command, setpoint

BAUD = 9600
STOP = mavlink.MAV_CMD_OMNI_ESTOP


@dataclass(frozen=True)
class Result:
    """``bytes_s`` over the run; ``excess_bytes`` is the most by which any stretch of time was over the budget.

    ``gap_s`` is the longest time between two setpoints on the line with no stop in between. ``stop_s`` are the times
    from each stop to its last byte on the line.
    ``told`` says whether the program that asked for too much was told, ``read`` how many parameters it asked for.
    """

    bytes_s: float
    excess_bytes: float
    gap_s: float
    stop_s: list[float]
    told: bool
    read: int


def run(duration_s: float, seed: int, *, signed: bool = False) -> Result:
    """Let them talk; stop the robot about once in two seconds, without taking the command away."""
    budget = radio_budget(SHARE * BAUD / BITS_PER_BYTE)
    signer = Signer(bytes(range(32)), clock=lambda: 1.8e9, link_id=1) if signed else None
    bench = Bench(HubSettings("radio", budget.bytes_s, budget.burst_bytes), signer)
    line = RadioDirection(RadioSettings(BAUD), seed)
    driver, reader, camera, stopper = (bench.join(name) for name in ("driver", "reader", "camera", "stopper"))
    driver.send(command(ARM, 1.0))
    bench.robot_is(armed=True)
    chance = random.Random(seed)
    stops: list[float] = []
    times: list[tuple[float, int]] = []
    gaps: list[float] = []
    last_s = float("inf")
    reads = written = 0
    asked_s = float("inf")
    steps = round(duration_s * 1e3)
    for step in range(steps):
        if step % 50 == 0:
            driver.send(setpoint(0.1 + step * 1e-6))
        if step % 1000 == 0:
            driver.send(beat())
        if step % 5 == 0:
            reader.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", step // 5 % 1000))
        if step % 20 == 0:
            camera.send(mavlink.MAVLink_vicon_position_estimate_message(step * 1000, 1, 2, 0, 0, 0, 1))
        if asked_s == float("inf") and chance.random() < 5e-4:
            asked_s = bench.now_s
            stopper.send(command(STOP, 1.0))
        bench.run(0.001)
        for at_s, frame in bench.frames[written:]:
            line.put(frame, at_s)
            message = bench.everything[written]
            stop = message.get_type() == "COMMAND_LONG" and message.command == STOP
            if stop:
                stops.append(line.waiting_s - asked_s)
                asked_s = last_s = float("inf")
            times.append((at_s, 0 if stop else len(frame)))
            reads += message.get_type() == "PARAM_REQUEST_READ"
            if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                gaps.append(line.waiting_s - last_s)
                last_s = line.waiting_s
            written += 1
    told = any("dropped" in text for text in reader.texts())
    total = sum(count for _, count in times)
    return Result(total / duration_s, _excess(times, budget.bytes_s, budget.burst_bytes), max(gaps), stops, told, reads)


def _excess(times: list[tuple[float, int]], bytes_s: float, burst: float) -> float:
    """Return by how many bytes the worst stretch of time exceeds ``burst + bytes_s t``."""
    worst = level = last_s = 0.0
    for at_s, count in times:
        level = max(0.0, level - bytes_s * (at_s - last_s)) + count
        last_s = at_s
        worst = max(worst, level - burst)
    return worst


def main() -> None:
    """Print what the guide says."""
    for signed in (False, True):
        results = [run(60.0, seed, signed=signed) for seed in range(1, 6)]
        stops = sorted(stop for result in results for stop in result.stop_s)
        sys.stdout.write(
            f"{'signed' if signed else 'open'}: {max(r.bytes_s for r in results):.0f} B/s, "
            f"over the budget by {max(r.excess_bytes for r in results):.0f} bytes at most; "
            f"setpoints at most {max(r.gap_s for r in results) * 1e3:.0f} ms apart; {len(stops)} stops, "
            f"median {stops[len(stops) // 2] * 1e3:.0f} ms, latest {stops[-1] * 1e3:.0f} ms; "
            f"{min(r.read for r in results)} parameters asked for\n"
        )


if __name__ == "__main__":
    main()
