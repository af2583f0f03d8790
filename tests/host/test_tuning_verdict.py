# SPDX-License-Identifier: MIT
"""Verdicts on repeated experiments: right intervals, and silence about what is only noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from omniwheel.tuning import Figures, Trace
from omniwheel.tuning_rounds import order, run_rounds
from omniwheel.tuning_verdict import judge


def tracking(values: np.ndarray) -> list[Figures]:
    return [Figures(float(value), 0.001) for value in values]


def test_the_interval_is_that_of_a_paired_t_test() -> None:
    rng = np.random.default_rng(1)
    before = 1e-3 + 1e-4 * rng.standard_normal(10)
    after = before + 2e-4 + 5e-5 * rng.standard_normal(10)
    position, heading = judge(tracking(before), tracking(after))
    wanted = stats.ttest_rel(after, before).confidence_interval(1.0 - 0.05 / 2)  # two figures share the 5 %
    assert position.difference - position.half_width == pytest.approx(wanted.low)
    assert position.difference + position.half_width == pytest.approx(wanted.high)
    assert position.shows
    assert not heading.shows
    assert "worse by 0.19 ± 0.02" in position.sentence()
    assert "within the noise of 10 rounds" in heading.sentence()


@pytest.mark.full
def test_noise_alone_seldom_makes_a_statement() -> None:
    """1000 changes that change nothing, with a drift of the battery over the rounds: at most 5 % are called one."""
    rng = np.random.default_rng(2)
    wrong = 0
    for _ in range(1000):
        drift = np.linspace(0.0, 1.0, 6)
        noise = rng.standard_normal((6, 3, 2))
        sets = [
            [
                Figures(1.0 + float(d + n[0]) * 0.01, 1.0 + float(d + n[1]) * 0.01)
                for d, n in zip(drift, noise[:, k], strict=True)
            ]
            for k in range(3)
        ]
        wrong += any(verdict.shows for candidate in sets[1:] for verdict in judge(sets[0], candidate, 2))
    assert wrong <= 50 + 3 * math.sqrt(50)


def test_a_real_change_is_found_under_noise() -> None:
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(200):
        before = 1.36e-3 + 3e-5 * rng.standard_normal(10)
        after = 1.20e-3 + 3e-5 * rng.standard_normal(10)
        position = judge(tracking(before), tracking(after))[0]
        found += position.shows and "better by 0.1" in position.sentence()
    assert found >= 190


def test_one_round_gives_no_verdict_and_what_is_missing_is_left_out() -> None:
    (position, heading) = judge(tracking(np.array([1e-3])), tracking(np.array([9e-3])))
    assert not position.shows
    assert math.isnan(heading.half_width)
    step = Figures(1e-3, 1e-3, 0.2, 0.0, 0.4)
    never = Figures(1e-3, 1e-3, 0.2, 0.0, math.nan)
    verdicts = {verdict.kind.key: verdict for verdict in judge([step] * 3, [never, step, step])}
    assert verdicts["settling_s"].rounds == 2
    assert verdicts["rise_s"].rounds == 3


def test_equal_tries_are_no_change() -> None:
    for verdict in judge([Figures(1e-3, 1e-3)] * 5, [Figures(1e-3, 1e-3)] * 5):
        assert not verdict.shows


def test_rounds_go_forth_and_back() -> None:
    assert [order(3, number) for number in range(3)] == [[0, 1, 2], [2, 1, 0], [0, 1, 2]]


class Robot:
    """Keeps the values that it was given."""

    def __init__(self) -> None:
        self.parameters = self
        self.seen: list[float] = []

    def set_many(self, values: dict[str, float]) -> None:
        self.seen.append(values["WS_P"])


def test_every_try_is_with_its_own_values() -> None:
    robot: Any = Robot()
    trace = Trace(np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))

    def experiment(_: Any) -> tuple[Trace, Figures]:
        return trace, Figures(robot.seen[-1], 0.0)

    tries = run_rounds(robot, [{"WS_P": 1.0}, {"WS_P": 2.0}], 3, experiment, lambda *_: None)
    assert robot.seen == [1.0, 2.0, 2.0, 1.0, 1.0, 2.0]
    assert [[figures.position_m for _, figures in entry] for entry in tries] == [[1.0] * 3, [2.0] * 3]
