# SPDX-License-Identifier: MIT
"""How near the robot's pose estimate comes to the best that any causal filter could do in its world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.batch import run_batches
from hil_sim.c_scenario import scenario_world
from hil_sim.dispersion import WIDEST
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import IDEAL_WHEELS
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.posterior_bound import (
    STEP_S,
    STEP_TICKS,
    Array,
    BoundError,
    Statistics,
    Wheels,
    bound_variances,
    motion_gains,
)
from omni_reproduce.reachable_filter import Filter, Readings, filter_errors, measure, together

NAME = "limits"
WHEELS: Mapping[str, bool] = {"ideal": True, "real": False}
"""The two kinds of wheels, and whether they are ideal."""
AXES, UNITS = ("position", "heading"), ("mm", "mrad")
BOUNDS_SHARE = 0.4
"""Of the time that all takes, that of the bounds."""
FAR = 1.1
"""A filter that knows and is farther than this from the bound does not show that it can be reached."""
GYRO_STEPS = 32768.0
"""Steps of a gyro's range, from sensor_gyro.c."""


@dataclass(frozen=True)
class Driven:
    """Paths that robots drove in one setting on ideal wheels, and what they measured.

    ``moves`` and ``gains`` are those of ``motion_gains``. ``on_path`` (paths, steps) says which steps count.
    """

    wheels: Wheels
    statistics: Statistics
    moves: Array
    gains: Array
    readings: Readings
    on_path: NDArray[np.bool_]


@dataclass(frozen=True)
class Figures:
    """Root mean squares of position [mm] and heading [mrad] of one setting on one kind of wheels.

    ``bound`` and ``told`` (2,): over the paths, always on ideal wheels. ``reached`` (seeds, 2): of each run.
    """

    bound: Array
    told: Array
    reached: Array

    @property
    def rms(self) -> Array:
        """What the robot's estimate reaches over all seeds, (2,)."""
        return np.asarray(np.sqrt(np.mean(self.reached**2, axis=0)))

    @property
    def ratio(self) -> Array:
        """That over the bound, (2,)."""
        return self.rms / self.bound


def run(context: Context) -> Result:
    """Drive every setting on both kinds of wheels; rows are the estimate and a filter that knows, beside the bound."""
    spec = read_spec(NAME)
    head = spec["experiment"]
    seeds = context.count(head["seeds"], head["quick_seeds"])
    paths = head["quick_paths"] if context.quick else head["paths"]
    keys = head["quick_settings"] if context.quick else list(spec["setting"])
    first = replace(context, progress=lambda share: context.progress(BOUNDS_SHARE * share))
    known = first.map(partial(bound_and_informed_filter, spec, paths=paths), keys)
    rows: list[Row] = []
    table: dict[tuple[str, str], Figures] = {}
    for key, (bound, told) in zip(keys, known, strict=True):
        for wheels in WHEELS:
            reached = reached_by_robot(scenario_of(spec, key, wheels), head["seed"], seeds, context.workers)
            table[key, wheels] = Figures(bound, told, reached)
            rows += _rows(spec, (key, wheels), table[key, wheels], paths)
            context.progress(BOUNDS_SHARE + (1.0 - BOUNDS_SHARE) * len(table) / (len(keys) * len(WHEELS)))
    return Result(tuple(rows), notes=_notes(spec, table, seeds, paths))


def scenario_of(spec: Mapping[str, Any], key: str, wheels: str) -> Scenario:
    """Return the scenario of a setting on one kind of wheels."""
    entry = spec["setting"][key]
    base = load_scenario(entry["scenario"])
    values = {name: base.robot.table[name].parse(NAME, name, v) for name, v in entry.get("parameters", {}).items()}
    world = {**entry.get("world", {}), **(IDEAL_WHEELS if WHEELS[wheels] else {})}
    return base.with_world(world).with_parameters(values)


def wheels_of(scenario: Scenario) -> tuple[Wheels, int]:
    """Return the wheels as the robot file has them, and the counts of an encoder per turn."""
    config = scenario_world(replace(scenario, dispersion=()))
    names = ("wheel_radius_m", "wheel_distance_m", "wheel_angle_rad")
    each = [np.array(list(getattr(config, name))[: config.wheels]) for name in names]
    return Wheels(*each), int(config.counts_per_revolution)


def statistics_of(scenario: Scenario, paths: int) -> Statistics:
    """Return what is random in a scenario's world; BoundError for a sensor that the bound does not know.

    A fix's noise that differs from robot to robot is spread evenly over the paths, from the least to the most.
    """
    config = scenario_world(replace(scenario, dispersion=()))
    if config.flow_rate_Hz > 0.0 and config.flow_turns:
        raise BoundError("flow_turns is 1: the bound knows ways over the floor only", hint="set world.flow_turns to 0")
    spread = {entry.quantity: entry for entry in scenario.dispersion}
    fix_sd = np.tile([config.fix_sd_xy_m, config.fix_sd_xy_m, config.fix_sd_theta_rad], (paths, 1))
    if "fix_sd_xy_m" in spread:
        entry = spread["fix_sd_xy_m"]
        fix_sd[:, :2] *= 1.0 + entry.low + (entry.high - entry.low) * ((np.arange(paths) + 0.5) / paths)[:, None]
    sds = [spread[name].sd if name in spread else 0.0 for name in ("wheel_radius_m", "wheel_distance_m")]
    angle_sd = spread["wheel_angle_rad"].sd if "wheel_angle_rad" in spread else 0.0
    cut = _sd_of_cut_normal()
    return Statistics(
        slip_max=config.slip_max,
        slip_time_s=config.slip_time_s,
        fix_rate_Hz=config.fix_rate_Hz,
        fix_sd=fix_sd,
        fix_delay_s=config.fix_delay_s,
        count_rad=2.0 * np.pi / config.counts_per_revolution,
        wheel_sd=(cut * sds[0], cut * sds[1], cut * angle_sd),
        gyro_step_variance=_gyro_step_variance(config),
        gyro_bias_sd=config.gyro_bias_rad_s,
        gyro_bias_walk=config.gyro_bias_walk,
        flow_rate_Hz=config.flow_rate_Hz,
        flow_sd=config.flow_sd_m,
        flow_share=config.flow_share,
    )


def _sd_of_cut_normal() -> float:
    """Return the standard deviation of a standard normal variable that is drawn again beyond WIDEST."""
    normal = NormalDist()
    inside = normal.cdf(WIDEST) - normal.cdf(-WIDEST)
    return float(np.sqrt(1.0 - 2.0 * WIDEST * normal.pdf(WIDEST) / inside))


def _gyro_step_variance(config: Any) -> float:
    """Return the variance [rad^2] of the turn in STEP_S: white noise, and each reading rounded."""
    if config.gyro_rate_Hz <= 0.0:
        return 0.0
    rounded = (config.gyro_range_rad_s / GYRO_STEPS) ** 2 / 12.0 / config.gyro_rate_Hz
    return float((config.gyro_noise_density**2 + rounded) * STEP_S)


def drive(spec: Mapping[str, Any], key: str, paths: int) -> Driven:
    """Drive a setting on ideal wheels, with a seed per path."""
    scenario = scenario_of(spec, key, "ideal")
    wheels, counts = wheels_of(scenario)
    statistics = statistics_of(scenario, paths)
    first = spec["experiment"]["seed"]
    moved, read, chosen = [], [], []
    for path in range(paths):
        record = run_in_process(scenario, first + path).record
        own = replace(statistics, fix_sd=statistics.fix_sd[path])
        moved.append(motion_gains(record, wheels, own))
        read.append(measure(record, wheels, own, counts, first + path))
        chosen.append(metrics.on_path(record)[:-1:STEP_TICKS])
    readings = together(read)
    steps = readings.turned.shape[1]
    moves, gains = (np.stack([part[kind][:steps] for part in moved]) for kind in (0, 1))
    return Driven(wheels, statistics, moves, gains, readings, np.stack([mask[:steps] for mask in chosen]))


def bound_of(driven: Driven) -> Array:
    """Return the bound, (position, heading) in mm and mrad, RMS over the paths."""
    variances = bound_variances(driven.moves, driven.gains, driven.wheels.count, driven.statistics)
    return rms(variances[driven.on_path])


def reached_by_filter(robot: Filter, driven: Driven) -> Array:
    """Return the errors of a filter of NumPy's on the same paths, as those of the bound."""
    return rms(filter_errors(robot, driven.readings)[driven.on_path])


def bound_and_informed_filter(spec: Mapping[str, Any], key: str, paths: int) -> tuple[Array, Array]:
    """Return bound and what the filter that knows reaches, each (position, heading) in mm and mrad, RMS over paths.

    Both are for ideal wheels.
    """
    driven = drive(spec, key, paths)
    return bound_of(driven), reached_by_filter(Filter(paths, driven.wheels, driven.statistics), driven)


def rms(squares: Array) -> Array:
    """Return the root mean squares of position [mm] and heading [mrad] of squared errors (n, 3) in m^2 and rad^2."""
    x, y, theta = squares.mean(axis=0)
    return 1e3 * np.sqrt([x + y, theta])


def reached_by_robot(scenario: Scenario, first_seed: int, seeds: int, workers: int) -> Array:
    """Return the RMS errors of the robot's estimate, (seeds, 2) in mm and mrad."""
    rows: list[NDArray[Any]] = [batch.rows for batch in run_batches(scenario, first_seed, seeds, workers)]
    every = np.concatenate(rows)
    return 1e3 * np.stack([every["estimate_position_m"], every["estimate_theta_rad"]], axis=1)


def _rows(spec: Mapping[str, Any], case: tuple[str, str], figures: Figures, paths: int) -> list[Row]:
    title = f"{spec['setting'][case[0]]['title']}, {case[1]} wheels"
    why = spec["explanation"]
    rows = []
    for axis, (name, unit) in enumerate(zip(AXES, UNITS, strict=True)):
        limit = float(figures.bound[axis])
        own = figures.reached[:, axis]
        mean, sd = float(figures.rms[axis]), float(own.std(ddof=1))
        text = why[case[1]].format(paths=paths)
        rows.append(Row(NAME, title, f"{name}, robot", unit, mean, sd, len(own), limit=limit, explanation=text))
        if WHEELS[case[1]]:
            told, text = float(figures.told[axis]), why["told"]
            quantity = f"{name}, filter that knows"
            rows.append(Row(NAME, title, quantity, unit, told, None, paths, limit=limit, explanation=text))
    return rows


def _notes(
    spec: Mapping[str, Any], table: Mapping[tuple[str, str], Figures], seeds: int, paths: int
) -> tuple[str, ...]:
    words = spec["notes"]
    return (
        words["what"].format(paths=paths, seeds=seeds),
        words["left_out"].format(counts_mm=1e3 * rounding_m(scenario_of(spec, "demo", "ideal"))),
        words["real"],
        _table(spec, table),
        *(
            f"**{spec['setting'][key]['title']}.** {_beside(entry, table[key, 'ideal'])}"
            for key, entry in spec["quoted"].items()
        ),
        verdict(spec, table),
        words["creep"],
    )


def rounding_m(scenario: Scenario) -> float:
    """Return the standard deviation [m] of what a wheel has rolled, by the rounding of its angle to counts."""
    wheels, counts = wheels_of(scenario)
    return float(wheels.radius_m.max() * 2.0 * np.pi / counts / np.sqrt(12.0))


def _table(spec: Mapping[str, Any], table: Mapping[tuple[str, str], Figures]) -> str:
    lines = [
        "| setting | bound, ideal wheels | robot, ideal wheels | over the bound | real wheels | over that bound |",
        "|---|---|---|---|---|---|",
    ]
    for key in _settings(table):
        ideal, real = table[key, "ideal"], table[key, "real"]
        cells = [_pair(ideal.bound), _pair(ideal.rms), _pair(ideal.ratio), _pair(real.rms), _pair(real.ratio)]
        lines.append(f"| {spec['setting'][key]['title']} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _settings(table: Mapping[tuple[str, str], Figures]) -> list[str]:
    """Return the settings that were driven, in their order."""
    return list(dict.fromkeys(key for key, _ in table))


def _pair(values: Array) -> str:
    return f"{values[0]:.2f} / {values[1]:.2f}"


def _beside(quoted: Mapping[str, Any], ours: Figures) -> str:
    text = (
        f"Readers outside of the project computed a bound of {_pair(quoted['bound'])}; here it is {_pair(ours.bound)}"
    )
    if "reached" in quoted:
        theirs = np.array(quoted["reached"])
        text += (
            f". They found the robot at {_pair(theirs)}, which is {_pair(theirs / np.array(quoted['bound']))} of their "
            f"bound. Here it is at {_pair(ours.rms)}, which is {_pair(ours.ratio)} of the bound"
        )
    return f"{text} (ideal wheels, mm / mrad)."


def verdict(spec: Mapping[str, Any], table: Mapping[tuple[str, str], Figures]) -> str:
    """Return where the robot's estimate is nearest to the bound and farthest, and what a filter that knows adds."""
    ideal = {key: table[key, "ideal"] for key in _settings(table)}
    parts = []
    for axis, name in enumerate(AXES):
        order = sorted(ideal, key=lambda key, axis=axis: float(ideal[key].ratio[axis]))  # type: ignore[misc]
        ends = [f"{ideal[key].ratio[axis]:.2f} ({spec['setting'][key]['title']})" for key in (order[0], order[-1])]
        parts.append(f"in {name} from {ends[0]} to {ends[1]} times the bound")
    told = np.array([entry.told / entry.bound for entry in ideal.values()])
    far = [spec["setting"][key]["title"] for key, entry in ideal.items() if (entry.told > FAR * entry.bound).any()]
    reached = f"It is farther than {FAR:g} times only in: {', '.join(far)}" if far else "So the bound can be reached"
    return (
        f"**Verdict.** On ideal wheels the robot's estimate is {' and '.join(parts)}. The filter that knows is from "
        f"{told.min():.2f} to {told.max():.2f} times the bound. {reached}."
    )
