# SPDX-License-Identifier: MIT
"""Where the camera is, from tags on the floor. ``omni mocap place`` writes it into a TOML file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomli_w

from omni_schema import SchemaError
from omni_schema.toml_file import number_within, read_toml, refuse_unknown_keys, take_table, take_text
from omniwheel import files
from omniwheel.errors import CameraError, MocapSourceError
from omniwheel.mocap.camera.geometry import CORNER_SD_PX, Eye, corners_of
from omniwheel.mocap.camera.lens import Lens
from omniwheel.mocap.camera.library import Array, load_cv2
from omniwheel.mocap.camera.setup import CameraSetup, PlacedTag

TOLERANCE_M = 0.01
"""How far a floor tag may be from where the file says."""
_AMBIGUOUS = 2.0
"""A second place of the camera must explain the picture so many times worse."""
_LARGEST_SD_M = 0.02
_HINT = "omni mocap place writes this file"


@dataclass(frozen=True)
class Placement:
    """The camera's place and how sure it is.

    ``offsets_m`` says for each floor tag how far it is from where the camera file has it. ``sd_m`` is the standard
    deviation of a floor point one metre from the middle of the tags.
    """

    eye: Eye
    rms_px: float
    offsets_m: Mapping[int, float]
    sd_m: float


def find_place(lens: Lens, floor: Sequence[PlacedTag], corners: Mapping[int, Array]) -> Placement:
    """Return where the camera is that sees floor tags at these corners [px]. Raises CameraError."""
    seen = [tag for tag in floor if tag.id in corners]
    if not seen:
        wanted = ", ".join(str(tag.id) for tag in floor)
        raise CameraError(f"none of the floor tags {wanted} is visible", hint="omni mocap look shows the visible tags")
    points = np.concatenate([corners_of(tag) for tag in seen])
    pixels = np.concatenate([corners[tag.id] for tag in seen])
    rotation, shift = _solved(lens, points, pixels)
    expected, slopes = lens.project(points, rotation, shift)
    rms = float(np.sqrt(np.mean(np.sum((pixels - expected) ** 2, axis=1))))
    spare = max(1, 2 * len(points) - 6)
    sd_px = max(CORNER_SD_PX, float(np.sqrt(np.sum((pixels - expected) ** 2) / spare)))
    eye = Eye(lens, rotation, shift, sd_px**2 * np.linalg.inv(slopes.T @ slopes))
    found = Placement(eye, rms, _offsets(eye, seen, corners), _floor_sd(eye, points.mean(axis=0)))
    _judge(found)
    return found


def _solved(lens: Lens, points: Array, pixels: Array) -> tuple[Array, Array]:
    """Return rotation and shift of the best place above the floor, if no other is nearly as good."""
    cv2 = load_cv2()
    flat = lens.directions(pixels).reshape(-1, 1, 2)
    _, rotations, shifts, _ = cv2.solvePnPGeneric(points, flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    found = []
    for rotation, shift in zip(rotations, shifts, strict=True):
        better = cv2.solvePnPRefineLM(points, pixels, lens.matrix, lens.coefficients, rotation.copy(), shift.copy())
        turn = cv2.Rodrigues(better[0])[0]
        if (-turn.T @ better[1])[2] > 0.0:
            away = pixels - lens.project(points, *better)[0]
            found.append((float(np.sqrt(np.mean(away**2))), better[0].ravel(), better[1].ravel()))
    if not found:
        hint = "check that each tag lies face up and has the right heading in the camera file"
        raise CameraError("the floor tags are seen as from below the floor", hint=hint)
    found.sort(key=lambda each: each[0])
    if len(found) == 2 and _different(found) and found[1][0] < _AMBIGUOUS * max(found[0][0], 0.5 * CORNER_SD_PX):
        hint = "lay out more floor tags, as far apart as the image allows"
        raise CameraError("the floor tags fit two places of the camera equally well", hint=hint)
    return found[0][1], found[0][2]


def _different(found: list[tuple[float, Array, Array]]) -> bool:
    one, other = (load_cv2().Rodrigues(each[1])[0] for each in found)  # two vectors may be one rotation
    return bool(np.abs(one - other).max() > 1e-3)


def _offsets(eye: Eye, seen: Sequence[PlacedTag], corners: Mapping[int, Array]) -> dict[int, float]:
    middles = {tag.id: eye.on_plane(corners[tag.id], 0.0).mean(axis=0) for tag in seen}
    return {tag.id: float(np.linalg.norm(middles[tag.id] - (tag.x_m, tag.y_m))) for tag in seen}


def _floor_sd(eye: Eye, middle: Array) -> float:
    """Return the standard deviation of floor points one metre from the middle of the tags, in the worst direction."""
    variances = []
    for x, y in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
        point = (middle + np.array([x, y, 0.0]))[None]
        _, slopes = eye.lens.project(point, eye.rotation, eye.shift)
        by_floor = (slopes[:, 3:] @ eye.turn)[:, :2]
        moved = np.linalg.solve(by_floor, slopes)
        variances.append(np.trace(moved @ eye.covariance @ moved.T) / 2.0)
    return float(np.sqrt(max(variances)))


def _judge(found: Placement) -> None:
    worst = max(found.offsets_m, key=lambda number: found.offsets_m[number])
    if found.offsets_m[worst] > TOLERANCE_M:
        each = ", ".join(f"{number}: {1e3 * off:.0f} mm" for number, off in sorted(found.offsets_m.items()))
        hint = f"measure places, sizes and headings again. Distances from the camera file: {each}"
        raise CameraError(f"floor tag {worst} is not at its place in the camera file", hint=hint)
    if not found.sd_m <= _LARGEST_SD_M:
        hint = "lay out more floor tags, as far apart as the image allows, or larger ones"
        raise CameraError(f"the camera's place is uncertain: {1e3 * found.sd_m:.0f} mm one metre away", hint=hint)


def floor_mark(setup: CameraSetup) -> str:
    """Return a short text that changes with the floor tags of a camera file."""
    numbers = [(t.id, t.size_m, t.x_m, t.y_m, t.heading_rad) for t in setup.floor]
    return hashlib.sha256(repr((setup.family, numbers)).encode()).hexdigest()[:12]


def save_place(found: Placement, setup: CameraSetup) -> None:
    """Write the place file that the camera file names. Raises OutputFileError."""
    eye = found.eye
    document = {
        "place": {
            "position_m": _rounded(eye.position),
            "rotation_rad": _rounded(eye.rotation),
            "shift_m": _rounded(eye.shift),
            "covariance": [_rounded(row) for row in eye.covariance],
            "rms_px": float(f"{found.rms_px:.4g}"),
            "lens": eye.lens.mark,
            "floor": floor_mark(setup),
        }
    }
    files.write_text(setup.place_path, "# Written by omni mocap place.\n" + tomli_w.dumps(document))


def _rounded(values: Array) -> list[float]:
    return [float(f"{value:.9g}") for value in np.ravel(values)]


def load_place(setup: CameraSetup, lens: Lens) -> Eye:
    """Read and check the place file. Raises MocapSourceError, also if it was made with another lens or other tags."""
    path = setup.place_path
    if not path.exists():
        raise MocapSourceError(f"{path}: no such file", hint=_HINT)
    try:
        table = take_table(str(path), "place", read_toml(path).get("place"))
        keys = ("position_m", "rotation_rad", "shift_m", "covariance", "rms_px", "lens", "floor")
        refuse_unknown_keys(str(path), "place.", table, keys)
        rotation, shift = (_vector(str(path), f"place.{key}", table.get(key), 3) for key in ("rotation_rad", "shift_m"))
        rows = table.get("covariance")
        rows = rows if isinstance(rows, list) and len(rows) == 6 else [None]
        covariance = np.array([_vector(str(path), "place.covariance", row, 6) for row in rows])
        made_with = {key: take_text(str(path), f"place.{key}", table.get(key)) for key in ("lens", "floor")}
    except SchemaError as error:
        raise MocapSourceError(str(error), hint=_HINT) from error
    if made_with != {"lens": lens.mark, "floor": floor_mark(setup)}:
        what = "the lens" if made_with["lens"] != lens.mark else "the floor tags of the camera file"
        raise MocapSourceError(f"{path}: {what} changed after this was written", hint="run omni mocap place again")
    return Eye(lens, rotation, shift, covariance)


def _vector(source: str, key: str, value: Any, count: int) -> Array:
    if not isinstance(value, list) or len(value) != count:
        raise SchemaError(source, key, f"is {value!r}; {count} numbers are needed here")
    return np.array([number_within(source, key, number, -1e6, 1e6) for number in value])
