# SPDX-License-Identifier: MIT
"""Figures 5 to 8: direct torque control of the slip-space plant: rose, random points, and slippery floors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hil_sim.world import GRAVITY_M_S2
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.torque_loop import TICK_S, Array, Case, Law, Trace, goals_of, law_of, simulate
from omni_reproduce.torque_pictures import draw_points, draw_rose, draw_slippery

NAME = "direct_torque"
MM, MRAD = 1e3, 1e3


@dataclass(frozen=True)
class Settling:
    """Per point: time [s] until the distance stays below a share of what it was, and overshoot as share of the way."""

    time_s: Array
    overshoot: Array


def run(context: Context) -> Result:
    """Run rose, random points and slippery floors; a row is one figure of one law."""
    spec = read_spec(NAME)
    cases = list(_cases(context, spec))
    traces = dict(zip(cases, context.map(partial(simulate, spec), cases), strict=True))
    rows = [*_rose_rows(spec, traces), *_points_rows(spec, traces), *_slippery_rows(spec, traces)]
    return Result(tuple(rows), tuple(_draw(spec, traces, context.folder)), _notes(spec))


def _cases(context: Context, spec: Mapping[str, Any]) -> Iterable[Case]:
    head, path, slippery = spec["experiment"], spec["rose"], spec["slippery"]
    quick = "quick_" if context.quick else ""
    grip = spec["robot"]["friction_coefficient"]
    for law in path["laws"]:
        friction = path["printed_friction_coefficient"] if law == "printed" else grip
        yield Case(law, "rose", friction, path[f"{quick}laps"] * path["period_s"])
    for law in slippery["laws"]:
        for friction in slippery[f"{quick}friction_coefficients"]:
            yield Case(law, "slippery", friction, slippery[f"{quick}duration_s"])
    for part, law in _point_parts(spec):
        for seed in range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"])):
            duration_s = spec["points"]["count"] * spec["points"]["every_s"]
            yield Case(law, part, spec["points"][part]["friction_coefficient"], duration_s, seed)


def _point_parts(spec: Mapping[str, Any]) -> list[tuple[str, str]]:
    parts = {name: part for name, part in spec["points"].items() if isinstance(part, dict)}
    return [(name, law) for name, part in parts.items() for law in part["laws"]]


def settling(trace: Trace, every_s: float, share: float) -> Settling:
    """Judge a run to random points; a point that is not reached in its time counts with the whole of it."""
    times, overshoots = [], []
    legs = np.floor(trace.time_s / every_s + 1e-9).astype(int)
    step_s = trace.time_s[1] - trace.time_s[0]
    for leg in range(legs[-1] + 1):
        error = trace.error[legs == leg, :2]
        distance = np.hypot(error[:, 0], error[:, 1])
        beyond = np.flatnonzero(distance > share * distance[0])
        times.append(step_s * (beyond[-1] + 1))
        overshoots.append(max(float((error @ -error[0]).max()) / distance[0] ** 2, 0.0))
    return Settling(np.array(times), np.array(overshoots))


def settling_of_gains(kp: float, kd: float, share: float) -> float:
    """Return when e'' = -kd e' - kp e, from rest, stays below ``share`` of where it began [s]."""
    roots = np.roots([1.0, kd, kp]).astype(complex)
    time_s = np.linspace(0.0, 10.0 / np.abs(roots.real).min(), 20_001)
    if abs(roots[0] - roots[1]) < 1e-6:
        error = (1.0 - roots[0] * time_s) * np.exp(roots[0] * time_s)
    else:
        error = (roots[1] * np.exp(roots[0] * time_s) - roots[0] * np.exp(roots[1] * time_s)) / (roots[1] - roots[0])
    return float(time_s[np.flatnonzero(np.abs(error.real) > share)[-1] + 1])


def growth_of_gains(law: Law) -> float:
    """Return the rate of the faster root of e'' = -kd e' - kp e [1/s] where e'' is held for the law's period."""
    step_s = law.period_s
    held = np.array([[1.0, step_s], [0.0, 1.0]]) - np.outer([0.5 * step_s**2, step_s], [law.kp, law.kd])
    return float(np.log(np.abs(np.linalg.eigvals(held)).max()) / step_s)


def growth(trace: Trace, start_s: float, stop_s: float) -> float:
    """Return the exponential rate of the position error's growth [1/s]."""
    chosen = (trace.time_s >= start_s) & (trace.time_s <= stop_s)
    distance = np.hypot(trace.error[chosen, 0], trace.error[chosen, 1])
    return float(np.polyfit(trace.time_s[chosen], np.log(distance), 1)[0])


def _rmse(trace: Trace, settled_s: float) -> Array:
    chosen = trace.error[trace.time_s >= settled_s]
    return np.asarray(np.sqrt((chosen**2).mean(axis=0)))


def _peak(values: Array) -> float:
    return float(np.abs(values).max())


def _rose_rows(spec: Mapping[str, Any], traces: Mapping[Case, Trace]) -> Iterable[Row]:
    explanation = spec["explanation"]
    for case, trace in traces.items():
        if case.part != "rose":
            continue
        title = f"six-petal rose: {spec['law'][case.law]['title']}"
        if case.law == "printed":
            law = law_of(spec, case.law)
            rate = growth(trace, *spec["rose"]["growth_s"])
            bound = growth_of_gains(law)
            yield Row(NAME, title, "growth of the error", "1/s", rate, limit=bound, explanation=explanation["printed"])
            yield Row(NAME, title, "time until 100 m away", "s", float(trace.time_s[-1]) if trace.lost else None)
            continue
        rmse = _rmse(trace, spec["rose"]["settled_s"]) * (MM, MM, MRAD)
        for axis, unit, value in zip(("x", "y", "θ"), ("mm", "mm", "mrad"), rmse, strict=True):
            text = explanation["rose"].get(case.law, "") if axis != "θ" else ""
            yield Row(NAME, title, f"{axis} RMSE after 6 s", unit, float(value), explanation=text)
        asked = _peak(trace.torque_N_m)
        published = spec["law"][case.law]["torque_limit_N_m"]
        text = explanation["torque"]
        yield Row(NAME, title, "largest torque of a wheel", "N m", asked, published=published, explanation=text)


def _points_rows(spec: Mapping[str, Any], traces: Mapping[Case, Trace]) -> Iterable[Row]:
    setup = spec["points"]
    for part, key in _point_parts(spec):
        chosen = [trace for case, trace in traces.items() if (case.part, case.law) == (part, key)]
        found = [settling(trace, setup["every_s"], setup["share"]) for trace in chosen]
        law = law_of(spec, key)
        title = f"points within ±{setup[part]['half_width_m']:g} m: {spec['law'][key]['title']}"
        bound = settling_of_gains(law.kp, law.kd, setup["share"])
        text = spec["explanation"]["points"][f"{part}.{key}"]
        mean = [float(entry.time_s.mean()) for entry in found]
        slowest = [float(entry.time_s.max()) for entry in found]
        yield _row(title, "settled to 2 %, mean over points", "s", mean, limit=bound, explanation=text)
        yield _row(title, "settled to 2 %, slowest point", "s", slowest, limit=bound)
        yield _row(title, "largest overshoot", "%", [100.0 * float(entry.overshoot.max()) for entry in found])
        yield _row(
            title,
            "largest torque of a wheel",
            "N m",
            [_peak(trace.torque_N_m) for trace in chosen],
            published=23.15 if part == "wide" else None,
        )


def _row(setting: str, quantity: str, unit: str, values: Sequence[float], **more: Any) -> Row:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return Row(NAME, setting, quantity, unit, float(np.mean(values)), sd, len(values), **more)


def _slippery_rows(spec: Mapping[str, Any], traces: Mapping[Case, Trace]) -> Iterable[Row]:
    for case, trace in traces.items():
        if case.part != "slippery" or case.friction_coefficient not in spec["slippery"]["rows"]:
            continue
        title = f"rose, friction {case.friction_coefficient:g}: {spec['law'][case.law]['title']}"
        text = spec["explanation"]["slippery"][case.law]
        law = law_of(spec, case.law)
        watched = law.slip_limit_m_s > 0.0 and law.floor == "true"
        limit = slip_bound(spec, law, case.friction_coefficient, trace) if watched else None
        error = trace.error[trace.time_s >= spec["slippery"]["settled_s"], :2]
        off = None if trace.lost else float(np.sqrt((error**2).sum(axis=1).mean()))
        yield Row(NAME, title, "position RMSE after 6 s", "m", off, explanation=text)
        yield Row(NAME, title, "fastest slip of a wheel", "m/s", _peak(trace.slip_m_s), limit=limit)


def slip_bound(spec: Mapping[str, Any], law: Law, friction_coefficient: float, trace: Trace) -> float:
    """Return the slip speed [m/s] that a watched wheel cannot exceed on a floor.

    Torque is whole up to half of the slip limit, and fades from there to the limit. It stands for a tick, in which a
    free wheel gains speed and what grip the floor has changes that of the robot.
    """
    robot = spec["robot"]
    gain = TICK_S * robot["wheel_radius_m"] * _peak(trace.torque_N_m) / robot["wheel_inertia_kg_m2"]
    lever = robot["mass_kg"] * robot["wheel_distance_m"] ** 2 / robot["inertia_kg_m2"]
    floor = TICK_S * friction_coefficient * GRAVITY_M_S2 * (1.0 + lever)
    return float(max(law.slip_limit_m_s, 0.5 * law.slip_limit_m_s + gain) + floor)


def _draw(spec: Mapping[str, Any], traces: Mapping[Case, Trace], folder: Path) -> list[Path]:
    def found(part: str, law: str) -> dict[Case, Trace]:
        return {case: trace for case, trace in traces.items() if (case.part, case.law) == (part, law)}

    titles = {key: law["title"] for key, law in spec["law"].items()}
    ice, seed = spec["slippery"], spec["experiment"]["seed"]
    (path,) = found("rose", "report").values()
    ways = {titles[law]: next(iter(found("wide", law).values())) for law in spec["points"]["wide"]["laws"]}
    runs = {
        titles[law]: {case.friction_coefficient: trace for case, trace in found("slippery", law).items()}
        for law in ice["laws"]
    }
    return [
        *draw_rose(path, spec["rose"]["settled_s"], folder),
        *draw_points(ways, goals_of(spec, "wide", seed), spec["points"]["every_s"], folder),
        draw_slippery(runs, ice["shown"], spec["law"]["watched"]["slip_limit_m_s"], folder),
    ]


def _notes(spec: Mapping[str, Any]) -> tuple[str, ...]:
    robot = spec["robot"]
    wheel_N = robot["mass_kg"] * GRAVITY_M_S2 / len(robot["wheel_angle_deg"])
    floor_N_m = robot["friction_coefficient"] * wheel_N * robot["wheel_radius_m"]
    limit_N_m = spec["law"]["report"]["torque_limit_N_m"]
    figures = {
        "wheel_N": wheel_N,
        "floor_N_m": floor_N_m,
        "push_N": limit_N_m / robot["wheel_radius_m"],
        "times": limit_N_m / floor_N_m,
        "spin_up": limit_N_m / robot["wheel_inertia_kg_m2"],
    }
    return tuple(paragraph.format(**figures) for paragraph in spec["notes"]["paragraphs"])
