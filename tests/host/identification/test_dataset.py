# SPDX-License-Identifier: MIT
"""A dataset is checked when it is made: what passes can be computed with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from omniwheel.errors import DatasetError
from omniwheel.identification.dataset import Dataset


def fields(**changes: Any) -> dict[str, Any]:
    rows = 5
    given: dict[str, Any] = {
        "name": "run",
        "time_s": np.arange(rows) * 0.02,
        "wheel_rad_s": np.ones((rows, 3)),
        "voltage_V": np.ones((rows, 3)),
        "pose_time_s": np.arange(3) * 0.03,
        "pose": np.zeros((3, 3)),
    }
    return {**given, **changes}


def test_unknown_speeds_and_headings_are_allowed() -> None:
    speed = np.ones((5, 3))
    speed[2, 1] = np.nan
    data = Dataset(**fields(wheel_rad_s=speed, pose=[[0.0, 0.0, np.nan]] * 3))
    assert data.wheels == 3
    assert data.period_s == pytest.approx(0.02)


def test_no_ground_truth_is_allowed() -> None:
    assert Dataset(**fields(pose_time_s=[], pose=[])).pose.shape == (0, 3)


def test_a_part_keeps_its_rows_together() -> None:
    part = Dataset(**fields(wheel_angle_rad=np.arange(15.0).reshape(5, 3))).between(0.02, 0.07)
    np.testing.assert_allclose(part.time_s, [0.02, 0.04, 0.06])
    np.testing.assert_allclose(part.pose_time_s, [0.03, 0.06])
    assert part.wheel_angle_rad is not None
    assert part.wheel_angle_rad[0, 0] == 3.0


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"time_s": [0.0, 0.1, 0.1, 0.2, 0.3]}, "time_s does not increase after row 1"),
        ({"time_s": [0.0, 0.1, np.nan, 0.2, 0.3]}, "time_s is not finite in row 2"),
        ({"time_s": [0.0]}, "time_s has shape"),
        ({"wheel_rad_s": np.ones((5, 2))}, "3 or 4 are needed"),
        ({"wheel_rad_s": np.ones((4, 3))}, "5 rows"),
        ({"voltage_V": np.full((5, 3), np.nan)}, "voltage_V is nan in row 0"),
        ({"voltage_V": np.ones((5, 4))}, "3 columns"),
        ({"pose": [[np.inf, 0.0, 0.0]] * 3}, "pose is inf"),
        ({"pose": [[np.nan, 0.0, 0.0]] * 3}, "pose is nan"),
        ({"pose": np.zeros((2, 3))}, "pose has shape"),
        ({"wheel_angle_rad": np.ones((5, 4))}, "wheel_angle_rad"),
        ({"voltage_V": "volts"}, "not an array of numbers"),
    ],
)
def test_bad_data_is_refused_with_its_place(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(DatasetError, match="run: ") as caught:
        Dataset(**fields(**changes))
    assert says in str(caught.value)
    assert caught.value.hint
