# SPDX-License-Identifier: MIT
"""Tables 5 and 7 and figures 13 to 16: the four filter combinations, as published, as the code had it, and honestly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.filter_limits import Limits
from omni_reproduce.filter_pictures import draw_run, draw_table
from omni_reproduce.filters import (
    AXES,
    AXIS_UNITS,
    FILTER_TITLES,
    FILTERS,
    Array,
    Setting,
    Study,
    pose_noise,
    read_setting,
    run_seeds,
    shortened,
)

NAME = "table7"
_PUBLISHED_RUNS = 100
_EKFS = ("ekf", "kf_ekf")


@dataclass(frozen=True)
class Outcome:
    """What the seeds of one setting gave, and the limits (3 per filter, None where there is none)."""

    key: str
    setting: Setting
    results: NDArray[np.void]
    limits: Mapping[str, Array | None]


def run(context: Context) -> Result:
    """Run all settings; a row is the mean over the seeds of one filter's RMS error along one axis."""
    spec = read_spec(NAME)
    weights = [_seeds(context, spec, key) for key in spec["setting"]]
    outcomes = []
    for number, key in enumerate(spec["setting"]):
        done, share = sum(weights[:number]) / sum(weights), weights[number] / sum(weights)
        outcomes.append(_outcome(context, spec, key, done, share))
    rows = [row for outcome in outcomes for row in _rows(spec, outcome)]
    published = spec["published"]
    overview = context.folder / "table7.png"
    shown = [outcome for outcome in outcomes if outcome.key in spec["overview"]["settings"]]
    draw_table(np.array([published[name] for name in FILTERS]), shown, overview)
    setting = shortened(read_setting(spec, "published"), spec["experiment"]["figures_s"])
    study = Study(setting)
    pictures = draw_run(study, study.samples(spec["experiment"]["figures_seed"]), context.folder)
    return Result(tuple(rows), (*pictures, overview), _notes(spec, outcomes))


def _seeds(context: Context, spec: Mapping[str, Any], key: str) -> int:
    head, own = spec["experiment"], spec["setting"][key]
    return context.count(own.get("seeds", head["seeds"]), own.get("quick_seeds", head["quick_seeds"]))


def _outcome(context: Context, spec: Mapping[str, Any], key: str, done: float, share: float) -> Outcome:
    head = spec["experiment"]
    setting = read_setting(spec, key)
    seeds = range(head["seed"], head["seed"] + _seeds(context, spec, key))
    results = run_seeds(setting, seeds, context.workers, lambda part: context.progress(done + part * share))
    limits = Limits(setting, head["seed"], head["quick_bound_s"] if context.quick else head["bound_s"])
    return Outcome(key, setting, results, {name: limits.of(name) for name in FILTERS})


def _rows(spec: Mapping[str, Any], outcome: Outcome) -> list[Row]:
    names = _EKFS if outcome.key == "own" else FILTERS
    rows = [_row(spec, outcome, name, axis) for name in names for axis in range(len(AXES))]
    return rows + [_closer_row(spec, outcome, name) for name in FILTERS if outcome.key in ("published", "honest_b")]


def _sd(values: Array) -> float | None:
    return float(values.std(ddof=1)) if len(values) > 1 else None


def _row(spec: Mapping[str, Any], outcome: Outcome, name: str, axis: int) -> Row:
    values = outcome.results["rmse"][:, FILTERS.index(name), axis]
    limits = outcome.limits[name]
    limit = None if limits is None else float(limits[axis])
    text = spec["explanation"][outcome.key]["walk" if name in ("none", "kf") else "fix"]
    return Row(
        experiment=NAME,
        setting=outcome.setting.title,
        quantity=f"{AXES[axis]} RMSE, {FILTER_TITLES[FILTERS.index(name)]}",
        unit=AXIS_UNITS[axis],
        ours=float(values.mean()),
        sd=_sd(values),
        seeds=len(values),
        published=spec["published"][name][axis],
        limit=limit,
        explanation=text.format(**_facts(outcome)),
    )


def _facts(outcome: Outcome) -> dict[str, str]:
    """Return the figures that explanations mention: means over filters and axes, so that rows share a footnote.

    ``scatter`` of dead reckoning is its sd over its mean; ``stale_share`` of the EKFs what is beyond the limit.
    """
    rmse = outcome.results["rmse"]
    mean = rmse.mean(axis=0)
    scatter = f"{100.0 * (rmse.std(axis=0, ddof=1) / mean)[:2].mean():.0f}" if len(rmse) > 1 else "?"
    limits = [outcome.limits[name] for name in _EKFS]
    shares = [
        1.0 - (limit / mean[FILTERS.index(name)]) ** 2
        for name, limit in zip(_EKFS, limits, strict=True)
        if limit is not None
    ]
    return {"scatter": scatter, "stale_share": f"{100.0 * np.mean(shares):.0f}" if shares else ""}


def _closer_row(spec: Mapping[str, Any], outcome: Outcome, name: str) -> Row:
    values = outcome.results["closer"][:, FILTERS.index(name)]
    kind = "walk" if name in ("none", "kf") else outcome.setting.fix
    return Row(
        experiment=NAME,
        setting=outcome.setting.title,
        quantity=f"estimates closer to the origin than the truth, {FILTER_TITLES[FILTERS.index(name)]}",
        unit="1",
        ours=float(values.mean()),
        sd=_sd(values),
        seeds=len(values),
        published=spec["published"]["closer"],
        explanation=spec["explanation"]["closer"][kind],
    )


def _notes(spec: Mapping[str, Any], outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    by_key = {outcome.key: outcome for outcome in outcomes}
    figures = {
        **_agreement(spec, by_key["published"]),
        **_fairness(by_key["honest_b"]),
        **_misfit(spec, by_key["honest_b"]),
    }
    return tuple(paragraph.format(**figures) for paragraph in spec["notes"]["paragraphs"])


def _agreement(spec: Mapping[str, Any], outcome: Outcome) -> dict[str, Any]:
    """Return what the notes say of the published figures beside ours."""
    published = np.array([spec["published"][name] for name in FILTERS])
    rmse = outcome.results["rmse"]
    mean, sd = rmse.mean(axis=0), rmse.std(axis=0)
    off = 100.0 * (mean / published - 1.0)
    z = _scores(spec, outcome)
    ekf, both = (FILTERS.index(name) for name in _EKFS)
    apart = published[0, 0] - published[0, 1]
    x, theta = pose_noise(outcome.setting, 1.0)
    worse = 100.0 * (mean[ekf] / mean[both] - 1.0)
    return {
        "deviations": "; ".join(f"{FILTER_TITLES[f]} {_signed(off[f], ' %')}" for f in (ekf, both)),
        "walk_scores": _signed(z[:2].ravel()),
        "published_runs": _PUBLISHED_RUNS,
        "apart_mm": f"{1e3 * abs(apart):.0f}",
        "runs_like_it": f"{(sd[0, 0] ** 2 + sd[0, 1] ** 2) / apart**2:.0f}",
        "lever": f"{theta / x:.0f}",
        "worse_theta": f"{worse[2]:.1f}",
        "worse_x": f"{worse[0]:.1f}",
    }


def _fairness(outcome: Outcome) -> dict[str, Any]:
    """Return what the notes say of the honest figures beside their limits."""
    rmse = outcome.results["rmse"]
    mean, error = rmse.mean(axis=0), rmse.std(axis=0) / np.sqrt(len(rmse))
    bounds = np.array([outcome.limits[name] for name in FILTERS])
    return {
        "bound_off": f"{100.0 * np.abs(mean[2:] / bounds[2:] - 1.0).max():.1f}",
        "walk_off": f"{np.abs((mean[:2] - bounds[:2]) / error[:2]).max():.1f}",
        "runs": len(rmse),
    }


def _scores(spec: Mapping[str, Any], outcome: Outcome) -> Array:
    """Return published minus ours in standard errors of the difference of both means, shape (filters, axes)."""
    published = np.array([spec["published"][name] for name in FILTERS])
    rmse = outcome.results["rmse"]
    error = rmse.std(axis=0) * np.sqrt(1.0 / _PUBLISHED_RUNS + 1.0 / len(rmse))
    scores: Array = (published - rmse.mean(axis=0)) / error
    return scores


def _misfit(spec: Mapping[str, Any], outcome: Outcome) -> dict[str, str]:
    """Return what the notes say of the published figures beside the honest ones."""
    published = np.array([spec["published"][name] for name in FILTERS])
    off = 100.0 * (published / outcome.results["rmse"].mean(axis=0) - 1.0)
    scores = _scores(spec, outcome)
    told = {f"scores_{name}": _signed(scores[f]) for f, name in enumerate(FILTERS)}
    return told | {f"off_{name}": _signed(off[f], " %") for f, name in enumerate(FILTERS)}


def _signed(values: Array, unit: str = "") -> str:
    return ", ".join(f"{value:+.1f}{unit}" for value in values)
