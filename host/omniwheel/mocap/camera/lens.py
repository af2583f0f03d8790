# SPDX-License-Identifier: MIT
"""A camera's lens: which direction each pixel looks into. ``omni mocap calibrate`` writes it into a TOML file.

A point at (x, y, z) of the camera's axes (right, down, into the picture) is first divided by z. Then it is distorted by
OpenCV's polynomial (k1, k2, p1, p2, k3). At last it is scaled by the focal lengths and moved by the centre, in pixels.
The middle of the picture's first pixel is (0, 0).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from omni_schema import SchemaError
from omni_schema.toml_file import number_within, read_toml, refuse_unknown_keys, take_table
from omniwheel import files
from omniwheel.errors import MocapSourceError
from omniwheel.mocap.camera.library import Array, load_cv2

MOST_PIXELS = 16384
_DISTORTION = ("k1", "k2", "p1", "p2", "k3")
_KEYS = ("width", "height", "fx_px", "fy_px", "cx_px", "cy_px", *_DISTORTION, "rms_px", "pictures")


@dataclass(frozen=True)
class Lens:
    """Picture size, focal lengths, centre and distortion. ``rms_px`` and ``pictures`` tell of the calibration."""

    width: int
    height: int
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...]
    rms_px: float
    pictures: int

    @property
    def matrix(self) -> Array:
        """The camera matrix, (3, 3)."""
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def coefficients(self) -> Array:
        """The distortion as OpenCV takes it, (5,)."""
        return np.array(self.distortion)

    @property
    def mark(self) -> str:
        """Return a short text that another lens does not have."""
        numbers = (self.width, self.height, *self.focal_px, *self.centre_px, *self.distortion)
        return hashlib.sha256(" ".join(f"{number:.6g}" for number in numbers).encode()).hexdigest()[:12]

    def directions(self, pixels: Array) -> Array:
        """Return x/z and y/z of what pixels (n, 2) look at, (n, 2)."""
        cv2 = load_cv2()
        precise = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-10)
        points = np.asarray(pixels, dtype=float).reshape(-1, 1, 2)
        if hasattr(cv2, "undistortPointsIter"):  # until OpenCV 5
            straight = cv2.undistortPointsIter(points, self.matrix, self.coefficients, None, None, precise)
        else:
            straight = cv2.undistortPoints(points, self.matrix, self.coefficients, criteria=precise)
        return np.asarray(straight).reshape(-1, 2)

    def project(self, points: Array, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Return the pixels (n, 2) of world points (n, 3), and their derivatives (2n, 6).

        ``rotation`` is a rotation vector [rad], ``shift`` [m]: both lead from the world to the camera's axes. The
        derivatives are by rotation and shift, rows in the order u, v of the first point, u, v of the second.
        """
        pixels, slopes = load_cv2().projectPoints(points, rotation, shift, self.matrix, self.coefficients)
        return np.asarray(pixels).reshape(-1, 2), np.asarray(slopes)[:, :6]


def save_lens(lens: Lens, path: Path) -> None:
    """Write a lens file. Raises OutputFileError."""
    document = {
        "lens": {
            "width": lens.width,
            "height": lens.height,
            **dict(zip(("fx_px", "fy_px", "cx_px", "cy_px"), (*lens.focal_px, *lens.centre_px), strict=True)),
            **dict(zip(_DISTORTION, lens.distortion, strict=True)),
            "rms_px": lens.rms_px,
            "pictures": lens.pictures,
        }
    }
    files.write_text(path, "# Written by omni mocap calibrate.\n" + tomli_w.dumps(_rounded(document)))


def _rounded(document: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {
        name: {key: float(f"{value:.8g}") if isinstance(value, float) else value for key, value in table.items()}
        for name, table in document.items()
    }


def load_lens(path: Path) -> Lens:
    """Read and check a lens file. Raises MocapSourceError that names file, key and what is allowed."""
    if not path.exists():
        raise MocapSourceError(f"{path}: no such file", hint="omni mocap calibrate writes it")
    try:
        document = read_toml(path)
        refuse_unknown_keys(str(path), "", document, ("lens",))
        table = take_table(str(path), "lens", document.get("lens"))
        refuse_unknown_keys(str(path), "lens.", table, _KEYS)
        return _checked(str(path), table)
    except SchemaError as error:
        raise MocapSourceError(str(error), hint="omni mocap calibrate writes this file") from error


def _checked(source: str, table: dict[str, Any]) -> Lens:
    def number(key: str, low: float, high: float) -> float:
        return number_within(source, f"lens.{key}", table.get(key), low, high)

    width, height = int(number("width", 16, MOST_PIXELS)), int(number("height", 16, MOST_PIXELS))
    most = 50.0 * max(width, height)
    return Lens(
        width=width,
        height=height,
        focal_px=(number("fx_px", 1.0, most), number("fy_px", 1.0, most)),
        centre_px=(number("cx_px", -width, 2.0 * width), number("cy_px", -height, 2.0 * height)),
        distortion=tuple(number(key, -100.0, 100.0) for key in _DISTORTION),
        rms_px=number("rms_px", 0.0, 100.0),
        pictures=int(number("pictures", 0, 1e6)),
    )
