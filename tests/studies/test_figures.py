# SPDX-License-Identifier: MIT
"""How a user names a number of many runs, and bounds it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil_sim.studies import engine
from hil_sim.studies.errors import StudyInputError
from hil_sim.studies.figures import FIGURES, parse_constraint, parse_number


@pytest.fixture
def rows() -> np.ndarray:
    made = np.zeros(101, engine.ROW)
    made["position_m"] = np.linspace(0.0, 1.0, 101)
    made["theta_rad"][7] = np.nan
    made["completed"][:60] = 1.0
    return made


def test_every_figure_is_a_column() -> None:
    assert set(FIGURES) <= set(engine.ROW.names or ())


def test_statistics_are_what_they_say(rows: np.ndarray) -> None:
    wanted = {
        "": 0.5,
        ".mean": 0.5,
        ".median": 0.5,
        ".p95": 0.95,
        ".p2.5": 0.025,
        ".p100": 1.0,
        ".min": 0.0,
        ".max": 1.0,
    }
    for statistic, value in wanted.items():
        assert parse_number(f"position_m{statistic}").of(rows) == pytest.approx(value)
    assert parse_number("position_m.sd").of(rows) == pytest.approx(np.std(rows["position_m"], ddof=1))
    assert parse_number("completed").of(rows) == pytest.approx(60 / 101)


def test_a_run_without_the_figure_leaves_no_number(rows: np.ndarray) -> None:
    assert math.isnan(parse_number("theta_rad").of(rows))
    assert parse_constraint("theta_rad<=1").violation(rows) == math.inf


def test_constraints_know_by_how_much_they_are_missed(rows: np.ndarray) -> None:
    assert parse_constraint("position_m.p95<=0.9").violation(rows) == pytest.approx(0.05)
    assert parse_constraint(" position_m >= 0.25 ").violation(rows) == pytest.approx(-0.25)
    assert parse_constraint("position_m.max<=1e0").violation(rows) <= 0.0


@pytest.mark.parametrize("text", ["positon_m", "position_m.p101", "position_m.mode", "", "position_m.p"])
def test_unknown_numbers_are_refused(text: str) -> None:
    with pytest.raises(StudyInputError):
        parse_number(text)


@pytest.mark.parametrize(
    "text", ["position_m", "position_m<0.1", "position_m<=", "position_m<=x", "position_m<=1e999", "<=1"]
)
def test_what_is_no_constraint_is_refused(text: str) -> None:
    with pytest.raises(StudyInputError):
        parse_constraint(text)
