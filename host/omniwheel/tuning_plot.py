# SPDX-License-Identifier: MIT
"""The picture of a tuning experiment: the answer before and after a change of gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omniwheel.files import save_picture
from omniwheel.plot_style import INK, SETS, STYLE
from omniwheel.tuning import AXES, UNITS, Trace

_SIZE_IN, _DPI = (10.0, 7.5), 120


def draw_tuning(tries: Mapping[str, Sequence[Trace]], title: str, path: Path) -> None:
    """Draw x, y and heading over time and their errors into a PNG file: every try of every set, by the sets' names.

    The first set is the present one. Wanted is that of the last try; each try is moved to where that one begins.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=_SIZE_IN, dpi=_DPI)
        FigureCanvasAgg(figure)
        figure.suptitle(title, x=0.06, ha="left", fontsize=13, fontweight="bold")
        grid = figure.add_gridspec(3, 2, left=0.09, right=0.98, top=0.86, bottom=0.08, hspace=0.35, wspace=0.24)
        for row, axis in enumerate(AXES):
            _draw_answers(figure.add_subplot(grid[row, 0]), tries, row, axis)
            _draw_errors(figure.add_subplot(grid[row, 1]), tries, row, axis)
        for axes in figure.axes[-2:]:
            axes.set_xlabel("time [s]")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper right", bbox_to_anchor=(0.98, 0.94), ncols=len(labels))
        figure.align_ylabels()
        save_picture(figure, path)


def _draw_answers(axes: Axes, tries: Mapping[str, Sequence[Trace]], column: int, axis: str) -> None:
    last = list(tries.values())[-1][-1]
    axes.plot(last.time_s, last.reference[:, column], color=INK, linewidth=1.0, linestyle="--", label="wanted")
    for (name, traces), colour in zip(tries.items(), SETS[: len(tries)], strict=True):
        for number, trace in enumerate(traces):
            label = name if number == 0 else None
            moved = trace.pose[:, column] - trace.reference[0, column] + last.reference[0, column]
            axes.plot(trace.time_s, moved, color=colour, linewidth=_width(traces), label=label)
    axes.set_ylabel(f"{axis} [{UNITS[axis]}]")


def _draw_errors(axes: Axes, tries: Mapping[str, Sequence[Trace]], column: int, axis: str) -> None:
    for traces, colour in zip(tries.values(), SETS[: len(tries)], strict=True):
        for trace in traces:
            error = trace.pose[:, column] - trace.reference[:, column]
            if axis == "theta":
                error = np.arctan2(np.sin(error), np.cos(error))
            axes.plot(trace.time_s, 1e3 * error, color=colour, linewidth=_width(traces))
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_ylabel(f"error of {axis} [m{UNITS[axis]}]")


def _width(traces: Sequence[Trace]) -> float:
    return 1.4 if len(traces) == 1 else 0.7
