# SPDX-License-Identifier: MIT
"""Figures 9 and 12: the report's block diagrams, as this project's core runs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from omni_reproduce.experiment import Context, Result
from omniwheel.files import save_picture
from omniwheel.plot_style import INK, STYLE

CONTROL, WORLD = "#dceaf5", "#fbe9c8"
WIDTH, HEIGHT, GAP = 2.3, 1.1, 1.0
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Block:
    """A box: what it does, the module that does it, and the signal that leaves it."""

    text: str
    module: str
    signal: str
    colour: str = CONTROL


_KINEMATICS = Block("inverse kinematics\nB(θ) / r, slip added", "kinematics.h", "φ̇*")
_LIMIT = Block("limit, direction kept", "saturation.h", "φ̇*")
FEEDBACK_LINEARISATION = (
    Block("P, PD or PID\n(36)–(38)", "feedback_linearization.h", "ξ̇*"),
    _KINEMATICS,
    _LIMIT,
    Block("robot\nwheels follow at once", "plant kinematic", "ξ", WORLD),
)
SLIDING_MODE = (
    Block("integral sliding mode\n(39)–(44)", "ismc.h", "ξ̇*"),
    _KINEMATICS,
    _LIMIT,
    Block("wheel-speed loops\nfeed-forward + PID", "wheel_speed.h", "V"),
    Block("motors and robot\n(24)–(27)", "plant full", "ξ", WORLD),
)


def run(context: Context) -> Result:
    """Draw both diagrams."""
    figures = []
    for name, title, blocks, inner in (
        ("fig9.png", "Figure 9: feedback linearisation on kinematics", FEEDBACK_LINEARISATION, None),
        (
            "fig12.png",
            "Figure 12: integral sliding mode over motor loops",
            SLIDING_MODE,
            (4, 3, "φ̇, counts → motor KF"),
        ),
    ):
        draw(title, blocks, inner, context.folder / name)
        figures.append(context.folder / name)
    note = (
        "Figures 9 and 12 are block diagrams; these show the modules that do it here. The error is pose minus wanted "
        "pose, as in the report. What is fed back is the filtered pose on the robot and the truth in the report's "
        "simulations."
    )
    return Result((), tuple(figures), (note,))


def draw(title: str, blocks: Sequence[Block], inner: tuple[int, int, str] | None, path: Path) -> None:
    """Draw blocks in a row with the pose fed back; ``inner`` is a feedback from one block to an earlier one."""
    with mpl.rc_context(STYLE):
        length = len(blocks) * (WIDTH + GAP) + 2.6
        figure = Figure(figsize=(0.95 * length, 3.6), dpi=120)
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.01, 0.02, 0.98, 0.84))
        axes.set(xlim=(-2.4, length - 2.4), ylim=(-2.6, 1.4))
        axes.set_axis_off()
        figure.text(0.015, 0.93, title, fontsize=13, fontweight="bold", va="center")
        for number, block in enumerate(blocks):
            _box(axes, number, block)
        _arrow(axes, (-2.3, 0.0), (-1.15, 0.0))
        axes.text(-1.75, 0.14, "ξ_d, ξ̇_d", ha="center")
        axes.plot(-0.95, 0.0, "o", markersize=19, markerfacecolor="white", markeredgecolor=INK, markeredgewidth=1.2)
        axes.text(-1.22, -0.26, MINUS, ha="center", va="center")
        axes.text(-0.78, -0.42, "+", ha="center", va="center")
        _arrow(axes, (-0.75, 0.0), (0.0, 0.0))
        axes.text(-0.37, 0.14, "e", ha="center")
        _feed_back(axes, _right(len(blocks) - 1) + 0.5, -0.95, -2.2, 0.2, "pose ξ, from the pose EKF (57)–(69)")
        if inner is not None:
            source, target, text = inner
            _feed_back(
                axes, _left(source) + 0.3 * WIDTH, _left(target) + 0.5 * WIDTH, -1.4, HEIGHT / 2, text, -HEIGHT / 2
            )
        save_picture(figure, path)


def _left(number: int) -> float:
    return number * (WIDTH + GAP)


def _right(number: int) -> float:
    return _left(number) + WIDTH


def _box(axes: Axes, number: int, block: Block) -> None:
    x = _left(number)
    axes.add_patch(
        FancyBboxPatch(
            (x, -HEIGHT / 2), WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
            facecolor=block.colour, edgecolor=INK, linewidth=1.2,
        )
    )  # fmt: skip
    axes.text(x + WIDTH / 2, 0.0, block.text, ha="center", va="center")
    axes.text(
        x + WIDTH / 2, HEIGHT / 2 + 0.16, block.module, ha="center", color="#555555", fontsize=9, family="monospace"
    )
    _arrow(axes, (x + WIDTH, 0.0), (x + WIDTH + GAP, 0.0))
    axes.text(x + WIDTH + GAP / 2, 0.14, block.signal, ha="center")


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    style = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, xytext=start, arrowprops=style)


def _feed_back(axes: Axes, x: float, to_x: float, y: float, below: float, text: str, from_y: float = 0.0) -> None:
    """A line from (x, from_y) down to y, back to to_x, and up to ``below`` under the row's middle."""
    axes.plot([x, x, to_x], [from_y, y, y], color=INK, linewidth=1.2)
    _arrow(axes, (to_x, y), (to_x, -below))
    axes.text((x + to_x) / 2, y + 0.12, text, ha="center", color=INK, fontsize=9)
