# SPDX-License-Identifier: MIT
"""What repeated experiments say of a change: how much each figure moved, with an interval, or that nothing shows.

Present values and candidates are tried in rounds, so that each round sees the same battery and the same floor. The
difference within a round is what counts. Its mean over n rounds has the half width ``t s / sqrt(n)``. There s is the
standard deviation of the differences, and t Student's quantile with n - 1 degrees of freedom. Several figures and
candidates are judged at once; each gets its share of the 5 % by which any of them may be wrong (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.identification.estimate import require_scipy
from omniwheel.tuning import Figures

RISK = 0.05
"""Chance that any statement about a change is wrong although nothing changed."""


@dataclass(frozen=True)
class Kind:
    """A figure for people: its name, unit, factor to that unit, and digits.

    ``better``: -1 if smaller is better, 1 if larger is, 0 if that depends.
    """

    key: str
    name: str
    unit: str
    factor: float
    digits: int
    better: int = -1

    def shown(self, value: float) -> str:
        """Return a value [SI] in the figure's unit, without the unit; a dash for none."""
        return f"{value * self.factor:.{self.digits}f}" if math.isfinite(value) else "–"


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

    @property
    def word(self) -> str:
        """Return "better" or "worse", or "higher" or "lower" where neither is better; "" inside the noise."""
        if not self.shows:
            return ""
        if self.kind.better == 0:
            return "higher" if self.difference > 0.0 else "lower"
        return "better" if self.difference * self.kind.better > 0.0 else "worse"

    def sentence(self) -> str:
        """Return the verdict for a person."""
        kind = self.kind
        values = (self.before, self.after, abs(self.difference), self.half_width)
        before, after, moved, width = map(kind.shown, values)
        change = f"{before} → {after} {kind.unit}".rstrip()
        if self.rounds < 2:
            return f"{kind.name}: one round only, no significance ({change})"
        if not self.shows:
            return f"{kind.name}: within the noise of {self.rounds} rounds ({change}, ± {width})"
        return f"{kind.name} {change}: {self.word} by {moved} ± {width}"


def judge(before: Sequence[Figures], after: Sequence[Figures], candidates: int = 1) -> list[Verdict]:
    """Return a verdict for each figure that the experiment has, from rounds in which both sides were tried.

    ``candidates``: how many are judged at once. Raises MissingPackageError without SciPy if there are several rounds.
    """
    one, other = ([entry.as_dict() for entry in side] for side in (before, after))
    return judge_figures(one, other, KINDS, candidates)


def judge_figures(
    before: Sequence[Mapping[str, float]], after: Sequence[Mapping[str, float]], kinds: Sequence[Kind], candidates: int
) -> list[Verdict]:
    """Do as :func:`judge`, for figures of these kinds by their keys; one that is missing counts as NaN."""
    pairs = list(zip(before, after, strict=True))
    sides = {k.key: np.array([[side.get(k.key, math.nan) for side in pair] for pair in pairs]) for k in kinds}
    known = {key: side[np.isfinite(side).all(axis=1)] for key, side in sides.items()}
    judged = [kind for kind in kinds if len(known[kind.key])]
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
