# SPDX-License-Identifier: MIT
"""The picture of an experiment that was repeated with several sets of parameters: each set has a colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Drawing

from omniwheel import files
from omniwheel.experiments.outcome import Line, Outcome, Panel
from omniwheel.plot_style import INK, SETS, STYLE

_COLUMNS, _WIDTH_IN, _ROW_IN, _DPI = 2, 11.0, 2.7, 110
WANTED_LINE = "wanted"


def draw_outcomes(tries: Mapping[str, Sequence[Outcome]], title: str, path: Path) -> None:
    """Draw all panels of all tries into a PNG file, by the sets' names; the first set is the present one.

    What was wanted is drawn once. Models are left out: their place is the picture of a single experiment.
    """
    first = next(iter(tries.values()))[0]
    rows = -(-len(first.panels) // _COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Drawing(figsize=(_WIDTH_IN, _ROW_IN * rows + 0.9), dpi=_DPI, layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle(f"{first.experiment}: {title}", x=0.02, ha="left", fontsize=13, fontweight="bold")
        grid = figure.add_gridspec(rows, _COLUMNS)
        for number, panel in enumerate(first.panels):
            _draw(figure.add_subplot(grid[number // _COLUMNS, number % _COLUMNS]), panel, tries)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
        files.save_picture(figure, path)


def _draw(axes: Axes, panel: Panel, tries: Mapping[str, Sequence[Outcome]]) -> None:
    for line in panel.lines:
        if line.name == WANTED_LINE:
            axes.plot(line.x, line.y, color=INK, linestyle="--", linewidth=1.0, label=WANTED_LINE)
    for (name, outcomes), colour in zip(tries.items(), SETS[: len(tries)], strict=True):
        width = 1.3 if len(outcomes) == 1 else 0.7
        shown = [line for outcome in outcomes for line in _answers(outcome, panel.title)]
        for number, line in enumerate(shown):
            axes.plot(line.x, line.y, color=colour, linewidth=width, label=name if number == 0 else None)
    if panel.logarithmic:
        axes.set_xscale("log")
    axes.set_title(panel.title)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)


def _answers(outcome: Outcome, title: str) -> list[Line]:
    """Return the measured lines of a panel, found by its title: a set without a model may have fewer panels."""
    lines = [line for panel in outcome.panels if panel.title == title for line in panel.lines]
    return [line for line in lines if not line.modelled and line.name != WANTED_LINE]
