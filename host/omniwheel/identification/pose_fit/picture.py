# SPDX-License-Identifier: MIT
"""The picture of a study: left-out runs dead-reckoned before and after, beside the measured positions."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omniwheel.files import save_picture
from omniwheel.identification.pose_fit.scores import dead_reckoned
from omniwheel.identification.pose_fit.study import GeometryStudy, HeldOut
from omniwheel.identification.pose_fit.wheel_model import Array
from omniwheel.plot_style import INK, STYLE, WHEEL_COLOURS

NOMINAL, IDENTIFIED = WHEEL_COLOURS[1], WHEEL_COLOURS[0]


def draw_study(study: GeometryStudy, path: Path, title: str = "") -> None:
    """Draw the left-out runs with the median and the largest error, and the errors of all, into a PNG file."""
    ranked = sorted(study.held_out, key=lambda run: run.identified.largest_m)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.5, 4.9), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        axes = [figure.add_subplot(1, 3, place) for place in (1, 2, 3)]
        _draw_run(axes[0], study, ranked[(len(ranked) - 1) // 2], "median")
        _draw_run(axes[1], study, ranked[-1], "largest")
        _draw_errors(axes[2], study)
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=len(names))
        if title:
            figure.suptitle(title, fontweight="bold", x=0.01, ha="left")
        save_picture(figure, path)


def _draw_run(axes: Axes, study: GeometryStudy, shown: HeldOut, rank: str) -> None:
    run, clock = study.runs[shown.number], study.clocks[shown.number]
    times = run.truth_s if run.same_clock else clock.on_log(run.truth_s)
    before, measured = dead_reckoned(run, study.layout.matrix(study.layout.nominal), times)
    after, _ = dead_reckoned(run, shown.matrix, times)
    axes.plot(*measured[:, :2].T, color=INK, linewidth=3.5, alpha=0.3, label="measured")
    axes.plot(*before[:, :2].T, color=NOMINAL, linewidth=1.2, linestyle="--", label="documented geometry")
    axes.plot(*after[:, :2].T, color=IDENTIFIED, linewidth=1.4, label="identified without the run's group")
    axes.plot(*measured[0, :2], "o", color=INK, markersize=5)
    axes.set_aspect("equal", adjustable="datalim")
    errors = f"{1e3 * shown.nominal.largest_m:.0f} → {1e3 * shown.identified.largest_m:.0f} mm"
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{rank} error: {errors}\n{run.name}")


def _draw_errors(axes: Axes, study: GeometryStudy) -> None:
    """Draw the distribution of the largest position errors over the left-out runs."""
    share = (np.arange(len(study.held_out)) + 1.0) / len(study.held_out)
    for values, colour in (
        (_largest_mm(study, "nominal"), NOMINAL),
        (_largest_mm(study, "identified"), IDENTIFIED),
    ):
        axes.step(values, share, where="post", color=colour, linewidth=1.8)
        axes.axvline(float(np.median(values)), color=colour, linestyle=":", linewidth=1.0)
    axes.set(xlabel="largest position error of a run [mm]", ylabel="share of the runs")
    axes.set(xlim=(0.0, None), ylim=(0.0, 1.0))
    axes.set_title(f"{len(study.held_out)} left-out runs (dotted: median)")


def _largest_mm(study: GeometryStudy, kind: str) -> Array:
    return np.sort([1e3 * getattr(run, kind).largest_m for run in study.held_out])
