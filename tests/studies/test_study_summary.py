# SPDX-License-Identifier: MIT
"""Studies' numbers against independent ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from hil_sim import core
from hil_sim.studies import engine
from hil_sim.studies.study_summary import fault_counts, ranking, spread, student_quantile, summarise, wilson


def test_students_quantile_is_scipys() -> None:
    for dof in (1, 2):
        assert student_quantile(dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=1e-9)
    for dof in (3, 4, 7, 20, 63, 1000, 10**6):
        assert student_quantile(dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=3e-3)


@pytest.mark.parametrize(("successes", "count"), [(0, 10), (10, 10), (3, 10), (995, 1000), (1, 1)])
def test_wilsons_interval_is_scipys(successes: int, count: int) -> None:
    wanted = stats.binomtest(successes, count).proportion_ci(0.95, "wilson")
    assert wilson(successes, count) == pytest.approx([wanted.low, wanted.high], abs=1e-9)


def test_the_interval_of_the_mean_covers_it_in_95_of_100_studies() -> None:
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(2000):
        low, high = spread(rng.normal(3.0, 2.0, 12))["mean_95"]
        covered += low <= 3.0 <= high
    assert covered / 2000 == pytest.approx(0.95, abs=0.015)


def test_a_spread_is_of_the_finite_values() -> None:
    values = np.array([1.0, 2.0, np.nan, 4.0, 9.0, np.inf])
    found = spread(values)
    assert found["runs"] == 4
    assert found["mean"] == 4.0
    assert found["median"] == 3.0
    assert (found["min"], found["max"]) == (1.0, 9.0)
    assert found["sd"] == pytest.approx(math.sqrt(38.0 / 3.0))
    assert spread(np.array([np.nan]))["mean"] is None
    assert spread(np.array([5.0]))["mean_95"] is None


def test_faults_are_counted_by_run_and_name() -> None:
    rows = np.zeros(5, engine.ROW)
    rows["faults"][1:3] = 1
    found = fault_counts(rows, "stops")
    assert found == {core.fault_names(1)[0]: 2}
    assert fault_counts(rows, "warnings") == {}


def test_the_worst_come_first_and_runs_without_the_figure_before_all() -> None:
    rows = np.zeros(5, engine.ROW)
    rows["seed"] = [10, 11, 12, 13, 14]
    rows["position_m"] = [0.2, 0.5, np.nan, 0.5, 0.1]
    assert ranking(rows, "position_m").tolist() == [2, 1, 3, 0, 4]


def test_a_summary_says_how_many_drove_to_the_end() -> None:
    rows = np.zeros(4, engine.ROW)
    rows["completed"] = [1.0, 1.0, 0.0, 1.0]
    rows["ticks"] = 1500
    summary = summarise(rows)
    assert summary["completed"]["share"] == 0.75
    assert summary["simulated_s"] == 6.0
