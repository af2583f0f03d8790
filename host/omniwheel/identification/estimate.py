# SPDX-License-Identifier: MIT
"""A set of estimated parameters with the intervals that the data give them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError, MissingPackageError

Array = NDArray[np.float64]
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """Values (p,) in SI (units are in the names), covariance (p, p), degrees of freedom of the intervals."""

    names: tuple[str, ...]
    values: Array
    covariance: Array
    dof: float

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def sd(self, name: str) -> float:
        """Return the standard deviation of one parameter."""
        index = self.names.index(name)
        return float(np.sqrt(self.covariance[index, index]))

    def half_width(self, name: str) -> float:
        """Return half the 95 % interval of one parameter."""
        return student_quantile(self.dof) * self.sd(name)

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of one parameter."""
        return self[name] - self.half_width(name), self[name] + self.half_width(name)

    def covers(self, name: str, truth: float) -> bool:
        """Tell whether the truth is inside the interval."""
        return abs(truth - self[name]) <= self.half_width(name)

    def joined(self, other: Estimate, prefix: str = "") -> Estimate:
        """Return both sets in one; the two are independent. ``prefix`` goes before the other's names."""
        names = self.names + tuple(prefix + name for name in other.names)
        zero = np.zeros((len(self.names), len(other.names)))
        covariance = np.block([[self.covariance, zero], [zero.T, other.covariance]])
        return Estimate(names, np.concatenate((self.values, other.values)), covariance, min(self.dof, other.dof))

    def transformed(self, names: tuple[str, ...], function: Callable[[Array], Array]) -> Estimate:
        """Return functions of the parameters, their covariance to first order."""
        step = 1e-6 * np.maximum(np.abs(self.values), 1e-9)
        columns = [
            (function(self.values + step * unit) - function(self.values - step * unit)) / (2.0 * step[i])
            for i, unit in enumerate(np.eye(len(self.values)))
        ]
        slope = np.column_stack(columns)
        return Estimate(names, function(self.values), slope @ self.covariance @ slope.T, self.dof)


def clustered_covariance(jacobian: Array, residual: Array, cluster: NDArray[np.int64]) -> tuple[Array, float]:
    """Return the covariance (p, p) of a least-squares estimate and its degrees of freedom.

    ``jacobian`` is (rows, p), ``residual`` and ``cluster`` are (rows,). Rows that share a number in ``cluster`` may be
    correlated in any way, in time and between wheels. Clusters are taken as independent (Liang and Zeger's sandwich
    with the factor B / (B - p)).
    """
    scale = np.linalg.norm(jacobian, axis=0)
    if np.any(scale == 0.0):
        raise IdentificationError("a parameter has no effect on the data", hint="excite every direction")
    scaled = jacobian / scale
    clusters = int(cluster.max()) + 1
    parameters = jacobian.shape[1]
    if clusters <= parameters:
        raise IdentificationError(f"the data make {clusters} independent parts; more than {parameters} are needed")
    scores = np.zeros((clusters, parameters))
    np.add.at(scores, cluster, scaled * residual[:, None])
    bread = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    dof = clusters - parameters
    covariance = bread @ (scores.T @ scores) @ bread * (clusters / dof)
    return covariance / np.outer(scale, scale), float(dof)


def student_quantile(dof: float) -> float:
    """Return the two-sided 95 % quantile of Student's t."""
    return float(require_scipy("special").stdtrit(dof, 0.5 + CONFIDENCE / 2.0))


def require_scipy(module: str) -> ModuleType:
    """Import a module of SciPy; MissingPackageError says how to get it."""
    try:
        return import_module(f"scipy.{module}")
    except ImportError as error:
        hint = "pip install 'omniwheel[study]', or in a clone: make setup"
        raise MissingPackageError("this needs SciPy, which is not installed", hint=hint) from error
