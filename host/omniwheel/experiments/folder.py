# SPDX-License-Identifier: MIT
"""What an experiment leaves in its folder: numbers, the burst, and the picture."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Drawing

from omniwheel import files
from omniwheel.experiments.outcome import Outcome, Panel
from omniwheel.number_text import finite
from omniwheel.plot_style import INK, MARK, STYLE, TRUTH, WANTED

NUMBERS_FILE, BURST_FILE, PICTURE_FILE = "experiment.json", "burst.npz", "experiment.png"
_COLUMNS, _WIDTH_IN, _ROW_IN, _DPI = 2, 11.0, 2.7, 110
_COLOURS = (INK, TRUTH, MARK)


def write_outcome(outcome: Outcome, folder: Path) -> None:
    """Write everything into a folder. Raises OutputFileError."""
    files.write_json(folder / NUMBERS_FILE, finite(outcome.document()))
    outcome.burst.save(folder / BURST_FILE)
    draw_outcome(outcome, folder / PICTURE_FILE)


def draw_outcome(outcome: Outcome, path: Path) -> None:
    """Draw all panels into a PNG file."""
    rows = -(-len(outcome.panels) // _COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Drawing(figsize=(_WIDTH_IN, _ROW_IN * rows + 0.6), dpi=_DPI, layout="constrained")
        FigureCanvasAgg(figure)
        figure.suptitle(outcome.experiment, x=0.02, ha="left", fontsize=13, fontweight="bold")
        grid = figure.add_gridspec(rows, _COLUMNS)
        for number, panel in enumerate(outcome.panels):
            _draw(figure.add_subplot(grid[number // _COLUMNS, number % _COLUMNS]), panel)
        files.save_picture(figure, path)


def _draw(axes: Axes, panel: Panel) -> None:
    for number, line in enumerate(panel.lines):
        colour = WANTED if line.modelled else _COLOURS[(number if len(panel.lines) > 1 else 1) % len(_COLOURS)]
        style = "--" if line.modelled else "-"
        axes.plot(line.x, line.y, color=colour, linestyle=style, linewidth=1.3, label=line.name)
    if panel.logarithmic:
        axes.set_xscale("log")
    axes.set_title(panel.title)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    if len(panel.lines) > 1:
        axes.legend()
