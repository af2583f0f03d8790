# SPDX-License-Identifier: MIT
"""The picture of a run: where the robot should have been and was, how far off, and what the wheels did."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hil_sim.metrics import PHASE_PATH, on_path, pose_error
from omniwheel.files import save_picture
from omniwheel.number_text import shown
from omniwheel.plot_style import HEADING, INK, MARK, STYLE, TRUTH, WANTED, WHEEL_COLOURS

WIDTH_PX, HEIGHT_PX, DPI = 1600, 1200, 120


def draw_run(summary: Mapping[str, Any], samples: NDArray[Any], path: Path) -> None:
    """Draw a run (its summary and samples, hil_sample_t rows) into a PNG file."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_PX / DPI, HEIGHT_PX / DPI), dpi=DPI)
        FigureCanvasAgg(figure)
        _head(figure, summary)
        grid = figure.add_gridspec(
            4, 2, left=0.06, right=0.985, top=0.865, bottom=0.065, hspace=0.42, wspace=0.15, width_ratios=(1.0, 1.1)
        )
        _draw_path(figure.add_subplot(grid[:3, 0]), samples)
        _draw_facts(figure.add_subplot(grid[3, 0]), summary)
        right = [figure.add_subplot(grid[row, 1]) for row in range(4)]
        for axes in right[1:]:
            axes.sharex(right[0])
        _draw_position_errors(right[0], samples)
        _draw_heading_error(right[1], samples)
        wheels = int(summary["parameters"]["WHEELS"])
        _draw_wheel_speeds(right[2], samples, wheels, float(summary["parameters"]["LIM_WHEEL"]))
        _draw_duties(right[3], samples, wheels)
        for axes in right:
            _mark_events(axes, summary, named=axes is right[0])
            axes.tick_params(labelbottom=axes is right[-1])
        right[-1].set_xlabel("time [s]")
        figure.align_ylabels(right)
        save_picture(figure, path)


def _number(value: float | None, factor: float, unit: str, digits: int = 2) -> str:
    return "–" if value is None else f"{shown(value, factor, digits)} {unit}".rstrip()


def _head(figure: Figure, summary: Mapping[str, Any]) -> None:
    names = (summary["scenario"], summary["robot"], summary["controller"].upper())
    title = "  ·  ".join(name.replace("_", " ") for name in names)
    figure.text(0.055, 0.955, title, fontsize=17, fontweight="bold", va="center")
    rmse, way = summary["rmse"], "real firmware in the loop" if summary["way"] == "hil" else "in process"
    if external := summary["world"].get("external"):
        way += f", world {external.split(':')[-1]}"
    line = (
        f"RMSE on the path: position {_number(rmse['position_m'], 1e3, 'mm')}, "
        f"heading {_number(rmse['theta_rad'], 1e3, 'mrad')}   ·   "
        f"{way}, seed {summary['seed']}, {summary['duration_s']:.1f} s simulated"
    )
    figure.text(0.055, 0.922, line, fontsize=11, color="#444444", va="center")
    faults = summary["faults"]
    if faults:
        figure.text(0.985, 0.955, f"faults: {', '.join(faults)}", fontsize=12, color=MARK, ha="right", va="center")


def _draw_path(axes: Axes, samples: NDArray[Any]) -> None:
    driven = samples[(samples["phase"] >= PHASE_PATH) & (samples["state"] == 2)]
    shown = driven if len(driven) else samples
    path = samples[on_path(samples)]
    axes.plot(
        *shown["reference"][:, :2].T, color=WANTED, linewidth=4.5, alpha=0.55, label="wanted", solid_capstyle="round"
    )
    axes.plot(*samples["truth"][:, :2].T, color=TRUTH, linewidth=1.1, label="driven (truth)")
    axes.plot(*samples["truth"][0, :2], "o", color=INK, markersize=7, label="start", zorder=4)
    if len(path):
        _draw_headings(axes, path)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="Path")
    axes.margins(0.06)
    _legend(axes, 4)


def _draw_headings(axes: Axes, path: NDArray[Any], count: int = 48) -> None:
    """Short strokes along the body's x axis, so that the rotation can be seen."""
    chosen = path[np.linspace(0, len(path) - 1, count).astype(int)]
    x, y, theta = chosen["truth"].T
    span = float(np.ptp(path["reference"][:, :2], axis=0).max())
    length = 0.045 * (span if span > 0.0 else 1.0)
    axes.quiver(
        x, y, length * np.cos(theta), length * np.sin(theta), angles="xy", scale_units="xy", scale=1.0,
        color=HEADING, width=0.003, headwidth=4.0, headlength=4.5, headaxislength=4.0, zorder=3,
    )  # fmt: skip
    axes.plot([], [], color=HEADING, linewidth=1.6, label="heading")


def _facts(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    effort, estimator, plan = summary["effort"], summary["estimator_rmse"], summary["plan"]
    facts = []
    if summary["change"] is not None:
        before, after = summary["change"]["rmse_before"], summary["change"]["rmse_after"]
        for name, key, unit in (("position", "position_m", "mm"), ("heading", "theta_rad", "mrad")):
            text = f"{_number(before[key], 1e3, unit)}  →  {_number(after[key], 1e3, unit)}"
            facts.append((f"{name} RMSE before → after the change", text))
    estimate = f"{_number(estimator['position_m'], 1e3, 'mm')}, {_number(estimator['theta_rad'], 1e3, 'mrad')}"
    facts.append(("RMSE of the pose estimate", estimate))
    peaks = f"{_number(effort['peak_wheel_rad_s'], 1.0, 'rad/s')}, {_number(effort['peak_duty'], 100.0, '%', 0)}"
    facts.append(("peak wheel speed, peak duty", peaks))
    limits = f"{_number(effort['saturated_share'], 100.0, '%', 1)}, {_number(effort['chatter'], 1.0, '', 4)}"
    facts.append(("time at a limit, chatter index", limits))
    if plan is not None:
        facts.append(("path slowed down by", f"{plan['scale']:.2f} (the limits need {plan['needed_scale']:.2f})"))
    factor = f"{_number(summary['realtime_factor'], 1.0, '×', 0)}, {summary['firmware_version'] or '–'}"
    return [*facts, ("real-time factor, firmware", factor)]


def _draw_facts(axes: Axes, summary: Mapping[str, Any]) -> None:
    axes.set_axis_off()
    axes.set_title("In numbers")
    for row, (name, value) in enumerate(_facts(summary)):
        height = 0.93 - 0.145 * row
        axes.text(0.0, height, name, transform=axes.transAxes, color="#555555", va="center")
        axes.text(1.0, height, value, transform=axes.transAxes, ha="right", va="center")


def _armed(samples: NDArray[Any]) -> NDArray[Any]:
    """Samples in which the robot was driven: outside of them, an error means nothing."""
    driven = samples[(samples["state"] == 2) & (samples["phase"] >= PHASE_PATH)]
    return driven if len(driven) else samples


def _limit_to_bulk(axes: Axes, values: NDArray[np.float64]) -> None:
    """Scale the y axis to nearly all values, so that one spike does not flatten the rest."""
    bulk = float(np.quantile(np.abs(values), 0.999)) if values.size else 0.0
    span = 1.35 * max(bulk, 1e-3)
    axes.set_ylim(-span, span)


def _legend(axes: Axes, entries: int) -> None:
    """Above the axes, at the right: it can hide nothing there."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=entries,
        borderaxespad=0.1,
        handlelength=1.5,
        columnspacing=1.2,
    )


def _draw_position_errors(axes: Axes, samples: NDArray[Any]) -> None:
    driven = _armed(samples)
    error = 1e3 * pose_error(driven)
    axes.plot(driven["time_s"], error[:, 0], color=WHEEL_COLOURS[0], linewidth=0.9, label="x")
    axes.plot(driven["time_s"], error[:, 1], color=WHEEL_COLOURS[1], linewidth=0.9, label="y")
    _limit_to_bulk(axes, error[:, :2])
    axes.set(ylabel="error [mm]", title="Position error, truth minus wanted")
    _legend(axes, 2)


def _draw_heading_error(axes: Axes, samples: NDArray[Any]) -> None:
    driven = _armed(samples)
    error = 1e3 * pose_error(driven)[:, 2]
    axes.plot(driven["time_s"], error, color=HEADING, linewidth=0.9)
    _limit_to_bulk(axes, error)
    axes.set(ylabel="error [mrad]", title="Heading error")


def _draw_wheel_speeds(axes: Axes, samples: NDArray[Any], wheels: int, limit: float) -> None:
    for i in range(wheels):
        axes.plot(
            samples["time_s"],
            samples["wheel_rad_s"][:, i],
            color=WHEEL_COLOURS[i],
            linewidth=0.8,
            label=f"wheel {i + 1}",
        )
    for sign in (-1.0, 1.0):
        axes.axhline(sign * limit, color=MARK, linewidth=1.0, linestyle="--", label="limit" if sign > 0 else None)
    axes.set(ylabel="speed [rad/s]", title="Wheel speeds", ylim=(-1.2 * limit, 1.2 * limit))
    _legend(axes, wheels + 1)


def _draw_duties(axes: Axes, samples: NDArray[Any], wheels: int) -> None:
    for i in range(wheels):
        axes.plot(
            samples["time_s"], samples["duty"][:, i], color=WHEEL_COLOURS[i], linewidth=0.6, label=f"motor {i + 1}"
        )
    for sign in (-1.0, 1.0):
        axes.axhline(sign, color=MARK, linewidth=1.0, linestyle="--", label="limit" if sign > 0 else None)
    axes.set(ylabel="duty [1]", title="Motor duties", ylim=(-1.15, 1.15))
    _legend(axes, wheels + 1)


def _mark_events(axes: Axes, summary: Mapping[str, Any], named: bool) -> None:
    """A line where parameters changed; a band where a fault was injected."""
    end = float(summary["duration_s"])
    for fault in summary["injected_faults"]:
        stop = end if fault["stop_s"] is None else min(float(fault["stop_s"]), end)
        axes.axvspan(fault["start_s"], stop, color=MARK, alpha=0.12, linewidth=0)
    change = summary["change"]
    if change is not None:
        axes.axvline(change["time_s"], color=INK, linewidth=1.0, linestyle=":")
        axes.annotate(
            change["what"] if named else "", (change["time_s"], 0.98), xycoords=("data", "axes fraction"),
            xytext=(4, 0), textcoords="offset points", fontsize=8.5, va="top",
        )  # fmt: skip
