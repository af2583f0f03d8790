# SPDX-License-Identifier: MIT
"""Which gains a controller gets."""

from __future__ import annotations

import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench


@pytest.mark.parametrize(("mode", "kd", "ki"), [("P", False, False), ("PD", True, False), ("PID", True, True)])
def test_a_controller_has_the_gains_that_its_name_says(mode: str, kd: bool, ki: bool) -> None:
    gains = {"FL_KP_XY": 1.5, "FL_KP_TH": 2.5, "FL_KD_XY": 0.25, "FL_KD_TH": 0.5, "FL_KI_XY": 0.75, "FL_KI_TH": 1.25}
    bench = Bench()
    fl = bench.configure(CTL_MODE=float(getattr(lib, f"OMNI_CTL_MODE_{mode}")), **gains).fl
    assert list(fl.kp) == [1.5, 1.5, 2.5]
    assert list(fl.kd) == ([0.25, 0.25, 0.5] if kd else [0.0] * 3)
    assert list(fl.ki) == ([0.75, 0.75, 1.25] if ki else [0.0] * 3)
