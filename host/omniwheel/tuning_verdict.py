# SPDX-License-Identifier: MIT
"""What repeated experiments say of a change: how much each figure moved, with an interval, or that nothing shows.

Present values and candidates are tried in rounds, so that each round sees the same battery and the same floor. The
difference within a round is what counts. Its mean over n rounds has the half width ``t s / sqrt(n)``. There s is the
standard deviation of the differences, and t Student's quantile with n - 1 degrees of freedom. Several figures and
candidates are judged at once; each gets its share of the 5 % by which any of them may be wrong (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.identification.estimate import require_scipy
from omniwheel.tuning import Figures

RISK = 0.05
"""Chance that any statement about a change is wrong although nothing changed."""


@dataclass(frozen=True)
class Kind:
    """A figure for people: its name, unit, factor to that unit, digits; all are better if they are smaller."""

    key: str
    name: str
    unit: str
    factor: float
    digits: int


KINDS = (
    Kind("rise_s", "rise time", "ms", 1e3, 0),
    Kind("overshoot", "overshoot", "%", 1e2, 1),
    Kind("settling_s", "settling time", "ms", 1e3, 0),
    Kind("position_m", "position RMSE", "mm", 1e3, 2),
    Kind("theta_rad", "heading RMSE", "mrad", 1e3, 2),
)


@dataclass(frozen=True)
class Verdict:
    """One figure before and after a change: means [SI], mean difference after - before and its interval's half width.

    ``rounds``: those in which both sides have the figure; fewer than two leave the half width NaN.
    """

    kind: Kind
    before: float
    after: float
    difference: float
    half_width: float
    rounds: int

    @property
    def shows(self) -> bool:
        """Whether the change is seen above the noise of the repeats."""
        return math.isfinite(self.half_width) and abs(self.difference) > self.half_width

    def sentence(self) -> str:
        """Return the verdict for a person."""
        kind = self.kind
        before, after, moved, width = (
            f"{value * kind.factor:.{kind.digits}f}"
            for value in (self.before, self.after, abs(self.difference), self.half_width)
        )
        if not self.shows:
            return f"{kind.name}: inside the noise of {self.rounds} rounds ({before} → {after} {kind.unit}, ± {width})"
        word = "better" if self.difference < 0.0 else "worse"
        return f"{kind.name} {before} → {after} {kind.unit}: {word} by {moved} ± {width}"


def judge(before: Sequence[Figures], after: Sequence[Figures], candidates: int = 1) -> list[Verdict]:
    """Return a verdict for each figure that the experiment has, from rounds in which both sides were tried.

    ``candidates``: how many are judged at once. Raises MissingPackageError without SciPy if there are several rounds.
    """
    pairs = [(one.as_dict(), other.as_dict()) for one, other in zip(before, after, strict=True)]
    sides = {kind.key: np.array([(one[kind.key], other[kind.key]) for one, other in pairs]) for kind in KINDS}
    known = {key: side[np.isfinite(side).all(axis=1)] for key, side in sides.items()}
    judged = [kind for kind in KINDS if len(known[kind.key])]
    return [_verdict(kind, known[kind.key], len(judged) * candidates) for kind in judged]


def _verdict(kind: Kind, side: np.ndarray[tuple[int, int], np.dtype[np.float64]], statements: int) -> Verdict:
    differences = side[:, 1] - side[:, 0]
    rounds = len(differences)
    half_width = math.nan
    if rounds > 1:
        quantile = float(require_scipy("special").stdtrit(rounds - 1, 1.0 - 0.5 * RISK / statements))
        half_width = quantile * float(np.std(differences, ddof=1)) / math.sqrt(rounds)
    means = side.mean(axis=0)
    return Verdict(kind, float(means[0]), float(means[1]), float(np.mean(differences)), half_width, rounds)
