# SPDX-License-Identifier: MIT
"""The same experiment with several sets of values, in rounds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from omniwheel.robot import Robot

_Try = TypeVar("_Try")
MAX_SETS = 5
"""As many sets can be told apart in one picture."""


def order(count: int, round_number: int) -> list[int]:
    """Return in which order a round tries ``count`` sets: forth and back in turns, so that a drift favours none."""
    forth = list(range(count))
    return forth if round_number % 2 == 0 else forth[::-1]


def run_rounds(
    robot: Robot,
    sets: Sequence[Mapping[str, float]],
    rounds: int,
    experiment: Callable[[Robot], _Try],
    say: Callable[[int, int], None],
    set_many: Callable[[Mapping[str, float]], None] | None = None,
) -> list[list[_Try]]:
    """Run an experiment with each set of parameter values in every round; return the tries of each set, in order.

    Each set holds all parameters that any of them changes. ``say(round, set)`` is called before each try. The robot is
    left with the values of the last try. ``set_many`` sets them; without it they are set for good.
    """
    use = set_many or robot.parameters.set_many
    tries: list[list[_Try]] = [[] for _ in sets]
    for number in range(rounds):
        for index in order(len(sets), number):
            say(number, index)
            use(sets[index])
            tries[index].append(experiment(robot))
    return tries
