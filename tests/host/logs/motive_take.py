# SPDX-License-Identifier: MIT
"""Writes takes as OptiTrack Motive exports them (format 1.23, and 1.25 with a row of parents)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def write_take(
    path: Path,
    pose: Array,
    *,
    rate_Hz: float = 100.0,
    height_m: float = 0.12,
    rotation: str = "Quaternion",
    unit: tuple[str, float] = ("Meters", 1.0),
    up: str = "y",
    bodies: Sequence[str] = ("Robot",),
    hidden: Sequence[int] = (),
    parents: bool = False,
    marker: bool = False,
) -> Path:
    """Write poses (n, 3) [m, m, rad] on the floor as a take; the first body has them, others stand still.

    Motive's x is x here, its -z is y, and its y is the height. With ``marker`` there is no rigid body, but a marker.
    """
    turn = ["X", "Y", "Z", "W"] if rotation == "Quaternion" else list(rotation)
    kind = "Marker" if marker else "Rigid Body"
    per_body = [] if marker else [("Rotation", axis) for axis in turn]
    per_body += [("Position", axis) for axis in "XYZ"]
    if not marker:
        per_body.append(("Mean Marker Error", ""))
    columns = [(kind, name, what, axis) for name in bodies for what, axis in per_body]
    if not marker:
        columns += [("Rigid Body Marker", f"{bodies[0]}:Marker1", "Position", axis) for axis in "XYZ"]
    settings = (
        f"Format Version,{1.25 if parents else 1.23},Take Name,Take 1,Take Notes,,Capture Frame Rate,{rate_Hz:.6f},"
        f"Export Frame Rate,{rate_Hz:.6f},Capture Start Time,2026-05-04 10.12.31.516 AM,"
        f"Total Frames in Take,{len(pose)},Total Exported Frames,{len(pose)},"
        f"Rotation Type,{rotation},Length Units,{unit[0]},Coordinate Space,Global"
    )
    lines = [settings, "", ",Type," + ",".join(c[0] for c in columns), ",Name," + ",".join(c[1] for c in columns)]
    lines.append(",ID," + ",".join(f'"{len(c[1])}F"' for c in columns))
    if parents:
        lines.append(",Parent," + ",".join("" for _ in columns))
    lines += [",," + ",".join(c[2] for c in columns), "Frame,Time (Seconds)," + ",".join(c[3] for c in columns)]
    for frame, (x, y, theta) in enumerate(pose):
        cells = []
        for number in range(len(bodies)):
            place = np.array([x, y, theta]) if number == 0 else np.array([0.5, 0.5, 0.0])
            cells += _body(place, height_m, rotation, unit[1], up, marker=marker)
        cells += [] if marker else ["0.1", "0.2", "0.3"]
        if frame in hidden:
            cells = [""] * len(cells)
        lines.append(f"{frame},{frame / rate_Hz:.6f}," + ",".join(cells))
    path.write_text("\ufeff" + "\r\n".join(lines) + "\r\n", encoding="utf-8")
    return path


def _body(pose: Array, height_m: float, rotation: str, unit_m: float, up: str, *, marker: bool) -> list[str]:
    x, y, theta = pose
    place = (x, height_m, -y) if up == "y" else (x, y, height_m)
    cells = [f"{value / unit_m:.6f}" for value in place]
    if marker:
        return cells
    axis = "XYZ".index(up.upper())
    if rotation == "Quaternion":
        turn = [0.0, 0.0, 0.0, np.cos(0.5 * theta)]
        turn[axis] = np.sin(0.5 * theta)
    else:
        angles = {"X": 0.0, "Y": 0.0, "Z": 0.0}
        wrapped = np.degrees(np.angle(np.exp(1j * theta)))
        if axis == 1 and rotation[1] == "Y" and abs(wrapped) > 90.0:  # the middle angle is within a quarter turn
            angles = {"X": 180.0, "Z": 180.0}
            wrapped = np.sign(wrapped) * 180.0 - wrapped
        angles["XYZ"[axis]] = wrapped
        turn = [angles[each] for each in rotation]
    return [*(f"{value:.6f}" for value in turn), *cells, "0.000213"]
