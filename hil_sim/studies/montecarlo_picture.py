# SPDX-License-Identifier: MIT
"""The picture of a Monte Carlo study: how its figures spread, and the paths of the middle and of the worst run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from hil_sim.metrics import PHASE_PATH, STATE_ARMED
from hil_sim.runs import run_in_process
from hil_sim.studies.figures import FIGURES
from hil_sim.studies.montecarlo import Outcome, Plan, typical_runs
from hil_sim.studies.picture_parts import draw_facts, draw_spread, sheet
from hil_sim.studies.study_summary import counted
from omniwheel.plot_style import INK, MARK, TRUTH, WANTED

SHOWN = ("position_m", "theta_rad", "estimate_position_m", "peak_wheel_rad_s")


def draw_montecarlo(plan: Plan, outcome: Outcome, path: Path) -> None:
    """Draw the study into a PNG file; two of its runs are run again for their paths."""
    summary, rows = outcome.summary, outcome.rows
    shown = SHOWN if plan.worst_by in SHOWN else (plan.worst_by, *SHOWN[:-1])
    first, last = summary["seeds"]
    title = f"{summary['scenario']}  ·  {summary['robot']}  ·  {summary['runs']} runs"
    line = f"seeds {first} to {last}, plant {summary['plant']}, {summary['simulated_s'] / 3600.0:.3g} hours simulated"
    with sheet(path, title, line) as figure:
        grid = figure.add_gridspec(
            4, 2, left=0.06, right=0.955, top=0.865, bottom=0.055, hspace=0.55, wspace=0.15, width_ratios=(1.0, 1.1)
        )
        _draw_paths(figure.add_subplot(grid[:3, 0]), plan, rows)
        draw_facts(figure.add_subplot(grid[3, 0]), _facts(summary))
        for row, name in enumerate(shown):
            draw_spread(figure.add_subplot(grid[row, 1]), rows[name], name)


def _draw_paths(axes: Axes, plan: Plan, rows: NDArray[Any]) -> None:
    figure, chosen = FIGURES[plan.worst_by], typical_runs(rows, plan.worst_by)
    if chosen is None:
        axes.text(0.5, 0.5, f"no run has a {figure.label}", transform=axes.transAxes, ha="center", color="#555555")
        return
    for word, row, colour in zip(("middle", "worst"), chosen, (TRUTH, MARK), strict=True):
        samples = run_in_process(plan.scenario, int(rows["seed"][row])).record
        driven = samples[(samples["phase"] >= PHASE_PATH) & (samples["state"] == STATE_ARMED)]
        if word == "middle":
            reference = (driven if len(driven) else samples)["reference"]
            axes.plot(*reference[:, :2].T, color=WANTED, linewidth=4.5, alpha=0.55, label="wanted")
            axes.plot(*samples["truth"][0, :2], "o", color=INK, markersize=7, label="start", zorder=4)
        label = f"{word}, seed {rows['seed'][row]}: {figure.show(rows[plan.worst_by][row])} {figure.unit}"
        axes.plot(*samples["truth"][:, :2].T, color=colour, linewidth=1.0, label=label)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1, handlelength=1.5)
    axes.margins(0.06)


def _facts(summary: dict[str, Any]) -> list[tuple[str, str]]:
    completed = summary["completed"]
    low, high = (100.0 * share for share in completed["share_95"])
    share = f"{100.0 * completed['share']:.4g} %  (95 %: {low:.4g} to {high:.4g} %)"
    facts = [("driven to the end", share)]
    for name in ("position_m", "theta_rad"):
        entry, figure = summary["figures"][name], FIGURES[name]
        half = "" if entry["mean_95"] is None else f" ± {figure.show(0.5 * float(np.ptp(entry['mean_95'])))}"
        facts.append((f"mean {figure.label}, 95 % interval", f"{figure.show(entry['mean'])}{half} {figure.unit}"))
    runs = summary["runs"]
    facts.append(("faults that stopped the robot", counted(summary["faults"]["stops"], runs)))
    facts.append(("warnings", counted(summary["faults"]["warnings"], runs)))
    return facts
