# SPDX-License-Identifier: MIT
"""The picture of a tuning experiment: the answer before and after a change of gains."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omniwheel.files import save_picture
from omniwheel.plot_style import INK, STYLE, TRUTH, WANTED
from omniwheel.tuning import AXES, UNITS, Trace

_SIZE_IN, _DPI = (10.0, 7.5), 120


def draw_tuning(before: Trace, after: Trace, what: str, path: Path) -> None:
    """Draw x, y and heading over time, wanted, before and after, and the errors, into a PNG file."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=_SIZE_IN, dpi=_DPI)
        FigureCanvasAgg(figure)
        figure.suptitle(what, x=0.06, ha="left", fontsize=13, fontweight="bold")
        grid = figure.add_gridspec(3, 2, left=0.09, right=0.98, top=0.87, bottom=0.08, hspace=0.35, wspace=0.24)
        for row, axis in enumerate(AXES):
            _draw_answer(figure.add_subplot(grid[row, 0]), before, after, row, axis)
            _draw_error(figure.add_subplot(grid[row, 1]), before, after, row, axis)
        for axes in figure.axes[-2:]:
            axes.set_xlabel("time [s]")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper right", bbox_to_anchor=(0.98, 0.935), ncols=3)
        figure.align_ylabels()
        save_picture(figure, path)


def _draw_answer(axes: Axes, before: Trace, after: Trace, column: int, axis: str) -> None:
    axes.plot(after.time_s, after.reference[:, column], color=INK, linewidth=1.0, linestyle="--", label="wanted")
    axes.plot(before.time_s, before.pose[:, column], color=WANTED, linewidth=1.4, label="before")
    axes.plot(after.time_s, after.pose[:, column], color=TRUTH, linewidth=1.4, label="after")
    axes.set_ylabel(f"{axis} [{UNITS[axis]}]")


def _draw_error(axes: Axes, before: Trace, after: Trace, column: int, axis: str) -> None:
    for trace, colour in ((before, WANTED), (after, TRUTH)):
        error = trace.pose[:, column] - trace.reference[:, column]
        if axis == "theta":
            error = np.arctan2(np.sin(error), np.cos(error))
        axes.plot(trace.time_s, 1e3 * error, color=colour, linewidth=1.1)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_ylabel(f"error of {axis} [m{UNITS[axis]}]")
