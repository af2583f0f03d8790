# SPDX-License-Identifier: MIT
"""What the pictures of studies share: the sheet and its head, histograms with their quantiles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from hil_sim.run_picture import DPI, HEIGHT_PX, WIDTH_PX
from hil_sim.studies.figures import FIGURES
from omniwheel.files import save_picture
from omniwheel.plot_style import INK, MARK, STYLE, TRUTH

QUANTILE_MARKS = ((0.5, "median", INK), (0.95, "95 %", "#E69F00"), (0.99, "99 %", MARK))
_BINS = 60


def ratio_axis(axes: Axes) -> None:
    """Give equal ratios of x equal lengths, with ticks in plain numbers at 1, 2 and 5."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


@contextmanager
def sheet(path: Path, title: str, line: str, height_px: int = HEIGHT_PX) -> Iterator[Figure]:
    """Give an empty figure with a title and a line below it; save it at the end."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_PX / DPI, height_px / DPI), dpi=DPI)
        FigureCanvasAgg(figure)
        inch = DPI / height_px
        figure.text(0.055, 1.0 - 0.45 * inch, title.replace("_", " "), fontsize=17, fontweight="bold", va="center")
        figure.text(0.055, 1.0 - 0.80 * inch, line, fontsize=11, color="#444444", va="center")
        yield figure
        save_picture(figure, path)


def draw_spread(axes: Axes, values: NDArray[np.float64], name: str) -> None:
    """Draw a figure's histogram over the runs, its quantiles as lines and the share of runs below (right axis)."""
    figure = FIGURES[name]
    shown = np.sort(values[np.isfinite(values)]) * figure.factor
    axes.set(xlabel=figure.heading, ylabel="runs")
    if len(shown) == 0:
        axes.text(0.5, 0.5, "no run has this figure", transform=axes.transAxes, ha="center", color="#555555")
        return
    # A few far runs must not flatten the rest: they are counted in the last bin, and the maximum is named.
    limit = max(float(np.quantile(shown, 0.99)) * 1.25 - 0.25 * float(shown[0]), float(shown[0]) + 1e-9)
    top = min(float(shown[-1]), limit)
    axes.hist(np.minimum(shown, top), bins=min(_BINS, max(10, int(np.sqrt(len(shown))))), color=TRUTH, alpha=0.55)
    for share, word, colour in QUANTILE_MARKS:
        value = float(np.quantile(shown, share))
        axes.axvline(value, color=colour, linewidth=1.4, label=f"{word} {value:.{figure.digits}f}")
    axes.plot([], [], " ", label=f"worst {shown[-1]:.{figure.digits}f}")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1, handlelength=0.8, columnspacing=0.9,
        handletextpad=0.4,
    )  # fmt: skip
    below = axes.twinx()
    below.plot(shown, np.arange(1, len(shown) + 1) / len(shown), color="#009E73", linewidth=1.2)
    below.set(ylim=(0.0, 1.02), ylabel="share below")
    below.grid(visible=False)
    below.spines["right"].set_visible(True)
    axes.set_xlim(right=top if top > shown[0] else None)


def draw_facts(axes: Axes, facts: list[tuple[str, str]]) -> None:
    """Write names and values below each other."""
    axes.set_axis_off()
    axes.set_title("In numbers")
    for row, (name, value) in enumerate(facts):
        height = 0.93 - 0.145 * row
        axes.text(0.0, height, name, transform=axes.transAxes, color="#555555", va="center")
        axes.text(1.0, height, value, transform=axes.transAxes, ha="right", va="center")
