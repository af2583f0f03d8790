# SPDX-License-Identifier: MIT
"""The noise that enters while a late fix is on its way; heading noise acts at the lever arm of the motion after it."""

from __future__ import annotations

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_pose_ekf import GEOMETRY, TICK_US, Ekf, float32, reference

NOISES = ({"q_xy": 1e-9, "q_theta": 6e-5}, {"q_xy": 1e-6, "q_theta": 1e-9})


@pytest.mark.parametrize("noises", NOISES, ids=("heading", "place"))
@pytest.mark.parametrize("wheels", [3, 4])
@pytest.mark.parametrize("slots", [4, 5, 8])
@pytest.mark.parametrize("direction", [0.0, 1.1, 2.5])
def test_noise_on_the_way_of_a_late_fix_is_that_of_each_tick(
    wheels: int, slots: int, direction: float, noises: dict[str, float]
) -> None:
    noise = reference.Noise(**noises)
    ekf = Ekf(wheels, noise=noise, sd=(0.05, 0.05))
    start = np.diag([0.0025] * 3)
    replay = reference.Replay(reference.Filter(GEOMETRY[wheels], noise, np.zeros(3), start))
    geometry = GEOMETRY[wheels]
    body = np.array([0.01 * np.cos(direction), 0.01 * np.sin(direction), 0.0])
    turned = float32(body @ geometry.matrix.T / geometry.radius_m)
    taken = 4
    ticks = taken + slots * 4
    for tick in range(ticks):
        ekf.predict(turned)
        if tick == 0:
            # The filter starts with its first tick: no noise has entered before it.
            replay.past.predict(turned)
        else:
            replay.predict(turned)
    fix = float32(geometry.inverse @ (geometry.radius_m * turned) * taken)
    assert ekf.correct(fix, (ticks - taken) * TICK_US) == lib.OMNI_OK
    replay.update(fix, ticks - taken)
    p, exact = ekf.p, replay.now().p
    # The mean lever arm is exact; its square within a slot of four ticks is not, by a tenth of a slot's motion.
    assert p[0, 2] == pytest.approx(exact[0, 2], abs=2e-3 * np.sqrt(exact[0, 0] * exact[2, 2]))
    assert p[1, 2] == pytest.approx(exact[1, 2], abs=2e-3 * np.sqrt(exact[1, 1] * exact[2, 2]))
    sd = np.sqrt(np.diag(exact))
    assert np.abs((p - exact) / np.outer(sd, sd)).max() <= 0.02
