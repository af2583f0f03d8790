# SPDX-License-Identifier: MIT
"""A study of geometry as numbers for programs and as lines for people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from omniwheel.identification.estimate import Estimate
from omniwheel.identification.pose_fit.scores import Score, Summary, summary
from omniwheel.identification.pose_fit.study import Geometry, GeometryStudy, HeldOut

MEASURES: dict[str, tuple[Callable[[Score], float], float, str]] = {
    "largest position error": (lambda run: run.largest_m, 1e3, "mm"),
    "RMS position error": (lambda run: run.rms_m, 1e3, "mm"),
    "final position error": (lambda run: run.final_m, 1e3, "mm"),
    "largest position error per metre": (lambda run: run.per_metre, 1e3, "mm/m"),
    "largest heading error": (lambda run: run.heading_rad, 180.0 / np.pi, "deg"),
}
"""What is measured of each run, the factor to the unit, and the unit."""
KINDS: dict[str, tuple[Callable[[HeldOut], Score], str]] = {
    "nominal": (lambda run: run.nominal, "documented geometry"),
    "held_out": (lambda run: run.identified, "identified without the run's group"),
    "held_out_own_clock": (
        lambda run: run.identified_own_clock,
        "identified without the run's group, the run's clock error removed",
    ),
}
_JSON = {"largest_m": "largest_m", "rms_m": "rms_m", "final_m": "final_m", "heading_rad": "heading_rad"}


def summaries(study: GeometryStudy, measure: str) -> dict[str, Summary]:
    """Return one measure over all left-out runs, by kind of geometry."""
    of_run = MEASURES[measure][0]
    return {kind: summary([of(run) for run in study.held_out], of_run) for kind, (of, _) in KINDS.items()}


def study_data(study: GeometryStudy) -> dict[str, Any]:
    """Return everything in SI units, ready for JSON."""
    return {
        "runs": len(study.runs),
        "left_out_together": {group: [r.name for r in study.runs if r.group == group] for group in study.groups},
        **_geometry(study.whole),
        "models_without_each_group": {group: model.name for group, model in study.models.items()},
        "unscored_groups": study.unscored,
        "held_out": {
            kind: {
                **{name: _summary([of(run) for run in study.held_out], _field(key)) for key, name in _JSON.items()},
                "per_metre": _summary([of(run) for run in study.held_out], lambda run: run.per_metre),
            }
            for kind, (of, _) in KINDS.items()
        }
        if study.held_out
        else {},
        "per_run": [
            {
                "name": run.nominal.name,
                "group": run.nominal.group,
                **{k: score_data(of(run)) for k, (of, _) in KINDS.items()},
            }
            for run in study.held_out
        ],
        "clocks": {
            run.name: {
                "measured": clock.measured,
                "offset_s": clock.offset_s,
                "offset_half_width_95_s": 1.96 * clock.offset_sd_s,
                "rate": clock.rate,
                "rate_half_width_95": 1.96 * clock.rate_sd,
                "warp_s": clock.warp_s,
            }
            for run, clock in zip(study.runs, study.clocks, strict=True)
        },
    }


def split_text(study: GeometryStudy) -> str:
    """Return how the runs were split before any fit."""
    if not study.held_out:
        return "no cross-validation, so the prediction error for other runs is unknown: " + (
            "; ".join(study.unscored.values()) or "there is only one group of runs"
        )
    sizes = [sum(run.group == group for run in study.runs) for group in study.models]
    text = f"each of {len(sizes)} groups left out in turn, {min(sizes)} to {max(sizes)} runs each"
    if not all(run.has_heading for run in study.runs):
        text += "; start headings fitted, since the truth has none"
    for group, why in study.unscored.items():
        text += f"\nnot left out: {group}; of the others, {why}"
    return text


def clock_text(study: GeometryStudy) -> str:
    """Return offset, rate and warp of the runs' clocks in one line."""
    known = [clock for clock in study.clocks if clock.measured]
    if not known:
        return "clocks: too few poses to estimate an offset or a rate; 0 is assumed"
    offset, rate, warp = (
        np.array([getattr(clock, name) for clock in known]) for name in ("offset_s", "rate", "warp_s")
    )
    return (
        f"clocks of {len(known)} runs, truth against log: offset {1e3 * np.min(offset):+.0f} to "
        f"{1e3 * np.max(offset):+.0f} ms, rate {1e3 * np.min(rate):+.2f} to {1e3 * np.max(rate):+.2f} ms/s, "
        f"up to {1e3 * np.max(warp):.0f} ms off a steady rate"
    )


def _geometry(found: Geometry) -> dict[str, Any]:
    return {
        "geometry": _values(found.plain),
        "model": found.model.name,
        "parameters": _values(found.chosen),
        "odometry_matrix": found.matrix.tolist(),
        "refused": [vars(refusal) for refusal in found.refused],
    }


def _values(found: Estimate) -> dict[str, dict[str, float]]:
    return {name: {"value": found[name], "half_width_95": found.half_width(name)} for name in found.names}


def _field(name: str) -> Callable[[Score], float]:
    return lambda run: float(getattr(run, name))


def _summary(scores: Sequence[Score], measure: Callable[[Score], float]) -> dict[str, float | None]:
    return {name: known(value) for name, value in vars(summary(scores, measure)).items()}


def score_data(run: Score) -> dict[str, float | None]:
    """Return one run's errors in SI units, None for what was not measured."""
    return {**{name: known(_field(key)(run)) for key, name in _JSON.items()}, "path_m": run.path_m}


def known(value: float) -> float | None:
    """Return a number that JSON has: None for what was not measured."""
    return value if np.isfinite(value) else None
