# SPDX-License-Identifier: MIT
"""Every controller with its default gains on both robots along every path, in the full simulated world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omniwheel.files import save_picture
from omniwheel.plot_style import STYLE
from omniwheel.robots import read_robot

FIGURE = "controllers.png"
SETTLED_S = 1.0
"""From when on a held pose counts."""
MM, MRAD, PERCENT = 1e3, 1e3, 100.0
_ESTIMATE = "What the robot's own estimate was off by on these runs."
_NOT_THE_BEST = (
    _ESTIMATE
    + " The robot is closer to its reference than to its estimate. It knows its reference, so this proves that "
    "its estimate is not the best one that could be made of what it knows."
)


@dataclass(frozen=True)
class Case:
    """One run: names of robot, controller and path, their settings, and the seed."""

    robot: str
    controller: str
    path: str
    settings: Mapping[str, Any]
    scenario: str
    seed: int


def run(context: Context) -> Result:
    """Run all combinations; a row is the mean over paths and seeds of one controller on one robot."""
    spec = read_spec("controllers")
    head = spec["experiment"]
    scenario = head["scenario"]
    seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))
    cut = {"duration_s": head["quick_duration_s"]} if context.quick else {}
    cases = [
        Case(robot, controller, path, {**spec["controller"][controller], **spec["path"][path], **cut}, scenario, seed)
        for robot, controller, path, seed in product(head["robots"], spec["controller"], spec["path"], seeds)
    ]
    figures = context.map(measure, cases)
    keys = [(case.robot, case.controller, case.path) for case in cases]
    names = (list(head["robots"]), list(spec["controller"]), list(spec["path"]))
    tables = {key: _table(names, keys, [entry[key] for entry in figures]) for key in figures[0]}
    rows = tuple(row for robot in names[0] for row in _rows(names, tables, robot, len(seeds)))
    picture = context.folder / FIGURE
    draw(names, tables["position_m"].mean(axis=3), picture)
    return Result(
        rows, (picture,), (_about(len(seeds), context.quick), *(_note(names, tables, robot) for robot in names[0]))
    )


def case_scenario(case: Case) -> Scenario:
    """Return the scenario of a case: the common floor with the case's robot, controller, path and seed."""
    base = load_scenario(case.scenario).with_seed(case.seed)
    robot = read_robot(case.robot)
    settings = dict(case.settings)
    duration_s = settings.pop("duration_s", base.duration_s)
    values = {name: robot.table[name].parse(case.scenario, name, value) for name, value in settings.items()}
    return replace(base, robot=robot, parameters={**base.parameters, **values}, duration_s=duration_s)


def measure(case: Case) -> dict[str, float]:
    """Return a run's figures. It is completed if the path, or the time given for it, was driven to the end."""
    scenario = case_scenario(case)
    run_ = run_in_process(scenario)
    record, completed = run_.record, run_.done
    armed = record["state"] == metrics.STATE_ARMED
    if scenario.duration_s is not None:
        completed = bool(np.any(armed & (record["time_s"] > scenario.duration_s - 0.1)))
    if not np.any(record["phase"] == metrics.PHASE_PATH):  # a pose that is held has no path
        record = record[armed & (record["time_s"] > SETTLED_S)].copy()
        record["phase"] = metrics.PHASE_PATH
    effort = metrics.effort(record, scenario.robot.wheels)
    return {
        **metrics.as_dict(metrics.tracking_rmse(record)),
        "estimate_m": metrics.estimator_rmse(record).position_m,
        "estimate_rad": metrics.estimator_rmse(record).theta_rad,
        "rms_duty": effort.rms_duty,
        "saturated_share": effort.saturated_share,
        "chatter": effort.chatter,
        "completed": float(completed),
    }


Names = tuple[Sequence[str], Sequence[str], Sequence[str]]


def _table(names: Names, keys: Sequence[tuple[str, str, str]], values: Sequence[float]) -> NDArray[np.float64]:
    """Return the values by robot, controller, path and seed."""
    shape = (*(len(axis) for axis in names), -1)
    assert keys[0] == tuple(axis[0] for axis in names)
    return np.array(values).reshape(shape)


def _rows(names: Names, tables: Mapping[str, NDArray[np.float64]], robot: str, seeds: int) -> list[Row]:
    r = names[0].index(robot)
    quantities = (
        ("position RMSE", "position_m", "mm", MM, ""),
        ("position RMSE of the estimate", "estimate_m", "mm", MM, "position_m"),
        ("heading RMSE", "theta_rad", "mrad", MRAD, ""),
        ("heading RMSE of the estimate", "estimate_rad", "mrad", MRAD, "theta_rad"),
        ("effort: RMS duty", "rms_duty", "%", PERCENT, ""),
        ("time at a limit", "saturated_share", "%", PERCENT, ""),
        ("chatter index", "chatter", "1", 1.0, ""),
        ("paths driven to the end", "completed", "%", PERCENT, ""),
    )
    rows = []
    for c, controller in enumerate(names[1]):
        for quantity, key, unit, factor, tracked in quantities:
            per_seed = factor * tables[key][r, c].mean(axis=0)
            why = _about_estimate(per_seed, factor * tables[tracked][r, c].mean(axis=0)) if tracked else ""
            sd = float(np.std(per_seed, ddof=1)) if seeds > 1 else None
            rows.append(
                Row(
                    "controllers", f"{controller}, {robot}", quantity, unit, float(per_seed.mean()), sd, seeds,
                    explanation=why,
                )
            )  # fmt: skip
    return rows


def _about_estimate(estimate: NDArray[np.float64], tracked: NDArray[np.float64]) -> str:
    """Return the footnote of an estimate's error, given the tracking error of the same runs."""
    return _NOT_THE_BEST if tracked.mean() < estimate.mean() else _ESTIMATE


def _about(seeds: int, quick: bool) -> str:
    length = "Only the beginning of each path is driven (--quick). " if quick else ""
    return length + (
        f"Mean over the paths of each path's figure; the deviation is that between seeds ({seeds}). Default gains, "
        "slip of up to 5 % that encoders cannot see, pose fixes at 50 Hz with 2 mm and 2 mrad of noise, 20 ms late. "
        "*Chatter* is the mean change of a duty from one millisecond to the next over the mean duty. "
        "Position RMSE [mm] / heading RMSE [mrad] of each path:"
    )


def _note(names: Names, tables: Mapping[str, NDArray[np.float64]], robot: str) -> str:
    r = names[0].index(robot)
    lines = [f"| {robot} | " + " | ".join(names[2]) + " |", "|" + "---|" * (1 + len(names[2]))]
    for c, controller in enumerate(names[1]):
        position = MM * tables["position_m"][r, c].mean(axis=1)
        heading = MRAD * tables["theta_rad"][r, c].mean(axis=1)
        entries = [f"{a:.2f} / {b:.2f}" for a, b in zip(position, heading, strict=True)]
        lines.append(f"| {controller} | " + " | ".join(entries) + " |")
    return "\n".join(lines)


def draw(names: Names, position_m: NDArray[np.float64], path: Path) -> None:
    """Draw the position RMSE of every combination (robot, controller, path) [m] into a PNG file."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 1.6 + 0.42 * position_m.shape[0] * position_m.shape[1]), dpi=120)
        FigureCanvasAgg(figure)
        all_axes = figure.subplots(position_m.shape[0], 1, squeeze=False, sharex=True)[:, 0]
        low, high = max(MM * float(np.nanmin(position_m)), 0.01), MM * float(np.nanmax(position_m))
        norm = LogNorm(low, high)
        for axes, robot, values in zip(all_axes, names[0], MM * position_m, strict=True):
            image = axes.imshow(values, cmap="cividis", norm=norm, aspect="auto")
            axes.grid(False)
            axes.set_title(f"{robot}: position RMSE [mm]")
            axes.set_yticks(range(len(names[1])), names[1])
            axes.set_xticks(range(len(names[2])), [fill(name, 10) for name in names[2]])
            for (i, j), value in np.ndenumerate(values):
                dark = norm(value) < 0.55
                axes.text(j, i, f"{value:.2f}", ha="center", va="center", color="white" if dark else "#111111")
        figure.tight_layout(rect=(0.0, 0.0, 0.93, 1.0))
        bar = figure.add_axes((0.94, 0.12, 0.012, 0.76))
        ticks = [tick for tick in (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if low <= tick <= high]
        colours = figure.colorbar(image, cax=bar, ticks=ticks, format="%g", label="position RMSE [mm]")
        colours.minorticks_off()
        save_picture(figure, path)
