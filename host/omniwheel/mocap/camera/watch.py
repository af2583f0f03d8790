# SPDX-License-Identifier: MIT
"""What a camera makes of a picture: the robot's pose, or why there is none. Never a pose that is in doubt."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from omniwheel.errors import MocapSourceError
from omniwheel.mocap.camera.edges import refined
from omniwheel.mocap.camera.families import CELLS
from omniwheel.mocap.camera.geometry import Eye, Located, corners_of, locate
from omniwheel.mocap.camera.lens import Lens, load_lens
from omniwheel.mocap.camera.library import Array
from omniwheel.mocap.camera.place import load_place
from omniwheel.mocap.camera.setup import CameraSetup, load_setup
from omniwheel.mocap.camera.tags import SeenTag, TagFinder, only_once

MISFIT_PX = 0.6
MISFIT_SHARE = 0.012
"""Tags may miss their places by this much, and by this share of a tag's side: paper is not quite flat."""
MOVED_PX = 2.5
"""A floor tag that is this far from its place in the picture: it or the camera was moved."""


@dataclass(frozen=True)
class Look:
    """What is in a picture. ``found`` is the robot; without it ``reason`` says in a few words why.

    ``tags`` has the corners [px] of all tags of the camera file, ``others`` the ids of further ones.
    """

    found: Located | None
    reason: str = ""
    tags: dict[int, Array] = field(default_factory=dict)
    others: tuple[int, ...] = ()


class Watcher:
    """Looks at pictures with a lens, and with a place once there is one."""

    def __init__(self, setup: CameraSetup, lens: Lens, eye: Eye | None = None) -> None:
        if (lens.width, lens.height) != (setup.width, setup.height):
            sizes = f"{lens.width} x {lens.height}, the camera file {setup.width} x {setup.height}"
            raise MocapSourceError(f"{setup.lens_path} is for {sizes}", hint="run omni mocap calibrate again")
        self.setup = setup
        self.lens = lens
        self.eye = eye
        self._finder = TagFinder(setup.family)
        self._floor = {tag.id: tag for tag in setup.floor}
        self._robot = {tag.id: tag for tag in setup.robot}

    def mirrored(self, picture: Array) -> bool:
        """Return whether there are tags only in the mirror image of a picture."""
        return not self._finder.find(picture) and bool(self._finder.find_mirrored(picture))

    def look(self, picture: Array) -> Look:
        """Return what a grey picture (height, width) of uint8 shows."""
        if picture.shape != (self.lens.height, self.lens.width):
            size = f"{picture.shape[1]} x {picture.shape[0]}"
            return Look(None, f"the picture has {size} pixels, the lens file {self.lens.width} x {self.lens.height}")
        seen, twice = only_once(self._finder.find(picture))
        tags = self._corners(picture, seen)
        others = tuple(sorted(number for number in seen if number not in self._floor | self._robot))
        if twice & self._robot.keys():
            return Look(None, f"tag {min(twice & self._robot.keys())} is visible twice", tags, others)
        found, reason = self._robot_of(tags, seen)
        return Look(found, reason, tags, others)

    def _corners(self, picture: Array, seen: dict[int, SeenTag]) -> dict[int, Array]:
        ours = (tag for tag in seen.values() if tag.id in self._floor or tag.id in self._robot)
        fine = {tag.id: refined(picture, tag.corners, CELLS[self.setup.family], self.lens) for tag in ours}
        return {number: corners for number, corners in fine.items() if corners is not None}

    def _robot_of(self, tags: dict[int, Array], seen: dict[int, SeenTag]) -> tuple[Located | None, str]:
        if self.eye is None:
            return None, "the camera's place is unknown"
        moved = self._moved(self.eye, tags)
        if moved:
            return None, f"floor tag {moved[0]} has moved, or the camera has"
        if not tags.keys() & self._robot.keys():
            blurred = seen.keys() & self._robot.keys()
            return None, f"the edges of tag {min(blurred)} are blurred" if blurred else "no tag of the robot"
        found = locate(self.eye, self.setup.robot, tags)
        if found is None:
            return None, "the robot's tag is not at its height"
        sides = [SeenTag(number, tags[number]).side_px for number in tags if number in self._robot]
        if found.rms_px > max(MISFIT_PX, MISFIT_SHARE * float(np.mean(sides))):
            return None, f"the robot's tag does not fit its size and height: {found.rms_px:.1f} px residual"
        return found, ""

    def _moved(self, eye: Eye, tags: dict[int, Array]) -> list[int]:
        """Return the floor tags that are not in their places, if those in place are not more."""
        away = {}
        for number in tags.keys() & self._floor.keys():
            expected = eye.lens.project(corners_of(self._floor[number]), eye.rotation, eye.shift)[0]
            away[number] = float(np.linalg.norm(np.mean(tags[number] - expected, axis=0)))
        off = sorted(number for number, distance in away.items() if distance > MOVED_PX)
        return off if 2 * len(off) >= len(away) else []


def open_watcher(path: Path) -> Watcher:
    """Return what the camera file at ``path`` describes, with lens and place. Raises MocapSourceError."""
    setup = load_setup(path)
    lens = load_lens(setup.lens_path)
    return Watcher(setup, lens, load_place(setup, lens))
