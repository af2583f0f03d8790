# SPDX-License-Identifier: MIT
"""What the studio's server and page keep over hours of telemetry: ``python -m tests.studio.memory --hours 8``.

A simulated robot drives for some seconds. What it says then is said again and again with later times, as fast as the
studio takes it. The robot itself is still there and answers.
"""

from __future__ import annotations

import argparse
import gc
import json
import math
import re
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import CDPSession, Page, sync_playwright

from omniwheel.dialect import mavlink
from tests.studio.measure import drive, prepared
from tests.studio.parts import CHROMIUM, SAFE, running, studio, until
from tests.studio.wire import Wire

BLOCK_S = 10
LARGEST_GROWTH_MB_PER_H = 0.5
"""What counts as flat, for the server's whole memory and the page's heap."""
CLOCKS = {"time_boot_ms": (1e3, 32), "time_usec": (1e6, 64)}
"""Fields with the robot's time: steps per second, and bits."""


class Telemetry:
    """Takes what a robot says in :data:`BLOCK_S`, then keeps the robot's own telemetry from the studio."""

    def __init__(self) -> None:
        self.frames: list[Any] = []
        self.repeating = False

    def pass_on(self, data: bytes, frames: list[Any]) -> bytes:
        timed = [frame for frame in frames if clock_of(frame) is not None]
        if not self.repeating:
            self.frames += timed
            return data
        return b"".join(bytes(frame.get_msgbuf()) for frame in frames if clock_of(frame) is None)

    def block(self, number: int, codec: Any) -> bytes:
        """Return the block again, ``number`` blocks later."""
        parts = []
        for frame in self.frames:
            name = clock_of(frame)
            assert name is not None
            per_s, bits = CLOCKS[name]
            was = getattr(frame, name)
            setattr(frame, name, int(was + number * BLOCK_S * per_s) % 2**bits)
            parts.append(frame.pack(codec))
            codec.seq = (codec.seq + 1) % 256
            setattr(frame, name, was)
        return b"".join(parts)


def clock_of(frame: Any) -> str | None:
    """Return the name of the field with the robot's time; None if there is none."""
    return next((name for name in CLOCKS if name in frame.fieldnames), None)


def server_mb(pid: int) -> float:
    """Return what the process has in memory."""
    found = re.search(r"^VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    assert found is not None
    return int(found.group(1)) / 1024


def heap_mb(devtools: CDPSession) -> float:
    """Return what JavaScript keeps after collecting its garbage."""
    devtools.send("HeapProfiler.collectGarbage")
    metrics = {metric["name"]: metric["value"] for metric in devtools.send("Performance.getMetrics")["metrics"]}
    return float(metrics["JSHeapUsedSize"] + metrics.get("ArrayBufferContents", 0)) / 2**20


def growth_per_hour(rows: list[dict[str, float]], key: str) -> float:
    """Return the slope of the later half, after everything has its size."""
    later = rows[len(rows) // 2 :]
    return float(np.polyfit([row["hours"] for row in later], [row[key] for row in later], 1)[0])


def repeated(
    page: Page, wire: Wire, telemetry: Telemetry, pid: int, hours: float, rows_per_hour: int, most_minutes: float
) -> list[Any]:
    """Say the block again for so many hours, or until ``most_minutes`` are over; return the memory over time."""
    telemetry.repeating = True
    gc.collect()
    devtools = page.context.new_cdp_session(page)
    devtools.send("Performance.enable")
    codec = mavlink.MAVLink(None, srcSystem=telemetry.frames[0].get_srcSystem())
    last_s = page.evaluate("studio.plots.newest")
    rows: list[dict[str, float]] = []
    blocks = int(hours * 3600 / BLOCK_S)
    began = time.monotonic()
    for number in range(1, blocks + 1):
        wire.send(telemetry.block(number, codec))
        # The next block waits for this one: a heartbeat behind many blocks would come too late.
        try:
            until(page, f"studio.plots.newest >= {last_s + (number - 1) * BLOCK_S}")
        except AssertionError as error:  # a starved machine loses the robot: what was measured before still counts
            if not rows:
                raise
            sys.stderr.write(f"ended after {number * BLOCK_S / 3600:.2f} h: {error}\n")
            break
        if number % (3600 // BLOCK_S // rows_per_hour) == 0:
            row = {"hours": number * BLOCK_S / 3600, "server_MB": server_mb(pid), "page_MB": heap_mb(devtools)}
            row["newest_s"] = page.evaluate("studio.plots.newest")
            rows.append(row)
            sys.stderr.write(f"{row} after {time.monotonic() - began:.0f} s\n")
            if time.monotonic() - began > 60 * most_minutes:
                break
    return rows


def main() -> int:
    """Print the memory over time as JSON; exit code 1 if it is not flat."""
    parser = argparse.ArgumentParser(prog="python -m tests.studio.memory", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--hours", type=float, default=8.0, help="how much telemetry: %(default)s h")
    parser.add_argument("--rows-per-hour", type=int, default=4, help="%(default)s")
    parser.add_argument("--minutes", type=float, default=math.inf, help="end after so many, with fewer hours")
    options = parser.parse_args()
    telemetry = Telemetry()
    with sync_playwright() as playwright, running("sitl", "fast", "--port", "0") as robot:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SAFE)
        wire = Wire(robot.ready["links"][0], telemetry.pass_on)
        with studio("--link", wire.url) as program:
            page = prepared(browser, program)
            drive(page)
            telemetry.frames.clear()
            time.sleep(BLOCK_S)
            page.click("#disarm")
            how = (options.hours, options.rows_per_hour, options.minutes)
            rows = repeated(page, wire, telemetry, program.process.pid, *how)
            page.close()
    growth = {key: growth_per_hour(rows, key) for key in ("server_MB", "page_MB")}
    messages = len(telemetry.frames) * round(rows[-1]["hours"] * 3600 / BLOCK_S)
    sys.stdout.write(json.dumps({"messages": messages, "rows": rows, "growth_MB_per_h": growth}, indent=1) + "\n")
    return 0 if max(growth.values()) < LARGEST_GROWTH_MB_PER_H else 1


if __name__ == "__main__":
    sys.exit(main())
