# SPDX-License-Identifier: MIT
"""The picture of a run of the original four-wheel robot: path, errors and PWM."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omniwheel.files import save_picture
from omniwheel.host_control.pwm_line import FULL_PWM, MOTORS
from omniwheel.plot_style import HEADING, INK, MARK, STYLE, TRUTH, WANTED, WHEEL_COLOURS

_SIZE_IN, _DPI = (11.0, 6.6), 120


def draw_host_control_run(
    record: NDArray[np.float64], truth: NDArray[np.float64] | None, title: str, path: Path
) -> None:
    """Draw a run (:meth:`~omniwheel.host_control.loop.HostControlRun.record`) into a PNG file.

    ``truth`` are the true poses at the same times, known in simulation only.
    """
    style: Any = {**STYLE, "legend.frameon": True, "legend.framealpha": 0.9, "legend.edgecolor": "none"}
    with mpl.rc_context(style):
        figure = Figure(figsize=_SIZE_IN, dpi=_DPI)
        FigureCanvasAgg(figure)
        figure.suptitle(title, x=0.06, ha="left", fontsize=13, fontweight="bold")
        grid = figure.add_gridspec(3, 2, left=0.07, right=0.985, top=0.885, bottom=0.08, hspace=0.36, wspace=0.2)
        _draw_path(figure.add_subplot(grid[:, 0]), record, truth)
        right = [figure.add_subplot(grid[row, 1]) for row in range(3)]
        _draw_errors(right[0], right[1], record, truth)
        _draw_pwm(right[2], record)
        right[2].set_xlabel("time [s]")
        figure.align_ylabels(right)
        save_picture(figure, path)


def _draw_path(axes: Axes, record: NDArray[np.float64], truth: NDArray[np.float64] | None) -> None:
    driven = record[:, 1:4] if truth is None else truth
    wanted = record[:, 4:6]
    if np.ptp(wanted, axis=0).max() > 0.0:
        axes.plot(*wanted.T, color=WANTED, linewidth=4.0, alpha=0.55, label="wanted")
    else:
        axes.plot(*wanted[0], "P", color=WANTED, markersize=15, label="wanted")
    axes.plot(driven[:, 0], driven[:, 1], color=TRUTH, linewidth=1.2, label="driven" if truth is None else "truth")
    axes.plot(driven[0, 0], driven[0, 1], "o", color=INK, markersize=7, label="start")
    axes.plot(driven[-1, 0], driven[-1, 1], "s", color=MARK, markersize=7, label="end")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="Path")
    axes.legend(loc="lower right", bbox_to_anchor=(1.01, 0.99), ncols=4, columnspacing=1.2, borderpad=0.0)


def _draw_errors(position: Axes, heading: Axes, record: NDArray[np.float64], truth: NDArray[np.float64] | None) -> None:
    error = record[:, 7:10] if truth is None else truth - record[:, 4:7]
    whose = "estimate" if truth is None else "truth"
    position.plot(record[:, 0], 1e3 * error[:, 0], color=TRUTH, linewidth=1.1, label="x")
    position.plot(record[:, 0], 1e3 * error[:, 1], color=WANTED, linewidth=1.1, label="y")
    position.set(ylabel="position [mm]", title=f"Error: {whose} minus wanted")
    position.legend(loc="lower right", bbox_to_anchor=(1.01, 0.99), ncols=2, borderpad=0.0)
    turn = np.arctan2(np.sin(error[:, 2]), np.cos(error[:, 2]))
    heading.plot(record[:, 0], 1e3 * turn, color=HEADING, linewidth=1.1)
    heading.set(ylabel="heading [mrad]")


def _draw_pwm(axes: Axes, record: NDArray[np.float64]) -> None:
    for motor, colour in enumerate(WHEEL_COLOURS[:MOTORS]):
        axes.plot(record[:, 0], record[:, 10 + motor], color=colour, linewidth=0.9, label=f"motor {motor + 1}")
    axes.set(ylabel="PWM -255..255", title="PWM", ylim=(-1.08 * FULL_PWM, 1.08 * FULL_PWM))
    axes.legend(loc="lower right", bbox_to_anchor=(1.01, 0.99), ncols=MOTORS, columnspacing=1.2, borderpad=0.0)
