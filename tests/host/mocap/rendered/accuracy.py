# SPDX-License-Identifier: MIT
"""The table of docs/guides/camera.md: ``python -m tests.host.mocap.rendered.accuracy`` prints it.

Each row is a camera above the floor with four tags, and twenty poses of the robot all over the floor. The place of the
camera is found from a picture of the empty floor. The lens is known exactly, so the figures leave its error out.
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from omniwheel.frames import Pose
from tests.host.mocap.rendered.lab import FLOOR, HD, SMALL, scene, watcher
from tests.host.mocap.rendered.scene import Lens, View

POSES = 20
SEED = 1
ROWS = ((HD, 1.5), (HD, 2.0), (HD, 3.0), (SMALL, 1.5), (SMALL, 2.0))
"""Pictures, and how high the camera is [m]."""


@dataclass(frozen=True)
class Row:
    """What a camera reaches: RMS and largest error, RMS of the heading, and the standard deviation it states."""

    rms_m: float
    largest_m: float
    heading_rad: float
    stated_m: float
    seen: int


def measured(lens: Lens, height_m: float, poses: int = POSES, seed: int = SEED) -> Row:
    """Return what a camera of this lens at this height [m] reaches. The poses are drawn with ``seed``."""
    reach = height_m / 2.0
    near = tuple(replace(tag, x=reach * tag.x, y=reach * tag.y) for tag in FLOOR)
    of = scene(View(lens, (0.05, -0.3 * height_m, height_m), (0.0, 0.0, 0.0), 0.1), floor=near)
    draw = np.random.default_rng(seed)
    away, headings, stated = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        eye = watcher(Path(folder), of)
        for at in range(poses):
            x, y, theta = draw.uniform((-0.6, -0.35, -math.pi), (0.6, 0.35, math.pi)) * (reach, reach, 1.0)
            found = eye.look(of.picture(Pose(x, y, theta), at)).found
            if found is not None:
                away.append(math.dist(found.pose[:2], (x, y)))
                headings.append(math.remainder(found.pose[2] - theta, math.tau))
                stated.append(np.trace((found.noise + found.bias)[:2, :2]))
    rms = [float(np.sqrt(np.mean(np.square(values)))) for values in (away, headings)]
    return Row(rms[0], max(away), rms[1], float(np.sqrt(np.mean(stated))), len(away))


def table() -> str:
    """Return the table as Markdown."""
    lines = [
        "| Pictures | camera above the floor | RMS [mm] | largest [mm] | stated RMS [mm] | heading, RMS [mrad] "
        "| poses |",
        "|---|---|---|---|---|---|---|",
    ]
    for lens, height_m in ROWS:
        row = measured(lens, height_m)
        figures = [1e3 * row.rms_m, 1e3 * row.largest_m, 1e3 * row.stated_m, 1e3 * row.heading_rad]
        said = " | ".join(f"{figure:.2f}" for figure in figures)
        lines.append(f"| {lens.width} x {lens.height} | {height_m:g} m | {said} | {row.seen} of {POSES} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
