# SPDX-License-Identifier: MIT
"""Twenty manoeuvres in our simulated world and in MuJoCo: how far two physics engines agree on one robot file.

Closed loop, each world is driven by the control core, with pose fixes and without. Open loop, the bridge voltages of
our run without fixes are played to both. It needs the extra ``mujoco``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.hil import run_hil
from hil_sim.mujoco_world import MujocoWorld
from hil_sim.processes import worker_pool
from hil_sim.runs import new_world, run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omni_reproduce.experiment import Context, Result, Row, read_spec

Array = NDArray[np.float64]

NAME = "physics"
TICK_S = 1e-3
TRANSIT_S = 30.0
"""Within this time every robot has come to where its path begins."""
FIXES, DEAD, END = "tracking RMSE, fixes", "tracking RMSE, no fixes", "dead reckoning at the end"
SPEEDS, RIPPLE, SLIP, AIR = "wheel speeds", "yaw ripple", "slipping wheels", "wheels in the air"
QUANTITIES = {FIXES: "mm", DEAD: "mm", END: "mm", SPEEDS: "rad/s", RIPPLE: "mrad/s", SLIP: "1", AIR: "1"}
LEAST = {FIXES: 0.02, DEAD: 0.02, END: 0.02, SPEEDS: 1e-3, RIPPLE: 1.0, SLIP: 0.01, AIR: 0.01}
"""In the quantity's unit: two figures that are nearer than this agree, whatever their ratio."""


@dataclass(frozen=True)
class Case:
    """``driven_s`` of a manoeuvre of a robot on a floor. The seed is that of fixes and of how the wheels stand."""

    robot: str
    floor: str
    manoeuvre: str
    seed: int
    driven_s: float


def run(context: Context) -> Result:
    """Run every case in both worlds; rows have the medians over a robot's cases, and how many cases agree."""
    spec = read_spec(NAME)
    if find_spec("mujoco") is None:
        missing = "Not run: it needs MuJoCo. pip install 'omniwheel[mujoco]'"
        return Result((Row(NAME, "not run", FIXES, QUANTITIES[FIXES], None, explanation=missing),))
    head, quick = spec["experiment"], context.quick
    cases = [
        Case(robot, floor, manoeuvre, head["seed"], head["quick_s"] if quick else head["longest_s"])
        for robot in spec["robot"]
        for floor in (head["quick_floors"] if quick else spec["floor"])
        for manoeuvre in (head["quick_manoeuvres"] if quick else spec["manoeuvre"])
    ]
    pairs = list(zip(cases, context.map(both, cases), strict=True))
    rows: list[Row] = []
    for robot in spec["robot"]:
        of_robot = [pair for case, pair in pairs if case.robot == robot]
        for quantity in QUANTITIES:
            rows += _rows(spec, robot, quantity, of_robot)
    return Result(tuple(rows), (), (_floors(spec, pairs),))


def both(case: Case) -> tuple[dict[str, float], dict[str, float]]:
    """Return every quantity of a case in our world and in MuJoCo, in the units of QUANTITIES."""
    spec = read_spec(NAME)
    with_fixes, scenario = (scenario_of(spec, case, fixes=fixes) for fixes in (True, False))
    given = run_in_process(scenario).record
    return _ours(spec, with_fixes, scenario, given), _theirs(spec, with_fixes, scenario, given)


def ours(case: Case) -> dict[str, float]:
    """Return every quantity in our world."""
    spec = read_spec(NAME)
    with_fixes, scenario = (scenario_of(spec, case, fixes=fixes) for fixes in (True, False))
    return _ours(spec, with_fixes, scenario, run_in_process(scenario).record)


def _ours(spec: Mapping[str, Any], with_fixes: Scenario, scenario: Scenario, dead: NDArray[Any]) -> dict[str, float]:
    """``dead``: our run without fixes."""
    fixed = run_in_process(with_fixes).record
    world = new_world(scenario)
    battery_V = float(world.c.config.battery_V)
    loads = []
    for duty, armed in duties(dead, world.wheels):
        if armed:
            world.drive_voltage(battery_V * duty)
        world.step()
        loads.append(list(world.c.load_N)[: world.wheels])
    return {**_closed(fixed, dead), **_open(spec, scenario, dead, np.array(loads))}


def _theirs(spec: Mapping[str, Any], with_fixes: Scenario, scenario: Scenario, given: NDArray[Any]) -> dict[str, float]:
    """The open loop gets the duties of ``given``, our run without fixes."""
    fixed = run_hil(with_fixes, world=MujocoWorld(with_fixes)).record
    dead = run_hil(scenario, world=MujocoWorld(scenario)).record
    world, played, loads = MujocoWorld(scenario), given.copy(), []
    wheels = scenario.robot.wheels
    for number, (duty, armed) in enumerate(duties(given, wheels)):
        played["truth"][number] = world.pose
        played["wheel_rad_s"][number, :wheels] = world.sense().wheel_rad_s
        world.apply(tuple(duty), (0.0 if armed else 1.0,) * wheels)
        world.step()
        loads.append(world.wheel_load_N)
    return {**_closed(fixed, dead), **_open(spec, scenario, played, np.array(loads))}


def scenario_of(spec: Mapping[str, Any], case: Case, *, fixes: bool) -> Scenario:
    """Return what both worlds run: the manoeuvre on real wheels, without imposed slip and without sag."""
    head, size = spec["experiment"], spec["robot"][case.robot]
    base = load_scenario("demo" if fixes else "no_slip", case.robot)
    given = {
        "TRJ_LAPS": 1.0,
        "TRJ_SCALE": True,
        "TRJ_RAMP": 1.0,
        "TRJ_SIZE": size["size_m"],
        "TRJ_PERIOD": size["period_s"],
        **spec["manoeuvre"][case.manoeuvre],
    }
    values = {name: base.robot.table[name].parse(NAME, name, value) for name, value in given.items()}
    radius_m = base.robot.geometry["wheel_radius_m"]
    world = {
        **spec["wheels"],
        **{name: radii * radius_m for name, radii in spec["wheels_by_radius"].items()},
        **spec["floor"][case.floor],
        "slip_max": 0.0,
        "battery_resistance_ohm": 0.0,
        "fix_rate_Hz": head["fix_rate_Hz"] if fixes else 0.0,
    }
    scenario = base.with_parameters(values).with_world(world).with_seed(case.seed)
    scenario = replace(scenario, start_pose=(0.0, 0.0, 0.0)).with_duration(TRANSIT_S)
    begins = np.flatnonzero(metrics.on_path(run_in_process(scenario).record))[0]
    return scenario.with_duration(float(begins * TICK_S + case.driven_s))


def duties(record: NDArray[Any], wheels: int) -> Iterator[tuple[Array, bool]]:
    """Yield the bridge duties of each tick, -1..1 per wheel, and whether the robot is armed; else its motors coast."""
    return zip(record["duty"][:, :wheels], record["state"] == metrics.STATE_ARMED, strict=True)


def _closed(fixed: NDArray[Any], dead: NDArray[Any]) -> dict[str, float]:
    last = dead[metrics.on_path(dead)][-1]
    drift = last["estimate"] - last["truth"]
    return {
        FIXES: 1e3 * metrics.tracking_rmse(fixed).position_m,
        DEAD: 1e3 * metrics.tracking_rmse(dead).position_m,
        END: 1e3 * float(np.hypot(drift[0], drift[1])),
    }


def _open(spec: Mapping[str, Any], scenario: Scenario, record: NDArray[Any], loads: Array) -> dict[str, float]:
    """Return what wheels and body did under given duties: ``record`` has their speeds and poses, one row per tick."""
    head, wheels, path = spec["experiment"], scenario.robot.wheels, metrics.on_path(record)[:-1]
    geometry = scenario.robot.geometry
    rates = np.diff(record["truth"], axis=0) / TICK_S
    middle = 0.5 * (record["truth"][1:, 2] + record["truth"][:-1, 2])
    rims = geometry["wheel_radius_m"] * 0.5 * (record["wheel_rad_s"][1:, :wheels] + record["wheel_rad_s"][:-1, :wheels])
    angles = middle[:, None] + np.radians(geometry["wheel_angle_deg"])
    along = rates[:, :1] * -np.sin(angles) + rates[:, 1:2] * np.cos(angles)
    floor = along + geometry["wheel_distance_m"] * rates[:, 2:]
    slipping = np.abs(rims - floor)[path] > head["slip_share"] * np.abs(rims[path]).max()
    width = round(head["ripple_s"] / TICK_S)
    smooth = np.convolve(rates[:, 2], np.full(width, 1.0 / width), mode="same")
    return {
        SPEEDS: float(np.sqrt(np.mean(record["wheel_rad_s"][:-1, :wheels][path] ** 2))),
        RIPPLE: 1e3 * float(np.std((rates[:, 2] - smooth)[path])),
        SLIP: float(np.mean(slipping)),
        AIR: float(np.mean(loads[:-1][path] == 0.0)),
    }


def agree(spec: Mapping[str, Any], quantity: str, our: float, their: float) -> bool:
    """Return whether two figures of a quantity are as near as wanted."""
    return bool(abs(our - their) <= max(spec["wanted"][quantity] * abs(their), LEAST[quantity]))


def _rows(
    spec: Mapping[str, Any], robot: str, quantity: str, pairs: list[tuple[dict[str, float], dict[str, float]]]
) -> list[Row]:
    our, their = (np.array([pair[world][quantity] for pair in pairs]) for world in (0, 1))
    share = np.mean([agree(spec, quantity, a, b) for a, b in zip(our, their, strict=True)])
    unit, within = QUANTITIES[quantity], f"{quantity}: cases within {100 * spec['wanted'][quantity]:.0f} %"
    why = spec["explanation"].get(robot, {}).get(quantity, "")
    told = f"predicted, with other seeds: {spec['prediction'][robot][quantity]:.3g}"
    return [
        Row(NAME, robot, f"{quantity}, our world", unit, float(np.median(our)), explanation=told),
        Row(NAME, robot, f"{quantity}, MuJoCo", unit, float(np.median(their))),
        Row(NAME, robot, within, "%", 100.0 * float(share), explanation=why),
    ]


def _floors(spec: Mapping[str, Any], pairs: list[tuple[Case, tuple[dict[str, float], dict[str, float]]]]) -> str:
    lines = ["Medians over the manoeuvres, ours / MuJoCo's:", ""]
    lines += [f"| robot | floor | {' | '.join(f'{name} [{unit}]' for name, unit in QUANTITIES.items())} |"]
    lines += [f"|{'---|' * (2 + len(QUANTITIES))}"]
    for robot in spec["robot"]:
        for floor in spec["floor"]:
            found = [pair for case, pair in pairs if (case.robot, case.floor) == (robot, floor)]
            if not found:
                continue
            cells = [
                " / ".join(f"{np.median([pair[world][name] for pair in found]):.3g}" for world in (0, 1))
                for name in QUANTITIES
            ]
            lines.append(f"| {robot} | {floor} | {' | '.join(cells)} |")
    return "\n".join(lines)


def predict(context: Context) -> dict[str, dict[str, float]]:
    """Return what our world says before MuJoCo is asked: medians over manoeuvres, floors and the prediction's seeds."""
    spec = read_spec(NAME)
    found = {}
    for robot in spec["robot"]:
        cases = [
            Case(robot, floor, manoeuvre, seed, spec["experiment"]["longest_s"])
            for floor in spec["floor"]
            for manoeuvre in spec["manoeuvre"]
            for seed in spec["prediction"]["seeds"]
        ]
        answers = context.map(ours, cases)
        found[robot] = {name: round(float(np.median([entry[name] for entry in answers])), 4) for name in QUANTITIES}
    return found


def main() -> None:
    """Print the prediction, as it stands in experiments/physics.toml."""
    with worker_pool() as pool:
        found = predict(Context(Path(), pool=pool))
    for robot, figures in found.items():
        lines = [f"[prediction.{robot}]", *(f'"{name}" = {figure}' for name, figure in figures.items())]
        sys.stdout.write("\n".join(lines) + "\n\n")


if __name__ == "__main__":
    main()
