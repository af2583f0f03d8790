# SPDX-License-Identifier: MIT
"""The report's models beside each other: the same voltages on five plants, where they agree, and where energy goes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.models_picture import draw
from omni_reproduce.plant_runs import LEDGER, Case, Run, simulate

NAME = "models"
MM, MRAD, PERCENT = 1e3, 1e3, 100.0


def run(context: Context) -> Result:
    """Drive all plants; a row is the mean over seeds of one figure of one plant and robot."""
    spec = read_spec(NAME)
    head = spec["experiment"]
    seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))
    cases = [
        Case(robot, plant, seed, limit)
        for robot in head["robots"]
        for plant in head["plants"]
        for limit in (False, True)
        for seed in (seeds if not limit else seeds[:1])
    ]
    runs = dict(zip(cases, context.map(partial(simulate, spec), cases), strict=True))
    rows = [row for robot in head["robots"] for row in _rows(spec, runs, robot)]
    shown = {case: found for case, found in runs.items() if case.seed == head["seed"] and not case.limit}
    return Result(tuple(rows), (draw(head["robots"], shown, context.folder),), _notes(spec))


def _rows(spec: Mapping[str, Any], runs: Mapping[Case, Run], robot: str) -> Iterable[Row]:
    plants, text = spec["experiment"]["plants"], spec["explanation"]

    def found(plant: str, limit: bool) -> list[Run]:
        return [entry for case, entry in runs.items() if (case.robot, case.plant, case.limit) == (robot, plant, limit)]

    for plant in plants:
        pairs = list(zip(found(plant, False), found("full", False), strict=True))
        yield _row(robot, plant, "way driven", "m", [_way(one) for one, _ in pairs], explanation=text[plant])
        if plant != "full":
            distances = [_apart(one, full) for one, full in pairs]
            yield _row(robot, plant, "distance from full, RMS", "mm", [MM * entry[0] for entry in distances])
            yield _row(robot, plant, "heading from full, RMS", "mrad", [MRAD * entry[1] for entry in distances])
        if plant in ("full", "slip", "linear"):
            yield from _ledger_rows(robot, plant, [one for one, _ in pairs], text["ledger"])
    limits = [found(plant, True)[0] for plant in plants]
    apart = max(_apart(one, limits[0])[0] / _way(limits[0]) for one in limits[1:])
    yield Row(NAME, f"{robot}, light and held fast", "largest distance of two plants over the way", "%",
              PERCENT * apart, limit=0.0, explanation=text["limit"])  # fmt: skip


def _row(robot: str, plant: str, quantity: str, unit: str, values: Sequence[float], explanation: str = "") -> Row:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
    setting = f"{robot}, {plant}"
    return Row(NAME, setting, quantity, unit, float(np.mean(values)), sd, len(values), explanation=explanation)


def _ledger_rows(robot: str, plant: str, runs: Sequence[Run], explanation: str) -> Iterable[Row]:
    for number, name in enumerate(LEDGER):
        if any(entry.spent_J[number] > 0.0 for entry in runs):
            share = [PERCENT * entry.spent_J[number] / entry.taken_J for entry in runs]
            yield _row(robot, plant, f"energy: {name}", "%", share)
    missing = [PERCENT * (1.0 - entry.spent_J.sum() / entry.taken_J) for entry in runs]
    yield _row(robot, plant, "energy: not accounted for", "%", missing, explanation)


def _way(entry: Run) -> float:
    return float(np.hypot(*np.diff(entry.pose[:, :2], axis=0).T).sum())


def _apart(one: Run, other: Run) -> tuple[float, float]:
    """Return the RMS distance [m] and heading difference [rad] of two runs."""
    off = one.pose - other.pose
    return float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())), float(np.sqrt((off[:, 2] ** 2).mean()))


def _notes(spec: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(paragraph.format(**spec["drive"]) for paragraph in spec["notes"]["paragraphs"])
