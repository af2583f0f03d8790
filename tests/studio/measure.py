# SPDX-License-Identifier: MIT
"""How fast the studio is here: ``python -m tests.studio.measure``, in headless Chromium with software rendering.

A simulated robot sends its tracking, wheels and control, 50 signals and more, at 200 Hz. Four plots show three signals
of them each, over ten seconds.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from tests.studio.parts import CHROMIUM, SAFE, Program, running, studio, until
from tests.studio.wire import Wire

PLOTS = [
    ["tracking.pose.x", "tracking.pose.y", "tracking.pose.theta"],
    ["wheels.speed.1", "wheels.speed.2", "wheels.speed.3"],
    ["wheels.duty.1", "wheels.duty.2", "wheels.duty.3"],
    ["control.error.x", "control.error.y", "control.error.theta"],
]
RATE_HZ = 200
SPAN_S = 10
GAIN = "ISMC_LAM_XY"

COUNT_FRAMES = """(seconds) => new Promise((done) => {
  const ages = [], begin = performance.now(), first = studio.plots.drawn.frames, samples = studio.plots.drawn.samples;
  studio.plots.on_drawn = () => {
    ages.push(studio.plots.drawn.age_ms);
    const passed = (performance.now() - begin) / 1000;
    if (passed < seconds) return;
    studio.plots.on_drawn = null;
    done({ frames_s: (studio.plots.drawn.frames - first) / passed, ages,
           samples_s: (studio.plots.drawn.samples - samples) / passed });
  };
})"""
CHANGE_GAIN = """([name, value]) => new Promise((done) => {
  const count = studio.plots.marked.length, begin = performance.now();
  studio.plots.on_drawn = () => {
    if (studio.plots.marked.length === count) return;
    studio.plots.on_drawn = null;
    done(performance.now() - begin);
  };
  const field = document.getElementById(`field-${name}`);
  field.value = value;
  field.dispatchEvent(new Event("change"));
})"""
PRESS_STOP = """() => new Promise((done) => {
  const begin = performance.now();
  document.body.dispatchEvent(new KeyboardEvent("keydown", { code: "Space", bubbles: true }));
  const look = () => {
    if (["1", "2", "3"].every((n) => studio.plots.latest(`wheels.duty.${n}`) === 0))
      done([performance.timeOrigin + begin, performance.now() - begin]);
    else setTimeout(look, 0);
  };
  look();
})"""


def _processor_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _open(browser: Browser, url: str) -> Page:
    page = browser.new_page(viewport={"width": 1500, "height": 950})
    page.set_default_timeout(120_000)
    page.goto(url)
    return page


def prepared(browser: Browser, program: Program) -> Page:
    """Return a page with the four plots, after enough time to fill them."""
    page = _open(browser, program.url)
    page.evaluate(f"localStorage.setItem('omniwheel-plots', JSON.stringify({json.dumps(PLOTS)}))")
    page.reload()
    until(page, "robot?.pose")
    page.select_option("#rate", str(RATE_HZ))
    page.select_option("#path", "rose")
    page.fill("#laps", "100")
    page.wait_for_timeout((SPAN_S + 2) * 1000)
    return page


def drive(page: Page) -> None:
    """Arm the robot and let it follow a path; a stop is released first."""
    if page.evaluate("studio.state.robot.state") == "estop":
        page.click("#release")
        until(page, "robot.state === 'disarmed'")
    page.click("#arm")
    until(page, "robot.armed")
    page.click("#start-path")
    until(page, "Math.abs(studio.plots.latest('wheels.duty.1')) > 0.01")


def _median_and_p99(figures_ms: list[float]) -> dict[str, float]:
    return {"median": float(np.median(figures_ms)), "p99": float(np.percentile(figures_ms, 99))}


def measured(seconds: float, repeats: int) -> dict[str, Any]:
    """Return the figures. The browser runs before the studio is started, as a user's does."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SAFE)
        return _measured_in(browser, seconds, repeats)


def _start_s(browser: Browser) -> float:
    began = time.monotonic()
    with studio("fast") as program:
        page = _open(browser, program.url)
        until(page, "window.studio?.plots.drawn.samples > 0")
        start_s = time.monotonic() - began
        page.close()
    return start_s


def _measured_in(browser: Browser, seconds: float, repeats: int) -> dict[str, Any]:
    start_s = _start_s(browser)
    with running("sitl", "fast", "--port", "0") as robot:
        wire = Wire(robot.ready["links"][0])
        with studio("--link", wire.url) as program:
            page = prepared(browser, program)
            drive(page)
            before, at = _processor_s(program.process.pid), time.monotonic()
            flow = page.evaluate(COUNT_FRAMES, seconds)
            share = (_processor_s(program.process.pid) - before) / (time.monotonic() - at)
            gains = [page.evaluate(CHANGE_GAIN, [GAIN, 6 + 0.1 * (number + 1)]) for number in range(repeats)]
            stops = [_stopped(page, wire) for _ in range(repeats)]
            page.close()
        wire.close()
    ages = np.array(flow["ages"])
    return {
        "frames_per_s": flow["frames_s"],
        "shown_samples_per_s": flow["samples_s"],
        "arrival_to_drawn_ms": {"median": float(np.median(ages)), "p95": float(np.percentile(ages, 95))},
        "gain_to_mark_ms": {"median": float(np.median(gains)), "largest": max(gains)},
        "stop_to_zero_duty_on_the_wire_ms": _median_and_p99([on_wire for on_wire, _ in stops]),
        "stop_to_zero_duty_on_page_ms": _median_and_p99([on_page for _, on_page in stops]),
        "start_to_first_sample_s": start_s,
        "server_processor_share": share,
    }


def _stopped(page: Page, wire: Wire) -> tuple[float, float]:
    """Return the time from the space bar until the robot says zero duty, and until the page has that [ms]."""
    pressed_ms, on_page_ms = page.evaluate(PRESS_STOP)
    on_wire_ms = 1000 * wire.first_zero_s(pressed_ms / 1000) - pressed_ms
    until(page, "robot.state === 'estop'")
    drive(page)
    return on_wire_ms, on_page_ms


def main() -> int:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.studio.measure", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="how long frames are counted: %(default)s")
    parser.add_argument("--repeats", type=int, default=20, help="gain changes and stops: %(default)s")
    options = parser.parse_args()
    sys.stdout.write(json.dumps(measured(options.seconds, options.repeats), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
