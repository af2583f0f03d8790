# SPDX-License-Identifier: MIT
"""Old and new values in turns, at the pace at which a robot is used; weakly damped ones come to that pace in steps.

A step is a short drive with each, and the next one is quicker. Each needs that the step before stopped nothing and that
the new values were no worse there. So the values are never kept by what a slow drive showed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from omniwheel.autotune.choice import Shown, worse_of
from omniwheel.autotune.room import Drive, drive
from omniwheel.frames import Pose
from omniwheel.robot import Robot
from omniwheel.tuning import Trace
from omniwheel.tuning_rounds import order
from omniwheel.tuning_verdict import Verdict, judge

STEPS = (0.25, 0.5)
"""Shares of the limits before the pace that counts, for old values that hardly damp the robot."""
STEP_LEGS = 4
LEAST_ROUNDS = 2
"""So many show a difference above noise. From then on the comparison ends when a figure is worse."""
SIDES = ("old", "new")

LegTime = Callable[[Sequence[Pose], float], float]
"""How long a leg takes [s] through these points at a share of the limits."""


@dataclass(frozen=True)
class Compared:
    """Verdicts and drives, old and new, at a share of the limits; ``whole``: at the pace that counts.

    ``unknown``: what the robot does not know of its own pose, by the key of a figure [m, rad].
    """

    verdicts: list[Verdict]
    tries: tuple[list[Drive], list[Drive]]
    share: float
    whole: bool

    @property
    def unknown(self) -> dict[str, float]:
        """Return what the robot does not know of its own pose, RMS over drives, by figure; none without fixes."""
        told = [entry.unknown for entry in self.tries[0] if entry.unknown]
        return {key: math.sqrt(sum(entry[key] ** 2 for entry in told) / len(told)) for key in (told[0] if told else ())}

    @property
    def shown(self) -> Shown:
        """What a choice rests on."""
        return Shown(self.verdicts, self.share, self.whole, self.unknown)

    @property
    def traces(self) -> dict[str, list[Trace]]:
        """Return the paths, before and after."""
        sides = zip(("before", "after"), self.tries, strict=True)
        return {name: [entry.trace for entry in side] for name, side in sides if side}


class Comparison:
    """Drives both sets on one robot. The robot is left with the values of the last drive."""

    def __init__(
        self,
        robot: Robot,
        sets: tuple[Mapping[str, float], Mapping[str, float]],
        use: Callable[[Mapping[str, float]], None],
        leg_time: LegTime,
        tell: Callable[[str], None],
    ) -> None:
        self._robot, self._sets, self._use, self._leg_time, self._report_progress = robot, sets, use, leg_time, tell

    def run(self, places: Sequence[Pose], pace: float, rounds: int, *, in_steps: bool) -> Compared:
        """Compare through these points at ``pace``, a share of the limits, ``in_steps`` or at once.

        Raises ExperimentError if the robot stops itself.
        """
        short = [*places[:STEP_LEGS], places[0]]
        for share in STEPS if in_steps else ():
            found = self._rounds(short, share, 1, whole=False)
            if worse_of(found.verdicts):
                return found
        return self._rounds(places, pace, rounds, whole=True)

    def _rounds(self, places: Sequence[Pose], share: float, rounds: int, *, whole: bool) -> Compared:
        tries: tuple[list[Drive], list[Drive]] = ([], [])
        leg_s = self._leg_time(places, share)
        verdicts: list[Verdict] = []
        for number in range(rounds):
            for index in order(2, number):
                self._report_progress(
                    f"round {number + 1} of {rounds} at {share:.0%} of the limits, with the {SIDES[index]} parameters"
                )
                self._use(self._sets[index])
                tries[index].append(drive(self._robot, places, leg_s))
            verdicts = judge([entry.figures for entry in tries[0]], [entry.figures for entry in tries[1]])
            if number + 1 >= LEAST_ROUNDS and any(v.shows and v.difference > 0.0 for v in verdicts):
                break
        return Compared(verdicts, tries, share, whole)
