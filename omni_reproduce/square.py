# SPDX-License-Identifier: MIT
"""UMBmark (Borenstein and Feng, 1996): what return errors of a square say, and what wrong geometry gives exactly.

A return error is where the robot is after a square, less where it believes to be. It is x and y [m] in the frame of
the start. Systematic errors move the centre of gravity of the runs of one direction. What spreads about it is not
systematic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CORNER_RAD = 0.5 * math.pi
EDGES = 4


@dataclass(frozen=True)
class Umbmark:
    """The centres of gravity [m] of the return errors, clockwise and counter-clockwise, and what spreads about them.

    ``spread_m`` is the root mean square distance of a run from its centre, both directions together. Each centre takes
    a degree of freedom.
    """

    clockwise_m: tuple[float, float]
    counter_clockwise_m: tuple[float, float]
    spread_m: float

    @property
    def systematic_m(self) -> float:
        """E_max,syst: the distance of the farther centre from zero."""
        return max(math.hypot(*self.clockwise_m), math.hypot(*self.counter_clockwise_m))


def umbmark(clockwise: Array, counter_clockwise: Array) -> Umbmark:
    """Return what the return errors (runs, 2) of both directions say. Each needs two runs for the spread."""
    centres = [errors.mean(axis=0) for errors in (clockwise, counter_clockwise)]
    squares = sum(
        float(((errors - centre) ** 2).sum())
        for errors, centre in zip((clockwise, counter_clockwise), centres, strict=True)
    )
    free = len(clockwise) + len(counter_clockwise) - len(centres)
    (x_cw, y_cw), (x_ccw, y_ccw) = (centre.tolist() for centre in centres)
    return Umbmark((x_cw, y_cw), (x_ccw, y_ccw), math.sqrt(squares / free) if free > 0 else math.nan)


@dataclass(frozen=True)
class Wheels:
    """Where wheels stand and how large they are: radius [m] and angle [rad] per wheel, and the distance [m] of all."""

    radius_m: Array
    angle_rad: Array
    distance_m: float

    def rims(self) -> Array:
        """Return the matrix (wheels, 3) from the body's motion to what each rim rolls, both in metres and radians."""
        return np.column_stack(
            [-np.sin(self.angle_rad), np.cos(self.angle_rad), np.full(len(self.angle_rad), self.distance_m)]
        )


def true_motion(motion: Array, true: Wheels, believed: Wheels) -> Array:
    """Return the body's motion (3,) when a robot with wrong geometry believes in ``motion``; its wheels never slip.

    Each wheel turns as the robot believes that it must. With four wheels, the floor settles in least squares what they
    contradict each other in.
    """
    turned = (believed.rims() @ motion) / believed.radius_m
    return np.asarray(np.linalg.lstsq(true.rims(), true.radius_m * turned, rcond=None)[0], dtype=np.float64)


def legs(edge_m: float, sign: int, *, turning: bool) -> list[Array]:
    """Return the body's motions of a square, in their order: x, y [m], turn [rad]. ``sign`` 1: counter-clockwise."""
    found: list[Array] = []
    for number in range(EDGES):
        if turning:
            found += [np.array([edge_m, 0.0, 0.0]), np.array([0.0, 0.0, sign * CORNER_RAD])]
        else:
            angle = sign * number * CORNER_RAD
            found.append(edge_m * np.array([math.cos(angle), math.sin(angle), 0.0]))
    return found


def end_of(motions: Sequence[Array]) -> Array:
    """Return the pose after motions of constant twist, one after another from zero: x, y [m], heading [rad]."""
    place, heading = 0.0 + 0.0j, 0.0
    for x, y, turn in motions:
        chord = np.sinc(0.5 * turn / math.pi) * (x + 1j * y)
        place += chord * np.exp(1j * (heading + 0.5 * turn))
        heading += float(turn)
    return np.array([place.real, place.imag, heading])


def expected_error(motions: Sequence[Array], true: Wheels, believed: Wheels) -> Array:
    """Return the pose error, truth less belief, that wrong geometry gives after motions on wheels that never slip."""
    real = [true_motion(motion, true, believed) for motion in motions]
    error: Array = end_of(real) - end_of(motions)
    return error
