# SPDX-License-Identifier: MIT
"""Geometry from runs with poses, judged on runs that were left out: the split is fixed before any fit.

Each group of runs is left out in turn. The model (plain geometry, full matrix, turn by translation, radius by
direction) is chosen among the other groups alone, by leaving out one of those: a model with more parameters has to
predict left-out runs better by more than the standard error of that difference. Clocks are measured with the documented
geometry, before any fit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from omniwheel.errors import LogError
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.pose_fit.clock import Clock, measure_clock
from omniwheel.identification.pose_fit.excitation import Refusal, not_excited, one_way_wheels, widest, without_heading
from omniwheel.identification.pose_fit.scores import Score, score
from omniwheel.identification.pose_fit.solve import Fit, Quadratics, estimate, fit_quadratics, fit_windows
from omniwheel.identification.pose_fit.wheel_model import MODELS, Array, Model, WheelModel
from omniwheel.identification.pose_fit.windows import Run, Window, cut, groups_of, window_length_s

LEAST_GROUPS = 2
"""Groups without which nothing can be left out."""
LARGEST_RESIDUAL = 0.5
"""Standard deviation of the positions' residuals over the motion's RMS above which the poses contradict the wheels."""
MOVED_M = 0.02
"""A robot that moves less than this stands still."""


@dataclass(frozen=True)
class Geometry:
    """What some runs show: the ``plain`` geometry, the ``chosen`` model's fit, and what was refused."""

    plain: Estimate
    chosen: Estimate
    model: Model
    matrix: Array
    plain_matrix: Array
    refused: tuple[Refusal, ...]


@dataclass(frozen=True)
class HeldOut:
    """One run that had no part in the fit: its errors with the documented and with the identified geometry.

    ``number`` is that of the run in the study, ``matrix`` what the other groups say.
    """

    number: int
    matrix: Array
    nominal: Score
    identified: Score
    identified_own_clock: Score


@dataclass(frozen=True)
class GeometryStudy:
    """Geometry from all runs, the left-out groups with what the others chose, their scores, and each run's clock.

    ``models`` is by left-out group. ``unscored`` are the groups without which the others show too little, and why.
    """

    layout: WheelModel
    runs: tuple[Run, ...]
    whole: Geometry
    groups: tuple[str, ...]
    models: dict[str, Model]
    unscored: dict[str, str]
    held_out: tuple[HeldOut, ...]
    clocks: tuple[Clock, ...]


def identify_geometry(runs: Sequence[Run], layout: WheelModel) -> GeometryStudy:
    """Identify geometry from runs with poses, and score it on each group of runs with what the others say.

    Raises LogError where the runs show no radius at all, or contradict their poses.
    """
    clocks, windows = _prepared(runs, layout)
    every = range(len(runs))
    whole = _identify(runs, windows, list(every), layout)
    groups = groups_of(runs)
    models: dict[str, Model] = {}
    unscored: dict[str, str] = {}
    held_out: list[HeldOut] = []
    for group in groups if len(groups) >= LEAST_GROUPS else ():
        left_out = [number for number in every if runs[number].group == group]
        try:
            found = _identify(runs, windows, [number for number in every if number not in left_out], layout)
        except LogError as error:
            unscored[group] = str(error)
            continue
        models[group] = found.model
        held_out += _scored(runs, left_out, clocks, layout, found.matrix)
    final = tuple(measure_clock(run, whole.matrix) for run in runs)
    return GeometryStudy(layout, tuple(runs), whole, groups, models, unscored, tuple(held_out), final)


def train_and_test(
    runs: Sequence[Run], layout: WheelModel, trained_on: Collection[str]
) -> tuple[Geometry, list[HeldOut]]:
    """Identify from the runs of the groups ``trained_on``; also the scores of all other runs.

    Raises LogError where a group has no run, or the runs show no radius.
    """
    missing = set(trained_on) - set(groups_of(runs))
    if missing:
        raise LogError(f"no runs of {', '.join(sorted(missing))}", hint="give a folder that has all runs of the split")
    train = [number for number, run in enumerate(runs) if run.group in trained_on]
    test = [number for number, run in enumerate(runs) if run.group not in trained_on]
    used = [runs[number] for number in train]
    # The length of the windows must not depend on the other runs.
    _, windows = _prepared(used, layout)
    found = _identify(used, windows, range(len(used)), layout)
    nominal = layout.matrix(layout.nominal)
    clocks = {number: measure_clock(runs[number], nominal) for number in test}
    return found, _scored(runs, test, clocks, layout, found.matrix)


def _prepared(runs: Sequence[Run], layout: WheelModel) -> tuple[dict[int, Clock], list[Window]]:
    """Measure the runs' clocks with the documented geometry, and cut the runs. Raises LogError."""
    for run in runs:
        if run.wheels != layout.wheels:
            raise LogError(f"{run.name} has {run.wheels} wheels; the robot file has {layout.wheels}")
    nominal = layout.matrix(layout.nominal)
    clocks = {number: measure_clock(run, nominal) for number, run in enumerate(runs)}
    return clocks, _windows(runs, clocks, window_length_s(runs))


def _windows(runs: Sequence[Run], clocks: Mapping[int, Clock], window_s: float) -> list[Window]:
    """Cut the runs of these numbers, each on its own clock."""
    return [
        window
        for number, clock in clocks.items()
        for window in cut(runs[number], number, clock.on_log(runs[number].truth_s), window_s)
    ]


def _scored(
    runs: Sequence[Run], numbers: Sequence[int], clocks: Mapping[int, Clock], layout: WheelModel, matrix: Array
) -> list[HeldOut]:
    """Score runs that had no part in the fit."""
    nominal = layout.matrix(layout.nominal)
    scored = []
    for number in numbers:
        run = runs[number]
        clock = clocks[number] if run.has_heading else measure_clock(run, matrix)
        raw = None if run.same_clock else clock
        scores = score(run, nominal, raw), score(run, matrix, raw), score(run, matrix, clock)
        scored.append(HeldOut(number, matrix, *scores))
    return scored


def _identify(runs: Sequence[Run], windows: Sequence[Window], chosen: Sequence[int], layout: WheelModel) -> Geometry:
    """Identify from the windows of the chosen runs."""
    used = [window for window in windows if window.run in chosen]
    known = [runs[number] for number in chosen]
    if not used:
        raise LogError(
            "no run has two poses within its log's time", hint="give each log its own truth, on a clock within 5 s"
        )
    if not any(run.has_heading for run in known):
        # Clocks were measured by the speed of a marker at the centre, and it may be elsewhere.
        held = [refusal.name for refusal in without_heading(known)]
        marked, _, _ = fit_windows(used, layout, MODELS[0], held)
        clocks = {number: measure_clock(runs[number], marked.matrix) for number in chosen}
        used = _windows(runs, clocks, window_length_s(runs))
    plain, quadratics, refused = _plain(known, used, layout)
    held = [refusal.name for refusal in refused]
    one_way = one_way_wheels(known)
    held_directions = [*held, *(refusal.name for refusal in one_way)]
    model = choose_model(quadratics, known, chosen, layout, held_directions, plain)
    fit, last = plain, quadratics
    if model is not MODELS[0]:
        fit, last, _ = fit_windows(used, layout, model, held_directions, plain.values)
        refused += one_way if "direction" in model.kinds else []
    return Geometry(
        estimate(plain, quadratics, layout),
        estimate(fit, last, layout),
        model,
        fit.matrix,
        plain.matrix,
        tuple(refused),
    )


def _require_that_poses_follow(windows: Sequence[Window], sd: Array) -> None:
    """Raise LogError where the residuals of the fit are about as large as the motion itself."""
    moved = np.concatenate([window.pose[:, :2] - window.start[:2] for window in windows])
    if sd[0] > LARGEST_RESIDUAL * float(np.sqrt(np.mean(moved**2))) and sd[0] > MOVED_M:
        raise LogError(
            "the poses do not follow the wheels: the fit leaves residuals about as large as the motion",
            hint="check the wheels' order, bearings and signs, that each truth belongs to its log, and that its y axis "
            "is 90 degrees counter-clockwise of its x axis",
        )


def _plain(runs: Sequence[Run], windows: Sequence[Window], layout: WheelModel) -> tuple[Fit, Quadratics, list[Refusal]]:
    """Fit the plain geometry; what its intervals do not show keeps its nominal value."""
    refused = without_heading(runs)
    limits = widest(layout)
    while True:
        held = [refusal.name for refusal in refused]
        fit, quadratics, sd = fit_windows(windows, layout, MODELS[0], held)
        _require_that_poses_follow(windows, sd)
        found = estimate(fit, quadratics, layout)
        wide = [name for name in found.names if found.half_width(name) > limits[layout.names.index(name)]]
        if not wide:
            return fit, quadratics, refused
        worst = max(wide, key=lambda name: found.half_width(name) / limits[layout.names.index(name)])
        kind = layout.kinds[layout.names.index(worst)]
        refused.append(not_excited(worst, kind, found.half_width(worst), runs))
        if not any(name.endswith("radius_m") for name in found.names if name != worst):
            shown = next(refusal for refusal in refused if refusal.name.endswith("radius_m"))
            raise LogError(
                f"no wheel radius can be identified from these runs: {shown.name} has a {shown.why}", hint=shown.motion
            )


def choose_model(
    quadratics: Quadratics,
    runs: Sequence[Run],
    numbers: Sequence[int],
    layout: WheelModel,
    held: Sequence[str],
    plain: Fit,
) -> Model:
    """Return the model that predicts left-out groups best; more parameters only for a clear gain.

    Where all runs are of one group, each is left out alone.
    """
    groups = groups_of(runs)
    parts = [[n for n, run in zip(numbers, runs, strict=True) if run.group == group] for group in groups]
    if len(groups) < LEAST_GROUPS:
        parts = [[number] for number in numbers]

    def costs(model: Model) -> Array:
        found = []
        for part in parts:
            others = [number for number in numbers if number not in part]
            if not np.any(np.isin(quadratics.run, part)) or not np.any(np.isin(quadratics.run, others)):
                continue
            fit = fit_quadratics(quadratics, others, layout, model, plain.values, held)
            found += [quadratics.cost(fit.matrix, [n]) for n in part if np.any(quadratics.run == n)]
        return np.array(found)

    best, best_costs = MODELS[0], costs(MODELS[0])
    for model in MODELS[1:]:
        tried = costs(model)
        gain = best_costs - tried
        if len(gain) > 1 and np.mean(gain) > np.std(gain, ddof=1) / np.sqrt(len(gain)):
            best, best_costs = model, tried
    return best


def left_out_together(runs: Sequence[Run], groups: int) -> list[Run]:
    """Return the runs in so many groups, in turn: for runs that come without groups of their own."""
    return [replace(run, group=f"{number % groups + 1} of {groups}") for number, run in enumerate(runs)]
