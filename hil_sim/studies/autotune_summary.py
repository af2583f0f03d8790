# SPDX-License-Identifier: MIT
"""What a study of autotune says: figures of its robots, of their rivals, and of stopped tunings, as data and a page."""

from __future__ import annotations

import math
import re
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

MARGIN_TOLERANCE = 0.2
RIVAL_TOLERANCE = 0.1
WORSE_BY = (0.01, 0.05, 0.2)
"""Shares by which a figure grew: how many robots are worse by more than that is said, too."""
_SHOWN = 6


def document(robots: Array, rivals: Array, stops: Array) -> dict[str, Any]:
    """Return the study's figures; parts that were not run are left out."""
    found: dict[str, Any] = {"robots": _robots(robots), "margins": _margins(robots)}
    if len(rivals):
        found["rivals"] = _rivals(rivals)
    if len(stops):
        found["stops"] = _stops(stops)
    return found


def _robots(rows: Array) -> dict[str, Any]:
    outcomes = Counter(row["outcome"].decode() for row in rows)
    failed = rows[np.isin(rows["outcome"], (b"refused", b"stopped"))]
    reasons = Counter(_kind(row["why"].decode(errors="replace")) for row in failed)
    worse, hardly = is_worse(rows), rows["hardly_damped"] > 0.0
    better_end = rows["completed_after"] > rows["completed_before"]
    return {
        "count": len(rows),
        "outcomes": dict(outcomes),
        "reasons": dict(reasons.most_common(_SHOWN)),
        "worse": int(np.sum(worse)),
        "worse_by": {f"{share:g}": int(np.sum(worse & (growth(rows) > share))) for share in WORSE_BY},
        "worse_seeds": [int(seed) for seed in rows["seed"][worse]],
        "worse_of_hardly_damped": int(np.sum(worse & hardly)),
        "kept_of_hardly_damped": int(np.sum((rows["outcome"] == b"kept") & hardly)),
        "complete_fewer_paths": int(np.sum(rows["completed_after"] < rows["completed_before"])),
        "stopped_seeds": [int(row["seed"]) for row in rows if row["outcome"] == b"stopped"],
        "complete_more_paths": int(np.sum(better_end)),
        "position_ratio": _ratio(rows, "position_m"),
        "heading_ratio": _ratio(rows, "theta_rad"),
        "simulated_s": _spread(rows["simulated_s"]),
    }


def is_worse(rows: Array) -> NDArray[np.bool_]:
    """Return which robots are worse than before: a path that is no longer completed, or a figure that surely grew."""
    ended = rows["completed_after"] < rows["completed_before"]
    grown = (rows["position_worse"] > 0.0) | (rows["theta_worse"] > 0.0)
    return np.asarray(ended | grown)


def growth(rows: Array) -> NDArray[np.float64]:
    """Return by which share of itself the position or heading RMSE grew; infinite if it completes less often.

    A figure that was not measured, or 0, before has no share: NaN, unless the other one has.
    """
    shares = []
    for name in ("position_m", "theta_rad"):
        before = np.where(rows[f"{name}_before"] > 0.0, rows[f"{name}_before"], math.nan)
        shares.append(rows[f"{name}_after"] / before - 1.0)
    fails = rows["completed_after"] < rows["completed_before"]
    return np.where(fails, math.inf, np.fmax(*shares))


def _kind(why: str) -> str:
    """Return a reason without its numbers, so that equal ones are counted together."""
    return re.sub(r"(?<!\w)\d[\d.]*", "…", why.split(":")[0])


def _ratio(rows: Array, name: str) -> dict[str, float]:
    kept = rows[rows["outcome"] == b"kept"]
    return _spread(kept[f"{name}_after"] / kept[f"{name}_before"])


def _spread(values: Array) -> dict[str, float]:
    values = np.asarray(values, dtype=np.float64)
    values = values[np.isfinite(values)]
    if not len(values):
        return {}
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return {"p05": float(low), "median": float(middle), "p95": float(high), "max": float(np.max(values))}


def _margins(rows: Array) -> dict[str, Any]:
    designed = rows[np.isin(rows["outcome"], (b"kept", b"reverted"))]
    found: dict[str, Any] = {"not_measured": int(np.sum(np.isnan(designed["distance_measured"])))}
    for name in ("gain", "phase", "distance"):
        measured = designed[f"{name}_measured"]
        found[name] = _promise(designed[f"{name}_promised"], measured)
        found[name]["model"] = _promise(designed[f"{name}_model"], measured)
    return found


def _promise(promised: Array, measured: Array) -> dict[str, Any]:
    """Return how often a promise was kept, of those margins that both sides know."""
    seen = np.isfinite(measured) & np.isfinite(promised) & (promised > 0.0)
    off = measured[seen] / promised[seen] - 1.0
    return {
        "measured": len(off),
        "as_promised": int(np.sum(np.abs(off) <= MARGIN_TOLERANCE)),
        "at_least_as_promised": int(np.sum(off >= -MARGIN_TOLERANCE)),
        "off": _spread(off),
    }


def _rivals(rows: Array) -> dict[str, Any]:
    whole = rows["completed_autotune"] >= rows["completed_rival"]
    ratio = rows["position_m_autotune"] / rows["position_m_rival"]
    near = whole & (ratio <= 1.0 + RIVAL_TOLERANCE)
    return {
        "count": len(rows),
        "no_rival": int(np.sum(rows["why"] != b"")),
        "within": int(np.sum(near)),
        "position_ratio": _spread(ratio),
        "far_seeds": [int(seed) for seed in rows["seed"][~near]],
    }


def _stops(rows: Array) -> dict[str, Any]:
    happened = rows[rows["stopped"] > 0.0]
    kinds = {}
    for kind in sorted({row["kind"].decode() for row in happened}):
        mine = happened[happened["kind"] == kind.encode()]
        kinds[kind] = {
            "count": len(mine),
            "at_rest": int(np.sum(mine["at_rest"] > 0.0)),
            "old_parameters": int(np.sum(mine["old_parameters"] > 0.0)),
        }
    return {"count": len(rows), "over_before": int(len(rows) - len(happened)), "kinds": kinds}


def page(summary: dict[str, Any]) -> str:
    """Return the figures as a page of Markdown."""
    robots, margins = summary["robots"], summary["margins"]
    lines = ["# Study of autotune", "", f"{robots['count']} robots.", "", "| | |", "|---|---|"]
    lines += [f"| outcome: {name} | {count} |" for name, count in sorted(robots["outcomes"].items())]
    lines += [f"| because: {name} | {count} |" for name, count in robots["reasons"].items()]
    by = ", ".join(f"{count} by more than {float(share):.0%}" for share, count in robots["worse_by"].items())
    lines += [
        f"| kept, of those whose old values hardly damp the robot | {robots['kept_of_hardly_damped']} |",
        f"| worse than before, however little | {robots['worse']} ({by}) |",
        f"| worse, of those whose old values hardly damp the robot | {robots['worse_of_hardly_damped']} |",
        f"| complete fewer paths than before | {robots['complete_fewer_paths']} |",
        f"| complete more paths than before | {robots['complete_more_paths']} |",
        f"| position RMSE, after / before, of those kept | {_words(robots['position_ratio'])} |",
        f"| heading RMSE, after / before, of those kept | {_words(robots['heading_ratio'])} |",
        f"| simulated time [s] | {_words(robots['simulated_s'])} |",
    ]
    for name in ("gain", "phase", "distance"):
        part = margins[name]
        for side, promise in (("the promise", part), ("the model alone", part["model"])):
            kept = f"{promise['as_promised']} of {promise['measured']}"
            lines.append(f"| {name} margin within {MARGIN_TOLERANCE:.0%} of {side} | {kept} |")
    lines.append(f"| margins that could not be measured | {margins['not_measured']} |")
    if "rivals" in summary:
        part = summary["rivals"]
        text = f"{part['within']} of {part['count']} ({_words(part['position_ratio'])})"
        lines.append(f"| position RMSE within {RIVAL_TOLERANCE:.0%} of the optimiser's | {text} |")
    for kind, part in summary.get("stops", {}).get("kinds", {}).items():
        text = f"{part['count']}: at rest {part['at_rest']}, old parameters {part['old_parameters']}"
        lines.append(f"| stopped by {kind} | {text} |")
    return "\n".join(lines) + "\n"


def _words(spread: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in spread.items()) or "none"
