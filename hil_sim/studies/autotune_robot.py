# SPDX-License-Identifier: MIT
"""One drawn robot is tuned by ``omni autotune``'s own code on the real firmware, in simulated time, and judged.

Judged on its true pose, over seeds that the tuning never saw. Before and after drive the same path on the same seeds.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.batch import run_batch
from hil_sim.lockstep import SteppedLink
from hil_sim.studies.autotune_link import CABLE, Way, reached_robot
from hil_sim.studies.drawn_robots import DrawnRobot, draw_robot
from omniwheel.autotune.design import CHANGED
from omniwheel.autotune.procedure import Outcome, Settings, autotune
from omniwheel.autotune.sweep import sweep
from omniwheel.errors import OmniError
from omniwheel.robot import Robot
from omniwheel.tuning import ExperimentError
from omniwheel.wheel_loop import Margins, loaded, loop_of, motor_of

FRESH_SEED = 1_000_000
"""The first seed that robots are judged by; the tuning's world has the robot's own seed."""
JUDGING_RUNS = 16
SWEEP_ROOM_M = 2.0
MARGIN_SIDES = ("model", "promised", "measured")
"""What the model says of a margin, what autotune promises after its own sweep, and what a later sweep shows."""
TEXT = 160

ROW = np.dtype(
    [
        ("seed", "<u8"),
        ("outcome", "S16"),
        ("why", f"S{TEXT}"),
        ("hardly_damped", "<f8"),
        ("share", "<f8"),
        ("wheels", "<f8"),
        ("counts", "<f8"),
        ("top_m_s", "<f8"),
        ("simulated_s", "<f8"),
        ("wall_s", "<f8"),
        ("explained", "<f8"),
        *(
            (f"{name}_{side}", "<f8")
            for name in ("completed", "position_m", "theta_rad")
            for side in ("before", "after")
        ),
        *((f"{name}_worse", "<f8") for name in ("position", "theta")),
        *((f"{name}_{what}", "<f8") for name in ("position", "theta") for what in ("seen", "seen_half")),
        *((f"{name}_{side}", "<f8") for name in ("gain", "phase", "distance") for side in MARGIN_SIDES),
        ("margin_why", f"S{TEXT}"),
        *((f"{name}_{side}", "<f8") for name in CHANGED for side in ("before", "after")),
    ]
)
"""What is kept of a robot. ``outcome``: kept, reverted, refused (autotune said no) or stopped (a safety fault).

``why``: the error, or what autotune's choice rests on. ``hardly_damped``: the old values
have less than half of the margins. ``share``: of the limits, at which both were compared last. ``position_worse``:
lower end of the 95 % interval by which the figure grew, paired by seed; above 0: worse. ``position_seen``: by which
share of itself the robot saw it grow while it was tuned, and half of that interval.
"""


@dataclass
class Trial:
    """A robot's tuning as far as it went."""

    outcome: Outcome | None = None
    error: OmniError | None = None
    stopped: bool = False
    parameters: dict[str, float] = field(default_factory=dict)
    before: dict[str, float] = field(default_factory=dict)
    simulated_s: float = 0.0
    measured: Margins | None = None
    margin_error: str = ""


@contextmanager
def waiting_robot(drawn: DrawnRobot, way: Way = CABLE) -> Iterator[tuple[Robot, SteppedLink]]:
    """Start the firmware with the wrong robot file in the true robot's world; it advances while a caller waits."""
    with reached_robot(drawn.tuning_scenario(), way) as found:
        yield found


def tune(
    drawn: DrawnRobot, settings: Settings, tell: Callable[[str], None] = lambda _: None, way: Way = CABLE
) -> Trial:
    """Tune a robot; the margins of the new values are measured afterwards, whether it keeps them or not."""
    trial = Trial()
    with waiting_robot(drawn, way) as (robot, link):
        trial.before = {name: robot.parameters[name] for name in CHANGED}
        try:
            trial.outcome = autotune(robot, settings, True, tell)
        except OmniError as error:
            trial.error = error
            trial.stopped = isinstance(error, ExperimentError)
        trial.simulated_s = link.clock_s()
        robot.parameters.forget()
        trial.parameters = {name: robot.parameters[name] for name in CHANGED}
        if trial.outcome is not None:
            trial.measured, trial.margin_error = _measured_margins(robot, trial.outcome.new)
    return trial


def _measured_margins(robot: Robot, values: Mapping[str, float]) -> tuple[Margins | None, str]:
    """Return the margins of these values, turning, as another sweep shows them; or why it does not."""
    try:
        robot.parameters.set_many(values)
        found = sweep(robot, SWEEP_ROOM_M, lambda _: None)
    except OmniError as error:
        return None, str(error)
    return found.margins, found.why


def modelled_margins(drawn: DrawnRobot, outcome: Outcome) -> Margins:
    """Return what autotune's model says of the loop that is swept."""
    values = {**drawn.tuning_scenario().parameter_values(), **outcome.new}
    loop = loop_of(values, loaded(motor_of(values), outcome.design.measured.turning))
    return loop.margins(values["WS_P"], values["WS_I"])


def judge(drawn: DrawnRobot, parameters: Mapping[str, float], runs: int = JUDGING_RUNS) -> NDArray[Any]:
    """Return the rows of fresh seeds with these parameters."""
    return run_batch(drawn.judging_scenario().with_parameters(parameters), FRESH_SEED, runs).rows


def robot_row(seed: int, task: tuple[Settings, Way]) -> NDArray[Any]:
    """Tune the robot of a seed with these settings in this way, judge it, and return its ROW."""
    settings, way = task
    started = time.perf_counter()
    row = np.zeros(1, ROW)
    for name in ROW.names or ():
        if row.dtype[name].kind == "f":
            row[name] = math.nan
    drawn = draw_robot(seed)
    trial = tune(drawn, settings, way=way)
    truth = drawn.truth.parameter_values()
    row["seed"], row["wheels"], row["counts"] = seed, drawn.truth.wheels, truth["ENC_CPR"]
    row["top_m_s"], row["simulated_s"] = truth["LIM_V"], trial.simulated_s
    row["outcome"] = _word(trial)
    row["why"] = str(trial.error or "").encode()[:TEXT]
    for name in CHANGED:
        row[f"{name}_before"], row[f"{name}_after"] = trial.before[name], trial.parameters[name]
    if trial.outcome is not None:
        row["explained"], row["hardly_damped"] = trial.outcome.design.fit.fit, trial.outcome.in_steps
        row["share"] = trial.outcome.compared.share
        row["why"] = trial.outcome.choice.why.encode()[:TEXT]
        for verdict in trial.outcome.verdicts:
            name = verdict.kind.key.partition("_")[0]
            row[f"{name}_seen"] = verdict.difference / verdict.before
            row[f"{name}_seen_half"] = verdict.half_width / verdict.before
    _fill_margins(row, drawn, trial)
    _fill_judgement(row, judge(drawn, trial.before), judge(drawn, trial.parameters))
    row["wall_s"] = time.perf_counter() - started
    return row


def _word(trial: Trial) -> str:
    if trial.outcome is not None:
        return "kept" if trial.outcome.kept else "reverted"
    return "stopped" if trial.stopped else "refused"


def _fill_margins(row: NDArray[Any], drawn: DrawnRobot, trial: Trial) -> None:
    row["margin_why"] = trial.margin_error.encode()[:TEXT]
    if trial.outcome is None or trial.measured is None:
        return
    model = modelled_margins(drawn, trial.outcome)
    sides = {"model": model, "promised": trial.outcome.swept.or_model(model), "measured": trial.measured}
    for side, found in sides.items():
        for name, value in (("gain", found.gain), ("phase", found.phase_rad), ("distance", found.distance)):
            row[f"{name}_{side}"] = value


def _fill_judgement(row: NDArray[Any], before: NDArray[Any], after: NDArray[Any]) -> None:
    both = (before["completed"] > 0.0) & (after["completed"] > 0.0)
    for side, rows in (("before", before), ("after", after)):
        row[f"completed_{side}"] = np.mean(rows["completed"])
        for name in ("position_m", "theta_rad"):
            row[f"{name}_{side}"] = np.mean(rows[name][both]) if np.any(both) else math.nan
    for name in ("position_m", "theta_rad"):
        row[f"{name.partition('_')[0]}_worse"] = grown(before[name][both], after[name][both])


def grown(before: NDArray[Any], after: NDArray[Any]) -> float:
    """Return the lower end of the 95 % interval by which a figure grew, paired by seed; NaN for less than two."""
    from omniwheel.identification.estimate import require_scipy

    difference = np.asarray(after - before, dtype=np.float64)
    if len(difference) < 2:
        return math.nan
    quantile = float(require_scipy("special").stdtrit(len(difference) - 1, 0.975))
    return float(np.mean(difference) - quantile * np.std(difference, ddof=1) / math.sqrt(len(difference)))


def values_after(row: NDArray[Any]) -> dict[str, float]:
    """Return the parameters that a robot ended with."""
    return {name: float(row[f"{name}_after"]) for name in CHANGED}
