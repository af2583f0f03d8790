# SPDX-License-Identifier: MIT
"""Pictures and films of a MuJoCo world, off screen."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from PIL import Image

from hil_sim.external import ExternalWorldInputError
from hil_sim.mujoco_settings import Film
from omniwheel import files

FILM_FILE = "world.gif"
_STEP_s = 1e-3


class Camera:
    """Looks at the robot from behind and above, and keeps what it has seen. Raises ExternalWorldInputError."""

    def __init__(self, model: Any, film: Film) -> None:
        import mujoco

        self._film = film
        try:
            self._renderer = mujoco.Renderer(model, film.height, film.width)
        except Exception as error:  # every kind of OpenGL has its own
            raise ExternalWorldInputError(
                f"MuJoCo cannot draw here: {type(error).__name__}: {error}",
                hint="off screen: apt-get install libosmesa6 and MUJOCO_GL=osmesa, or MUJOCO_GL=egl with a driver",
            ) from error
        self._view = mujoco.MjvCamera()
        self._view.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        self._view.trackbodyid = model.body("chassis").id
        reach_m = math.hypot(*model.body("wheel_1").pos)
        self._view.distance, self._view.azimuth, self._view.elevation = 5.0 * reach_m, 60.0, -35.0
        self._pictures: list[Image.Image] = []
        self._ticks = 0

    def picture(self, data: Any) -> Image.Image:
        """Return what is to be seen now."""
        self._renderer.update_scene(data, self._view)
        return Image.fromarray(self._renderer.render())

    def look(self, data: Any) -> None:
        """Keep a picture, if it is time. To be called once per step."""
        if self._ticks % max(round(self._film.every_s / _STEP_s), 1) == 0:
            self._pictures.append(self.picture(data).quantize(64))
        self._ticks += 1

    def write(self, path: Path) -> None:
        """Write the pictures as an animation that runs in real time. Raises OutputFileError."""
        if not self._pictures:
            return
        first, *others = self._pictures
        with files.replaced(path) as file:
            shown_ms = round(1e3 * self._film.every_s)
            first.save(file, format="GIF", save_all=True, append_images=others, duration=shown_ms, loop=0)
