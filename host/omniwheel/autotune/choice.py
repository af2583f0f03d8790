# SPDX-License-Identifier: MIT
"""Which values a robot has when autotune is over, the old or the new ones, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from omniwheel.autotune.design import Design
from omniwheel.autotune.gains import Requirements
from omniwheel.autotune.prefer import Prefer
from omniwheel.tuning_verdict import Verdict

WORTH = 0.1
"""Share of a figure: an improvement that is smaller is not worth other gains, and what is worse by more is bad."""


@dataclass(frozen=True)
class Choice:
    """Whether the new values are kept, and why: the end of a sentence."""

    kept: bool
    why: str


def choose(verdicts: Sequence[Verdict], design: Design, required: Requirements, prefer: Prefer) -> Choice:
    """Choose. The new values need a reason, and no figure may be worse; no ``verdicts``: the old ones were not driven.

    A figure is worse if that shows above the noise, or if it looks worse by more than WORTH. The reason is a figure
    that is better by more than WORTH, above the noise. With Prefer.MARGIN it is a reason, too, that the old values have
    less margin than ``required``; then a figure may be worse. With less than half of it they need no preference: the
    new values are kept unless a figure is worse.
    """
    lacking = _lacking(design, required)
    if not verdicts:
        return Choice(True, f"the old values do not damp this robot: {lacking}")
    worse = [v for v in verdicts if v.difference > 0.0 and (v.shows or v.difference > WORTH * v.before)]
    better = [v for v in verdicts if v.shows and v.difference < -WORTH * v.before]
    seen = _seen(worse) or _seen(better) or f"no figure is better by more than {WORTH:.0%} above the noise"
    if lacking and prefer is Prefer.MARGIN:
        return Choice(True, f"margins were preferred; {seen}, but the old values lack margin: {lacking}")
    if better and not worse:
        return Choice(True, seen)
    if not worse and design.old_hardly_damp(required):
        return Choice(True, f"{seen}, but the old values hardly damp this robot: {lacking}")
    remedy = f". But the old values lack margin: {lacking}. --prefer margin takes the new ones" if lacking else ""
    return Choice(False, seen + remedy)


def _seen(verdicts: Sequence[Verdict]) -> str:
    """Return which figures moved, by how much."""
    return ", ".join(
        f"{v.kind.name} is {'worse' if v.difference > 0.0 else 'better'} by {abs(v.difference) / v.before:.0%}"
        for v in verdicts
    )


def _lacking(design: Design, required: Requirements) -> str:
    """Return which margins the old values lack, beside what is required; "" if they have all."""
    if not design.before.margins.stable:
        return "the wheel loops swing by themselves"
    parts = []
    for loop, found in (("wheel loops", design.before.margins), ("position loop", design.position_before)):
        if not found.stable:
            parts.append(f"the {loop} swings by itself")
            continue
        words = (
            (found.gain < required.gain, f"gain margin {found.gain:.2g} of {required.gain:.2g}"),
            (
                found.phase_rad < required.phase_rad,
                f"phase margin {math.degrees(found.phase_rad):.0f}° of {math.degrees(required.phase_rad):.0f}°",
            ),
            (found.distance < required.distance, f"distance from -1 {found.distance:.2f} of {required.distance:.2f}"),
        )
        missing = ", ".join(text for lacks, text in words if lacks)
        if missing:
            parts.append(f"{loop}: {missing}")
    return "; ".join(parts)
