# SPDX-License-Identifier: MIT
"""The picture of UMBmark: the return errors of every run, per robot and way of driving."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from omni_reproduce.picture_file import new_figure, save
from omniwheel.plot_style import INK, STYLE

Array = NDArray[np.float64]
COLOURS = {
    "right file, our world": "#0072B2",
    "right file, gyro, our world": "#56B4E9",
    "wrong file, our world": "#D55E00",
    "wrong file, gyro, our world": "#E69F00",
    "right file, MuJoCo": "#009E73",
    "right file, gyro, MuJoCo": "#CC79A7",
}
MARKS = ("v", "^")
_MM = 1e3


def draw(panels: Mapping[str, Mapping[str, tuple[Array, Sequence[Array]]]], folder: Path) -> Path:
    """Draw odometry.png: a panel per robot and way of driving; the first half of a set's runs is clockwise."""
    with mpl.rc_context(STYLE):
        figure = new_figure(12.0, 4.6 * ((len(panels) + 1) // 2))
        rows = figure.subplots((len(panels) + 1) // 2, 2, squeeze=False)
        for axes in rows.flat[len(panels) :]:
            axes.remove()
        for axes, (title, sets) in zip(rows.flat[: len(panels)], panels.items(), strict=True):
            _draw_panel(axes, sets)
            axes.set(xlabel="return error x [mm]", ylabel="return error y [mm]", title=title)
        lines: dict[str, Artist] = {}
        for axes in figure.axes:
            for line, label in zip(*axes.get_legend_handles_labels(), strict=True):
                lines.setdefault(label, line)
        figure.legend(list(lines.values()), list(lines), loc="outside lower center", ncols=4)
        return save(figure, folder / "odometry.png")


def _draw_panel(axes: Axes, sets: Mapping[str, tuple[Array, Sequence[Array]]]) -> None:
    axes.axhline(0.0, color=INK, linewidth=0.5)
    axes.axvline(0.0, color=INK, linewidth=0.5)
    for name, (errors, expected) in sets.items():
        half = len(errors) // 2
        for mark, way, found in zip(MARKS, ("clockwise", "counter"), (errors[:half], errors[half:]), strict=True):
            axes.plot(
                *(_MM * found.T), mark, color=COLOURS[name], markersize=5, alpha=0.8, label=f"{name}, {way}", ls=""
            )
        for centre in expected:
            axes.plot(*(_MM * centre), "x", color=INK, markersize=9, ls="", label="expected on wheels that never slip")
    axes.set_aspect("equal", adjustable="datalim")
