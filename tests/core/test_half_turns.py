# SPDX-License-Identifier: MIT
"""Wrapping at the floats around every half turn, where rounding decides on which side an angle is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from omniwheel._core import lib

PI_F = float(np.float32(math.pi))


@pytest.mark.parametrize("half_turns", [*range(-41, 42, 2), 101, -1001, 10001, -100001, 318309, -318309])
def test_floats_around_a_half_turn_stay_in_range_and_keep_their_direction(half_turns: int) -> None:
    centre = np.float32(half_turns * math.pi)
    near = [centre]
    for direction in (-np.inf, np.inf):
        angle: Any = centre
        for _ in range(30):
            angle = np.nextafter(angle, np.float32(direction))
            near.append(angle)
    for angle in map(float, near):
        wrapped = lib.omni_wrap_pi(angle)
        assert -PI_F <= wrapped < PI_F
        turns = (angle - wrapped) / math.tau
        assert abs(turns - round(turns)) * math.tau < 4e-7
