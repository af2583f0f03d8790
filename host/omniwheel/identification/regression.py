# SPDX-License-Identifier: MIT
"""The report's identification, (82)-(88), as published: to be compared with, not to be used.

States (x, y, theta) and inputs (u_1..u_4) of wheels at 0, 90, 180 and 270 degrees, one row per T::

    x_k+1 = A_d x_k + B_d u_k + D_d,  A_d diagonal,  B_d as rows (0, b1, 0, -b1), (b2, 0, -b2, 0), (b3, b3, b3, b3)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError

Array = NDArray[np.float64]

NAMES = ("a11_d", "a22_d", "a33_d", "b1_d", "b2_d", "b3_d", "f1_d", "f2_d", "f3_d")
PWM_FULL = 255.0


@dataclass(frozen=True)
class Discrete:
    """The nine unknowns of (83) in the order of Table 8."""

    a: tuple[float, float, float]
    b: tuple[float, float, float]
    f: tuple[float, float, float]


def inputs(u: Array) -> Array:
    """Return u_2 - u_4, u_1 - u_3 and the sum of all, (n, 3), from wheel inputs (n, 4)."""
    return np.column_stack((u[:, 1] - u[:, 3], u[:, 0] - u[:, 2], u.sum(axis=1)))


def least_squares(before: Array, after: Array, u: Array, *, sign_terms: bool = False) -> Discrete:
    """Solve (83) in closed form, P = (E' E)^-1 E' O: states before and after each row (n, 3), wheel inputs (n, 4).

    With ``sign_terms`` D_d multiplies sgn of the state, as in (14), instead of 1 as in (82). Raises
    IdentificationError.
    """
    if before.shape != after.shape or before.shape[1:] != (3,) or u.shape != (len(before), 4):
        raise IdentificationError("(83) needs n x 3 states before and after, and n x 4 inputs: a four-wheel robot")
    n = len(before)
    drive = inputs(u)
    constant = np.sign(before) if sign_terms else np.ones_like(before)
    matrix = np.zeros((3 * n, 9))
    for axis in range(3):
        for block, column in enumerate((before, drive, constant)):
            matrix[axis * n : (axis + 1) * n, 3 * block + axis] = column[:, axis]
    solved, _, rank, _ = np.linalg.lstsq(matrix, after.T.reshape(-1), rcond=None)
    if rank < 9:
        raise IdentificationError("E of (83) is rank-deficient: an axis is not excited", hint="drive circles and spins")
    a, b, f = (tuple(float(x) for x in part) for part in solved.reshape(3, 3))
    return Discrete((a[0], a[1], a[2]), (b[0], b[1], b[2]), (f[0], f[1], f[2]))


def continuous(found: Discrete, period_s: float, mass_kg: float, distance_m: float) -> dict[str, float]:
    """Return Table 9's variables by (84)-(88) as printed, nan where a logarithm does not exist.

    ``J`` is (87) times 255, the PWM's full scale.
    ``beta_1`` is (85)'s first form, ``beta_1_second`` its second, ``beta_1_exact`` what inverts the discretisation.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        a = np.log(np.array(found.a)) / period_s
        grown = np.exp(a * period_s)
        f = np.array(found.f) * a / (grown - 1.0)
    beta_1 = -found.b[0] * mass_kg * a[0] / grown[0]
    beta_2 = found.b[2] * a[2] / (beta_1 * (grown[2] - 1.0))
    return {
        **{f"a{i + 1}{i + 1}": float(a[i]) for i in range(3)},
        "beta_1": float(beta_1),
        "beta_1_second": float(found.b[1] * mass_kg * a[1] / grown[1]),
        "beta_1_exact": float(-found.b[0] * mass_kg * a[0] / (grown[0] - 1.0)),
        "beta_2": float(beta_2),
        "d": distance_m,
        "J": float(PWM_FULL * distance_m / beta_2),
        **{f"f{i + 1}": float(f[i]) for i in range(3)},
    }


def wrapped_by_atan(heading_rad: Array) -> Array:
    """Return headings as an arc tangent of one argument gives them: between -pi/2 and pi/2."""
    wrapped: Array = np.arctan(np.tan(heading_rad))
    return wrapped
