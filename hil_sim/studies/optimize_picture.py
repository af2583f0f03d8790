# SPDX-License-Identifier: MIT
"""The picture of an optimisation: how the best value fell, and where in the ranges the trials were."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hil_sim.studies.figures import FIGURES
from hil_sim.studies.optimize import Outcome, Plan
from hil_sim.studies.picture_parts import ratio_axis, sheet
from omniwheel.plot_style import MARK, TRUTH

HEIGHT_PX = 900
_MAX_PANELS = 5


def draw_history(plan: Plan, outcome: Outcome, path: Path) -> None:
    """Draw the optimisation into a PNG file."""
    figure_shown = FIGURES.get(plan.minimise.figure)
    factor, unit = (figure_shown.factor, figure_shown.unit) if figure_shown else (1.0, "")
    label = f"{plan.minimise}{f' [{unit}]' if unit else ''}"
    feasible = np.array([trial.feasible for trial in outcome.trials])
    values = np.array([trial.objective for trial in outcome.trials]) * factor
    numbers = np.arange(len(values))
    best = np.fmin.accumulate(np.where(feasible, values, np.nan))
    title = f"{plan.scenario.name}  ·  {plan.scenario.robot.name}  ·  {len(values)} trials × {plan.runs} runs"
    line = f"{label}, {plan.sampler}; {int(feasible.sum())} trials keep " + ", ".join(map(str, plan.bounds))
    with sheet(path, title, line, HEIGHT_PX) as figure:
        axes_shown = plan.axes[:_MAX_PANELS]
        grid = figure.add_gridspec(
            2, len(axes_shown), left=0.07, right=0.98, top=0.85, bottom=0.09, hspace=0.3, wspace=0.28
        )
        top = figure.add_subplot(grid[0, :])
        top.plot(numbers[feasible], values[feasible], "o", color=TRUTH, markersize=4, alpha=0.7, label="trial")
        top.plot(numbers[~feasible], values[~feasible], "x", color=MARK, markersize=5, label="breaks a constraint")
        top.step(numbers, best, where="post", color="#009E73", linewidth=1.6, label="best so far")
        top.set(xlabel="trial", ylabel=label)
        finite = values[np.isfinite(values)]
        if len(finite) and finite.min() > 0.0 and finite.max() > 20.0 * finite.min():
            top.set_yscale("log")
        top.legend(loc="best", ncols=3)
        for number, axis in enumerate(axes_shown):
            panel = figure.add_subplot(grid[1, number])
            x = np.array([trial.values[axis.name] for trial in outcome.trials])
            panel.plot(x[feasible], values[feasible], "o", color=TRUTH, markersize=4, alpha=0.7)
            panel.plot(x[~feasible], values[~feasible], "x", color=MARK, markersize=5)
            panel.axvline(outcome.best.values[axis.name], color="#009E73", linewidth=1.4)
            panel.set(xlabel=axis.heading, ylabel="" if number else label)
            if axis.log:
                ratio_axis(panel)
            panel.set_yscale(top.get_yscale())
