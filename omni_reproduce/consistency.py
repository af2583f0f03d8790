# SPDX-License-Identifier: MIT
"""Whether the pose filters are as good as they claim, and as good as they can be, when their models are exact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.filter_limits import Limits, nees
from omni_reproduce.filters import AXES, AXIS_UNITS, FILTER_TITLES, FILTERS, Array, Setting, read_setting, run_seeds
from omni_reproduce.riccati import chi_square_band

NAME = "consistency"
_FIX_AXES, _FIRST_EKF = 3, FILTERS.index("ekf")


def run(context: Context) -> Result:
    """Run every case; rows are NIS, NEES and RMS errors beside what they must be."""
    spec, settings = read_spec(NAME), read_spec("table7")
    rows: list[Row] = []
    notes: list[str] = []
    for number, case in enumerate(spec["case"].values()):
        done, share = number / len(spec["case"]), 1.0 / len(spec["case"])
        setting = replace(read_setting(settings, case["setting"]), title=case["title"], **case["changes"])
        head = spec["experiment"]
        seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))

        def progress(part: float, done: float = done, share: float = share) -> None:
            context.progress(done + part * share)

        results = run_seeds(setting, seeds, context.workers, progress)
        limits = Limits(setting, head["seed"], head["quick_bound_s"] if context.quick else head["bound_s"])
        for name in case["filters"]:
            rows += _rows(spec, setting, results, name, limits.of(name))
        rows += _motor_rows(spec, setting, results)
        notes.append(_note(spec, setting, results, case["filters"]))
    return Result(tuple(rows), (), tuple(notes))


def inside(values: Array, degrees: float, share: float) -> Array:
    """Return which means over ``degrees`` squared standard normals lie inside their chi-square band of ``share``."""
    low, high = (edge / degrees for edge in chi_square_band(degrees, share))
    return np.asarray((values >= low) & (values <= high))


def _row(
    spec: Mapping[str, Any], setting: Setting, quantity: str, unit: str, values: Array, key: str, limit: float
) -> Row:
    return Row(
        experiment=NAME,
        setting=setting.title,
        quantity=quantity,
        unit=unit,
        ours=float(values.mean()),
        sd=float(values.std(ddof=1)) if len(values) > 1 and values.dtype != bool else None,
        seeds=len(values),
        limit=limit,
        explanation=spec["explanation"][key].format(steps=setting.steps),
    )


def _rows(
    spec: Mapping[str, Any], setting: Setting, results: NDArray[np.void], name: str, bound: Array | None
) -> list[Row]:
    number, share = FILTERS.index(name), spec["experiment"]["share"]
    title = FILTER_TITLES[number]
    nis = results["nis"][:, number - _FIRST_EKF] / _FIX_AXES
    within = inside(nis, _FIX_AXES * setting.steps, share)
    end = nees(results)[:, number - _FIRST_EKF]
    rows = [
        _row(spec, setting, f"mean NIS, {title}", "1", _FIX_AXES * nis, "nis", _FIX_AXES),
        _row(spec, setting, f"runs with NIS inside {100 * share:.0f} %, {title}", "1", within, "nis_share", share),
        _row(spec, setting, f"NEES at the end, {title}", "1", end, "nees", _FIX_AXES),
    ]
    if bound is not None:
        rows += [
            _row(spec, setting, f"{axis} RMSE, {title}", unit, results["rmse"][:, number, a], "rmse", bound[a])
            for a, (axis, unit) in enumerate(zip(AXES, AXIS_UNITS, strict=True))
        ]
    return rows


def _motor_rows(spec: Mapping[str, Any], setting: Setting, results: NDArray[np.void]) -> list[Row]:
    share = spec["experiment"]["share"]
    within = inside(results["motor_nis"], setting.wheels * setting.steps, share)
    return [
        _row(spec, setting, "mean NIS, motor filters", "1", results["motor_nis"], "motor", 1.0),
        _row(spec, setting, f"runs with NIS inside {100 * share:.0f} %, motor filters", "1", within, "motor", share),
    ]


def _note(spec: Mapping[str, Any], setting: Setting, results: NDArray[np.void], names: list[str]) -> str:
    share, count = spec["experiment"]["share"], len(results)
    run_band = [edge / setting.steps for edge in chi_square_band(_FIX_AXES * setting.steps, share)]
    end_band = [edge / count for edge in chi_square_band(_FIX_AXES * count, share)]
    ends = nees(results).mean(axis=0)
    means = results["nis"].mean(axis=0)
    found = "; ".join(
        f"{FILTER_TITLES[f]}: NIS {means[f - _FIRST_EKF]:.3f}, NEES {ends[f - _FIRST_EKF]:.2f}"
        for f in map(FILTERS.index, names)
    )
    return (
        f"**{setting.title}.** The {100 * share:.0f} % bands are {run_band[0]:.3f} to {run_band[1]:.3f} for the mean "
        f"NIS of a run and {end_band[0]:.2f} to {end_band[1]:.2f} for the mean NEES of {count} runs. {found}."
    )
