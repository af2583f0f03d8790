# SPDX-License-Identifier: MIT
"""Figures 13 to 16: one run on the rose with all filter combinations; and the table at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from omni_reproduce.filters import AXES, AXIS_UNITS, FILTER_TITLES, Array, Setting, Study
from omni_reproduce.picture_file import new_figure, save
from omniwheel.plot_style import GREY, INK, STYLE

_RUN = "four-petal rose in 30 s, as the report's code had it"
_COLOURS = ("#E69F00", "#56B4E9", "#009E73", "#CC79A7")
_DASHES: tuple[Any, ...] = ("-", "-", "-", (0, (4, 2)))
_PUBLISHED = "#222222"
_SETTING_COLOURS, _MARKERS = ("#0072B2", "#E69F00", "#009E73"), ("o", "s", "^")
_ZOOM_S, _ZOOM_M, _ZOOM_WINDOW_S = 24.0, 0.08, 0.5


class Outcome(Protocol):
    """What the overview needs of a setting's outcome."""

    @property
    def setting(self) -> Setting:
        """The setting."""

    @property
    def results(self) -> NDArray[np.void]:
        """Results of its seeds."""


def draw_run(study: Study, samples: NDArray[np.void], folder: Path) -> list[Path]:
    """Draw fig13.png to fig16.png of one run, samples of SAMPLE; return their paths."""
    t = np.arange(1, len(samples) + 1, dtype=np.float64) * study.setting.step_s
    wanted = study.poses[1:]
    middle = samples["truth"][np.searchsorted(t, _ZOOM_S)]
    with mpl.rc_context(STYLE):
        whole, zoom = (_path_figure(wanted, samples, title) for title in ("Path", "Path, zoomed"))
        zoom.axes[0].set(
            xlim=(middle[0] - _ZOOM_M, middle[0] + _ZOOM_M), ylim=(middle[1] - _ZOOM_M, middle[1] + _ZOOM_M)
        )
        heading, close = (_heading_figure(t, wanted, samples, title) for title in ("Heading", "Heading, zoomed"))
        shown = abs(t - _ZOOM_S) <= 0.5 * _ZOOM_WINDOW_S
        seen = np.concatenate([samples["truth"][shown, 2], samples["estimate"][shown, :, 2].ravel()])
        margin = 0.1 * np.ptp(seen)
        close.axes[0].set(xlim=(t[shown][0], t[shown][-1]), ylim=(seen.min() - margin, seen.max() + margin))
        figures = (whole, zoom, heading, close)
        return [save(figure, folder / f"fig{number}.png") for number, figure in enumerate(figures, start=13)]


def _lines(axes: Axes, horizontal: Sequence[Array], vertical: Sequence[Array]) -> None:
    """Draw reference, truth and the four estimates, in this order."""
    axes.plot(horizontal[0], vertical[0], color=GREY, lw=1.0, ls=":", label="reference")
    axes.plot(horizontal[1], vertical[1], color=INK, lw=2.6, alpha=0.55, label="truth")
    for number, title in enumerate(FILTER_TITLES):
        axes.plot(
            horizontal[2 + number],
            vertical[2 + number],
            color=_COLOURS[number],
            ls=_DASHES[number],
            lw=1.3,
            label=title,
        )


def _path_figure(wanted: Array, samples: NDArray[np.void], title: str) -> Figure:
    figure = new_figure(8.6, 6.6)
    axes = figure.add_subplot()
    curves = [wanted, samples["truth"], *np.moveaxis(samples["estimate"], 1, 0)]
    _lines(axes, [curve[:, 0] for curve in curves], [curve[:, 1] for curve in curves])
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{title}: {_RUN}")
    axes.set_aspect("equal", adjustable="box")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")
    return figure


def _heading_figure(t: Array, wanted: Array, samples: NDArray[np.void], title: str) -> Figure:
    figure = new_figure(10.0, 4.8)
    axes = figure.add_subplot()
    curves = [wanted, samples["truth"], *np.moveaxis(samples["estimate"], 1, 0)]
    _lines(axes, [t] * len(curves), [curve[:, 2] for curve in curves])
    axes.set(xlabel="time [s]", ylabel="θ [rad]", title=f"{title}: {_RUN}")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")
    return figure


def draw_table(published: Array, groups: Sequence[Outcome], path: Path) -> None:
    """Draw the table: a panel per axis; ``published`` (4, 3) beside each setting's mean with one standard deviation."""
    with mpl.rc_context(STYLE):
        figure = new_figure(11.0, 4.6)
        panels = figure.subplots(1, 3, sharey=False)
        places = np.arange(len(FILTER_TITLES))
        apart = 0.7 / (len(groups) + 1)
        for axis, axes in enumerate(panels):
            axes.plot(places - 0.35, published[:, axis], "_", ms=13, mew=2.2, color=_PUBLISHED, label="published")
            for number, group in enumerate(groups, start=1):
                rmse = group.results["rmse"][:, :, axis]
                axes.errorbar(
                    places - 0.35 + number * apart,
                    rmse.mean(axis=0),
                    rmse.std(axis=0),
                    fmt=_MARKERS[number - 1],
                    ms=6,
                    lw=1.2,
                    color=_SETTING_COLOURS[number - 1],
                    label=group.setting.title,
                )
            axes.set_yscale("log")
            axes.set_xticks(places, [title.replace(" and ", "\nand ") for title in FILTER_TITLES])
            axes.set(title=f"{AXES[axis]} RMSE in 600 s", ylabel=f"RMSE [{AXIS_UNITS[axis]}]")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(groups) + 1)
        save(figure, path)
