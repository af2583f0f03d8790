# SPDX-License-Identifier: MIT
"""What the body in the feed-forward brings on real wheels: ``python -m tests.hil_sim.feed_forward_page [--write]``.

Three robots drive their scenario's path, and starts and stops as hard as LIM_A allows. Each drives without and with
WS_FF_BODY, over the same seeds, with the wheel loops' gains as shipped and with a quarter of them. The table is in
docs/concepts/derivations/feed_forward.md.
"""

from __future__ import annotations

import sys
from dataclasses import astuple, dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil_sim.metrics import effort, on_path, pose_error, rmse
from hil_sim.runs import Run, run_in_process
from hil_sim.scenario import Event, Scenario, load_scenario
from tests.host.preset_page import SECONDS, WITHOUT_FIXES
from tests.page_tables import main, with_tables

PAGE = Path(__file__).parents[2] / "docs" / "concepts" / "derivations" / "feed_forward.md"
ROBOTS = {"three_wheel": "demo", "fast_three_wheel": "fast", "four_wheel": "demo"}
SEEDS = range(1, 5)
WEAKER = 0.25
LEG_S = 1.5
SPEED_SHARE = 0.6
"""Of LIM_V, in starts and stops, and no more than the wheels bear."""


@dataclass(frozen=True)
class Figures:
    """Of one robot, the mean over the seeds; currents and duties are the largest of all.

    Errors are root mean squares: of position [mm] and heading [mrad] on the path, of the true wheel speeds against
    what was asked for [rad/s] on the path and while starts and stops accelerate.
    """

    position_mm: float
    heading_mrad: float
    path_rad_s: float
    ramp_rad_s: float
    path_A: float
    ramp_A: float
    path_duty: float
    ramp_duty: float


def wheel_error(samples: NDArray[np.void], wheels: int) -> float:
    """Return the root mean square of true less wanted wheel speeds [rad/s]."""
    error = samples["wheel_rad_s"][:, :wheels] - samples["wheel_reference"][:, :wheels]
    return float(np.sqrt(np.mean(error**2)))


def ramps(robot: str) -> Scenario:
    """Return the scenario of starts and stops: there, back, sideways, a turn, and rest."""
    # Fixes make what is asked of the wheels jump, and that is not what is looked at here.
    scenario = load_scenario(WITHOUT_FIXES[ROBOTS[robot]], robot)
    values = scenario.parameter_values()
    reach = 0.8 * values["LIM_WHEEL"] * values["WHEEL_RADIUS"]
    speed = SPEED_SHARE * min(values["LIM_V"], reach)
    turn = SPEED_SHARE * min(values["LIM_W"], reach / values["WHEEL_DIST"])
    twists = ((speed, 0.0, 0.0), (-speed, 0.0, 0.0), (0.0, speed, 0.0), (0.0, 0.0, turn), (0.0, 0.0, 0.0))
    events = [Event(at_s=0.4, command="arm")]
    events += [Event(at_s=0.5 + LEG_S * number, velocity=twist) for number, twist in enumerate(twists)]
    return replace(scenario, events=tuple(events), duration_s=0.5 + LEG_S * len(twists))


def ramping(run: Run, wheels: int) -> NDArray[np.void]:
    """Return the samples in which the wanted wheel speeds change."""
    record = run.record
    change = np.abs(np.diff(record["wheel_reference"][:, :wheels], axis=0, prepend=np.nan)).max(axis=1)
    chosen: NDArray[np.void] = record[
        np.isfinite(change) & (change > 0.2 * np.nanmax(change)) & (record["time_s"] > 0.5)
    ]
    return chosen


def driven(scenario: Scenario, seed: int, body: float, gain: float) -> Run:
    """Drive with this share of the body in the feed-forward, and this share of the wheel loops' gains."""
    values = scenario.parameter_values()
    changed = {"WS_FF_BODY": body, **{name: gain * values[name] for name in ("WS_P", "WS_I")}}
    return run_in_process(scenario.with_seed(seed).with_parameters(changed))


@cache
def figures(robot: str, body: float, gain: float = 1.0) -> Figures:
    """Drive a robot on all seeds."""
    path = load_scenario(ROBOTS[robot], robot).with_duration(SECONDS[ROBOTS[robot]])
    wheels = path.robot.wheels
    found = []
    for seed in SEEDS:
        record = driven(path, seed, body, gain).record
        way = record[on_path(record)]
        error = rmse(pose_error(way.copy()))
        hard = ramping(driven(ramps(robot), seed, body, gain), wheels)
        currents = [float(np.abs(samples["current_A"]).max()) for samples in (way, hard)]
        duties = [effort(record, wheels).peak_duty, float(np.abs(hard["duty"]).max())]
        errors = (1e3 * error.position_m, 1e3 * error.theta_rad, wheel_error(way, wheels), wheel_error(hard, wheels))
        found.append((*errors, *currents, *duties))
    means, most = np.mean(found, axis=0), np.max(found, axis=0)
    return Figures(*map(float, (*means[:4], *most[4:])))


def table() -> list[str]:
    """Return the lines of the table: each cell without and with the body."""
    lines = [
        "| robot | `WS_P`, `WS_I` | position, mm | heading, mrad | wheel speeds, rad/s | the same, starts and stops "
        "| largest current, A | the same, starts and stops | largest duty | the same, starts and stops |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    digits = (2, 2, 3, 3, 2, 2, 2, 2)
    for robot in ROBOTS:
        for gain, words in ((1.0, "as shipped"), (WEAKER, "a quarter")):
            pairs = zip(*(astuple(figures(robot, body, gain)) for body in (0.0, 1.0)), digits, strict=True)
            cells = [f"{without:.{digit}f} → {with_it:.{digit}f}" for without, with_it, digit in pairs]
            lines.append(f"| `{robot}` | {words} | {' | '.join(cells)} |")
    return lines


def tables() -> dict[str, list[str]]:
    """Return the table with the name of its place in the page."""
    return {"feed-forward": table()}


def written() -> str:
    """Return the page with the table of fresh runs."""
    return with_tables(PAGE, tables())


if __name__ == "__main__":
    sys.exit(main("tests.hil_sim.feed_forward_page", __doc__, PAGE, tables))
