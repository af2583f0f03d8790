# SPDX-License-Identifier: MIT
"""The speed polygon: top speed by direction, as a polar picture with forward up."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from omniwheel import files
from omniwheel.capability.card import DIRECTIONS
from omniwheel.capability.drive_model import DriveModel
from omniwheel.capability.speeds import direction, limit_speed, motor_speed
from omniwheel.plot_style import GREY, MARK, STYLE, TRUTH, WANTED

FINE = 360


def draw_speeds(model: DriveModel, title: str, path: Path) -> None:
    """Draw what motors, LIM_WHEEL and LIM_V allow in every direction. Raises OutputFileError."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    angles = np.linspace(0.0, 2.0 * math.pi, FINE + 1)
    curves = (
        ("motors' limit alone", [motor_speed(model, direction(a)) for a in angles], GREY, "--"),
        ("LIM_WHEEL", [limit_speed(model, direction(a)) for a in angles], WANTED, "-."),
        ("LIM_V", [model.speed_limit_m_s] * len(angles), MARK, ":"),
    )
    least = np.min([speeds for _, speeds, _, _ in curves], axis=0)
    with rc_context(STYLE):
        figure = Figure(figsize=(6.0, 6.4), layout="constrained")
        axes: Any = figure.add_subplot(projection="polar")  # Matplotlib types it as plain Axes
        axes.set_theta_zero_location("N")
        axes.fill(angles, least, color=TRUTH, alpha=0.15)
        axes.plot(angles, least, color=TRUTH, linewidth=2.0, label="top speed")
        shown = 1.6 * float(np.max(least))
        for label, speeds, colour, line in curves:
            axes.plot(angles, np.minimum(speeds, shown), color=colour, linestyle=line, linewidth=1.2, label=label)
        axes.set_rmax(shown)
        axes.set_rlabel_position(360.0 / DIRECTIONS)
        axes.set_title(f"{title}:\ntop speed by direction [m/s], forward is up", loc="center", pad=18)
        figure.legend(loc="outside lower center", ncols=4)
        files.save_picture(figure, path)
