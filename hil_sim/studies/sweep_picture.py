# SPDX-License-Identifier: MIT
"""The picture of a sweep: a line over one axis, a map over two, one panel per axis over more."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil_sim.studies.figures import FIGURES
from hil_sim.studies.figures import Figure as Shown
from hil_sim.studies.picture_parts import ratio_axis, sheet
from hil_sim.studies.space import Axis
from hil_sim.studies.sweep import Plan, PointResult
from omniwheel.plot_style import MARK, TRUTH

HEIGHT_PX = 800
_PLAIN = Shown("fraction of runs driven to the end", "%", 100.0, 1)
_MAP = "viridis"


def draw_sweep(plan: Plan, results: Sequence[PointResult], path: Path) -> None:
    """Draw the sweep into a PNG file."""
    title = f"{plan.scenario.name}  ·  {plan.scenario.robot.name}  ·  {len(results)} points × {plan.runs} runs"
    line = f"{_label(plan)}; the same seeds at every point"
    with sheet(path, title, line, HEIGHT_PX) as figure:
        if len(plan.axes) == 1:
            _draw_line(figure.add_axes((0.08, 0.1, 0.88, 0.72)), plan, results)
        elif len(plan.axes) == 2:
            _draw_map(figure, plan, results)
        else:
            _draw_panels(figure, plan, results)


def _shown(plan: Plan) -> Shown:
    return FIGURES.get(plan.shown.figure, _PLAIN)


def _label(plan: Plan) -> str:
    shown = _shown(plan)
    unit = f" [{shown.unit}]" if shown.unit else ""
    return f"{plan.shown.statistic} of {shown.label}{unit}"


def _scale_x(axes: Axes, axis: Axis) -> None:
    """Label the axis; equal ratios get equal lengths, choices their names."""
    axes.set_xlabel(axis.heading)
    if axis.log:
        ratio_axis(axes)
    if axis.choices:
        axes.set_xticks(sorted(axis.values), [axis.show(value) for value in sorted(axis.values)])


def _values(results: Sequence[PointResult], axis: Axis) -> np.ndarray:
    return np.array([result.point.values[axis.name] for result in results])


def _numbers(plan: Plan, results: Sequence[PointResult]) -> np.ndarray:
    return np.array([result.shown for result in results]) * _shown(plan).factor


def _draw_line(axes: Axes, plan: Plan, results: Sequence[PointResult]) -> None:
    (axis,) = plan.axes
    x, y = _values(results, axis), _numbers(plan, results)
    order = np.argsort(x)
    axes.plot(x[order], y[order], "o-", color=TRUTH, label=plan.shown.statistic)
    figure = plan.shown.figure
    if figure in FIGURES:
        spread = [(result.summary or {}).get("figures", {}).get(figure, {}) for result in results]
        band = (
            np.array([[entry.get(key) for key in ("p5", "p95")] for entry in spread], dtype=float) * _shown(plan).factor
        )
        axes.fill_between(
            x[order], *band[order].T, color=TRUTH, alpha=0.18, linewidth=0, label="5 % to 95 % of the runs"
        )
    _mark_refused(axes, x, y)
    _scale_x(axes, axis)
    axes.set_ylabel(_label(plan))
    axes.legend(loc="best")


def _mark_refused(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    for value in x[~np.isfinite(y)]:
        axes.axvline(value, color=MARK, linewidth=1.0, linestyle=":")
    if not np.all(np.isfinite(y)):
        axes.plot([], [], ":", color=MARK, label="refused, or runs without this figure")


def _draw_map(figure: Figure, plan: Plan, results: Sequence[PointResult]) -> None:
    axes = figure.add_axes((0.08, 0.1, 0.78, 0.72))
    bar = figure.add_axes((0.89, 0.1, 0.02, 0.72))
    first, second = plan.axes
    x, y, z = _values(results, first), _values(results, second), _numbers(plan, results)
    columns, rows = np.unique(x), np.unique(y)
    if len(results) == len(columns) * len(rows):
        cells = np.full((len(rows), len(columns)), np.nan)
        cells[np.searchsorted(rows, y), np.searchsorted(columns, x)] = z
        image = axes.imshow(cells, origin="lower", aspect="auto", cmap=_MAP)
        axes.set_xticks(range(len(columns)), [first.show(value, 4) for value in columns])
        axes.set_yticks(range(len(rows)), [second.show(value, 4) for value in rows])
        axes.grid(visible=False)
        if cells.size <= 150:
            _write_cells(axes, cells, _shown(plan))
        figure.colorbar(image, cax=bar, label=_label(plan))
    else:
        dots = axes.scatter(x, y, c=z, cmap=_MAP, s=60, edgecolors="none")
        axes.plot(x[~np.isfinite(z)], y[~np.isfinite(z)], "x", color=MARK)
        figure.colorbar(dots, cax=bar, label=_label(plan))
    axes.set(xlabel=first.heading, ylabel=second.heading)


def _write_cells(axes: Axes, cells: np.ndarray, shown: Shown) -> None:
    finite = cells[np.isfinite(cells)]
    middle = 0.5 * float(finite.min() + finite.max()) if finite.size else 0.0
    digits = _cell_digits(float(np.ptp(finite)) if finite.size else 0.0, max(shown.digits - 1, 0))
    for (row, column), value in np.ndenumerate(cells):
        text = f"{value:.{digits}f}" if np.isfinite(value) else "–"
        axes.text(column, row, text, ha="center", va="center", fontsize=9, color="white" if value < middle else "black")


def _cell_digits(span: float, usual: int) -> int:
    """Return so many decimals that cells of different colours also differ in their numbers, within reason."""
    return max(usual, min(usual + 3, math.ceil(1.0 - math.log10(span)))) if span > 0.0 else usual


def _draw_panels(figure: Figure, plan: Plan, results: Sequence[PointResult]) -> None:
    columns = min(4, len(plan.axes))
    rows = -(-len(plan.axes) // columns)
    grid = figure.add_gridspec(rows, columns, left=0.06, right=0.98, top=0.84, bottom=0.1, hspace=0.4, wspace=0.25)
    z = _numbers(plan, results)
    for number, axis in enumerate(plan.axes):
        axes = figure.add_subplot(grid[number // columns, number % columns])
        axes.plot(_values(results, axis), z, "o", color=TRUTH, markersize=4, alpha=0.7)
        _scale_x(axes, axis)
        axes.set_ylabel(_label(plan) if number % columns == 0 else "")
