# SPDX-License-Identifier: MIT
"""OptiTrack Motive's CSV export as ground truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.log_sources import open_log
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import save_log
from omniwheel.logs.mapping import Mapping, read_mapping
from omniwheel.logs.motive import MotiveOptions, read_motive
from tests.host.logs import synthetic
from tests.host.logs.motive_take import Array, write_take


@pytest.fixture(scope="module")
def pose() -> Array:
    """Three seconds of a bent path with more than a full turn."""
    time = np.arange(300) * 0.01
    return np.column_stack((0.5 * np.sin(time), 0.3 * time, 3.0 * time - 1.0))


@pytest.mark.parametrize(
    "written",
    [
        {},
        {"rotation": "XYZ"},
        {"rotation": "YXZ"},
        {"rotation": "ZYX", "up": "z"},
        {"up": "z"},
        {"unit": ("Millimeters", 1e-3), "parents": True},
        {"unit": ("Centimeters", 1e-2), "bodies": ("Robot", "Table")},
    ],
)
def test_positions_and_headings_come_back(tmp_path: Path, pose: Array, written: dict[str, Any]) -> None:
    path = write_take(tmp_path / "take.csv", pose, **written)
    body = "Robot" if "bodies" in written else ""
    track = read_motive(path, MotiveOptions(body, written.get("up", "y")))
    assert np.allclose(track.time_s, np.arange(len(pose)) * 0.01)
    assert np.allclose(track.xy, pose[:, :2], atol=1e-5)
    assert np.allclose(track.theta, pose[:, 2], atol=1e-5)
    assert track.hidden_frames == 0


def test_frames_without_the_body_are_left_out_and_counted(tmp_path: Path, pose: Array) -> None:
    hidden = [*range(50, 80), 120]
    track = read_motive(write_take(tmp_path / "take.csv", pose, hidden=hidden), MotiveOptions())
    seen = np.setdiff1d(np.arange(len(pose)), hidden)
    assert track.hidden_frames == len(hidden)
    assert np.allclose(track.time_s, 0.01 * seen)
    assert np.allclose(track.theta, pose[seen, 2], atol=1e-5)


def test_a_marker_has_a_position_only(tmp_path: Path, pose: Array) -> None:
    track = read_motive(write_take(tmp_path / "take.csv", pose, marker=True), MotiveOptions())
    assert np.allclose(track.xy, pose[:, :2], atol=1e-5)
    assert np.all(np.isnan(track.theta))


@pytest.mark.parametrize("setting", ["", "Rotation Type,,"])
def test_a_marker_needs_no_rotation_type(tmp_path: Path, pose: Array, setting: str) -> None:
    path = changed(write_take(tmp_path / "take.csv", pose, marker=True), "Rotation Type,Quaternion,", setting)
    assert np.allclose(read_motive(path, MotiveOptions()).xy, pose[:, :2], atol=1e-5)


def test_an_import_takes_a_take_as_truth(
    tmp_path: Path, files: Path, pose: Array, mapping: Mapping, robot: Robot
) -> None:
    take = write_take(tmp_path / "take.csv", pose, hidden=[3, 4])
    log, summary = import_log(files / "run1.csv", mapping, take)
    assert log.truth is not None
    assert (len(log.truth.time_s), summary.truth_dropped_rows) == (len(pose) - 2, 2)
    save_log(replace(log, truth=None), tmp_path / "run1.npz")
    again = open_log(tmp_path / "run1.npz", robot, truth=take)
    assert again.truth is not None
    assert np.allclose(again.truth.xy, log.truth.xy)


def changed(path: Path, old: str, new: str) -> Path:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("written", "options", "named"),
    [
        ({"up": "z"}, MotiveOptions(), "up"),
        ({"bodies": ("Robot", "Table")}, MotiveOptions(), "Table"),
        ({"bodies": ("Robot", "Table")}, MotiveOptions("Tablo"), "Table"),
        ({"hidden": range(300)}, MotiveOptions(), "pose"),
        ({"unit": ("Feet", 0.3048)}, MotiveOptions(), "Feet"),
    ],
)
def test_a_take_that_does_not_fit_is_refused(
    tmp_path: Path, pose: Array, written: dict[str, Any], options: MotiveOptions, named: str
) -> None:
    path = write_take(tmp_path / "take.csv", pose, **written)
    with pytest.raises(LogError) as caught:
        read_motive(path, options)
    assert named in f"{caught.value} {caught.value.hint}"


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("Frame,Time (Seconds)", "Picture,Time (Seconds)", "header"),
        ("Rotation Type,Quaternion", "Rotation Type,Rodrigues", "Rodrigues"),
        ("Rotation Type,Quaternion", "Rotation Type,XYZ", "XYZ"),
        ("Rotation Type,Quaternion", "Rotation Type,", "rotation type"),
        ("Rotation Type,Quaternion,", "", "rotation type"),
        ("\n7,0.070000,", "\n7,noon,", ":15"),
        ("Position,Position,Position,Mean", "Place,Place,Place,Mean", "position"),
    ],
)
def test_a_damaged_take_names_file_and_problem(tmp_path: Path, pose: Array, old: str, new: str, named: str) -> None:
    path = changed(write_take(tmp_path / "take.csv", pose), old, new)
    with pytest.raises(LogError) as caught:
        read_motive(path, MotiveOptions())
    assert str(path) in str(caught.value)
    assert named in str(caught.value)


def test_a_body_on_its_side_is_refused(tmp_path: Path, pose: Array) -> None:
    path = write_take(tmp_path / "take.csv", pose, rotation="XYZ", up="z")
    still = np.column_stack((pose[:, :2] * [1.0, 0.1], pose[:, 2]))
    path = write_take(tmp_path / "take.csv", still, rotation="XYZ", up="z", height_m=0.0)
    with pytest.raises(LogError):
        read_motive(path, MotiveOptions(up="y"))


def test_a_take_in_place_of_the_log_is_named_as_such(tmp_path: Path, pose: Array, mapping: Mapping) -> None:
    with pytest.raises(LogError) as caught:
        import_log(write_take(tmp_path / "take.csv", pose), mapping)
    assert "Motive" in str(caught.value)


@pytest.mark.parametrize("line", ['up = "x"', "body = 3", 'time = "t"', 'format = "c3d"'])
def test_wrong_keys_for_a_take_are_refused(tmp_path: Path, line: str) -> None:
    text = synthetic.MAPPING[: synthetic.MAPPING.index("[truth]")]
    kind = "" if line.startswith("format") else 'format = "motive"\n'
    (tmp_path / "mapping.toml").write_text(f"{text}[truth]\n{kind}{line}\n", encoding="utf-8")
    with pytest.raises(LogError) as caught:
        read_mapping(tmp_path / "mapping.toml")
    assert line.split()[0] in str(caught.value)
