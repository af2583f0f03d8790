# SPDX-License-Identifier: MIT
"""How fast others draw what the studio draws: ``python -m tests.studio.peers``, in headless Chromium on this machine.

Four plots of three traces of 2000 points each, 850 by 190 pixels, move on with every frame. npm fetches ECharts and
Plotly into ``build``; uPlot is the studio's. Matplotlib draws the same into memory, without a window. MAVProxy's graph
(:mod:`tests.studio.mavproxy_graph`) is measured if Debian's wxPython and a virtual screen are installed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import Browser, sync_playwright

from tests.studio.parts import CHROMIUM, SAFE

ROOT = Path(__file__).parents[2]
FETCHED = ROOT / "build" / "studio-peers"
PACKAGES = ("echarts@5", "plotly.js-basic-dist-min@3")
MODULES = FETCHED / "node_modules"
UPLOT = ROOT / "host" / "omni" / "studio" / "vendor" / "uPlot.esm.js"
SCRIPTS = {
    "ECharts": MODULES / "echarts" / "dist" / "echarts.min.js",
    "Plotly": MODULES / "plotly.js-basic-dist-min" / "plotly-basic.min.js",
}
PLOTS, TRACES, POINTS, STEP = 4, 3, 2000, 4
WIDTH_PX, HEIGHT_PX = 850, 190

DATA = f"""
const PLOTS = {PLOTS}, TRACES = {TRACES}, POINTS = {POINTS}, STEP = {STEP};
const LONG = 100_000;
let first = 0;
const all = Float64Array.from({{ length: LONG }}, (_, n) => n / 200);
const waves = Array.from({{ length: TRACES }}, (_, k) => Float64Array.from({{ length: LONG }}, (_, n) =>
  Math.sin(n / (60 + 10 * k)) + 0.05 * Math.sin(n * (3 + k))));
const times = () => all.subarray(first, first + POINTS);
const values = (k) => waves[k].subarray(first, first + POINTS);
const divs = Array.from({{ length: PLOTS }}, () => document.body.appendChild(document.createElement("div")));
for (const div of divs) div.style.cssText = "width:{WIDTH_PX}px;height:{HEIGHT_PX}px";
const traces = Array.from({{ length: TRACES }}, (_, k) => k);
"""
DRAW = {
    "uPlot": f"""
const plots = divs.map((div) => new uPlot({{ width: {WIDTH_PX}, height: {HEIGHT_PX}, scales: {{ x: {{ time: false }} }},
  series: [{{}}, ...traces.map(() => ({{ stroke: "blue", width: 1 }}))] }}, [[]], div));
const draw = () => plots.forEach((plot) => plot.setData([times(), ...traces.map(values)]));
""",
    "ECharts": """
const plots = divs.map((div) => echarts.init(div));
const draw = () => plots.forEach((plot) => plot.setOption({ animation: false,
  grid: { left: 50, right: 10, top: 10, bottom: 30 },
  xAxis: { type: "value", min: "dataMin", max: "dataMax" }, yAxis: { type: "value" },
  dataset: { source: { time: times(), ...Object.fromEntries(traces.map((k) => [`v${k}`, values(k)])) } },
  series: traces.map((k) => ({ type: "line", showSymbol: false, lineStyle: { width: 1 },
    encode: { x: "time", y: `v${k}` } })) }));
""",
    "Plotly": """
const draw = () => divs.forEach((div) => Plotly.react(div, traces.map((k) => ({ x: times(), y: values(k),
  mode: "lines", line: { width: 1 } })), { margin: { l: 40, r: 10, t: 10, b: 30 } }));
""",
}
COUNT = """(seconds) => new Promise((done) => {
  let frames = 0;
  const begin = performance.now();
  const frame = () => {
    const passed = (performance.now() - begin) / 1000;
    if (passed > seconds) return done(frames / passed);
    first += STEP;
    draw();
    frames += 1;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
})"""


def page_frames_s(browser: Browser, name: str, seconds: float) -> float:
    """Return the frames per second that a page with this library draws."""
    page = browser.new_page(viewport={"width": 900, "height": 850})
    page.set_content("<body></body>")
    if name == "uPlot":
        script = UPLOT.read_text().replace("export { uPlot as default };", "window.uPlot = uPlot;")
        page.add_script_tag(content=f"(() => {{ {script} }})()")
    else:
        page.add_script_tag(path=SCRIPTS[name])
    page.add_script_tag(content=DATA + DRAW[name])
    frames_s = float(page.evaluate(COUNT, seconds))
    page.close()
    return frames_s


def matplotlib_frames_s(seconds: float) -> float:
    """Return the frames per second that Matplotlib draws with its own quick way: only the lines, onto a kept ground."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(PLOTS, 1, figsize=(WIDTH_PX / 100, PLOTS * HEIGHT_PX / 100), dpi=100)
    samples = np.arange(POINTS)
    lines = [
        ax.plot(samples / 200, np.sin(samples / 60.0), lw=1, animated=True)[0] for ax in axes for _ in range(TRACES)
    ]
    figure.canvas.draw()
    ground = figure.canvas.copy_from_bbox(figure.bbox)  # type: ignore[attr-defined]
    begin, frames = time.monotonic(), 0
    while time.monotonic() - begin < seconds:
        figure.canvas.restore_region(ground)  # type: ignore[attr-defined]
        for number, line in enumerate(lines):
            at = samples + STEP * frames
            line.set_ydata(np.sin(at / (60 + 10 * (number % TRACES))) + 0.05 * np.sin(at * (3 + number % TRACES)))
            line.axes.draw_artist(line)
        figure.canvas.blit(figure.bbox)
        frames += 1
    return frames / (time.monotonic() - begin)


def main() -> int:
    """Print the frames per second of each as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.studio.peers", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="how long each is measured: %(default)s")
    parser.add_argument("--npm", default="npm", help="the npm that fetches the others: %(default)s")
    options = parser.parse_args()
    if not all(script.exists() for script in SCRIPTS.values()):
        FETCHED.mkdir(parents=True, exist_ok=True)
        fetch = [
            options.npm,
            "install",
            "--no-save",
            "--silent",
            "--no-audit",
            "--no-fund",
            "--ignore-scripts",
            *PACKAGES,
        ]
        subprocess.run(fetch, cwd=FETCHED, check=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SAFE)
        frames_s = {name: page_frames_s(browser, name, options.seconds) for name in DRAW}
    frames_s["Matplotlib"] = matplotlib_frames_s(options.seconds)
    command = [sys.executable, "-m", "tests.studio.mavproxy_graph", "--seconds", str(options.seconds)]
    graph = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=False)  # it says what it misses
    frames_s |= json.loads(graph.stdout or "{}")
    sys.stdout.write(json.dumps(frames_s, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
