# SPDX-License-Identifier: MIT
"""How far an identification can be believed: fit, whiteness of the residual, excitation."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.identification.estimate import require_scipy
from omniwheel.identification.output_error import Fit

Array = NDArray[np.float64]

LAGS = 10
TEST_LEVEL = 0.01
CONDITION_MAX = 1e3
COLOURED = 0.2


@dataclass(frozen=True)
class Diagnostics:
    """What is known of a fit.

    ``fit`` is the share of the speeds' variation explained, and ``rmse_rad_s`` the residual. ``correlation`` is that of
    neighbouring residuals. ``whiteness_p`` is of the Ljung-Box test (small: not white). ``condition`` is that of the
    parameters' correlation (large: some trade against each other). ``saturated_share`` is of moving rows at full duty.
    """

    fit: float
    rmse_rad_s: float
    correlation: float
    whiteness_p: float
    condition: float
    saturated_share: float

    def as_dict(self) -> dict[str, float]:
        """Return the numbers by name."""
        return asdict(self)

    def remarks(self) -> tuple[str, ...]:
        """Return what a reader should know before using the numbers, one sentence each."""
        remarks = []
        if self.whiteness_p < TEST_LEVEL and abs(self.correlation) > COLOURED:
            remarks.append(
                f"The residual is not white (neighbours correlate by {self.correlation:.2f}): quantisation of the "
                "encoders if negative, an unmodelled effect if positive. The intervals include it."
            )
        if self.condition > CONDITION_MAX:
            remarks.append("Some parameters are strongly correlated: vary speed and direction more.")
        if self.saturated_share > 0.0:
            remarks.append(f"{100 * self.saturated_share:.0f} % of the rows are at full duty and were left out.")
        return tuple(remarks)


def diagnose(fit: Fit) -> Diagnostics:
    """Return the diagnostics of a fit."""
    autocorrelation, pairs = residual_autocorrelation(fit.residual_rad_s, LAGS)
    statistic = float(np.sum(autocorrelation[1:] ** 2 * pairs[1:]))
    sd = np.sqrt(np.diag(fit.estimate.covariance))
    singular = np.linalg.svd(fit.estimate.covariance / np.outer(sd, sd), compute_uv=False)
    return Diagnostics(
        fit.fit,
        fit.rmse_rad_s,
        float(autocorrelation[1]),
        float(require_scipy("special").chdtrc(LAGS, statistic)),
        float(np.sqrt(singular[0] / singular[-1])),
        fit.saturated_share,
    )


def residual_autocorrelation(residual: Array, lags: int) -> tuple[Array, Array]:
    """Return the autocorrelation (lags + 1,) of residuals (segments, rows, wheels) along rows, and the pairs behind it.

    NaN rows are left out; pairs never reach over a segment's end.
    """
    rows = residual.shape[1]
    sums, pairs = np.zeros(lags + 1), np.zeros(lags + 1)
    for lag in range(min(lags, rows - 1) + 1):
        product = residual[:, lag:] * residual[:, : rows - lag]
        pairs[lag] = np.sum(np.isfinite(product))
        sums[lag] = np.nansum(product)
    correlation: Array = (sums / np.maximum(pairs, 1)) / (sums[0] / max(pairs[0], 1))
    return correlation, pairs
