# SPDX-License-Identifier: MIT
"""The pose from rendered pictures, beside the truth; and pictures that must not give one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omniwheel.errors import CameraError, MocapSourceError
from omniwheel.frames import Pose
from omniwheel.mocap.camera.frames import Frame
from omniwheel.mocap.camera.place import find_place
from omniwheel.mocap.camera.setup import load_setup
from omniwheel.mocap.camera.source import CameraSource
from omniwheel.mocap.camera.watch import Look, Watcher
from tests.host.mocap.rendered.lab import FLOOR, SMALL, camera_file, scene, true_lens, watcher
from tests.host.mocap.rendered.scene import Array, Light, Robot, Scene, Sheet, View

VIEW = View(SMALL, (0.05, -0.6, 1.5), (0.0, 0.0, 0.0), 0.1)
NEAR = tuple(replace(tag, x=0.7 * tag.x, y=0.7 * tag.y) for tag in FLOOR)
SCENE = scene(VIEW, floor=NEAR)
HERE = Pose(0.1, 0.05, 0.7)


@pytest.fixture(scope="module")
def eye(tmp_path_factory: pytest.TempPathFactory) -> Watcher:
    return watcher(tmp_path_factory.mktemp("camera"), SCENE)


def spoilt(**light: object) -> Scene:
    """The scene in another light. All but a shadow leaves the empty floor as it is drawn."""
    return replace(SCENE, light=Light(**light), cache={} if "shadow" in light else SCENE.cache)  # type: ignore[arg-type]


def error(seen: Look, truth: Pose) -> Array:
    assert seen.found is not None, seen.reason
    x, y, theta = np.subtract(seen.found.pose, truth)
    return np.array([x, y, math.remainder(theta, math.tau)])


@pytest.mark.full
def test_the_place_of_the_camera_is_found(eye: Watcher) -> None:
    assert eye.eye is not None
    assert np.linalg.norm(eye.eye.position - VIEW.position) < 0.003


@pytest.mark.full
def test_poses_all_over_the_floor_are_as_good_as_stated(eye: Watcher) -> None:
    draw = np.random.default_rng(3)
    ratios, errors = [], []
    for seed in range(8):
        truth = Pose(draw.uniform(-0.45, 0.45), draw.uniform(-0.25, 0.3), draw.uniform(-math.pi, math.pi))
        seen = eye.look(SCENE.picture(truth, seed))
        errors.append(error(seen, truth))
        assert seen.found is not None
        ratios.append(errors[-1] ** 2 / np.diagonal(seen.found.noise + seen.found.bias))
    # Chi-square with 8 degrees of freedom per coordinate: above 21.95 in 5 of 1000 cases. It is stated with caution.
    assert (np.sum(ratios, axis=0) < 21.95).all()
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx([0.0, 0.0, 0.0], abs=0.006)
    assert np.abs(errors)[:, :2].max() < 0.002


@pytest.mark.full
@pytest.mark.parametrize("truth", [Pose(0.0, 0.0, 0.0), Pose(0.3, 0.0, math.pi / 2), Pose(0.0, 0.2, -2.0)])
def test_axes_and_turns_are_the_worlds(eye: Watcher, truth: Pose) -> None:
    assert error(eye.look(SCENE.picture(truth)), truth) == pytest.approx([0.0, 0.0, 0.0], abs=0.006)


@pytest.mark.full
def test_a_tag_aside_and_turned_on_the_robot_gives_the_robots_pose(tmp_path: Path) -> None:
    robot = Robot((Sheet(10, 0.03, -0.02, 0.9, 0.12, 0.1), Sheet(11, -0.06, 0.04, -2.0, 0.08, 0.08)), 0.14, 0.08)
    here = scene(VIEW, robot, NEAR)
    assert error(watcher(tmp_path, here).look(here.picture(HERE)), HERE) == pytest.approx([0.0] * 3, abs=0.006)


@pytest.mark.nightly
def test_a_moving_robot_is_where_it_was_in_the_middle_of_the_exposure(eye: Watcher) -> None:
    path = [Pose(0.1 + 0.006 * share, 0.05, 0.7 + 0.03 * share) for share in np.linspace(-0.5, 0.5, 5)]
    assert error(eye.look(SCENE.picture(path)), HERE) == pytest.approx([0.0, 0.0, 0.0], abs=0.012)


@pytest.mark.full
def test_a_shadow_and_poor_light_cost_accuracy_and_no_truth(eye: Watcher) -> None:
    for light in ({"shadow": 0.5, "shadow_edge": 0.15}, {"gain": 0.3, "noise": 4.0}):
        assert error(eye.look(spoilt(**light).picture(HERE)), HERE) == pytest.approx([0.0, 0.0, 0.0], abs=0.012)


def beside(x: float, y: float, tag: int = 10, size: float = 0.12) -> Sheet:
    return Sheet(tag, x, y, 0.0, 0.12, size)


NO_POSE: dict[str, tuple[Callable[[], Array], str]] = {
    "no robot": (lambda: SCENE.picture(None), "no tag of the robot"),
    "another tag": (lambda: SCENE.picture(None, others=[beside(0.1, 0.0, 33)]), "no tag of the robot"),
    "two robots": (lambda: SCENE.picture(HERE, others=[beside(-0.25, -0.1)]), "tag 10 is visible twice"),
    "a smaller tag": (lambda: SCENE.picture(None, others=[beside(0.1, 0.0, 10, 0.09)]), "does not fit"),
    "a large blur": (lambda: spoilt(blur_px=6.0).picture(HERE), "no tag of the robot"),
    "darkness": (lambda: spoilt(gain=0.02).picture(HERE), "no tag of the robot"),
    "glare on the tag": (lambda: spoilt(glare=(0.1, 0.05, 0.12, 0.03)).picture(HERE), "no tag of the robot"),
    "another size": (lambda: SCENE.picture(HERE)[::2, ::2].copy(), "320 x 180 pixels"),
    "a mirror image": (lambda: SCENE.picture(HERE)[:, ::-1].copy(), "no tag of the robot"),
}


@pytest.mark.full
@pytest.mark.parametrize("case", NO_POSE)
def test_no_pose_is_better_than_a_wrong_one(eye: Watcher, case: str) -> None:
    picture, reason = NO_POSE[case]
    seen = eye.look(picture())
    assert seen.found is None
    assert reason in seen.reason


@pytest.mark.nightly
def test_a_tag_that_is_partly_covered_gives_the_pose_or_none(eye: Watcher) -> None:
    """A spot of light or a finger anywhere on the tag: what is taken for a pose is one."""
    poses = 0
    places = [(dx, dy) for dx in (-0.06, 0.0, 0.06) for dy in (-0.06, 0.06)]
    for at, (dx, dy) in enumerate(places):
        radius = (0.008, 0.02)[(at + at // 2) % 2]
        seen = eye.look(spoilt(glare=(0.1 + dx, 0.05 + dy, 0.12, radius)).picture(HERE, at))
        poses += seen.found is not None
        if seen.found is not None:
            assert error(seen, HERE) == pytest.approx([0.0, 0.0, 0.0], abs=0.02)
            assert math.dist(seen.found.pose[:2], HERE[:2]) < 0.004
    assert poses < len(places)


@pytest.mark.full
def test_a_camera_that_was_pushed_gives_no_pose(eye: Watcher) -> None:
    pushed = replace(SCENE, view=replace(VIEW, target=(0.02, 0.0, 0.0)), cache={})
    seen = eye.look(pushed.picture(HERE))
    assert seen.found is None
    assert "has moved" in seen.reason


@pytest.mark.full
def test_one_floor_tag_that_was_kicked_is_outvoted(eye: Watcher) -> None:
    kicked = replace(SCENE, floor=(replace(NEAR[0], x=NEAR[0].x + 0.05), *NEAR[1:]), cache={})
    assert error(eye.look(kicked.picture(HERE)), HERE) == pytest.approx([0.0, 0.0, 0.0], abs=0.006)


class Given:
    """Pictures with times put in by hand."""

    ended = False

    def __init__(self, frames: list[tuple[Array, float]]) -> None:
        self._frames = [Frame(picture, taken_s, at) for at, (picture, taken_s) in enumerate(frames)]

    def read(self, timeout_s: float) -> Frame | None:
        return self._frames.pop(0) if self._frames else None

    def close(self) -> None:
        pass


@pytest.mark.full
def test_times_are_told_and_wrong_times_and_frozen_pictures_refused(eye: Watcher) -> None:
    one, two = SCENE.picture(HERE, 1), SCENE.picture(HERE, 2)
    frames = Given([(one, 10.0), (one, 10.1), (two, 9.9), (two, 10.0), (two, 10.2)])
    source = CameraSource("camera:test", frames, eye, latency_s=0.03, clock=lambda: 10.25)
    found = [pose for pose in (source.read(0.0) for _ in range(5)) if pose is not None]
    assert [(pose.arrived_s, pose.frame) for pose in found] == [(10.25, 0), (10.25, 4)]
    assert [pose.taken_s for pose in found] == pytest.approx([9.97, 10.17])
    assert sum(source.reasons.values()) == 3
    assert sum(count for reason, count in source.reasons.items() if "hangs" in reason) == 1


def placed(tmp_path: Path, file: Scene, seen: Scene) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(camera_file(file), encoding="utf-8")
    setup, lens = load_setup(path), true_lens(SMALL)
    find_place(lens, setup.floor, Watcher(setup, lens).look(seen.picture(None)).tags)


@pytest.mark.parametrize(
    ("file", "seen", "problem"),
    [
        (SCENE, replace(SCENE, floor=(), cache={}), "none of the floor tags"),
        (replace(SCENE, floor=(replace(NEAR[0], x=-0.45), *NEAR[1:])), SCENE, "is not at its place"),
        (
            replace(SCENE, floor=(Sheet(1, 0.0, 0.0, size=0.08),)),
            replace(SCENE, floor=(Sheet(1, 0.0, 0.0, size=0.08),), cache={}),
            r"uncertain|equally well",
        ),
    ],
)
def test_floor_tags_that_cannot_tell_the_place_are_refused(
    tmp_path: Path, file: Scene, seen: Scene, problem: str
) -> None:
    with pytest.raises(CameraError, match=problem):
        placed(tmp_path, file, seen)


def test_lens_and_picture_sizes_must_agree(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(camera_file(SCENE), encoding="utf-8")
    with pytest.raises(MocapSourceError, match="320 x 180, the camera file 640 x 360"):
        Watcher(load_setup(path), true_lens(SMALL.scaled(0.5)))
