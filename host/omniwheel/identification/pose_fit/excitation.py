# SPDX-License-Identifier: MIT
"""Which parameters the motion of the runs does not show, and the motion that would show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.identification.pose_fit.wheel_model import WheelModel
from omniwheel.identification.pose_fit.windows import Run

LEAST_SHARE = 0.1
"""Share of a wheel's rolling that each direction needs, for a radius by direction."""
WIDEST_SHARE = 0.05
"""A radius or distance whose 95 % interval is wider than this share of it (half width) is not identified."""
WIDEST_POINT_M = 0.02
WIDEST_HEADING_RAD = 0.035


@dataclass(frozen=True)
class Refusal:
    """A parameter that keeps its nominal value, why, and the motion that would show it."""

    name: str
    why: str
    motion: str


def widest(layout: WheelModel) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the largest half width (p,) of a 95 % interval with which a parameter counts as identified."""
    limits = {
        "radius": WIDEST_SHARE * layout.radius_m,
        "distance": WIDEST_SHARE * layout.distance_m,
        "tracked_x": WIDEST_POINT_M,
        "tracked_y": WIDEST_POINT_M,
        "tracked_heading": WIDEST_HEADING_RAD,
    }
    return np.array([limits.get(kind, np.inf) for kind in layout.kinds])


def not_excited(name: str, kind: str, half_width: float, runs: Sequence[Run]) -> Refusal:
    """Return the refusal of a parameter with its interval, in SI units."""
    motions = {
        "radius": "drive straight for two metres or more in two directions: ahead and sideways",
        "distance": f"turn on the spot, two full turns to each side{_one_way(runs)}",
        "tracked_x": "turn on the spot, or drive a circle, two full turns to each side",
        "tracked_y": "turn on the spot, or drive a circle, two full turns to each side",
        "tracked_heading": "drive straight for two metres or more without turning",
    }
    return Refusal(name, f"95 % interval ±{half_width:.2g} {name.rpartition('_')[2]}", motions[kind])


def without_heading(runs: Sequence[Run]) -> list[Refusal]:
    """Return the refusal of the tracked heading where no truth has one: any value of it gives the same positions."""
    if any(run.has_heading for run in runs):
        return []
    return [Refusal("tracked_heading_rad", "the truth has no heading", "also measure the heading, with two markers")]


def one_way_wheels(runs: Sequence[Run]) -> list[Refusal]:
    """Return the refusals of the direction parameters of wheels that roll (nearly) one way only."""
    forward, backward = _rolled(runs)
    found = []
    for wheel, (ahead, back) in enumerate(zip(forward, backward, strict=True), start=1):
        if min(ahead, back) >= LEAST_SHARE * (ahead + back):
            continue
        way, side = ("forward", "left") if ahead < back else ("backward", "right")
        share = 100.0 * min(ahead, back) / max(ahead + back, 1e-9)
        found.append(
            Refusal(
                f"wheel_{wheel}_direction",
                f"{share:.0f} % of its rolling is {way}",
                f"drive a circle to the {side}, too",
            )
        )
    return found


def _rolled(runs: Sequence[Run]) -> tuple[list[float], list[float]]:
    wheels = runs[0].wheels
    total = sum((np.abs(run.rolled_rad[-1] - run.rolled_rad[0]) for run in runs), np.zeros(3 * wheels))
    return [float(value) for value in total[:wheels]], [float(value) for value in total[wheels : 2 * wheels]]


def _one_way(runs: Sequence[Run]) -> str:
    if not all(run.has_heading for run in runs):
        return ""
    turned = sum(float(np.sum(np.abs(np.diff(run.pose[:, 2])))) for run in runs)
    return f" (the truth turns by {turned:.1f} rad in all)"
