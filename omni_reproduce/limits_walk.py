# SPDX-License-Identifier: MIT
"""How near the bound a filter is that takes slip for a random walk: python -m omni_reproduce.limits_walk [SETTING]...

The filter is that of ``reachable_filter``, in NumPy. It is told all that is random in the world but one thing: that
slip is linear between moments at which it is drawn. As the robot's filter does, it takes each ratio for a random walk.
Steps of several sizes are tried, and the one with the least error on these very paths is taken. So with noise levels
that stay hardly any filter of this kind is better. Cells are errors over the posterior bound of ideal wheels, position
/ heading. The robot's are over --seeds runs. Settings are those of ``limits.toml``; all by default.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omni_reproduce import limits
from omni_reproduce.experiment import read_spec
from omni_reproduce.limits_noise import over_bound
from omni_reproduce.limits_table import print_table
from omni_reproduce.posterior_bound import STEP_S, Array, Statistics, Wheels
from omni_reproduce.reachable_filter import Filter

PATHS = 10
FACTORS = (0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.5, 4.0, 8.0)
"""Variances of the walk's steps that are tried, over what slip changes by from moment to moment."""
NEVER = 2**40
"""A moment so many steps away does not come."""


class WalkFilter(Filter):
    """The filter with a random walk in place of the law of slip; ``variance_per_s`` is that of its steps."""

    def __init__(self, paths: int, wheels: Wheels, statistics: Statistics, variance_per_s: float) -> None:
        super().__init__(paths, wheels, statistics)
        layout = self._layout
        self.schedule.knot = NEVER
        before = np.arange(layout.before.start, layout.before.stop)
        after = np.arange(layout.after.start, layout.after.stop)
        for rows, columns in ((before, after), (after, before)):  # one number, which the state has twice
            self.p[:, rows, columns] = statistics.slip_variance
        for rows in (before, after):
            for columns in (before, after):
                self._fresh[rows, columns] = variance_per_s * STEP_S


def natural_variance(statistics: Statistics) -> float:
    """Return the variance per second of a walk that comes as far as slip does from one moment to the next [1/s]."""
    return 2.0 * statistics.slip_variance / statistics.slip_time_s


def best_walk(driven: limits.Driven, bound: Array) -> tuple[float, Array]:
    """Return the factor with the least sum of both errors over the bound, and the errors in mm and mrad."""
    tried = {}
    for factor in FACTORS:
        variance = factor * natural_variance(driven.statistics)
        robot = WalkFilter(len(driven.moves), driven.wheels, driven.statistics, variance)
        tried[factor] = limits.reached_by_filter(robot, driven)
    factor = min(tried, key=lambda factor: float((tried[factor] / bound).sum()))
    return factor, tried[factor]


def line(key: str, seeds: int) -> str:
    """Return a setting's row of the table."""
    spec = read_spec(limits.NAME)
    driven = limits.drive(spec, key, PATHS)
    bound = limits.bound_of(driven)
    told = limits.reached_by_filter(Filter(PATHS, driven.wheels, driven.statistics), driven)
    factor, walk = best_walk(driven, bound)
    robot = over_bound(key, {}, bound, seeds)
    ratios = [told / bound, walk / bound, robot]
    cells = [f"{ratio[0]:.2f} / {ratio[1]:.2f}" for ratio in ratios]
    return f"| {spec['setting'][key]['title']} | {cells[0]} | {cells[1]} (x {factor:g}) | {cells[2]} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    known = list(read_spec(limits.NAME)["setting"])
    headings = ["told the law of slip", "takes slip for a walk", "robot as shipped"]
    print_table(("python -m omni_reproduce.limits_walk", __doc__), known, headings, line, arguments)


if __name__ == "__main__":
    main()
