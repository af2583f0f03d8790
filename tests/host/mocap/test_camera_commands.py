# SPDX-License-Identifier: MIT
"""The road of docs/guides/camera.md: print, calibrate, place, look, record. The camera is rendered."""

from __future__ import annotations

import importlib
import json
import math
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.errors import CameraError, MocapLibraryError, MocapSourceError
from omniwheel.frames import Pose
from omniwheel.limits import TAG_FAMILIES
from omniwheel.mocap.camera import library
from omniwheel.mocap.camera.calibrate import Collector, collect, find_lens
from omniwheel.mocap.camera.families import CELLS, FAMILIES
from omniwheel.mocap.camera.lens import load_lens, save_lens
from omniwheel.mocap.camera.place import load_place
from omniwheel.mocap.camera.setup import load_setup
from omniwheel.mocap.camera.sheets import sheets
from omniwheel.mocap.camera.tags import TagFinder
from omniwheel.mocap.recorded import read_recording
from tests.host.mocap.rendered.lab import FLOOR, SMALL, board_pictures, camera_file, scene, write_files
from tests.host.mocap.rendered.scene import Array, View

VIEW = View(SMALL, (0.05, -0.9, 1.8), (0.0, 0.0, 0.0))
SCENE = scene(VIEW)
LAP = [Pose(0.3 * math.cos(a), 0.3 * math.sin(a), a) for a in np.linspace(0.0, 1.0, 6)]


def run(*words: str, code: int = 0) -> Any:
    result = CliRunner().invoke(app, ["mocap", *words])
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result


@pytest.fixture(scope="module")
def boards() -> list[tuple[str, Array]]:
    return board_pictures(SMALL)


def store(folder: Path, pictures: Sequence[tuple[str, Array]]) -> Path:
    folder.mkdir()
    for name, picture in pictures:
        cv2.imwrite(str(folder / name), picture)
    return folder


@pytest.mark.full
def test_from_print_to_poses(tmp_path: Path, boards: list[tuple[str, Array]]) -> None:
    run("markers", str(tmp_path / "tags"), "--sheets", "svg", "--floor", "2")
    camera = tmp_path / "tags" / "camera.toml"
    assert load_setup(camera).robot[0].id in range(TAG_FAMILIES["apriltag_36h11"])
    store(tmp_path / "tags" / "floor", [(f"{at:03}.png", SCENE.picture(pose, at)) for at, pose in enumerate(LAP)])
    camera.write_text(camera_file(SCENE, '"floor"', "rate_Hz = 20.0", latency_s=0.01), encoding="utf-8")

    said = json.loads(run("calibrate", str(camera), str(store(tmp_path / "boards", boards)), "--json").stdout)
    assert said["pictures"] == len(boards)
    assert said["rms_px"] < 0.3
    cv2.imwrite(str(tmp_path / "empty.png"), SCENE.picture(None))
    said = json.loads(run("place", str(camera), str(tmp_path / "empty.png"), "--json").stdout)
    assert max(said["offsets_m"].values()) < 0.004
    assert math.dist(said["position_m"], VIEW.position) < 0.03
    assert "above the floor" in run("place", str(camera)).stdout  # the camera itself: here a folder of pictures

    seen = json.loads(run("look", str(camera), "--json").stdout)["pictures"]
    for pose, found in zip(LAP, seen, strict=True):
        assert math.dist(found["pose"][:2], pose[:2]) < 0.004
        assert abs(math.remainder(found["pose"][2] - pose.theta, math.tau)) < 0.02
    assert "no pose: no tag of the robot" in run("look", str(camera), str(tmp_path / "empty.png")).stdout
    cv2.imwrite(str(tmp_path / "mirror.png"), SCENE.picture(LAP[0])[:, ::-1])
    assert "mirror image" in run("look", str(camera), str(tmp_path / "mirror.png")).stdout
    assert "mirror" in run("place", str(camera), str(tmp_path / "mirror.png"), code=1).stderr

    run("record", str(tmp_path / "lap.csv"), "--source", f"camera:{camera}")
    recorded = read_recording(tmp_path / "lap.csv")
    assert [pose.frame for pose in recorded] == list(range(len(LAP)))
    assert np.diff([pose.taken_s for pose in recorded]) == pytest.approx(0.05, abs=1e-5)
    assert all(pose.arrived_s - pose.taken_s >= 0.01 for pose in recorded)


@pytest.mark.full
def test_a_known_lens_is_found_again(boards: list[tuple[str, Array]]) -> None:
    """All over the picture the found lens sees in the same directions, but for a turn of the whole camera."""
    lens = find_lens(collect(boards))
    u, v = np.meshgrid(np.linspace(20, 620, 9), np.linspace(20, 340, 7))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    true = np.column_stack([*SMALL.straight(pixels[:, 0], pixels[:, 1]), np.ones(len(pixels))])
    found = np.column_stack([lens.directions(pixels), np.ones(len(pixels))])
    true, found = (rays / np.linalg.norm(rays, axis=1)[:, None] for rays in (true, found))
    left, _, right = np.linalg.svd(found.T @ true)
    away = np.linalg.norm(found @ left @ right - true, axis=1)
    assert 540.0 * away.max() < 1.5  # pixels, in the corners, where no board was
    assert 540.0 * np.sqrt(np.mean(away**2)) < 0.5
    assert lens.focal_px == pytest.approx(SMALL.focal_px, rel=0.01)


@pytest.mark.full
def test_too_few_too_similar_and_one_sided_pictures_are_refused(boards: list[tuple[str, Array]]) -> None:
    with pytest.raises(CameraError, match="0 pictures of the board can be used; 10 are needed"):
        find_lens(collect([("empty", SCENE.picture(None))]))
    collector = Collector()
    reasons = [collector.add(name, picture) for name, picture in [boards[0], ("again", boards[0][1]), boards[1]]]
    assert reasons == ["", "the board has not moved since another picture", ""]
    with pytest.raises(CameraError, match="2 pictures of the board") as refused:
        find_lens(collector.collected)
    assert "has not moved" in refused.value.hint
    with pytest.raises(CameraError, match="pixels"):
        collector.add("large", np.zeros((100, 100), np.uint8))


@pytest.mark.full
def test_boards_at_one_side_only_are_refused(boards: list[tuple[str, Array]]) -> None:
    collected = collect(boards)
    for view in collected.views:
        object.__setattr__(view, "pixels", 0.5 * view.pixels)
    with pytest.raises(CameraError, match="never near the right or lower side"):
        find_lens(collected)


@pytest.mark.full
def test_a_board_that_is_not_flat_is_refused(boards: list[tuple[str, Array]]) -> None:
    collected = collect(boards)
    for view in collected.views:
        bent = np.hypot(*(view.points[:, :2] - (4.0, 3.0)).T) ** 2
        object.__setattr__(view, "pixels", view.pixels + 0.6 * bent[:, None])
    with pytest.raises(CameraError, match=r"do not fit one lens|uncertain"):
        find_lens(collected)


@pytest.mark.full
@pytest.mark.parametrize("family", FAMILIES)
def test_a_printed_tag_has_its_size_and_is_found(family: str, tmp_path: Path) -> None:
    for name, sheet in [*sheets(family, [1], 0.15, 10, 0.12, "a4")][1:]:
        sheet.figure.savefig(tmp_path / f"{name}.png", dpi=100)
    assert CELLS.keys() == FAMILIES.keys() == TAG_FAMILIES.keys()
    for name, number, side_m in (("floor-1", 1, 0.15), ("robot-10", 10, 0.12)):
        picture = cv2.imread(str(tmp_path / f"{name}.png"), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        (tag,) = TagFinder(family).find(picture)
        assert tag.id == number
        assert tag.side_px == pytest.approx(side_m / 0.0254 * 100, abs=2.0)
        assert tag.corners[1][0] > tag.corners[0][0]  # upright: x to the right, y up
        assert tag.corners[3][1] > tag.corners[0][1]


@pytest.mark.full
def test_sheets_are_written_in_true_size(tmp_path: Path) -> None:
    run("markers", str(tmp_path / "a"), "--paper", "letter", "--floor", "1")
    page = (tmp_path / "a" / "floor-1.pdf").read_bytes()
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", page)
    assert box is not None
    assert [float(size) for size in box.groups()] == pytest.approx([612.0, 792.0], abs=0.1)
    assert "exists already" in " ".join(run("markers", str(tmp_path / "a"), code=2).stderr.split())
    run("markers", str(tmp_path / "a"), "--sheets", "png", "--floor", "1", "--family", "aruco_4x4", "--force")
    assert load_setup(tmp_path / "a" / "camera.toml").family == "aruco_4x4"
    assert "'qr'" in run("markers", str(tmp_path / "b"), "--family", "qr", code=2).stderr


BAD_FILES = {
    "device = 0": ("device = -1", "camera.device"),
    "width = 640": ("width = 7", "camera.width"),
    "id = 10": ("id = 1", "used by two tags"),
    "height_m = 0.12": ("height_m = -1.0", "height_m"),
    "size_m = 0.12": ("siez_m = 0.12", "size_m"),
    "[[robot]]": ("[[robots]]", "robot"),
    "[camera]": ("[tags]\nfamily = 'qr'\n[camera]", "tags.family"),
}


@pytest.mark.parametrize("old", BAD_FILES)
def test_a_bad_camera_file_is_named(tmp_path: Path, old: str) -> None:
    text = camera_file(SCENE)
    new, problem = BAD_FILES[old]
    assert old in text
    (tmp_path / "camera.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(MocapSourceError, match=re.escape(problem)):
        load_setup(tmp_path / "camera.toml")


@pytest.mark.full
def test_lens_and_place_files_are_checked(tmp_path: Path) -> None:
    camera = write_files(tmp_path, SCENE)
    setup = load_setup(camera)
    lens = load_lens(setup.lens_path)
    assert np.linalg.norm(load_place(setup, lens).position - VIEW.position) < 0.003
    camera.write_text(camera_file(scene(VIEW, floor=FLOOR[:3])), encoding="utf-8")
    with pytest.raises(MocapSourceError, match="floor tags of the camera file changed"):
        load_place(load_setup(camera), lens)
    other = type(lens)(**{**vars(lens), "focal_px": (500.0, 500.0)})
    with pytest.raises(MocapSourceError, match="the lens changed"):
        load_place(setup, other)
    for path, problem in ((setup.lens_path, "fx_px"), (setup.place_path, "shift_m")):
        wrong = problem.upper()  # such a file has no section [parameters] to send anybody to
        path.write_text(path.read_text(encoding="utf-8").replace(problem, wrong), encoding="utf-8")
    with pytest.raises(MocapSourceError, match="unknown key"):
        load_lens(setup.lens_path)
    save_lens(lens, setup.lens_path)
    with pytest.raises(MocapSourceError, match="unknown key"):
        load_place(setup, lens)
    setup.place_path.unlink()
    assert "omni mocap place" in run("record", str(tmp_path / "x.csv"), "--source", f"camera:{camera}", code=2).stderr
    setup.lens_path.unlink()
    assert "omni mocap calibrate" in run("look", str(camera), code=2).stderr


def test_pictures_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    camera = write_files(tmp_path, SCENE, '"nowhere"')
    assert "nowhere" in run("look", str(camera), code=2).stderr
    (tmp_path / "nowhere").mkdir()
    assert "has no pictures" in run("look", str(camera), code=2).stderr
    (tmp_path / "bad.png").write_text("no picture", encoding="ascii")
    assert "bad.png" in run("look", str(camera), str(tmp_path / "bad.png"), code=2).stderr
    shutil.copy(tmp_path / "bad.png", tmp_path / "bad.avi")
    camera.write_text(camera_file(SCENE, '"bad.avi"'), encoding="utf-8")
    assert "cannot be opened" in run("look", str(camera), code=1).stderr


def test_without_opencv_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: str) -> None:
        raise ImportError("no cv2")

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(MocapLibraryError) as error:
        library.load_cv2()
    assert "omniwheel[vision]" in error.value.hint
    monkeypatch.setattr(importlib, "import_module", lambda _: object())
    with pytest.raises(MocapLibraryError, match=r"4\.8"):
        library.load_cv2()
