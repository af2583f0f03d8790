# SPDX-License-Identifier: MIT
"""Geometry of two real robots from counts beside motion capture, scored on runs that had no part in the fit.

The settings file states the splits: each session left out in turn, and named sets of sessions to fit to. The published
figures beside ours are in-sample: of the runs that they were fitted to.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.real_logs import data_folder
from omniwheel.errors import LogError
from omniwheel.identification.pose_fit.picture import draw_study
from omniwheel.identification.pose_fit.scores import Score, score, summary
from omniwheel.identification.pose_fit.study import Geometry, GeometryStudy, identify_geometry, train_and_test
from omniwheel.identification.pose_fit.wheel_model import WheelModel, wheel_model
from omniwheel.identification.pose_fit.windows import Run, groups_of, run_of
from omniwheel.logs.importer import import_log
from omniwheel.logs.mapping import read_mapping
from omniwheel.robots import read_robot

NAME = "optiodom"
ROBOT_FOLDER = Path(__file__).parent / "optiodom"
NEEDS = "Needs the logs, which are not part of this project."
LARGEST, HEADING = "largest position error of a run", "largest heading error of a run"
IN_SAMPLE = (
    "In-sample: all runs, the same as it was fitted to. Quoted from Sousa and others, J. Intell. Robot. Syst. 105 "
    "(2022) 39, who also fitted the method of Lin and others."
)
DOCUMENTED, LEFT_OUT = "documented geometry", "each session left out"
POSITIONS = "each session left out, fitted to positions without headings"
AT_TRUE_PERIOD = "counts at the log's true period"
STATISTICS = {"median": "median of the runs", "percentile_95": "95 % of the runs", "largest": "largest of all runs"}


@dataclass(frozen=True)
class Split:
    """What was fitted to some runs, and the ``scores`` of the others. ``model`` names the model that the former chose.

    ``trained_on`` and ``tested_on`` have the names of the runs, by turn of the split.
    """

    name: str
    scores: list[Score]
    models: list[str]
    trained_on: list[set[str]]
    tested_on: list[set[str]]


@dataclass(frozen=True)
class Found:
    """One robot: the study that leaves out each session, on the counts as logged, and all splits."""

    study: GeometryStudy
    splits: list[Split]


def run(context: Context) -> Result:
    """Identify both robots; a row says how to give the logs where they are absent."""
    spec = read_spec(NAME)
    folder = data_folder(spec, context.data)
    rows, pictures, notes, parts = [], [], [_honesty()], []
    for number, (data, settings) in enumerate(spec["robots"].items()):
        place = next((place for place in (folder / data, folder / "data" / data) if place.is_dir()), folder / data)
        paths = sorted(place.glob(spec["experiment"]["runs"]))
        runs = read_runs(paths, settings["file"])
        if len(runs) != settings["runs"]:
            parts.append(f"{len(runs)} of {settings['runs']} runs in {place}")
        if len(groups_of(runs)) < 2:
            missing = (
                f"Not run: {len(runs)} runs in {place}; two sessions are needed. Set "
                f"{spec['experiment']['folder_variable']} to a clone of github.com/sousarbarb/optiodom."
            )
            rows.append(Row(NAME, settings["name"], LARGEST, "m", None, explanation=missing))
            continue
        found = identified(runs, paths, settings, positions=not context.quick)
        rows += _rows(found, settings)
        notes.append(_note(found, settings["name"]))
        pictures.append(context.folder / f"optiodom_{settings['file']}.png")
        draw_study(found.study, pictures[-1], settings["name"])
        context.progress((number + 1) / len(spec["robots"]))
    return Result(tuple(rows), tuple(pictures), tuple(notes), "; ".join(parts))


def read_runs(paths: Sequence[Path], robot: str) -> list[Run]:
    """Read the runs of a robot; the folder of a run is its session."""
    mapping, layout = read_mapping(ROBOT_FOLDER / f"{robot}_mapping.toml"), layout_of(robot)
    return [run_of(import_log(path, mapping)[0], path.parent.name, layout) for path in paths]


def layout_of(robot: str) -> WheelModel:
    """Return the documented layout of a robot."""
    return wheel_model(read_robot(str(ROBOT_FOLDER / f"{robot}.toml")))


def identified(
    runs: Sequence[Run], paths: Sequence[Path], settings: dict[str, Any], *, positions: bool = True
) -> Found:
    """Identify and score by all splits that the runs allow; also from ``positions`` alone, which takes the longest."""
    layout = layout_of(settings["file"])
    study = identify_geometry(runs, layout)
    splits = [_documented(study), _left_out(study, LEFT_OUT)]
    if positions:
        bare = identify_geometry([without_headings(run) for run in runs], layout)
        splits.append(_left_out(bare, POSITIONS, runs))
    named = {name: set(sessions) for name, sessions in settings["trained_on"].items()}
    usable = {name: sessions for name, sessions in named.items() if sessions <= set(groups_of(runs))}
    splits += [_trained(runs, layout, name, sessions) for name, sessions in usable.items()]
    if settings["counts_at_nominal_period"]:
        timed = [at_true_period(run, path) for run, path in zip(runs, paths, strict=True)]
        splits.append(_left_out(identify_geometry(timed, layout), f"{LEFT_OUT}, {AT_TRUE_PERIOD}"))
        splits += [_trained(timed, layout, name, of, f", {AT_TRUE_PERIOD}") for name, of in usable.items()]
    return Found(study, splits)


def without_headings(run: Run) -> Run:
    """Return a run whose truth has positions only."""
    return replace(run, pose=np.column_stack((run.pose[:, :2], np.full(len(run.pose), np.nan))))


def at_true_period(run: Run, path: Path) -> Run:
    """Return a run whose increments are speeds times a nominal period, with the true period in its place.

    The metadata of the session have begin and end of each run on the clocks of robot and motion capture. No pose is
    used. Raises LogError where they are missing.
    """
    metadata = path.parent / f"{path.parent.name}_metadata.csv"
    number = int(path.stem.rpartition("-")[2]) - 1
    try:
        with metadata.open(encoding="utf-8-sig", newline="") as file:
            known = {row[0]: row[1:] for row in csv.reader(file) if row}
        ends = {name: float(known[name][number]) for name in ("gt_ti", "gt_tf", "odo_ti", "odo_tf")}
    except (OSError, KeyError, IndexError, ValueError) as error:
        raise LogError(f"{metadata} has no times of run {number + 1}: {error}") from error
    period = (ends["gt_tf"] - ends["gt_ti"]) / (ends["odo_tf"] - ends["odo_ti"])
    return replace(run, rolled_rad=period * run.rolled_rad)


def _documented(study: GeometryStudy) -> Split:
    return Split(DOCUMENTED, [run.nominal for run in study.held_out], [], [], [])


def _left_out(study: GeometryStudy, name: str, measured: Sequence[Run] = ()) -> Split:
    """Return a study's left-out runs; their scores with the poses of other ``measured`` runs, if given."""
    scored = list(study.models)
    tested = [{run.name for run in study.runs if run.group == group} for group in scored]
    every = {run.name for run in study.runs}
    models = sorted({model.name for model in study.models.values()})
    scores = [score(measured[run.number], run.matrix) if measured else run.identified for run in study.held_out]
    return Split(name, scores, models, [every - part for part in tested], tested)


def _trained(runs: Sequence[Run], layout: WheelModel, name: str, sessions: set[str], more: str = "") -> Split:
    found: Geometry
    found, held_out = train_and_test(runs, layout, sessions)
    train = {run.name for run in runs if run.group in sessions}
    scores = [run.identified for run in held_out]
    return Split(f"fitted to {name}{more}", scores, [found.model.name], [train], [{each.name for each in scores}])


def _rows(found: Found, settings: dict[str, Any]) -> list[Row]:
    measures: tuple[tuple[str, str, Callable[[Score], float]], ...] = (
        (LARGEST, "m", lambda run: run.largest_m),
        (HEADING, "deg", lambda run: float(np.degrees(run.heading_rad))),
    )
    rows = [
        Row(NAME, f"{settings['name']}, {who}, in-sample", f"{LARGEST}, {STATISTICS[name]}", "m", None, published=value,
            explanation=IN_SAMPLE)
        for who, known in settings["published"].items() for name, value in known.items()
    ]  # fmt: skip
    for split in found.splits:
        told = f"{len(split.scores)} runs, {'none' if split.models else 'no run'} fitted to. {NEEDS}"
        for quantity, unit, measure in measures:
            values = vars(summary(split.scores, measure))
            setting = f"{settings['name']}, {split.name}"
            rows += [
                Row(NAME, setting, f"{quantity}, {text}", unit, values[name], explanation=told)
                for name, text in STATISTICS.items()
            ]
    return rows + _geometry_rows(found, settings["name"])


def _geometry_rows(found: Found, name: str) -> list[Row]:
    plain, layout = found.study.whole.plain, found.study.layout
    nominal = dict(zip(layout.names, layout.nominal, strict=True))
    rows = []
    for parameter in plain.names:
        unit = parameter.rpartition("_")[2]
        width = 1e3 * plain.half_width(parameter)
        told = f"± {width:.2g} m{unit} (95 %), documented {1e3 * nominal[parameter]:.4g} m{unit}. {NEEDS}"
        rows.append(Row(NAME, f"{name}, all runs", parameter, unit, plain[parameter], explanation=told))
    return rows


def _note(found: Found, name: str) -> str:
    study = found.study
    models = "; ".join(f"{split.name}: {', '.join(split.models)}" for split in found.splits if split.models)
    return (
        f"{name[0].upper()}{name[1:]}: {len(study.runs)} runs in {len(study.groups)} sessions. The models that "
        f"the fitted runs chose: {models}."
    )


def _honesty() -> str:
    return (
        "Dead reckoning begins at the measured first pose; nothing is aligned afterwards. Left-out runs have no part "
        "in the fit or in the choice of the model. The kinds of models and the length of the windows were chosen by "
        "cross-validation inside the named sets, but by people who had seen errors of all runs: expect somewhat larger "
        f"ones of other robots. *{AT_TRUE_PERIOD[0].upper()}{AT_TRUE_PERIOD[1:]}*: the four-wheel robot logged speeds "
        "times a nominal period of 10 ms, which was 6 to 12 % longer and differs by session (found by comparing the "
        "lengths of the paths of all runs). Each run's counts are multiplied by its duration on the clock of the "
        "motion capture over that on the robot's. Wanted were at most 0.075 m in the median and 0.155 m in all runs "
        "with three wheels, 0.06 m and 0.13 m with four."
    )
