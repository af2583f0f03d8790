# SPDX-License-Identifier: MIT
"""The picture of the models: paths, distances from the full plant, and where the energy goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omni_reproduce.plant_runs import LEDGER, Case, Run
from omniwheel.files import save_picture
from omniwheel.plot_style import STYLE

_DPI = 120
_LINES = {
    "full": ("#222222", "-", 2.6),
    "slip": ("#0072B2", "-", 1.4),
    "linear": ("#D55E00", "-.", 1.4),
    "kinematic+motors": ("#009E73", "--", 1.4),
    "kinematic": ("#E69F00", ":", 1.8),
}
_PARTS = ("#D55E00", "#E69F00", "#0072B2", "#56B4E9", "#009E73")
_PER_M = 1e3


def draw(robots: Sequence[str], runs: Mapping[Case, Run], folder: Path) -> Path:
    """Draw models.png: a row per robot; the runs are those of one seed."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.5, 8.4), dpi=_DPI, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(robots), 3, width_ratios=(1.0, 1.15, 0.9), squeeze=False)
        for row, robot in zip(panels, robots, strict=True):
            found = {case.plant: run for case, run in runs.items() if case.robot == robot}
            _draw_paths(row[0], robot, found)
            _draw_distances(row[1], found)
            _draw_energy(row[2], found)
        lines = panels[0][0].get_legend_handles_labels()
        figure.legend(*lines, loc="outside lower left", ncols=len(_LINES), title="plant")
        bars = panels[0][2].get_legend_handles_labels()
        figure.legend(*bars, loc="outside lower right", ncols=len(LEDGER), title="energy")
        path = folder / "models.png"
        save_picture(figure, path)
        return path


def _draw_paths(axes: Axes, robot: str, found: Mapping[str, Run]) -> None:
    for plant, run in found.items():
        colour, dashes, width = _LINES[plant]
        axes.plot(run.pose[:, 0], run.pose[:, 1], color=colour, ls=dashes, lw=width, label=plant)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{robot}: same voltages, from rest")
    axes.set_aspect("equal", adjustable="datalim")


def _draw_distances(axes: Axes, found: Mapping[str, Run]) -> None:
    full = found["full"]
    for plant, run in found.items():
        if plant != "full":
            colour, dashes, width = _LINES[plant]
            distance = np.hypot(*(run.pose - full.pose)[:, :2].T)
            axes.plot(run.time_s, _PER_M * distance, color=colour, ls=dashes, lw=width)
    axes.set(xlabel="time [s]", ylabel="distance [mm]", title="Distance from the plant full")


def _draw_energy(axes: Axes, found: Mapping[str, Run]) -> None:
    names = [plant for plant in ("full", "slip", "linear") if plant in found]
    bottom = np.zeros(len(names))
    for number, part in enumerate(LEDGER):
        share = np.array([100.0 * found[plant].spent_J[number] / found[plant].taken_J for plant in names])
        axes.bar(names, share, bottom=bottom, color=_PARTS[number], width=0.6, label=part)
        bottom += share
    axes.set_axisbelow(True)
    axes.axhline(100.0, color="#222222", lw=1.0)
    axes.set(ylabel="share of the electrical energy [%]", title="Where the energy goes")
