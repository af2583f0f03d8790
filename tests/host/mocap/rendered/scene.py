# SPDX-License-Identifier: MIT
"""Pictures with known truth: a floor with tags and a robot with a tag, seen by a camera with a distorting lens.

Every pixel is a bundle of rays into the world, cut with planes: nothing here projects a point, as the program under
test does. The lens is inverted by iteration here, and not by OpenCV.

World: x, y on the floor, z up [m]. Camera: x right, y down, z into the picture. Pixel (u, v) has its centre there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from omniwheel.frames import Pose
from omniwheel.mocap.camera.families import FAMILIES

Array = npt.NDArray[Any]
Window = tuple[slice, slice]
_SAMPLES = 6
_COARSE = 8
_BOARD_SAMPLES = 3
_PAPER, _INK = 215.0, 25.0


@dataclass(frozen=True)
class Lens:
    """Focal length and centre [px], distortion k1, k2, p1, p2, k3 of the usual polynomial."""

    width: int = 640
    height: int = 480
    focal_px: tuple[float, float] = (540.0, 542.0)
    centre_px: tuple[float, float] = (322.5, 236.5)
    distortion: tuple[float, ...] = (-0.18, 0.06, 0.0008, -0.0006, 0.0)

    def scaled(self, factor: float) -> Lens:
        """Return the same lens before a sensor with more pixels."""
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        centre = (factor * (cx + 0.5) - 0.5, factor * (cy + 0.5) - 0.5)
        size = (round(factor * self.width), round(factor * self.height))
        return Lens(*size, (factor * fx, factor * fy), centre, self.distortion)

    def straight(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return the directions x/z, y/z that a pinhole would see where this lens shows (u, v)."""
        k1, k2, p1, p2, k3 = self.distortion
        x0, y0 = (u - self.centre_px[0]) / self.focal_px[0], (v - self.centre_px[1]) / self.focal_px[1]
        x, y = x0.copy(), y0.copy()
        for _ in range(12):
            r2 = x * x + y * y
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            x, y = (
                (x0 - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial,
                (y0 - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial,
            )
        return x, y


@dataclass(frozen=True)
class Sheet:
    """A printed tag: its centre (x, y) at height z [m], the bearing of its right-hand side [rad], and its side [m]."""

    tag: int
    x: float
    y: float
    heading: float = 0.0
    z: float = 0.0
    size: float = 0.15
    family: str = "apriltag_36h11"

    @cached_property
    def cells(self) -> Array:
        """Brightness of the cells, in a white margin of one cell."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[self.family]))
        side = dictionary.markerSize + 2
        cells = cv2.aruco.generateImageMarker(dictionary, self.tag, side)
        return np.pad(np.where(cells > 127, _PAPER, _INK), 1, constant_values=_PAPER)

    def draw(self, x: Array, y: Array, picture: Array) -> None:
        """Paint the sheet over ``picture``, whose samples lie at (x, y) of its plane."""
        cells = self.cells
        count = len(cells) - 2
        dx, dy = x - self.x, y - self.y
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        column = (cos * dx + sin * dy) / self.size * count + count / 2 + 1
        row = (sin * dx - cos * dy) / self.size * count + count / 2 + 1
        with np.errstate(invalid="ignore"):
            inside = (column >= 0) & (column < count + 2) & (row >= 0) & (row < count + 2)
        picture[inside] = cells[row[inside].astype(int), column[inside].astype(int)]


@dataclass(frozen=True)
class View:
    """A camera at ``position`` [m] that looks at ``target``; ``roll`` turns it about its axis [rad]."""

    lens: Lens = Lens()
    position: tuple[float, float, float] = (0.0, -0.9, 2.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    roll: float = 0.0

    @cached_property
    def axes(self) -> Array:
        """Rows: the camera's x, y, z in the world."""
        forward = np.subtract(self.target, self.position)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])
        down = np.cross(forward, right)
        cos, sin = math.cos(self.roll), math.sin(self.roll)
        return np.array([cos * right + sin * down, cos * down - sin * right, forward])

    @cached_property
    def rays(self) -> Array:
        """Directions in the world of the middles of the pixels, (height, width, 3)."""
        u, v = np.meshgrid(np.arange(self.lens.width, dtype=float), np.arange(self.lens.height, dtype=float))
        x, y = self.lens.straight(u, v)
        return np.stack([x, y, np.ones_like(x)], axis=-1) @ self.axes

    def fine_rays(self, window: Window, samples: int = _SAMPLES) -> Array:
        """Return rays through samples x samples places of each pixel, from those of the pixels around it."""
        ways = zip(window, self.rays.shape[:2], strict=True)
        rows, columns = (self._between(part, size, samples) for part, size in ways)
        halfway = self.rays[rows[0]] * (1.0 - rows[1])[:, None, None] + self.rays[rows[0] + 1] * rows[1][:, None, None]
        left, right = halfway[:, columns[0]], halfway[:, columns[0] + 1]
        return np.asarray(left + (right - left) * columns[1][:, None])

    @staticmethod
    def _between(part: slice, size: int, samples: int) -> tuple[Array, Array]:
        offsets = (np.arange(samples) + 0.5) / samples - 0.5
        at = (np.arange(part.start, part.stop)[:, None] + offsets).ravel()
        below = np.clip(np.floor(at).astype(int), 0, size - 2)
        return below, at - below

    def plane(self, z: float, rays: Array) -> tuple[Array, Array]:
        """Return where rays meet the plane at height z: x and y, NaN where they do not."""
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (z - self.position[2]) / rays[..., 2]
            along = np.where(along > 0.0, along, np.nan)
            return self.position[0] + along * rays[..., 0], self.position[1] + along * rays[..., 1]

    def window(self, z: float, x: float, y: float, reach: float) -> Window | None:
        """Return the pixels that see the plane at height z within ``reach`` of (x, y)."""
        seen_x, seen_y = self.plane(z, self.rays[::_COARSE, ::_COARSE])
        with np.errstate(invalid="ignore"):
            near = np.argwhere((np.abs(seen_x - x) < reach) & (np.abs(seen_y - y) < reach))
        if not len(near):
            return None
        (top, left), (bottom, right) = near.min(axis=0) - 1, near.max(axis=0) + 2
        rows = slice(max(0, top * _COARSE), min(self.lens.height, bottom * _COARSE))
        return rows, slice(max(0, left * _COARSE), min(self.lens.width, right * _COARSE))


@dataclass(frozen=True)
class Robot:
    """A dark drum with its tags on top. The tags' x, y and heading are those on the robot."""

    tags: tuple[Sheet, ...] = (Sheet(10, 0.0, 0.0, 0.0, 0.12, 0.1),)
    radius: float = 0.11
    height: float = 0.12

    def placed(self, pose: Pose) -> list[Sheet]:
        """Return the tags where they are in the world."""
        cos, sin = math.cos(pose.theta), math.sin(pose.theta)
        return [
            replace(
                tag,
                x=pose.x + cos * tag.x - sin * tag.y,
                y=pose.y + sin * tag.x + cos * tag.y,
                heading=pose.theta + tag.heading,
            )
            for tag in self.tags
        ]


@dataclass(frozen=True)
class Light:
    """What spoils a picture. ``blur_px`` is the optics', ``noise`` of the sensor [grey levels of 255].

    ``gain`` darkens, ``shadow`` is the share of light left where x + y > ``shadow_edge``. ``glare`` is a burnt-out spot
    in the world: x, y, z, radius [m].
    """

    blur_px: float = 0.6
    noise: float = 2.0
    gain: float = 1.0
    shadow: float = 1.0
    shadow_edge: float = 0.0
    glare: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class Scene:
    """A floor with tags under a camera; :meth:`picture` puts a robot on it."""

    view: View = View()
    floor: tuple[Sheet, ...] = ()
    robot: Robot = Robot()
    light: Light = Light()
    cache: dict[str, Array] = field(default_factory=dict, compare=False)

    def _empty(self) -> Array:
        if "floor" not in self.cache:
            lens = self.view.lens
            whole = self._window((slice(0, lens.height), slice(0, lens.width)), None, (), 1)
            for sheet in self.floor:
                window = self.view.window(0.0, sheet.x, sheet.y, 1.2 * sheet.size)
                if window is not None:
                    whole[window] = self._window(window, None, ())
            self.cache["floor"] = whole
        return self.cache["floor"]

    def picture(self, poses: Pose | Sequence[Pose] | None, seed: int = 1, others: Sequence[Sheet] = ()) -> Array:
        """Return a grey picture, (height, width) of uint8. Several poses: the robot moves while the shutter is open.

        ``others`` are more tags, each at its height.
        """
        several = [poses] if poses is None or isinstance(poses, Pose) else list(poses)
        return self._exposed(np.mean([self._sharp(pose, others) for pose in several], axis=0), seed)

    def _sharp(self, pose: Pose | None, others: Sequence[Sheet]) -> Array:
        picture = self._empty().copy()
        places = [(tag.z, tag.x, tag.y, tag.size) for tag in others]
        if pose is not None:
            reach = 1.2 * self.robot.radius
            places += [(z, pose.x, pose.y, reach) for z in (0.0, self.robot.height)]
            places += [(tag.z, tag.x, tag.y, 1.2 * tag.size) for tag in self.robot.placed(pose)]
        for window in (self.view.window(*place) for place in places):
            if window is not None:
                picture[window] = self._window(window, pose, others)
        return picture

    def _window(self, window: Window, pose: Pose | None, others: Sequence[Sheet], samples: int = _SAMPLES) -> Array:
        rays = self.view.fine_rays(window, samples)
        x, y = self.view.plane(0.0, rays)
        with np.errstate(invalid="ignore"):
            planks = 120.0 + 12.0 * np.sin(9.0 * x) * np.cos(7.0 * y) + 6.0 * (np.floor(x / 0.09) % 2)
        picture = np.where(np.isfinite(x), planks, 180.0)
        for sheet in self.floor:
            sheet.draw(x, y, picture)
        if pose is not None:
            self._drum(picture, rays, pose)
        for tag in [*(self.robot.placed(pose) if pose is not None else ()), *others]:
            tag.draw(*self.view.plane(tag.z, rays), picture)
        self._shade(picture, rays)
        height, width = (part.stop - part.start for part in window)
        return np.asarray(picture.reshape(height, samples, width, samples).mean(axis=(1, 3)))

    def _drum(self, picture: Array, rays: Array, pose: Pose) -> None:
        for z in (float(z) for z in np.linspace(0.0, self.robot.height, 5)):
            x, y = self.view.plane(z, rays)
            with np.errstate(invalid="ignore"):
                picture[(x - pose.x) ** 2 + (y - pose.y) ** 2 < self.robot.radius**2] = 55.0 + 100.0 * z

    def _shade(self, picture: Array, rays: Array) -> None:
        if self.light.shadow < 1.0:
            x, y = self.view.plane(0.0, rays)
            with np.errstate(invalid="ignore"):
                picture[x + y > self.light.shadow_edge] *= self.light.shadow
        if self.light.glare is not None:
            gx, gy, gz, radius = self.light.glare
            x, y = self.view.plane(gz, rays)
            with np.errstate(invalid="ignore"):
                picture[(x - gx) ** 2 + (y - gy) ** 2 < radius**2] = 400.0

    def _exposed(self, picture: Array, seed: int) -> Array:
        light = self.light
        if light.blur_px > 0.0:
            picture = cv2.GaussianBlur(picture, (0, 0), light.blur_px)
        noise = light.noise * np.random.default_rng(seed).standard_normal(picture.shape)
        return np.clip(light.gain * picture + noise + 0.5, 0.0, 255.0).astype(np.uint8)


@dataclass(frozen=True)
class BoardView:
    """A printed board before the camera: its middle [m] in the camera's axes, and how it is turned.

    ``tilt`` is about x and y and ``spin`` about z [rad].
    """

    middle: tuple[float, float, float]
    tilt: tuple[float, float] = (0.0, 0.0)
    spin: float = 0.0

    @property
    def axes(self) -> Array:
        """Rows: the print's right, down and away in the camera's axes."""
        (a, b), c = self.tilt, self.spin
        about_x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
        about_y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
        about_z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
        return np.asarray((about_x @ about_y @ about_z).T)


@lru_cache(maxsize=4)
def _straight(lens: Lens) -> View:
    """Return a camera whose axes are the world's."""
    return View(lens, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0)


def board_picture(
    lens: Lens, paper: Array, width_m: float, view: BoardView, seed: int = 1, noise: float = 2.0
) -> Array:
    """Return a picture of a printed sheet ``paper`` (height, width), ``width_m`` wide, on a grey background."""
    straight = _straight(lens)
    in_camera = straight.axes.T  # rays are in the world's axes
    picture = np.full((lens.height, lens.width), 90.0)
    _, _, coarse = _on_sheet(straight.rays[::_COARSE, ::_COARSE] @ in_camera, paper, width_m, view)
    near = np.argwhere(coarse)
    (top, left), (bottom, right) = _COARSE * (near.min(axis=0) - 1), _COARSE * (near.max(axis=0) + 2)
    window = slice(max(0, top), min(lens.height, bottom)), slice(max(0, left), min(lens.width, right))
    rays = straight.fine_rays(window, _BOARD_SAMPLES) @ in_camera
    row, column, inside = _on_sheet(rays, paper, width_m, view)
    fine = np.full(inside.shape, 90.0)
    fine[inside] = _INK + (_PAPER - _INK) / 255.0 * paper[row[inside], column[inside]]
    height, width = (part.stop - part.start for part in window)
    picture[window] = fine.reshape(height, _BOARD_SAMPLES, width, _BOARD_SAMPLES).mean(axis=(1, 3))
    return Scene(straight, light=Light(noise=noise))._exposed(picture, seed)


def _on_sheet(rays: Array, paper: Array, width_m: float, view: BoardView) -> tuple[Array, Array, Array]:
    """Return row and column of the print that rays (..., 3) of the camera's axes hit, and whether they hit it."""
    right, down, away = view.axes
    middle = np.array(view.middle)
    along = (middle @ away) / (rays @ away)
    scale = paper.shape[1] / width_m
    hit = rays * along[..., None] - middle
    column = np.floor(scale * (hit @ right) + paper.shape[1] / 2).astype(int)
    row = np.floor(scale * (hit @ down) + paper.shape[0] / 2).astype(int)
    inside = (column >= 0) & (column < paper.shape[1]) & (row >= 0) & (row < paper.shape[0]) & (along > 0)
    return row, column, inside
