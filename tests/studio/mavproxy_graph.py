# SPDX-License-Identifier: MIT
"""How fast MAVProxy's live graph draws what :mod:`tests.studio.peers` draws: ``python -m tests.studio.mavproxy_graph``.

Each of MAVProxy's graphs is a window of its own, in a process of its own. Four of them show three traces of 2000
points, in a virtual screen (Xvfb). It needs wxPython, which PyPI has for no Linux: Debian's python3-wxgtk4.0 and xvfb.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tests.studio.peers import HEIGHT_PX, PLOTS, POINTS, TRACES, WIDTH_PX

DEBIAN = Path("/usr/lib/python3/dist-packages")
"""Where Debian's wxPython is, which has to be made for this Python's version."""
RATE_HZ = 200.0
USUAL_TICK_S, USUAL_SPAN_S = 0.2, 20.0
"""What ``graph`` has if nobody asks for more: 100 points, 5 frames per second."""


def missing() -> str:
    """Return what is not installed; "": nothing."""
    wx = any(DEBIAN.glob(f"wx/_core.cpython-3{sys.version_info.minor}-*.so"))
    return "" if wx and shutil.which("Xvfb") else "python3-wxgtk4.0 and xvfb of Debian, for this version of Python"


@contextmanager
def virtual_screen() -> Iterator[str]:
    """Run a screen without glass; yield its name."""
    read, write = os.pipe()
    words = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1920x1080x24", "-nolisten", "tcp", "-noreset"]
    with subprocess.Popen(words, pass_fds=[write], stderr=subprocess.DEVNULL) as process:
        os.close(write)
        with os.fdopen(read) as told:
            yield f":{told.readline().strip()}"
        process.terminate()


def _graphs(tick_s: float, span_s: float, seconds: float) -> list[float]:
    """Show the graphs on the screen of ``DISPLAY``; return the frames per second of each, full of points."""
    from MAVProxy.modules.lib import live_graph, multiproc

    points = len(np.arange(-span_s, 0, tick_s))
    results = multiproc.Queue()

    class Graph(live_graph.LiveGraph):  # type: ignore[misc]
        def child_task(self) -> None:
            sys.path.append(str(DEBIAN))  # behind everything of this environment
            import matplotlib as mpl
            from MAVProxy.modules.lib import wx_processguard  # noqa: F401  # it allows this process to load wx

            mpl.use("WXAgg")
            from MAVProxy.modules.lib import live_graph_ui

            live_graph_ui.GraphFrame = _counting(live_graph_ui.GraphFrame, points, seconds, results)
            super().child_task()

    shown = [Graph([f"f{k}" for k in range(TRACES)], timespan=span_s, tickresolution=tick_s) for _ in range(PLOTS)]
    done = threading.Event()

    def feed() -> None:
        n = 0
        while not done.wait(1 / RATE_HZ):
            n += 1
            for graph in shown:
                graph.add_values([float(np.sin(n / (60 + 10 * k))) for k in range(TRACES)])

    feeder = threading.Thread(target=feed)
    feeder.start()
    try:
        return [results.get(timeout=60 + 10 * seconds) for _ in shown]
    finally:
        done.set()
        feeder.join()
        for graph in shown:
            graph.close()


def _counting(frame: Any, points: int, seconds: float, results: Any) -> Any:
    """Return MAVProxy's window, full of points from the start, which tells how often it drew."""

    class Frame(frame):  # type: ignore[misc]
        def __init__(self, state: Any) -> None:
            super().__init__(state)
            wave = np.arange(points)
            self.data = [list(np.sin(wave / (60 + 10 * k))) for k in range(TRACES)]
            self.canvas.SetMinSize((WIDTH_PX, HEIGHT_PX))
            self.Fit()
            self.times: list[float] = []
            self.told = False

        def draw_plot(self) -> None:
            super().draw_plot()
            self.canvas.Update()  # now, not with the next event
            assert len(self.data[0]) == points
            self.times.append(time.monotonic())
            passed = self.times[-1] - self.times[0]
            if passed > seconds and not self.told:
                self.told = True
                results.put((len(self.times) - 1) / passed)

    return Frame


def frames_s(seconds: float) -> dict[str, float]:
    """Return the frames per second of a window: with as many points as the others, and as MAVProxy comes."""
    found = {}
    with virtual_screen() as screen:
        for name, tick_s, span_s in (
            ("MAVProxy's graph", POINTS**-1 * 10.0, 10.0),
            ("MAVProxy's graph, as it comes (100 points)", USUAL_TICK_S, USUAL_SPAN_S),
        ):
            words = [sys.executable, "-m", "tests.studio.mavproxy_graph", "--screen", screen]
            words += ["--tick", str(tick_s), "--span", str(span_s), "--seconds", str(seconds)]
            done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
            found[name] = float(np.mean(json.loads(done.stdout.splitlines()[-1])))
    return found


def main() -> int:
    """Print the frames per second as JSON."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.studio.mavproxy_graph", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="how long each is measured: %(default)s")
    parser.add_argument("--screen", help="show the graphs there, and nothing else")
    parser.add_argument("--tick", type=float, default=USUAL_TICK_S, help="MAVProxy's tickresolution: %(default)s s")
    parser.add_argument("--span", type=float, default=USUAL_SPAN_S, help="MAVProxy's timespan: %(default)s s")
    options = parser.parse_args()
    if why := missing():
        sys.stderr.write(f"MAVProxy's graph cannot be measured here: install {why}.\n")
        return 1
    if options.screen is None:
        sys.stdout.write(json.dumps(frames_s(options.seconds), indent=1) + "\n")
        return 0
    os.environ["DISPLAY"] = options.screen
    sys.stdout.write("\n" + json.dumps(_graphs(options.tick, options.span, options.seconds)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
