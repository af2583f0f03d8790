# SPDX-License-Identifier: MIT
"""Which values a robot has when autotune is over, the old or the new ones, and why."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from omniwheel.autotune.design import Design
from omniwheel.autotune.gains import Requirements
from omniwheel.autotune.prefer import Prefer
from omniwheel.tuning_verdict import Verdict
from omniwheel.wheel_loop import Margins

SWEPT_SHARE = 0.8
"""Of the required margins, what a sweep must show of the new values. The rest is its own noise."""
WORTH = 0.1
"""Share of a figure: an improvement that is smaller is not worth other gains."""


@dataclass(frozen=True)
class Choice:
    """Whether the new values are kept, and why: the end of a sentence.

    ``lacking``: which margins the old values lack, if that is why Prefer.MARGIN would have kept the new ones.
    """

    kept: bool
    why: str
    lacking: str = ""


@dataclass(frozen=True)
class Shown:
    """What a comparison showed at a ``share`` of the limits; ``whole``: that is the pace that counts.

    ``unknown``: standard deviation of the robot's own pose, by the figure's key [m, rad]; {}: it knows it exactly.
    ``swept``: the margins that a sweep with the new values showed, None without one.
    """

    verdicts: Sequence[Verdict]
    share: float
    whole: bool = True
    unknown: Mapping[str, float] = field(default_factory=dict)
    swept: Margins | None = None


def worse_of(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the figures that speak against the new values: worse above the noise, or by more than WORTH."""
    return [v for v in verdicts if v.difference > 0.0 and (v.shows or v.difference > WORTH * v.before)]


def choose(shown: Shown, design: Design, required: Requirements, prefer: Prefer) -> Choice:
    """Choose. The new values need a reason, and no figure may be or look worse.

    The reason is a figure that is better by more than WORTH, above the noise, at the pace that counts. What the robot
    sees of its error and what it does not know of its pose add up for that, as squares. With Prefer.MARGIN it is a
    reason, too, that the old values have less margin than ``required``. Then a figure may be worse.

    New values that lack margin themselves, as the sweep shows, are never kept.
    """
    if shown.swept is not None and not required.part(SWEPT_SHARE).kept_by(shown.swept):
        return Choice(False, f"a sweep shows that the new values lack margin: {_less(shown.swept, required)}")
    lacking = _lacking(design, required)
    worse = worse_of(shown.verdicts)
    looks_worse = [v for v in shown.verdicts if v.difference > 0.0]
    looks_better = [v for v in shown.verdicts if v.shows and v.difference < -WORTH * v.before]
    unknown = shown.unknown
    better = [v for v in looks_better if _whole(v, v.after, unknown) < (1.0 - WORTH) * _whole(v, v.before, unknown)]
    seen = _seen(worse) or _seen(better) or _lost(looks_better, unknown)
    if not shown.whole:
        seen = f"{seen}, at {shown.share:.0%} of the limits already"
    if lacking and prefer is Prefer.MARGIN:
        return Choice(True, f"margins were preferred; {seen}, but the old values lack margin: {lacking}")
    if better and shown.whole and not looks_worse:
        return Choice(True, seen)
    if better and not worse and looks_worse:
        seen = f"{seen}, but {_seen(looks_worse)}, within the noise"
    return Choice(False, seen + (f", but the old values lack margin: {lacking}" if lacking else ""), lacking)


def _whole(verdict: Verdict, seen: float, unknown: Mapping[str, float]) -> float:
    return math.hypot(seen, unknown.get(verdict.kind.key, 0.0))


def _lost(looks_better: Sequence[Verdict], unknown: Mapping[str, float]) -> str:
    """Return why there is no reason."""
    kinds = [v.kind for v in looks_better if unknown.get(v.kind.key, 0.0) > 0.0]
    if not kinds:
        return f"no metric improves by more than {WORTH:.0%} above the noise"
    doubts = " and ".join(f"{unknown[kind.key] * kind.factor:.{kind.digits}f} {kind.unit}" for kind in kinds)
    return f"{_seen(looks_better)}, but less than its pose uncertainty of {doubts}"


def _seen(verdicts: Sequence[Verdict]) -> str:
    """Return which figures moved, by how much."""
    return ", ".join(
        f"{v.kind.name} is {'worse' if v.difference > 0.0 else 'better'} by {abs(v.difference) / v.before:.0%}"
        for v in verdicts
    )


def _lacking(design: Design, required: Requirements) -> str:
    """Return which margins the old values lack, beside what is required; "" if they have all."""
    if not design.before.margins.stable:
        return "the wheel loops oscillate"
    parts = []
    for loop, found in (("wheel loops", design.before.margins), ("position loop", design.position_before)):
        if not found.stable:
            parts.append(f"the {loop} oscillates")
            continue
        missing = _less(found, required)
        if missing:
            parts.append(f"{loop}: {missing}")
    return "; ".join(parts)


def _less(found: Margins, required: Requirements) -> str:
    """Return which margins are less than required, in words."""
    words = (
        (found.gain < required.gain, f"gain margin {found.gain:.2g} of {required.gain:.2g}"),
        (
            found.phase_rad < required.phase_rad,
            f"phase margin {math.degrees(found.phase_rad):.0f}° of {math.degrees(required.phase_rad):.0f}°",
        ),
        (found.distance < required.distance, f"distance from -1 {found.distance:.2f} of {required.distance:.2f}"),
    )
    return ", ".join(text for lacks, text in words if lacks)
