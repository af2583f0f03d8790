# SPDX-License-Identifier: MIT
"""Finds tags in a picture. A tag of whose bits even one is wrong is not taken: no tag is better than another's id."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.mocap.camera.families import FAMILIES
from omniwheel.mocap.camera.library import Array, load_cv2

LEAST_CELL_PX = 2.5
"""Smaller cells are guessed and not seen."""


@dataclass(frozen=True)
class SeenTag:
    """A tag in a picture: its corners [px], (4, 2), from its upper left one as printed, clockwise as printed."""

    id: int
    corners: Array

    @property
    def side_px(self) -> float:
        """The shortest side [px]."""
        return float(np.linalg.norm(self.corners - np.roll(self.corners, -1, axis=0), axis=1).min())


def square(size_m: float) -> Array:
    """Return the corners of a tag about its own centre [m], (4, 2): x to its right, y to its top, as printed."""
    return 0.5 * size_m * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])


class TagFinder:
    """Finds the tags of one family in grey pictures."""

    def __init__(self, family: str) -> None:
        self._cv2 = cv2 = load_cv2()
        self._dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family]))
        self._cells = self._dictionary.markerSize + 2
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        settings.cornerRefinementMaxIterations = 50
        settings.cornerRefinementMinAccuracy = 0.005
        settings.errorCorrectionRate = 0.0
        settings.maxErroneousBitsInBorderRate = 0.0
        settings.minMarkerPerimeterRate = 0.02
        self._detector = cv2.aruco.ArucoDetector(self._dictionary, settings)

    def find(self, picture: Array) -> list[SeenTag]:
        """Return the tags of a picture (height, width) of uint8, in the order of their ids."""
        corners, ids, _ = self._detector.detectMarkers(picture)
        if ids is None:
            return []
        found = [SeenTag(int(i), np.asarray(c, float).reshape(4, 2)) for c, i in zip(corners, ids.ravel(), strict=True)]
        return sorted((tag for tag in found if self._large(tag)), key=lambda tag: tag.id)

    def find_mirrored(self, picture: Array) -> list[SeenTag]:
        """Return what would be found if the picture were turned over: a camera set to show a mirror image."""
        return self.find(np.ascontiguousarray(picture[:, ::-1]))

    def _large(self, tag: SeenTag) -> bool:
        return bool(tag.side_px >= LEAST_CELL_PX * self._cells)


def only_once(tags: Sequence[SeenTag]) -> tuple[dict[int, SeenTag], set[int]]:
    """Return the tags by id, and the ids that were seen twice, which are left out."""
    counts: dict[int, int] = {}
    for tag in tags:
        counts[tag.id] = counts.get(tag.id, 0) + 1
    twice = {number for number, count in counts.items() if count > 1}
    return {tag.id: tag for tag in tags if tag.id not in twice}, twice
