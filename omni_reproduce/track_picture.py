# SPDX-License-Identifier: MIT
"""The picture of runs along a path: where the robot should have been and was, and its errors over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Rectangle

from omni_reproduce.loops import Track
from omniwheel.files import save_picture
from omniwheel.plot_style import INK, STYLE, WANTED

COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#D55E00")
_MM, _MRAD = 1e3, 1e3


@dataclass(frozen=True)
class View:
    """What the picture shows: the time between rows, the window of the errors, and the place looked at closely."""

    title: str
    step_s: float
    from_s: float
    until_s: float
    centre_m: tuple[float, float]
    half_width_m: float


def draw_tracks(tracks: Mapping[str, Track], view: View, path: Path) -> None:
    """Draw runs by their titles into a PNG file."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14.0, 9.5), dpi=115)
        FigureCanvasAgg(figure)
        figure.text(0.05, 0.968, view.title, fontsize=14, fontweight="bold", va="center")
        halves = figure.add_gridspec(1, 2, left=0.06, right=0.968, top=0.925, bottom=0.06, wspace=0.16)
        left = halves[0].subgridspec(3, 1, height_ratios=(0.12 * (1 + len(tracks)), 3.4, 1.0), hspace=0.25)
        whole, close = figure.add_subplot(left[1]), figure.add_subplot(left[2])
        _draw_paths(whole, tracks)
        whole.set(xlabel="x [m]", ylabel="y [m]")
        whole.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), borderaxespad=0.1)
        _draw_paths(close, tracks, scale=_MM)
        close.set(xlabel="x [mm]", ylabel="y [mm]", title="In the frame")
        _look_closely(close, whole, view)
        right = halves[1].subgridspec(len(tracks), 1, hspace=0.33)
        for number, (name, run) in enumerate(tracks.items()):
            _draw_errors(figure, right[number], run, view, name, number)
        save_picture(figure, path)


def _draw_paths(axes: Axes, tracks: Mapping[str, Track], scale: float = 1.0) -> None:
    first = next(iter(tracks.values()))
    axes.plot(*(scale * first.reference[:, :2].T), color=WANTED, linewidth=5.0, alpha=0.45, label="reference")
    for number, (name, run) in enumerate(tracks.items()):
        driven = scale * (run.reference + run.error)
        style = ("-", "--", ":")[number % 3]
        axes.plot(*driven[:, :2].T, style, color=COLOURS[number], linewidth=1.3, label=name)
    axes.set_aspect("equal", adjustable="datalim")


def _look_closely(close: Axes, whole: Axes, view: View) -> None:
    """Show a part of the paths, and draw its frame where all of them are shown."""
    (x, y), half_x = view.centre_m, view.half_width_m
    half_y = half_x * float(close.bbox.height / close.bbox.width)
    close.set_xlim(_MM * (x - half_x), _MM * (x + half_x))
    close.set_ylim(_MM * (y - half_y), _MM * (y + half_y))
    whole.add_patch(Rectangle((x - half_x, y - half_y), 2 * half_x, 2 * half_y, fill=False, edgecolor=INK, zorder=5))


def _draw_errors(figure: Figure, place: SubplotSpec, run: Track, view: View, name: str, number: int) -> None:
    pair = place.subgridspec(2, 1, hspace=0.12)
    position = figure.add_subplot(pair[0])
    heading = figure.add_subplot(pair[1], sharex=position)
    rows = slice(round(view.from_s / view.step_s), round(view.until_s / view.step_s))
    time_s, error = view.step_s * np.arange(len(run.error))[rows], run.error[rows]
    position.plot(time_s, _MM * error[:, 0], color=COLOURS[number], linewidth=1.0, label="x")
    position.plot(time_s, _MM * error[:, 1], color=WANTED, linewidth=1.0, label="y")
    position.set_title(name, fontsize=10)
    position.set(ylabel="error [mm]")
    position.legend(
        loc="center left", bbox_to_anchor=(0.995, 0.5), borderaxespad=0.0, handlelength=0.8, handletextpad=0.3
    )
    position.tick_params(labelbottom=False)
    heading.plot(time_s, _MRAD * error[:, 2], color=COLOURS[number], linewidth=1.0)
    heading.set(ylabel="θ [mrad]")
    heading.set_xlabel("time [s]", labelpad=1.0)
    figure.align_ylabels([position, heading])
