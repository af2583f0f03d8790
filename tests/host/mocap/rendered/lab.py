# SPDX-License-Identifier: MIT
"""A rendered camera with its files: what ``omni mocap`` would have written, or what it is to find out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from omniwheel.mocap.camera.lens import Lens as FoundLens
from omniwheel.mocap.camera.lens import save_lens
from omniwheel.mocap.camera.place import find_place, load_place, save_place
from omniwheel.mocap.camera.setup import load_setup
from omniwheel.mocap.camera.sheets import board_sheet
from omniwheel.mocap.camera.watch import Watcher
from tests.host.mocap.rendered.scene import Array, BoardView, Lens, Robot, Scene, Sheet, View, board_picture

HD = Lens(1280, 720, (1080.0, 1083.0), (644.0, 352.0))
"""A webcam of 1280 x 720: 61 degrees wide."""
SMALL = Lens(640, 360, (540.0, 541.5), (321.75, 175.75))
"""The same before half as many pixels."""
FLOOR = (Sheet(1, -0.75, -0.4), Sheet(2, 0.75, -0.4, 0.3), Sheet(3, 0.75, 0.45), Sheet(4, -0.75, 0.45, -1.2))
ROBOT = Robot((Sheet(10, 0.0, 0.0, 0.0, 0.12, 0.12),))
ABOVE = View(HD, (0.05, -0.6, 2.0), (0.0, 0.0, 0.0))


def scene(view: View = ABOVE, robot: Robot = ROBOT, floor: Sequence[Sheet] = FLOOR) -> Scene:
    """Return a floor with its tags, and a robot to put on it."""
    return Scene(view, tuple(floor), robot)


def camera_file(of: Scene, device: str = "0", more: str = "", latency_s: float = 0.0) -> str:
    """Return the camera file of a scene, as a person would write it."""
    lens = of.view.lens
    text = (
        f"[camera]\ndevice = {device}\nwidth = {lens.width}\nheight = {lens.height}\nlatency_s = {latency_s}\n{more}\n"
    )
    for kind, tags in (("floor", of.floor), ("robot", of.robot.tags)):
        for tag in tags:
            place = f"x_m = {tag.x}\ny_m = {tag.y}\nheading_deg = {math.degrees(tag.heading)}"
            height = f"\nheight_m = {tag.z}" if kind == "robot" else ""
            text += f"[[{kind}]]\nid = {tag.tag}\nsize_m = {tag.size}\n{place}{height}\n"
    return text


def true_lens(lens: Lens) -> FoundLens:
    """Return the lens as if the calibration had been perfect."""
    return FoundLens(lens.width, lens.height, lens.focal_px, lens.centre_px, lens.distortion, 0.0, 20)


def write_files(folder: Path, of: Scene, device: str = "0", **options: float) -> Path:
    """Write camera file and lens file, find the place from a picture of the empty floor; return the camera file."""
    path = folder / "camera.toml"
    path.write_text(camera_file(of, device, **options), encoding="utf-8")  # type: ignore[arg-type]
    setup = load_setup(path)
    lens = true_lens(of.view.lens)
    save_lens(lens, setup.lens_path)
    corners = Watcher(setup, lens).look(of.picture(None, seed=99)).tags
    save_place(find_place(lens, setup.floor, corners), setup)
    return path


def watcher(folder: Path, of: Scene) -> Watcher:
    """Return what looks at this scene's pictures, with its place found from one."""
    setup = load_setup(write_files(folder, of))
    lens = true_lens(of.view.lens)
    return Watcher(setup, lens, load_place(setup, lens))


def printed_board() -> tuple[Array, float]:
    """Return the calibration board as it is printed, and its width [m].

    It is softened by the distance of a picture's rays on it, or those would round its edges to whole rays.
    """
    sheet = board_sheet("a4")
    sheet.figure.set_dpi(508)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(sheet.figure)
    canvas.draw()
    grey = cv2.cvtColor(np.asarray(canvas.buffer_rgba()), cv2.COLOR_RGBA2GRAY)
    return np.asarray(cv2.blur(grey, (7, 7))), 1e-3 * sheet.width


VIEWS = tuple(
    BoardView((x, y, z), (a, b), c)
    for x, y, z, a, b, c in (
        (0.0, 0.0, 0.42, 0.0, 0.0, 0.0),
        (-0.17, -0.08, 0.55, 0.5, 0.0, 0.0),
        (0.17, -0.08, 0.55, -0.5, 0.1, 0.1),
        (-0.17, 0.09, 0.55, 0.1, 0.5, 0.0),
        (0.17, 0.09, 0.55, 0.0, -0.5, 0.2),
        (0.0, 0.0, 0.5, 0.6, 0.3, 0.4),
        (0.05, 0.0, 0.5, -0.6, 0.3, -0.4),
        (-0.05, 0.02, 0.5, 0.3, -0.6, 0.8),
        (-0.1, 0.0, 0.6, -0.3, 0.6, 1.5),
        (0.21, 0.11, 0.7, 0.4, 0.4, 1.0),
        (-0.21, -0.11, 0.7, -0.4, -0.4, 1.1),
        (0.21, -0.11, 0.7, 0.4, -0.4, 2.0),
        (-0.21, 0.11, 0.7, -0.4, 0.4, 2.0),
        (0.0, 0.0, 0.36, 0.5, 0.0, 3.1),
        (0.0, 0.0, 0.4, 0.0, 0.5, 1.6),
    )
)
"""How a person holds the board: everywhere in the picture, and tilted."""


def board_pictures(lens: Lens, views: Sequence[BoardView] = VIEWS, noise: float = 2.0) -> list[tuple[str, Array]]:
    """Return pictures of the board by name."""
    paper, width_m = printed_board()
    return [
        (f"board{at:02}.png", board_picture(lens, paper, width_m, view, at, noise)) for at, view in enumerate(views)
    ]
