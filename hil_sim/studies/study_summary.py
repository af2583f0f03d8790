# SPDX-License-Identifier: MIT
"""What very many runs say together: means with confidence, spread, quantiles, how many drove to the end, faults."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.batch import STATUSES
from hil_sim.studies.engine import OK
from hil_sim.studies.figures import COMPLETED, FIGURES

QUANTILES = {"median": 0.5, "p5": 0.05, "p95": 0.95, "p99": 0.99}
_Z = NormalDist().inv_cdf(0.975)


def summarise(rows: NDArray[Any]) -> dict[str, Any]:
    """Return the numbers of these runs as plain data, SI units. The rows' order counts: have them by seed."""
    reached = int(np.count_nonzero(rows[COMPLETED] > 0.0))
    return {
        "runs": len(rows),
        "simulated_s": float(np.sum(rows["ticks"]) * 1e-3),
        "completed": {"runs": reached, "share": reached / len(rows), "share_95": wilson(reached, len(rows))},
        "not_run": not_run(rows),
        "faults": {name: fault_counts(rows, name) for name in ("stops", "warnings")},
        "figures": {name: spread(rows[name]) for name in FIGURES},
    }


def spread(values: NDArray[np.float64]) -> dict[str, Any]:
    """Return mean, its 95 % interval (Student), deviation of the sample, quantiles and extremes of the finite values.

    ``runs`` says how many those are. Quantiles are those of the sample, interpolated linearly. Without values: None.
    """
    finite = values[np.isfinite(values)]
    count = len(finite)
    if count == 0:
        return {"runs": 0, **dict.fromkeys(("mean", "mean_95", "sd", *QUANTILES, "min", "max"))}
    mean, sd = float(np.mean(finite)), float(np.std(finite, ddof=1)) if count > 1 else 0.0
    half = student_quantile(count - 1) * sd / math.sqrt(count) if count > 1 else math.inf
    found = np.quantile(finite, list(QUANTILES.values()))
    return {
        "runs": count,
        "mean": mean,
        "mean_95": [mean - half, mean + half] if count > 1 else None,
        "sd": sd,
        **{name: float(value) for name, value in zip(QUANTILES, found, strict=True)},
        "min": float(np.min(finite)),
        "max": float(np.max(finite)),
    }


def student_quantile(dof: int) -> float:
    """Return the two-sided 95 % quantile of Student's t: within 0.3 % from 3 degrees of freedom on, exact below.

    Abramowitz and Stegun, 26.7.5; no SciPy, which is optional.
    """
    if dof == 1:
        return math.tan(0.475 * math.pi)
    if dof == 2:
        return 0.95 / math.sqrt(2.0 * 0.975 * 0.025)
    z, n = _Z, float(dof)
    terms = (
        (z**3 + z) / 4.0,
        (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0,
        (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0,
        (79.0 * z**9 + 776.0 * z**7 + 1482.0 * z**5 - 1920.0 * z**3 - 945.0 * z) / 92160.0,
    )
    return z + sum(term / n ** (power + 1) for power, term in enumerate(terms))


def wilson(successes: int, count: int) -> list[float]:
    """Return Wilson's 95 % interval of a share: sensible for 0 and for all, too."""
    share, z2 = successes / count, _Z * _Z
    centre = share + z2 / (2.0 * count)
    half = _Z * math.sqrt(share * (1.0 - share) / count + z2 / (4.0 * count * count))
    scale = 1.0 + z2 / count
    low = 0.0 if successes == 0 else (centre - half) / scale
    return [low, 1.0 if successes == count else (centre + half) / scale]


def not_run(rows: NDArray[Any]) -> dict[str, int]:
    """Return how many runs could not start or go on, by why."""
    numbers, counts = np.unique(rows["status"], return_counts=True)
    return {STATUSES[int(n)]: int(c) for n, c in zip(numbers, counts, strict=True) if n != OK}


def fault_counts(rows: NDArray[Any], what: str) -> dict[str, int]:
    """Return in how many runs each stop fault ("stops") or warning ("warnings") was seen, the commonest first."""
    names = core.fault_names if what == "stops" else core.warning_names
    bits, counts = np.unique(rows["faults"], return_counts=True)
    found: dict[str, int] = {}
    for value, count in zip(bits, counts, strict=True):
        for name in names(int(value)):
            found[name] = found.get(name, 0) + int(count)
    return dict(sorted(found.items(), key=lambda entry: (-entry[1], entry[0])))


def ranking(rows: NDArray[Any], figure: str) -> NDArray[np.int64]:
    """Return the rows' numbers, the worst first: runs without the figure, then the largest; ties by seed."""
    values = rows[figure].astype(np.float64)
    severity = np.where(np.isfinite(values), values, np.inf)
    order: NDArray[np.int64] = np.lexsort((rows["seed"], -severity))
    return order


def counted(entries: dict[str, Any], runs: int) -> str:
    """Return counted names as one line: "encoder stuck 3 (0.3 %)"."""
    return ", ".join(f"{name} {count} ({100.0 * count / runs:.3g} %)" for name, count in entries.items()) or "none"
