# SPDX-License-Identifier: MIT
"""What the body in the feed-forward brings on real wheels: ``python -m tests.hil_sim.feed_forward_page [--write]``.

Three robots drive their scenario's path, and starts and stops as hard as LIM_A allows. Each drives without and with
WS_FF_BODY, over the same seeds. The table is in docs/concepts/derivations/feed_forward.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil_sim.metrics import effort, on_path, rmse, pose_error
from hil_sim.runs import Run, run_in_process
from hil_sim.scenario import Event, Scenario, load_scenario
from tests.parity.budget_page import replace_block

PAGE = Path(__file__).parents[2] / "docs" / "concepts" / "derivations" / "feed_forward.md"
ROBOTS = {"three_wheel": "demo", "fast_three_wheel": "fast", "four_wheel": "demo"}
SECONDS = {"demo": 40.0, "fast": 20.0}
SEEDS = range(1, 9)
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
    scenario = load_scenario(ROBOTS[robot], robot)
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
    chosen: NDArray[np.void] = record[np.isfinite(change) & (change > 0.2 * np.nanmax(change)) & (record["time_s"] > 0.5)]
    return chosen


def driven(scenario: Scenario, seed: int, body: float) -> Run:
    """Drive with this share of the body in the feed-forward."""
    return run_in_process(scenario.with_seed(seed).with_parameters({"WS_FF_BODY": body}))


@cache
def figures(robot: str, body: float, seeds: Sequence[int] = SEEDS) -> Figures:
    """Drive a robot on all seeds."""
    path = load_scenario(ROBOTS[robot], robot).with_duration(SECONDS[ROBOTS[robot]])
    wheels = path.robot.wheels
    found = []
    for seed in seeds:
        record = driven(path, seed, body).record
        way = record[on_path(record)]
        error = rmse(pose_error(way.copy()))
        hard = ramping(driven(ramps(robot), seed, body), wheels)
        currents = [float(np.abs(samples["current_A"]).max()) for samples in (way, hard)]
        duties = [effort(record, wheels).peak_duty, float(np.abs(hard["duty"]).max())]
        errors = (1e3 * error.position_m, 1e3 * error.theta_rad, wheel_error(way, wheels), wheel_error(hard, wheels))
        found.append((*errors, *currents, *duties))
    means, most = np.mean(found, axis=0), np.max(found, axis=0)
    return Figures(*map(float, (*means[:4], *most[4:])))


def table() -> list[str]:
    """Return the lines of the table."""
    lines = [
        "| robot | `WS_FF_BODY` | position, mm | heading, mrad | wheel speed, rad/s | the same, starts and stops "
        "| largest current, A | largest duty |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for robot in ROBOTS:
        for body in (0.0, 1.0):
            f = figures(robot, body)
            lines.append(
                f"| `{robot}` | {body:g} | {f.position_mm:.2f} | {f.heading_mrad:.2f} | {f.path_rad_s:.3f} "
                f"| {f.ramp_rad_s:.3f} | {f.path_A:.2f} / {f.ramp_A:.2f} | {f.path_duty:.2f} / {f.ramp_duty:.2f} |"
            )
    return lines


def written() -> str:
    """Return the page with the table of fresh runs."""
    return replace_block(PAGE.read_text(encoding="utf-8"), "feed-forward", table())


def main() -> int:
    """Print the page's table, or write it into the page."""
    what = (__doc__ or "").split(":")[0]
    parser = argparse.ArgumentParser(prog="python -m tests.hil_sim.feed_forward_page", description=what)
    parser.add_argument("--write", action="store_true", help="write the table into the page")
    if parser.parse_args().write:
        PAGE.write_text(written(), encoding="utf-8")
    else:
        sys.stdout.write("\n".join(table()) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
