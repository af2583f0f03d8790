# SPDX-License-Identifier: MIT
"""The picture of a replay: path, distance from the truth, heading, wheel speeds."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omniwheel.files import save_picture
from omniwheel.logs.alignment import Alignment, truth_at
from omniwheel.logs.log import Array, WheelLog
from omniwheel.plot_style import GREY, HEADING, INK, STYLE, TRUTH, WANTED, WHEEL_COLOURS
from omniwheel.replay import Replay


def draw_replay(log: WheelLog, run: Replay, fixed: Replay | None, aligned: Alignment | None, path: Path) -> None:
    """Draw a dead-reckoned replay, the one with fixes if there is one, and the aligned truth, into a PNG file."""
    truth = None
    if aligned is not None:
        truth = aligned.to_robot(truth_at(log.require_truth(), log.time_s + aligned.offset_s))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 7.5), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.15))
        _draw_path(figure.add_subplot(grid[:, 0]), log, run, fixed, truth)
        right = [figure.add_subplot(grid[row, 1]) for row in range(3)]
        _draw_distance(right[0], log, run, fixed, truth)
        _draw_heading(right[1], log, run)
        _draw_speeds(right[2], log, run)
        for axes in right[1:]:
            axes.sharex(right[0])
        right[-1].set_xlabel("time [s]")
        save_picture(figure, path)


def _legend(axes: Axes) -> None:
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1, handlelength=1.5)


def _draw_path(axes: Axes, log: WheelLog, run: Replay, fixed: Replay | None, truth: Array | None) -> None:
    if truth is not None:
        axes.plot(*truth.T, color=INK, linewidth=3.5, alpha=0.3, label="truth, aligned")
    axes.plot(*run.pose[:, :2].T, color=TRUTH, linewidth=1.3, label="dead reckoning")
    if fixed is not None:
        axes.plot(*fixed.pose[:, :2].T, color=WANTED, linewidth=1.3, label="with fixes")
    axes.plot(*run.pose[0, :2], "o", color=INK, markersize=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=log.name)
    _legend(axes)


def _draw_distance(axes: Axes, log: WheelLog, run: Replay, fixed: Replay | None, truth: Array | None) -> None:
    axes.set(ylabel="distance [mm]", title="Distance from the truth")
    if truth is None:
        axes.text(0.5, 0.5, "no truth in this log", transform=axes.transAxes, ha="center", color=GREY)
        return
    for each, colour, name in ((run, TRUTH, "dead reckoning"), (fixed, WANTED, "with fixes")):
        if each is not None:
            distance = 1e3 * np.hypot(*(each.pose[:, :2] - truth).T)
            axes.plot(log.time_s, distance, color=colour, linewidth=1.1, label=name)
    axes.set_ylim(bottom=0.0)
    _legend(axes)


def _draw_heading(axes: Axes, log: WheelLog, run: Replay) -> None:
    if log.has_heading:
        axes.plot(log.time_s, log.heading_rad, color=INK, linewidth=3.0, alpha=0.3, label="measured")
    axes.plot(log.time_s, run.pose[:, 2], color=HEADING, linewidth=1.1, label="estimate")
    axes.set(ylabel="heading [rad]", title="Heading")
    _legend(axes)


def _draw_speeds(axes: Axes, log: WheelLog, run: Replay) -> None:
    for wheel in range(log.wheels):
        good = log.good[:, wheel]
        colour = WHEEL_COLOURS[wheel]
        axes.plot(log.time_s[good], log.wheel_rad_s[good, wheel], ".", color=colour, markersize=1.5, alpha=0.35)
        axes.plot(log.time_s, run.wheel_rad_s[:, wheel], color=colour, linewidth=1.3, label=f"wheel {wheel + 1}")
    axes.set(ylabel="speed [rad/s]", title="Wheel speeds: counts, filtered")
    _legend(axes)
