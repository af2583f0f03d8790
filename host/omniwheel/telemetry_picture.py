# SPDX-License-Identifier: MIT
"""The picture of a telemetry log: path, errors, wheel speeds and duties, with what happened as marks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel import files
from omniwheel.plot_style import GREY, INK, MARK, STYLE, TRUTH, WANTED, WHEEL_COLOURS
from omniwheel.telemetry_record import Array, TelemetryRecord

MOST_MARKS = 12
SIZE_IN = (13.0, 9.0)


def draw_telemetry(record: TelemetryRecord, title: str, path: Path) -> None:
    """Draw a telemetry log into a PNG file. Raises OutputFileError."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=SIZE_IN, layout="constrained")
        draw_into(figure, record, title)
        files.save_picture(figure, path)


def draw_into(figure: Any, record: TelemetryRecord, title: str) -> None:
    """Draw a telemetry log into a Matplotlib figure."""
    figure.suptitle("\n".join(filter(None, (title, in_words(record.numbers())))), fontsize=12.0)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.0, 1.1))
    _draw_path(figure.add_subplot(grid[:, 0]), record)
    axes = [figure.add_subplot(grid[0, 1])]
    axes += [figure.add_subplot(grid[row, 1], sharex=axes[0]) for row in (1, 2, 3)]
    start = min([float(times[0]) for times in (record.time_s, record.wheel_time_s) if len(times)])
    _draw_errors(axes[0], axes[1], record, start)
    _draw_wheels(axes[2], axes[3], record, start)
    for time_s, _ in record.events[:MOST_MARKS]:
        for one in axes:
            one.axvline(time_s - start, color=MARK, linewidth=0.8, alpha=0.6)
    axes[3].set_xlabel("time [s]")


def in_words(numbers: Mapping[str, float | None]) -> str:
    """Return a drive's numbers as one line."""
    parts = (
        ("way_m", 1.0, "{:.2f} m driven"),
        ("duration_s", 1.0, "{:.1f} s"),
        ("position_rmse_m", 1e3, "position RMSE {:.2f} mm"),
        ("heading_rmse_rad", 1e3, "heading RMSE {:.2f} mrad"),
        ("top_speed_m_s", 1.0, "at most {:.2f} m/s"),
    )
    words = [text.format(value * factor) for key, factor, text in parts if (value := numbers.get(key)) is not None]
    return ", ".join((*words, *jumps_in_words(numbers)))


def jumps_in_words(numbers: Mapping[str, float | None]) -> list[str]:
    """Return how often the pose estimate jumped, which is no motion; nothing if it did not."""
    count = numbers.get("pose_jumps")
    return [f"pose estimate jumped {count:.0f} times" if count != 1.0 else "pose estimate jumped once"] if count else []


def _parted(rows: Array, borders: NDArray[np.int64]) -> Array:
    """Return rows with a gap before each part of the log, for a line that does not go across."""
    return np.insert(rows, borders[borders < len(rows)], np.nan, axis=0)


def _draw_path(axes: Any, record: TelemetryRecord) -> None:
    borders = record.pose_borders()
    axes.plot(*_parted(record.reference[:, :2], borders).T, color=WANTED, linewidth=4.0, alpha=0.55, label="wanted")
    axes.plot(*_parted(record.pose[:, :2], borders).T, color=TRUTH, linewidth=1.2, label="the robot's estimate")
    if len(record.pose):
        axes.plot(*record.pose[0, :2], "o", color=INK, label="start")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title="Path", xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="upper right")


def _draw_errors(position: Any, heading: Any, record: TelemetryRecord, start: float) -> None:
    borders = record.pose_borders()
    times = _parted(record.time_s - start, borders)
    error = _parted(record.pose - record.reference, borders)
    position.plot(times, 1e3 * error[:, 0], color=TRUTH, label="x")
    position.plot(times, 1e3 * error[:, 1], color=WANTED, label="y")
    position.set(title="Estimate minus reference", ylabel="position [mm]")
    position.legend(loc="upper right", ncols=2)
    heading.plot(times, 1e3 * error[:, 2], color=TRUTH)
    heading.set_ylabel("heading [mrad]")


def _draw_wheels(speed: Any, duty: Any, record: TelemetryRecord, start: float) -> None:
    borders = record.borders(record.wheel_time_s)
    times = _parted(record.wheel_time_s - start, borders)
    wanted, turned, driven = (_parted(rows, borders) for rows in (record.wanted, record.speed, record.duty))
    for wheel, colour in zip(range(record.wheels), WHEEL_COLOURS, strict=False):
        speed.plot(times, wanted[:, wheel], color=GREY, linewidth=0.8)
        speed.plot(times, turned[:, wheel], color=colour, linewidth=1.0, label=f"wheel {wheel + 1}")
        duty.plot(times, driven[:, wheel], color=colour, linewidth=1.0)
    speed.set(title="Wheel speeds; grey: setpoints", ylabel="speed [rad/s]")
    speed.legend(loc="upper right", ncols=4)
    duty.set_ylabel("duty")
    largest = float(np.max(np.abs(record.duty))) if len(record.duty) else 1.0
    duty.set_ylim(-1.05 * max(largest, 0.05), 1.05 * max(largest, 0.05))
