# SPDX-License-Identifier: MIT
"""A fix from hours ago is refused, however its age looks in 32 bits of microseconds."""

from __future__ import annotations

import pytest

from omniwheel._core import lib
from tests.core.test_pose_ekf import Ekf


@pytest.mark.parametrize("young_us", [0, 1, 5_000, 100_000])
@pytest.mark.parametrize("rounds", [1, 2, 3])
def test_an_age_of_whole_rounds_of_32_bits_is_not_young(young_us: int, rounds: int) -> None:
    ekf = Ekf()
    ekf.time_us = 2**35
    ekf.predict([0.0, 0.0, 0.0], count=300)
    before = ekf.snapshot()
    assert ekf.correct((0.01, 0.0, 0.0), rounds * 2**32 + young_us) == lib.OMNI_ERR_TIME
    assert ekf.snapshot() == before
    assert ekf.correct((0.01, 0.0, 0.0), young_us) == lib.OMNI_OK
