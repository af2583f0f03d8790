# SPDX-License-Identifier: MIT
"""What autotune decides without a robot: the first drives' gains, rows of coarse encoders, keep or go back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil_sim.studies.drawn_robots import draw_robot
from omniwheel.autotune.design import GENTLE, gentle_values
from omniwheel.autotune.procedure import _worth_keeping
from omniwheel.autotune.room import merged
from omniwheel.autotune.wheel_loop import loaded, loop_of, motor_of
from omniwheel.dialect import mavlink
from omniwheel.tuning_verdict import KINDS, Verdict

PERIOD_US = 20_000


@pytest.mark.parametrize("seed", [1, 5, 7, 11])
def test_the_first_drives_gains_hold_the_true_robot_whose_file_is_wrong(seed: int) -> None:
    """Its numbers are wrong by up to 30 %, either way."""
    drawn = draw_robot(seed)
    believed, truth = drawn.believed.parameter_values(), drawn.truth.parameter_values()
    gentle = gentle_values(believed)
    assert gentle["ISMC_LAM_XY"] <= GENTLE.quickest_1_s
    values = {**believed, **gentle}
    arm = truth["WHEEL_RADIUS"] / truth["WHEEL_DIST"]
    inertias = (
        truth["MOT_J"] + 2.0 * truth["MASS"] * truth["WHEEL_RADIUS"] ** 2 / truth["WHEELS"],
        truth["MOT_J"] + truth["INERTIA"] * arm**2 / truth["WHEELS"],
    )
    for inertia in inertias:
        found = loop_of(values, loaded(motor_of(truth), inertia)).margins(values["WS_P"], values["WS_I"])
        assert found.gain > 2.0
        assert math.degrees(found.phase_rad) > 40.0
        assert found.distance > 0.5


def sample(row: int, counts: float) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_omni_sample_message(
        row * PERIOD_US, [round(counts)] * 4, [1000 * row] * 4, 12.0, [0.0, 0.0, 0.0], 0
    )


@pytest.mark.parametrize(("counts", "every"), [(48, 4), (4000, 1)])
def test_few_counts_make_longer_rows_and_lose_no_motion(counts: int, every: int) -> None:
    parameters = {"WHEELS": 3.0, "ENC_CPR": float(counts), **{f"W{wheel}_ENC_DIR": 1.0 for wheel in (1, 2, 3)}}
    turns = 0.5 * (1.0 - np.cos(np.arange(200) * 0.02))
    data = merged([sample(row, turn * counts) for row, turn in enumerate(turns)], "test", parameters)
    assert data.period_s == pytest.approx(0.02 * every)
    assert data.wheel_angle_rad is not None
    last = (len(data.time_s) - 1) * every
    whole = round(turns[last] * counts) * 2.0 * math.pi / counts
    assert data.wheel_angle_rad[-1, 0] == pytest.approx(whole)


def verdict(difference: float, half_width: float) -> Verdict:
    return Verdict(KINDS[3], 1.0, 1.0 + difference, difference, half_width, 4)


def test_new_values_are_kept_only_for_a_reason() -> None:
    better, worse, same = verdict(-0.2, 0.1), verdict(0.2, 0.1), verdict(-0.05, 0.1)
    assert _worth_keeping([better, same], old_fits=True)
    assert not _worth_keeping([same, same], old_fits=True)
    assert _worth_keeping([same, same], old_fits=False)
    assert not _worth_keeping([better, worse], old_fits=False)
    assert _worth_keeping([], old_fits=False)
