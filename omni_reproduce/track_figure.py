# SPDX-License-Identifier: MIT
"""The picture of runs along a path: where the robot should have been and was, and its errors over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hil_sim.report import STYLE, WANTED
from omni_reproduce.loops import Track

COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#D55E00")
_MM, _MRAD = 1e3, 1e3


def draw_tracks(tracks: Mapping[str, Track], step_s: float, path: Path, title: str) -> None:
    """Draw runs by their titles into a PNG file; ``step_s`` is the time between their rows."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.5, 3.9 + 2.4 * len(tracks)), dpi=120)
        FigureCanvasAgg(figure)
        figure.suptitle(title, x=0.05, ha="left", fontsize=14, fontweight="bold")
        grid = figure.add_gridspec(
            2 * len(tracks), 2, left=0.065, right=0.985, top=0.86, bottom=0.075, hspace=0.55, wspace=0.17
        )
        _draw_paths(figure.add_subplot(grid[:, 0]), tracks)
        for number, (name, run) in enumerate(tracks.items()):
            position = figure.add_subplot(grid[2 * number, 1])
            heading = figure.add_subplot(grid[2 * number + 1, 1], sharex=position)
            _draw_errors(position, heading, run, step_s, name, COLOURS[number])
        figure.savefig(path, metadata={"Software": None})


def _draw_paths(axes: Axes, tracks: Mapping[str, Track]) -> None:
    first = next(iter(tracks.values()))
    axes.plot(*first.reference[:, :2].T, color=WANTED, linewidth=5.0, alpha=0.5, label="reference")
    for number, (name, run) in enumerate(tracks.items()):
        driven = run.reference + run.error
        axes.plot(*driven[:, :2].T, color=COLOURS[number], linewidth=1.2, label=name, linestyle=("-", "--")[number % 2])
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.1)


def _draw_errors(position: Axes, heading: Axes, run: Track, step_s: float, name: str, colour: str) -> None:
    time_s = step_s * np.arange(len(run.error))
    position.plot(time_s, _MM * run.error[:, 0], color=colour, linewidth=0.7, label="x")
    position.plot(time_s, _MM * run.error[:, 1], color=WANTED, linewidth=0.7, alpha=0.8, label="y")
    position.set_title(name, fontsize=10)
    position.set(ylabel="error [mm]")
    position.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, borderaxespad=0.1, handlelength=1.2)
    position.tick_params(labelbottom=False)
    heading.plot(time_s, _MRAD * run.error[:, 2], color=colour, linewidth=0.7)
    heading.set(ylabel="θ error [mrad]", xlabel="time [s]")
