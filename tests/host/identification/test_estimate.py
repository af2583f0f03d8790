# SPDX-License-Identifier: MIT
"""Intervals: against textbook formulas and against counting."""

from __future__ import annotations

import builtins
from typing import Any

import numpy as np
import pytest

from omniwheel.errors import IdentificationError, MissingPackageError
from omniwheel.identification import estimate
from omniwheel.identification.estimate import Estimate, clustered_covariance, student_quantile


def test_independent_rows_give_the_textbook_covariance() -> None:
    draw = np.random.default_rng(1)
    jacobian = draw.standard_normal((4000, 2)) * [1.0, 1e-3]
    residual = 0.5 * draw.standard_normal(4000)
    covariance, dof = clustered_covariance(jacobian, residual, np.arange(4000))
    textbook = 0.25 * np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(np.diag(covariance), np.diag(textbook), rtol=0.1)
    assert dof == 3998.0


def test_intervals_cover_under_correlated_noise() -> None:
    """Residuals that hold for 25 rows: naive intervals would hold the truth in a third of the cases."""
    draw = np.random.default_rng(2)
    inside = 0
    for _ in range(300):
        blocks = np.repeat(np.arange(40), 25)
        slope = np.repeat(draw.standard_normal(40), 25)[:, None]
        noise = np.repeat(draw.standard_normal(40), 25)
        fitted = float(np.linalg.lstsq(slope, noise, rcond=None)[0][0])
        covariance, dof = clustered_covariance(slope, noise - slope[:, 0] * fitted, blocks)
        inside += Estimate(("x",), np.array([fitted]), covariance, dof).covers("x", 0.0)
    assert 0.90 <= inside / 300 <= 0.99


def test_what_does_nothing_or_is_too_little_is_refused() -> None:
    with pytest.raises(IdentificationError, match="no effect"):
        clustered_covariance(np.array([[1.0, 0.0], [2.0, 0.0], [1.0, 0.0]]), np.ones(3), np.arange(3))
    with pytest.raises(IdentificationError, match="independent parts"):
        clustered_covariance(np.ones((10, 2)), np.ones(10), np.repeat([0, 1], 5))


def test_functions_of_parameters_carry_their_covariance() -> None:
    given = Estimate(("a", "b"), np.array([2.0, 3.0]), np.array([[0.04, 0.01], [0.01, 0.09]]), 50.0)
    product = given.transformed(("ab",), lambda v: np.array([v[0] * v[1]]))
    assert product["ab"] == pytest.approx(6.0)
    assert product.sd("ab") ** 2 == pytest.approx(9.0 * 0.04 + 2.0 * 6.0 * 0.01 + 4.0 * 0.09, rel=1e-6)


def test_joined_estimates_are_independent() -> None:
    one = Estimate(("a",), np.array([1.0]), np.array([[1.0]]), 10.0)
    both = one.joined(Estimate(("a",), np.array([2.0]), np.array([[4.0]]), 5.0), "other_")
    assert both["other_a"] == 2.0
    assert both.covariance[0, 1] == 0.0
    assert both.dof == 5.0


def test_the_quantile_is_students() -> None:
    assert student_quantile(4.0) == pytest.approx(2.776, abs=1e-3)
    assert student_quantile(1e6) == pytest.approx(1.960, abs=1e-3)


def test_missing_scipy_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str, package: str | None = None) -> Any:
        raise builtins.ImportError(name)

    monkeypatch.setattr(estimate, "import_module", refuse)
    with pytest.raises(MissingPackageError) as caught:
        student_quantile(4.0)
    assert "omniwheel[study]" in caught.value.hint
