# SPDX-License-Identifier: MIT
"""Benchmarks of dead reckoning in two worlds: UMBmark's square, petals of a flower, and the report's roses.

MuJoCo needs the extra ``mujoco``, and is left out of a quick run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.odometry_picture import draw
from omni_reproduce.odometry_runs import MUJOCO, NAME, OURS, Case, Driven, drive, petal, square, wheels_of
from omni_reproduce.square import Umbmark, expected_error, legs, umbmark

Array = NDArray[np.float64]
SYSTEMATIC, SPREAD = "E_max,syst", "spread"
PETAL_POSITION, PETAL_HEADING = "petals, position RMS", "petals, heading RMS"


@dataclass(frozen=True)
class Setting:
    """A robot with a right or wrong file, with or without a gyro, in a world; ``turning`` says how it drives a square.

    Not a square if ``turning`` is None.
    """

    robot: str
    wrong: bool
    gyro: bool
    world: str
    turning: bool | None = None

    @property
    def title(self) -> str:
        """What the rows call it."""
        parts = [self.robot, "wrong file" if self.wrong else "right file", *(["gyro"] if self.gyro else []), self.world]
        if self.turning is not None:
            parts.insert(1, "turning" if self.turning else "not turning")
        return ", ".join(parts)


def run(context: Context) -> Result:
    """Drive everything; rows have the figures of squares, petals and roses, a note the centres of gravity."""
    spec = quick_spec() if context.quick else read_spec(NAME)
    head = spec["experiment"]
    runs = context.count(head["runs"], head["quick_runs"])
    petals = head["petals"]
    mujoco = not context.quick and find_spec("mujoco") is not None
    squares = {setting: _square_cases(spec, setting, runs) for setting in square_settings(spec, mujoco=mujoco)}
    flowers = {setting: _petal_cases(spec, setting, petals) for setting in petal_settings(spec, mujoco=mujoco)}
    roses = {(robot, laps): _rose_cases(spec, robot, laps) for robot in spec["robot"] for laps in head["laps"]}
    cases = [case for part in (squares, flowers, roses) for group in part.values() for case in group]
    found = dict(zip(cases, context.map(drive, cases), strict=True))
    driven = {setting: [found[case] for case in group] for setting, group in squares.items()}
    results = {setting: result_of(group) for setting, group in driven.items()}
    rows = [row for setting, result in results.items() for row in square_rows(spec, setting, result, driven[setting])]
    for setting, group in flowers.items():
        rows += _petal_rows(setting, [found[case] for case in group])
    rows += [_rose_row(robot, laps, [found[case] for case in group]) for (robot, laps), group in roses.items()]
    rows += published(spec)
    if not mujoco:
        why = "a quick run leaves it out" if context.quick else "it needs MuJoCo: pip install 'omniwheel[mujoco]'"
        rows.append(Row(NAME, MUJOCO, SYSTEMATIC, "mm", None, explanation=f"Not run: {why}."))
    errors = {setting: _positions(group) for setting, group in driven.items()}
    picture = draw(_panels(spec, errors), context.folder)
    return Result(tuple(rows), (picture,), (*notes(spec, runs, petals), centres(spec, results)))


def quick_spec() -> dict[str, Any]:
    """Return the settings of a quick run: one robot, few petals, one lap."""
    spec = read_spec(NAME)
    head = spec["experiment"]
    robots = {robot: spec["robot"][robot] for robot in head["quick_robots"]}
    return {**spec, "robot": robots, "experiment": {**head, "petals": head["quick_petals"], "laps": head["quick_laps"]}}


def square_settings(spec: Mapping[str, Any], *, mujoco: bool) -> list[Setting]:
    """Return how squares are driven. In MuJoCo the file is right, and the gyro only helps where the robot turns."""
    ours = [
        Setting(robot, wrong, gyro, OURS, turning)
        for robot in spec["robot"]
        for turning in (True, False)
        for wrong in (False, True)
        for gyro in (False, True)
    ]
    theirs = [
        Setting(robot, wrong=False, gyro=gyro, world=MUJOCO, turning=turning)
        for robot, size in spec["robot"].items()
        if mujoco and size["mujoco"]
        for turning, gyro in ((True, False), (True, True), (False, False))
    ]
    return ours + theirs


def petal_settings(spec: Mapping[str, Any], *, mujoco: bool) -> list[Setting]:
    """Return how petals are driven: without a gyro, in MuJoCo with a right file."""
    ours = [Setting(robot, wrong, gyro=False, world=OURS) for robot in spec["robot"] for wrong in (False, True)]
    theirs = [
        Setting(robot, wrong=False, gyro=False, world=MUJOCO)
        for robot, size in spec["robot"].items()
        if mujoco and size["mujoco"]
    ]
    return ours + theirs


def _square_cases(spec: Mapping[str, Any], setting: Setting, runs: int) -> list[Case]:
    """Clockwise first."""
    first = spec["experiment"]["seed"]
    seeds = {-1: range(first, first + runs), 1: range(first + runs, first + 2 * runs)}
    return [
        Case(
            setting.robot,
            seed,
            square(spec, setting.robot, sign, turning=bool(setting.turning)),
            setting.wrong,
            setting.gyro,
            setting.world,
        )
        for sign, own in seeds.items()
        for seed in own
    ]


def _petal_cases(spec: Mapping[str, Any], setting: Setting, petals: int) -> list[Case]:
    first = spec["experiment"]["seed"]
    return [
        Case(
            setting.robot,
            first + number,
            petal(spec, setting.robot, 2.0 * math.pi * number / petals),
            setting.wrong,
            world=setting.world,
        )
        for number in range(petals)
    ]


def _rose_cases(spec: Mapping[str, Any], robot: str, laps: int) -> list[Case]:
    head = spec["experiment"]
    return [Case(robot, head["seed"], petals=petals, laps=laps) for petals in head["roses"]]


def _positions(driven: Sequence[Driven]) -> Array:
    return np.array([run.error[:2] for run in driven])


def result_of(driven: Sequence[Driven]) -> Umbmark:
    """Return what the runs of a square say: the first half was clockwise."""
    half = len(driven) // 2
    return umbmark(_positions(driven[:half]), _positions(driven[half:]))


def expected(spec: Mapping[str, Any], setting: Setting) -> tuple[Array, Array]:
    """Return the return errors [m] that a setting's file gives on wheels that never slip: clockwise, and counter."""
    edge_m = spec["robot"][setting.robot]["edge_m"]
    true, believed = (wheels_of(spec, setting.robot, wrong=wrong) for wrong in (False, setting.wrong))
    clockwise, counter = (
        expected_error(legs(edge_m, sign, turning=bool(setting.turning)), true, believed)[:2] for sign in (-1, 1)
    )
    return clockwise, counter


def square_rows(
    spec: Mapping[str, Any], setting: Setting, result: Umbmark, driven: Sequence[Driven]
) -> tuple[Row, Row]:
    """Return the rows of a square."""
    limit = None
    if setting.wrong and not setting.gyro:
        limit = 1e3 * max(float(np.hypot(*error)) for error in expected(spec, setting))
    words, key = spec["explanation"], "gyro" if setting.gyro else "wrong" if setting.wrong else "right"
    turned = 1e3 * np.abs([run.turned_at_rest_rad for run in driven])
    if setting.gyro and setting.world == MUJOCO:
        key = "mujoco_gyro"
    why = words[key].format(
        gyro_rest_s=spec["experiment"]["gyro_rest_s"], turned_mrad=float(turned.mean()), most_mrad=float(turned.max())
    )
    first = Row(
        NAME,
        setting.title,
        SYSTEMATIC,
        "mm",
        1e3 * result.systematic_m,
        seeds=len(driven),
        limit=limit,
        explanation=why,
    )
    spread = 1e3 * result.spread_m
    return first, replace(first, quantity=SPREAD, ours=spread if math.isfinite(spread) else None, limit=None)


def _petal_rows(setting: Setting, driven: Sequence[Driven]) -> list[Row]:
    errors = np.array([run.error for run in driven])
    position = 1e3 * float(np.sqrt((errors[:, :2] ** 2).sum(axis=1).mean()))
    heading = 1e3 * float(np.sqrt((errors[:, 2] ** 2).mean()))
    first = Row(NAME, setting.title, PETAL_POSITION, "mm", position, seeds=len(driven))
    return [first, replace(first, quantity=PETAL_HEADING, unit="mrad", ours=heading)]


def _rose_row(robot: str, laps: int, driven: Sequence[Driven]) -> Row:
    lengths = 1e3 * np.hypot(*_positions(driven).T)
    title = Setting(robot, wrong=False, gyro=False, world=OURS).title
    quantity = f"roses, position after {laps} lap{'s' if laps > 1 else ''}"
    return Row(NAME, title, quantity, "mm", float(lengths.mean()), float(lengths.std(ddof=1)), len(driven))


def published(spec: Mapping[str, Any]) -> list[Row]:
    """Return the rows of real robots."""
    rows = []
    for entry in spec["published"]["session"]:
        title = f"{entry['title']}, edge {entry['edge_m']:g} m, {entry['runs']} runs"
        for quantity, figure in ((SYSTEMATIC, entry["systematic_mm"]), (SPREAD, entry["spread_mm"])):
            why = spec["explanation"]["real"]
            rows.append(Row(NAME, title, quantity, "mm", None, published=figure, explanation=why))
    return rows


def notes(spec: Mapping[str, Any], runs: int, petals: int) -> tuple[str, ...]:
    """Return what the page says before its tables."""
    edges = ", ".join(f"{size['edge_m']:g} m ({robot})" for robot, size in spec["robot"].items())
    wrong = spec["wrong"]
    words = {
        "runs": runs,
        "seed": spec["experiment"]["seed"],
        "edges": edges,
        "petals": petals,
        "step_deg": 360.0 / petals,
        "distance_percent": 100.0 * wrong["distance"],
        "radius_percent": " and ".join(f"{100.0 * share:+g}" for share in wrong["radius"]),
        "commit": spec["published"]["commit"],
    }
    return tuple(spec["notes"][name].format(**words) for name in ("what", "wrong", "petals", "real", "left_out"))


def centres(spec: Mapping[str, Any], results: Mapping[Setting, Umbmark]) -> str:
    """Return the table of the centres of gravity, beside those that the file gives on wheels that never slip."""
    lines = [
        "Centres of gravity x, y [mm]:",
        "",
        "| setting | clockwise | counter-clockwise | expected clockwise | counter |",
        "|---|---|---|---|---|",
    ]
    for setting, result in results.items():
        pairs = [result.clockwise_m, result.counter_clockwise_m]
        told = ["–", "–"] if setting.gyro else [_pair(tuple(error)) for error in expected(spec, setting)]
        lines.append(f"| {setting.title} | {' | '.join([*(_pair(pair) for pair in pairs), *told])} |")
    return "\n".join(lines)


def _pair(metres: Sequence[float]) -> str:
    return ", ".join(f"{round(1e3 * value, 1) + 0.0:.1f}" for value in metres)


def _panels(
    spec: Mapping[str, Any], errors: Mapping[Setting, Array]
) -> dict[str, dict[str, tuple[Array, list[Array]]]]:
    """Return the panels of the picture: by robot and way of driving, return errors and expected centres of each set."""
    panels: dict[str, dict[str, tuple[Array, list[Array]]]] = {}
    for setting, found in errors.items():
        panel = f"{setting.robot}, {'turning' if setting.turning else 'not turning'}"
        name = setting.title.split("turning, ", 1)[1]
        told = list(expected(spec, setting)) if setting.wrong and not setting.gyro else []
        panels.setdefault(panel, {})[name] = (found, told)
    return panels
