# SPDX-License-Identifier: MIT
"""The picture of an identification from logs: each run's truth, its nominal and its identified path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omniwheel.files import save_picture
from omniwheel.identification.log_study import LogStudy, Scored
from omniwheel.logs.log import WheelLog
from omniwheel.plot_style import GREY, INK, STYLE, WHEEL_COLOURS

NOMINAL, HELD_OUT = WHEEL_COLOURS[1], WHEEL_COLOURS[0]
COLUMNS = 3


def draw_study(study: LogStudy, runs: Sequence[WheelLog], path: Path) -> None:
    """Draw truth, nominal and left-out path of every run, and the RMS distances, into a PNG file."""
    panels = len(runs) + 1
    rows = -(-panels // COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 4.3 * rows), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        grid = [figure.add_subplot(rows, COLUMNS, index + 1) for index in range(panels)]
        for axes, log, run in zip(grid, runs, study.scored, strict=False):
            _draw_run(axes, log, run)
        _draw_bars(grid[-1], study)
        handles, names = grid[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=len(names))
        save_picture(figure, path)


def _draw_run(axes: Axes, log: WheelLog, run: Scored) -> None:
    truth = log.require_truth()
    axes.plot(*truth.xy.T, color=INK, linewidth=3.0, alpha=0.35, label="truth (camera)")
    axes.plot(*run.nominal.xy.T, color=NOMINAL, linewidth=1.2, linestyle="--", label="nominal geometry")
    axes.plot(*run.held_out.xy.T, color=HELD_OUT, linewidth=1.4, label="identified on the other runs")
    axes.plot(*run.held_out.xy[0], "o", color=HELD_OUT, markersize=5)
    axes.set_aspect("equal", adjustable="datalim")
    rms = [1e3 * track.alignment.rms_m for track in (run.nominal, run.held_out)]
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{run.name}: {rms[0]:.0f} → {rms[1]:.0f} mm RMS")


def _draw_bars(axes: Axes, study: LogStudy) -> None:
    width = 0.38
    for place, run in enumerate(study.scored):
        axes.bar(place - 0.5 * width, 1e3 * run.nominal.alignment.rms_m, width, color=NOMINAL)
        axes.bar(place + 0.5 * width, 1e3 * run.held_out.alignment.rms_m, width, color=HELD_OUT)
    for kind, colour in (("nominal", NOMINAL), ("held_out", HELD_OUT)):
        median = 1e3 * study.median_m(kind)
        axes.axhline(median, color=colour, linewidth=1.0, linestyle=":")
        axes.text(len(study.scored) - 0.4, median, f"{median:.0f}", color=GREY, va="bottom", fontsize=9.0)
    axes.set_xticks(range(len(study.scored)), [run.name for run in study.scored])
    axes.set_axisbelow(True)
    axes.set(ylabel="RMS distance [mm]", title="RMS distance (dotted: median)")
