# SPDX-License-Identifier: MIT
"""Finds a lens from pictures of the calibration board, a chessboard with markers (ChArUco)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from omniwheel.errors import CameraError
from omniwheel.mocap.camera.families import BOARD_FAMILY, BOARD_FIRST_ID, BOARD_MARKER_SHARE, BOARD_SQUARES
from omniwheel.mocap.camera.lens import Lens
from omniwheel.mocap.camera.library import Array, load_cv2

LEAST_PICTURES = 10
LEAST_CORNERS = 12
LARGEST_RMS_PX = 1.0
LARGEST_FOCAL_SD = 0.005
"""Standard deviation of the focal length over the focal length."""
SIMILAR_SHARE = 0.03
"""Two pictures are the same if the board's corners move by less than this share of the picture's width."""
_GRID = 4
_LEAST_CELLS = 13
_HOW = (
    "take 15 pictures or more: the board near, far, in each corner of the picture, "
    "and tilted by 30 degrees to each side"
)


@dataclass(frozen=True)
class BoardView:
    """The board in a picture: corners [px] (n, 2) by number, and where they are on the board [squares] (n, 3)."""

    name: str
    ids: Array
    pixels: Array
    points: Array


@dataclass
class Collected:
    """Pictures so far: those that are used, and why others are not, by name."""

    size: tuple[int, int] | None = None
    views: list[BoardView] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)


def board() -> object:
    """Return OpenCV's description of the board; the unit of length is one square."""
    aruco = load_cv2().aruco
    count = BOARD_SQUARES[0] * BOARD_SQUARES[1] // 2
    ids = np.arange(BOARD_FIRST_ID, BOARD_FIRST_ID + count)
    dictionary = aruco.getPredefinedDictionary(getattr(aruco, BOARD_FAMILY))
    return aruco.CharucoBoard(BOARD_SQUARES, 1.0, BOARD_MARKER_SHARE, dictionary, ids)


class Collector:
    """Takes pictures one by one and keeps those that tell something new."""

    def __init__(self) -> None:
        self.collected = Collected()
        self._board = board()
        self._detector = load_cv2().aruco.CharucoDetector(self._board)

    def add(self, name: str, picture: Array) -> str:
        """Take a picture; return "" if it is used, else why not. CameraError if its size is another one."""
        size = (picture.shape[1], picture.shape[0])
        if self.collected.size is None:
            self.collected.size = size
        if size != self.collected.size:
            what = f"{name} has {size[0]} x {size[1]} pixels, the first picture {self.collected.size}"
            raise CameraError(what, hint="take all pictures with the camera's size of the camera file")
        view, reason = self._view(name, picture)
        if view is not None and any(_similar(view, other, size[0]) for other in self.collected.views):
            view, reason = None, "the board has not moved since another picture"
        if view is None:
            self.collected.left_out[name] = reason
            return reason
        self.collected.views.append(view)
        return ""

    def _view(self, name: str, picture: Array) -> tuple[BoardView | None, str]:
        corners, ids, _, _ = self._detector.detectBoard(picture)
        count = 0 if ids is None else len(ids)
        if count < LEAST_CORNERS:
            return None, f"{count} corners of the board are visible; at least {LEAST_CORNERS} are needed"
        numbers = np.asarray(ids).ravel()
        points = np.asarray(self._board.getChessboardCorners())[numbers]  # type: ignore[attr-defined]
        return BoardView(name, numbers, np.asarray(corners, float).reshape(-1, 2), points), ""


def _similar(one: BoardView, other: BoardView, width: int) -> bool:
    shared, here, there = np.intersect1d(one.ids, other.ids, return_indices=True)
    if len(shared) < LEAST_CORNERS // 2:
        return False
    return bool(np.linalg.norm(one.pixels[here] - other.pixels[there], axis=1).mean() < SIMILAR_SHARE * width)


def collect(pictures: Iterable[tuple[str, Array]]) -> Collected:
    """Return what pictures by name tell."""
    collector = Collector()
    for name, picture in pictures:
        collector.add(name, picture)
    return collector.collected


def find_lens(collected: Collected) -> Lens:
    """Return the lens. Raises CameraError if the pictures are too few, too similar, or do not fit one lens."""
    views, size = collected.views, collected.size
    if len(views) < LEAST_PICTURES or size is None:
        reasons = sorted(set(collected.left_out.values()))
        unused = f" Left out: {'; '.join(reasons)}." if reasons else ""
        raise CameraError(
            f"{len(views)} pictures of the board can be used; {LEAST_PICTURES} are needed", hint=_HOW + unused
        )
    _need_whole_picture(views, size)
    cv2 = load_cv2()
    rms, matrix, distortion, _, _, sd, _, each = cv2.calibrateCameraExtended(
        [view.points.astype(np.float32) for view in views],
        [view.pixels.astype(np.float32) for view in views],
        size,
        None,
        None,
        flags=cv2.CALIB_FIX_K3,
    )
    _judge(float(rms), np.asarray(matrix), np.asarray(sd).ravel(), [view.name for view in views], np.ravel(each))
    return Lens(
        width=size[0],
        height=size[1],
        focal_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre_px=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=tuple(float(value) for value in np.ravel(distortion)[:5]),
        rms_px=float(rms),
        pictures=len(views),
    )


def _need_whole_picture(views: list[BoardView], size: tuple[int, int]) -> None:
    """Raise CameraError if the board was never near one of the picture's sides: the lens bends most there."""
    seen = np.concatenate([view.pixels for view in views]) / size
    filled = {(int(x), int(y)) for x, y in np.clip(_GRID * seen, 0, _GRID - 1)}
    if len(filled) >= _LEAST_CELLS:
        return
    sides = {
        "left": seen[:, 0].min() > 1.0 / _GRID,
        "right": seen[:, 0].max() < 1.0 - 1.0 / _GRID,
        "upper": seen[:, 1].min() > 1.0 / _GRID,
        "lower": seen[:, 1].max() < 1.0 - 1.0 / _GRID,
    }
    empty = [name for name, missing in sides.items() if missing]
    where = (
        f"it was never near the {' or '.join(empty)} side" if empty else "it was never near some corners of the image"
    )
    raise CameraError(f"the board's pictures do not cover the whole image: {where}", hint=_HOW)


def _judge(rms: float, matrix: Array, sd: Array, names: list[str], each: Array) -> None:
    if rms > LARGEST_RMS_PX:
        worst = names[int(np.argmax(each))]
        hint = f"check that the board is flat and the pictures are sharp. Worst: {worst}, {each.max():.1f} px"
        raise CameraError(f"the pictures do not fit one lens: {rms:.2f} px; at most {LARGEST_RMS_PX:g} px", hint=hint)
    if max(sd[0] / matrix[0, 0], sd[1] / matrix[1, 1]) > LARGEST_FOCAL_SD:
        share = 100.0 * max(sd[0] / matrix[0, 0], sd[1] / matrix[1, 1])
        hint = "tilt the board by 30 degrees and more in half of the pictures, to each side"
        raise CameraError(f"the focal length is uncertain by {share:.1f} %; at most 0.5 % is good", hint=hint)
