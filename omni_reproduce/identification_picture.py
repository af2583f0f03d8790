# SPDX-License-Identifier: MIT
"""The picture of the identification: a validation run, its residual, the report's method, intervals against truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from omni_reproduce.identification_answers import Experiment, Validation
from omniwheel.files import save_picture
from omniwheel.plot_style import GREY, INK, MARK, STYLE, WHEEL_COLOURS

Ladder = tuple[Mapping[str, Mapping[str, float]], Mapping[str, float]]
SHOWN_S = 10.0
SHORT = {
    "speed_gain_V_s": "speed gain",
    "coulomb_V": "Coulomb voltage",
    "inertia_xy_V_s2": "inertia, translation",
    "inertia_theta_V_s2": "inertia, rotation",
    "drag_xy_V_s": "roller drag",
    "dry_drag_V": "dry roller drag",
    "motor_constant_N_m_A": "K",
    "motor_viscous_N_m_s": "b",
    "motor_coulomb_N_m": "Coulomb torque",
    "motor_inertia_kg_m2": "J of a wheel",
    "inertia_kg_m2": "I of the body",
    "wheel_distance_m": "wheel distance",
}


def draw(
    path: Path,
    validation: Validation,
    ladders: Sequence[Ladder],
    experiments: Sequence[Experiment],
) -> None:
    """Draw all four into a PNG file."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14.0, 10.0), dpi=110, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, 2)
        _draw_validation(axes[0, 0], validation)
        _draw_residual(axes[1, 0], validation)
        _draw_ladder(axes[0, 1], ladders)
        _draw_intervals(axes[1, 1], experiments)
        save_picture(figure, path)


def _draw_validation(axes: Axes, validation: Validation) -> None:
    shown = validation.time_s < SHOWN_S
    for wheel in range(validation.measured_rad_s.shape[1]):
        colour = WHEEL_COLOURS[wheel]
        axes.plot(validation.time_s[shown], validation.measured_rad_s[shown, wheel], color=colour, lw=3.5, alpha=0.35)
        axes.plot(
            validation.time_s[shown],
            validation.predicted_rad_s[shown, wheel],
            color=colour,
            lw=1.0,
            label=f"wheel {wheel + 1}",
        )
    axes.set(
        title=f"A run that was not fitted: {100 * validation.fit:.2f} % explained",
        xlabel="time [s]",
        ylabel="wheel speed [rad/s]\n(broad: measured, thin: predicted)",
    )
    axes.margins(y=0.18)
    axes.legend(ncols=4, loc="upper right")


def _draw_residual(axes: Axes, validation: Validation) -> None:
    residual = 1e3 * (validation.measured_rad_s - validation.predicted_rad_s)
    for wheel in range(residual.shape[1]):
        axes.plot(
            validation.time_s, residual[:, wheel], ".", ms=2.5, color=WHEEL_COLOURS[wheel], label=f"wheel {wheel + 1}"
        )
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set(title="Its residual", xlabel="time [s]", ylabel="measured minus predicted [mrad/s]")
    axes.margins(y=0.15)
    axes.legend(ncols=4, loc="upper right", markerscale=4)


def _draw_ladder(axes: Axes, ladders: Sequence[Ladder]) -> None:
    names = list(ladders[0][0])
    for index, (axis, mark) in enumerate(zip(("a11_d", "a22_d", "a33_d"), "o^s", strict=True)):
        place = np.arange(len(names)) + 0.2 * (index - 1)
        colour = WHEEL_COLOURS[index]
        for number, (found, truth) in enumerate(ladders):
            label = None if number else f"${axis[0]}_{{{axis[1:3]}}}^d$"
            axes.plot([found[name][axis] for name in names], place, mark, ms=6, color=colour, alpha=0.8, label=label)
            axes.axvline(truth[axis], color=colour, lw=1.0, ls=":", label=None if number else "true")
    axes.set_yticks(np.arange(len(names)), [name.replace(", ", ",\n") for name in names])
    axes.invert_yaxis()
    axes.set(
        title="The report's method, repaired step by step",
        xlabel="share of a velocity left after 20 ms",
    )
    axes.legend(loc="center right")


def _draw_intervals(axes: Axes, experiments: Sequence[Experiment]) -> None:
    names = list(experiments[0].found)
    rng = np.linspace(-0.28, 0.28, len(experiments))
    for row, name in enumerate(names):
        error = np.array([(e.found[name] - e.truth[name]) / e.half_width[name] for e in experiments])
        inside = np.abs(error) <= 1.0
        axes.plot(error[inside], row + rng[inside], ".", ms=3.5, color=WHEEL_COLOURS[0])
        axes.plot(error[~inside], row + rng[~inside], "x", ms=5, color=MARK)
        axes.text(2.32, row, f"{100 * inside.mean():.0f} %", va="center", ha="right", fontsize=9, color=INK)
    axes.axvspan(-1.0, 1.0, color=GREY, alpha=0.15, lw=0)
    axes.set_xlim(-2.4, 2.4)
    axes.set_yticks(range(len(names)), [SHORT.get(n, n.removesuffix("_m").replace("_", " ")) for n in names])
    axes.invert_yaxis()
    axes.set(
        title=f"{len(experiments)} random robots: error / half of the 95 % interval",
        xlabel="error in units of the interval's half width; right: share inside",
    )
