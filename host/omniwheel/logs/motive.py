# SPDX-License-Identifier: MIT
"""OptiTrack Motive's CSV export as ground truth: one rigid body, or one marker, on the floor.

The file has a line of settings, then rows that give the type, name, ID (and parent) of each column's object, the row
"Rotation, Position, ...", the row "Frame, Time (Seconds), X, Y, ...", and one row per frame. Cells are empty while the
cameras do not see the body.

Motive's axes are right-handed with y up by default. Here x is forward along its X, y along its -Z, and z up.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omni_schema.errors import did_you_mean
from omniwheel.errors import LogError
from omniwheel.logs.log import Array
from omniwheel.quaternion import find_wrong_length

FIRST_CELL = "Format Version"
LENGTH_M = {"Meters": 1.0, "Centimeters": 1e-2, "Millimeters": 1e-3}
AXES = "XYZ"
UP_AXES = {"y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), "z": np.eye(3)}
"""Rotation from the export's axes to x, y on the floor and z up, by the axis that is up."""
BODY, MARKER = "Rigid Body", "Marker"
HEADER_LINES = 20
"""The row of axes is within the first so many lines."""
LARGEST_HEIGHT_M = 0.1
"""Height that a robot on a floor does not exceed between 5 and 95 % of its run."""
LARGEST_TILT_RAD = np.radians(30.0)


@dataclass(frozen=True)
class MotiveOptions:
    """Name of the ``body`` ("": the file has one only), and which axis of the export is ``up``."""

    body: str = ""
    up: str = "y"


@dataclass(frozen=True)
class MotiveTrack:
    """Poses of the frames in which the body was seen.

    ``time_s`` (n,) since the take began, ``xy`` (n, 2) [m], ``theta`` (n,) [rad], NaN for a marker; ``hidden_frames``
    had no pose.
    """

    time_s: Array
    xy: Array
    theta: Array
    hidden_frames: int


def is_motive_export(path: Path) -> bool:
    """Say whether a file begins like Motive's CSV export."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            return file.read(len(FIRST_CELL)) == FIRST_CELL
    except (OSError, UnicodeDecodeError):
        return False


def read_motive(path: Path, options: MotiveOptions) -> MotiveTrack:
    """Read one body of an export. Raises LogError that names the file and its line."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LogError(f"{path} cannot be read: {error}", hint="export the take from Motive again") from error
    first, header = _header(path, lines)
    settings = dict(zip(lines[0][::2], lines[0][1::2], strict=False))
    chosen, is_body = _columns_of(path, header, options.body)
    rotation = settings.get("Rotation Type", "") if is_body else ""
    if is_body and not rotation:
        raise LogError(
            f"{path}: the settings in its first line have no rotation type, so the body's heading is unknown",
            hint="export with the rotation type Quaternion, or choose a marker, which needs none: truth.body",
        )
    names = _pose_columns(path, header, chosen, rotation)
    time_s, cells = _numbers(path, lines, first, names)
    seen = np.all(np.isfinite(cells), axis=1)
    if not np.any(seen):
        raise LogError(f"{path}: no frame has a pose of this body", hint="choose another body: truth.body")
    axes = UP_AXES[options.up]
    place = cells[seen, :3] @ axes.T * _length_m(path, settings)
    _require_floor(path, place, options.up)
    theta = np.full(len(place), np.nan)
    if is_body:
        turned = _matrices(path, cells[seen, 3:], rotation, np.flatnonzero(seen) + first + 1)
        theta = _headings(path, axes @ turned @ axes.T)
    return MotiveTrack(time_s[seen], place[:, :2], theta, int(np.sum(~seen)))


def _header(path: Path, lines: list[list[str]]) -> tuple[int, list[list[str]]]:
    """Return the index of the first frame's line, and the rows that describe the columns. Raises LogError."""
    for index, row in enumerate(islice(lines, HEADER_LINES)):
        if row and row[0].strip() == "Frame":
            header = [line for line in lines[1 : index + 1] if any(cell.strip() for cell in line)]
            width = len(row)
            if len(header) < 4 or any(len(line) > width for line in header):
                break
            return index + 1, [[cell.strip() for cell in line] + [""] * (width - len(line)) for line in header]
    raise LogError(
        f"{path} is not a complete Motive export: its header lacks the rows of type, name, position and axis",
        hint="export with header information, rigid bodies and positions",
    )


def _columns_of(path: Path, header: list[list[str]], wanted: str) -> tuple[list[int], bool]:
    """Return the columns of the body or marker, and whether it is a body, which has a rotation. Raises LogError."""
    objects: dict[str, dict[str, list[int]]] = {BODY: {}, MARKER: {}}
    for column in range(2, len(header[0])):
        kind, name = header[0][column], header[1][column]
        if kind in objects:
            objects[kind].setdefault(name, []).append(column)
    bodies, markers = objects[BODY], objects[MARKER]
    known = bodies or markers
    if wanted in bodies or wanted in markers:
        return (bodies[wanted], True) if wanted in bodies else (markers[wanted], False)
    if wanted:
        every = [*bodies, *markers]
        raise LogError(
            f"{path} has no body {wanted!r}{did_you_mean(wanted, every)}",
            hint=f"set truth.body in the mapping to one of: {', '.join(every) or 'none is in the file'}",
        )
    if len(known) == 1:
        return next(iter(known.values())), bool(bodies)
    if not known:
        raise LogError(f"{path} has neither a rigid body nor a marker", hint="export rigid bodies from Motive")
    raise LogError(
        f"{path} has {len(known)} {'rigid bodies' if bodies else 'markers'}: {', '.join(known)}",
        hint='choose one in the column mapping: [truth] format = "motive", body = "NAME"',
    )


def _pose_columns(path: Path, header: list[list[str]], chosen: list[int], rotation: str) -> list[int]:
    """Return the columns of X, Y, Z, and of the rotation in its own order: X, Y, Z, W or the Euler angles' axes."""
    place = {header[-1][c]: c for c in chosen if header[-2][c] == "Position"}
    turn = {header[-1][c]: c for c in chosen if header[-2][c] == "Rotation"}
    if set(place) != set(AXES):
        raise LogError(f"{path}: the body has no columns of its position", hint="export positions from Motive")
    if not rotation:
        return [place[axis] for axis in AXES]
    quaternion = rotation == "Quaternion"
    if not quaternion and sorted(rotation) != list(AXES):
        raise LogError(f"{path}: the rotation type is {rotation!r}", hint="export with the rotation type Quaternion")
    wanted = AXES + "W" if quaternion else rotation
    if set(turn) != set(wanted):
        raise LogError(
            f"{path}: the rotation type is {rotation}, but its columns are {', '.join(turn) or 'missing'}",
            hint="export with the rotation type Quaternion",
        )
    return [*(place[axis] for axis in AXES), *(turn[axis] for axis in wanted)]


def _numbers(path: Path, lines: list[list[str]], first: int, columns: list[int]) -> tuple[Array, Array]:
    """Return the times (n,) [s] and the cells (n, columns), NaN where a cell is empty. Raises LogError."""
    times, cells = [], []
    for number, row in enumerate(lines[first:], first + 1):
        if not any(cell.strip() for cell in row):
            continue
        try:
            times.append(float(row[1]))
            found = [row[column].strip() if column < len(row) else "" for column in columns]
            cells.append([float(cell) if cell else np.nan for cell in found])
        except (ValueError, IndexError):
            raise LogError(
                f"{path}:{number}: a time or a pose is not a number with a decimal point",
                hint="repair that line, or export the take again",
            ) from None
    if not times:
        raise LogError(f"{path} has no frames", hint="export the take again")
    return np.array(times), np.array(cells)


def _length_m(path: Path, settings: dict[str, str]) -> float:
    unit = settings.get("Length Units", "Meters")
    if unit not in LENGTH_M:
        raise LogError(f"{path}: the length unit is {unit!r}", hint=f"export with one of: {', '.join(LENGTH_M)}")
    return LENGTH_M[unit]


def _require_floor(path: Path, place: Array, up: str) -> None:
    """Raise LogError where the height changes more than a robot's on a floor, and more than another axis."""
    spread = np.percentile(place, 95.0, axis=0) - np.percentile(place, 5.0, axis=0)
    if spread[2] > LARGEST_HEIGHT_M and spread[2] > np.min(spread[:2]):
        other = "z" if up == "y" else "y"
        raise LogError(
            f"{path}: the body moves {spread[2]:.2f} m along {up}, which is taken as the axis that points up",
            hint=f'if the take was exported with {other} up, write up = "{other}" and format = "motive" under [truth]',
        )


def _matrices(path: Path, cells: Array, rotation: str, line: NDArray[np.int64]) -> Array:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4) x y z w, or of intrinsic Euler angles (n, 3) [deg]."""
    if rotation != "Quaternion":
        found = np.tile(np.eye(3), (len(cells), 1, 1))
        for axis, angle in zip(rotation, np.radians(cells).T, strict=True):
            found = found @ _about(AXES.index(axis), angle)
        return found
    if (wrong := find_wrong_length(cells)) is not None:
        row, length = wrong
        raise LogError(
            f"{path}:{line[row]}: the quaternion's length is {length:.3g} instead of 1",
            hint="delete that line, or export the take again",
        )
    x, y, z, w = (cells / np.linalg.norm(cells, axis=1)[:, None]).T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def _about(axis: int, angle_rad: Array) -> Array:
    """Rotations (n, 3, 3) about one axis."""
    found = np.tile(np.eye(3), (len(angle_rad), 1, 1))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    found[:, one, one] = found[:, two, two] = np.cos(angle_rad)
    found[:, two, one] = np.sin(angle_rad)
    found[:, one, two] = -found[:, two, one]
    return found


def _headings(path: Path, turned: Array) -> Array:
    """Headings (n,) [rad] of upright bodies: where their x axis points on the floor. Raises LogError."""
    tilt = np.arccos(np.clip(turned[:, 2, 2], -1.0, 1.0))
    if float(np.median(tilt)) > LARGEST_TILT_RAD:
        raise LogError(
            f"{path}: the body is tilted by {np.degrees(np.median(tilt)):.0f} degrees in the median",
            hint="reset the rigid body's orientation in Motive while the robot stands on the floor, and export again",
        )
    return np.unwrap(np.arctan2(turned[:, 1, 0], turned[:, 0, 0]))
