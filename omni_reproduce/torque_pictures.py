# SPDX-License-Identifier: MIT
"""Pictures of direct torque control: figures 5 to 8, and what becomes of the laws where the floor is slippery."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omni_reproduce.picture_file import new_figure, save
from omni_reproduce.torque_loop import Array, Trace
from omniwheel.plot_style import GREY, INK, STYLE

_X, _Y, _THETA = "#0072B2", "#E69F00", "#009E73"
_LAWS = ("#0072B2", "#009E73", "#E69F00", "#D55E00")
_DASHES = ("-", (0, (5, 2)), "-", (0, (1, 1)))
_MM, _MRAD = 1e3, 1e3


def _path_axes(figure: Figure, title: str) -> Axes:
    axes = figure.add_subplot()
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    axes.set_aspect("equal", adjustable="box")
    return axes


def draw_rose(trace: Trace, settled_s: float, folder: Path) -> list[Path]:
    """Draw fig5.png, the path, and fig6.png, the errors over time."""
    with mpl.rc_context(STYLE):
        path = new_figure(6.6, 6.6)
        axes = _path_axes(path, "Six-petal rose, direct torque control at 50 Hz")
        axes.plot(trace.reference[:, 0], trace.reference[:, 1], color=GREY, lw=3.0, alpha=0.6, label="reference")
        axes.plot(trace.pose[:, 0], trace.pose[:, 1], color=_X, lw=1.2, label="robot, from the origin")
        path.legend(loc="outside lower center", ncols=2)
        errors = new_figure(9.0, 5.6)
        upper, lower = errors.subplots(2, 1, sharex=True)
        _draw_errors(upper, trace, 0.0)
        upper.set(title="Error on the six-petal rose: all of it, and from 6 s on")
        _draw_errors(lower, trace, settled_s)
        lower.set_xlabel("time [s]")
        errors.legend(*upper.get_legend_handles_labels(), loc="outside right upper")
        return [save(path, folder / "fig5.png"), save(errors, folder / "fig6.png")]


def _draw_errors(axes: Axes, trace: Trace, from_s: float) -> None:
    chosen = trace.time_s >= from_s
    error = trace.error[chosen] * (_MM, _MM, _MRAD)
    for axis, (name, colour) in enumerate((("x [mm]", _X), ("y [mm]", _Y), ("θ [mrad]", _THETA))):
        axes.plot(trace.time_s[chosen], error[:, axis], color=colour, lw=1.2, label=name)
    axes.axhline(0.0, color=GREY, lw=0.6)
    axes.set_ylabel("error [mm], [mrad]")


def draw_points(traces: Mapping[str, Trace], goals: Array, every_s: float, folder: Path) -> list[Path]:
    """Draw fig7.png, the path of the first run, and fig8.png, the distance to the point over time of all."""
    first = next(iter(traces.values()))
    with mpl.rc_context(STYLE):
        path = new_figure(7.4, 6.0)
        axes = _path_axes(path, f"Random points, one every {every_s:g} s, report's gains")
        axes.plot(first.pose[:, 0], first.pose[:, 1], color=_X, lw=1.2, label="robot, from the origin")
        axes.plot(goals[:, 0], goals[:, 1], "o", color=_Y, ms=8, label="points")
        for number, goal in enumerate(goals, start=1):
            axes.annotate(str(number), goal[:2], xytext=(8, 6), textcoords="offset points", color=INK)
        path.legend(loc="outside lower center", ncols=2)
        errors = new_figure(9.0, 6.2)
        panels = errors.subplots(2, 1, sharex=True)
        for (title, trace), colour, dashes in zip(traces.items(), _LAWS, _DASHES, strict=False):
            distance = np.hypot(trace.error[:, 0], trace.error[:, 1])
            panels[0].plot(trace.time_s, distance, color=colour, ls=dashes, lw=1.3, label=title)
            panels[1].plot(trace.time_s, trace.error[:, 2], color=colour, ls=dashes, lw=1.3)
        panels[0].set(ylabel="distance to the point [m]", title="Error on the way to random points")
        panels[1].set(ylabel="heading error [rad]", xlabel="time [s]")
        panels[1].set_xticks(np.arange(0.0, first.time_s[-1] + every_s, every_s))
        errors.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return [save(path, folder / "fig7.png"), save(errors, folder / "fig8.png")]


def draw_slippery(runs: Mapping[str, Mapping[float, Trace]], shown: float, slip_limit_m_s: float, folder: Path) -> Path:
    """Draw error and slip over time at the friction ``shown``, and the fastest slip over friction, of every law."""
    with mpl.rc_context(STYLE):
        figure = new_figure(11.0, 7.6)
        panels = figure.subplot_mosaic([["error", "all"], ["slip", "all"]], width_ratios=(1.35, 1.0))
        for (title, by_friction), colour, dashes in zip(runs.items(), _LAWS, _DASHES, strict=False):
            trace = by_friction[shown]
            distance = np.hypot(trace.error[:, 0], trace.error[:, 1])
            slip = np.abs(trace.slip_m_s).max(axis=1)
            panels["error"].semilogy(trace.time_s, distance, color=colour, ls=dashes, lw=1.4, label=title)
            panels["slip"].semilogy(trace.time_s, np.maximum(slip, 1e-3), color=colour, ls=dashes, lw=1.4)
            fastest = [float(np.abs(run.slip_m_s).max()) for run in by_friction.values()]
            panels["all"].loglog(list(by_friction), fastest, marker="o", color=colour, ls=dashes, lw=1.4, ms=5)
        panels["error"].set(ylabel="distance from the path [m]", title=f"Rose on a floor of friction {shown:g}")
        panels["slip"].set(ylabel="fastest slip [m/s]", xlabel="time [s]")
        panels["slip"].sharex(panels["error"])
        frictions = list(next(iter(runs.values())))
        panels["all"].set_xticks(frictions, [f"{value:g}" for value in frictions])
        panels["all"].set_xticks([], minor=True)
        panels["all"].set(
            xlabel="friction coefficient", ylabel="fastest slip of a wheel [m/s]", title="Fastest slip over friction"
        )
        for name in ("slip", "all"):
            panels[name].axhline(slip_limit_m_s, color=GREY, lw=1.0, ls=":")
        panels["all"].annotate(
            "slip limit", (frictions[-1], slip_limit_m_s), xytext=(0, -12), textcoords="offset points", color=GREY
        )
        figure.legend(*panels["error"].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return save(figure, folder / "direct_torque_low_friction.png")
