# SPDX-License-Identifier: MIT
"""Where a lens stands in the world, where its pixels meet a plane, and the pose of tags that lie in planes.

The robot's pose has three unknowns, because its tags move at a known height. So a tag's position comes from the
direction in which it is seen. How large it looks would tell it ten times worse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.frames import Pose
from omniwheel.mocap.camera.lens import Lens
from omniwheel.mocap.camera.library import Array, load_cv2
from omniwheel.mocap.camera.setup import PlacedTag
from omniwheel.mocap.camera.tags import square

CORNER_SD_PX = 0.2
"""Standard deviation of a corner in each direction, as assumed where uncertainty is stated. A worse fit raises it."""
_ROUNDS = 8


@dataclass(frozen=True)
class Eye:
    """A lens at its place. ``rotation`` (a rotation vector [rad]) and ``shift`` [m] lead from world to camera axes.

    ``covariance`` (6, 6) is that of both together.
    """

    lens: Lens
    rotation: Array
    shift: Array
    covariance: Array

    @property
    def turn(self) -> Array:
        """The rotation as a matrix (3, 3)."""
        return np.asarray(load_cv2().Rodrigues(np.asarray(self.rotation, dtype=float))[0])

    @property
    def position(self) -> Array:
        """Where the lens is in the world [m], (3,)."""
        return np.asarray(-self.turn.T @ self.shift)

    def on_plane(self, pixels: Array, height_m: float) -> Array:
        """Return the world x, y [m] that pixels (n, 2) see of the plane at this height; NaN where they see none."""
        flat = self.lens.directions(pixels)
        rays = np.column_stack([flat, np.ones(len(flat))]) @ self.turn
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (height_m - self.position[2]) / rays[:, 2]
        along = np.where(along > 0.0, along, np.nan)
        return np.asarray(self.position[:2] + along[:, None] * rays[:, :2])


def corners_of(tag: PlacedTag) -> Array:
    """Return a tag's corners (4, 3) [m], in the frame in which its place is given."""
    flat = square(tag.size_m) @ _turned(tag.heading_rad).T + (tag.x_m, tag.y_m)
    return np.column_stack([flat, np.full(4, tag.height_m)])


def _turned(angle: float) -> Array:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


@dataclass(frozen=True)
class Located:
    """A pose, how well its tags fit it (``rms_px``), and its covariances (3, 3) in m and rad.

    ``noise`` is what differs from picture to picture; ``bias`` is what is the same each time, because the camera's
    place is not known better.
    """

    pose: Pose
    rms_px: float
    noise: Array
    bias: Array

    @property
    def sd_xy_m(self) -> float:
        """Standard deviation of x and y in the worst direction, noise and bias together."""
        return math.sqrt(float(np.linalg.eigvalsh((self.noise + self.bias)[:2, :2])[-1]))

    @property
    def sd_theta_rad(self) -> float:
        """Standard deviation of the heading, noise and bias together."""
        return math.sqrt(float((self.noise + self.bias)[2, 2]))


def locate(eye: Eye, tags: Sequence[PlacedTag], corners: Mapping[int, Array]) -> Located | None:
    """Return the pose of the body that carries ``tags``, of which ``corners`` [px] are seen; None if there is none.

    Least squares of the corners' distances in the picture.
    """
    seen = [tag for tag in tags if tag.id in corners]
    body = np.concatenate([corners_of(tag) for tag in seen])
    pixels = np.concatenate([corners[tag.id] for tag in seen])
    state = _first_guess(eye, seen[0], corners[seen[0].id])
    for _ in range(_ROUNDS):
        if state is None or not np.isfinite(state).all():
            return None
        away, slopes, by_place = _misfit(eye, body, pixels, state)
        step = np.linalg.lstsq(slopes, away, rcond=None)[0]
        state = state + step
    if state is None or not np.isfinite(state).all():
        return None
    away, slopes, by_place = _misfit(eye, body, pixels, state)
    try:
        inverse = np.linalg.inv(slopes.T @ slopes)
    except np.linalg.LinAlgError:
        return None
    moved = inverse @ slopes.T @ by_place
    bias = moved @ eye.covariance @ moved.T
    if not (np.isfinite(inverse + bias).all() and (np.diag(inverse) > 0.0).all() and (np.diag(bias) >= 0.0).all()):
        return None  # nothing says how sure it is
    pose = Pose(float(state[0]), float(state[1]), math.remainder(float(state[2]), math.tau))
    rms = float(np.sqrt(np.mean(away**2) * 2.0))
    sd_px = max(CORNER_SD_PX, float(np.sqrt(np.sum(away**2) / (len(away) - 3))))
    return Located(pose, rms, sd_px**2 * inverse, bias)


def _first_guess(eye: Eye, tag: PlacedTag, corners: Array) -> Array | None:
    """Return x, y, theta of the body from one tag; None if it is not before the camera."""
    points = eye.on_plane(corners, tag.height_m)
    if not np.isfinite(points).all():
        return None
    right = points[1] + points[2] - points[0] - points[3]
    theta = math.atan2(right[1], right[0]) - tag.heading_rad
    x, y = points.mean(axis=0) - _turned(theta) @ (tag.x_m, tag.y_m)
    return np.array([x, y, theta])


def _misfit(eye: Eye, body: Array, pixels: Array, state: Array) -> tuple[Array, Array, Array]:
    """Return seen minus expected pixels (2n,), and the slopes by pose (2n, 3) and by the camera's place (2n, 6)."""
    turned = body[:, :2] @ _turned(state[2]).T
    world = np.column_stack([turned + state[:2], body[:, 2]])
    expected, by_place = eye.lens.project(world, eye.rotation, eye.shift)
    by_world = (by_place[:, 3:] @ eye.turn).reshape(-1, 2, 3)
    by_turn = by_world[:, :, 1] * turned[:, :1] - by_world[:, :, 0] * turned[:, 1:]
    slopes = np.stack([by_world[:, :, 0], by_world[:, :, 1], by_turn], axis=-1).reshape(-1, 3)
    return (pixels - expected).ravel(), slopes, by_place
