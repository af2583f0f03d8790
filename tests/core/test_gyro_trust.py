# SPDX-License-Identifier: MIT
"""When a gyro is believed: wheels that a person turns, wheels that skid, a held robot, and a bias that steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_gyro import DENSITY, TICK_S, Filter


def noise(seed: int) -> Any:
    """Return a function that gives a reading's noise."""
    rng = np.random.default_rng(seed)
    return lambda: rng.normal(0.0, DENSITY / math.sqrt(TICK_S))


def turned(core: Filter, wheels_rad_s: float, gyro_rad_s: float, seconds: float, driven: bool = True) -> bool:
    """Let wheels and gyro turn for a while; return whether the readings were used all the time."""
    each = noise(core.time_us)
    ticks = round(seconds / TICK_S)
    used = [core.tick(wheels_rad_s, 0.004 + gyro_rad_s + each(), driven=driven) for _ in range(ticks)]
    return all(used)


def test_wheels_that_a_person_turns_say_nothing_of_the_gyro() -> None:
    """As in bring-up: each wheel by a whole turn, the robot on a stand. Motors have no voltage."""
    core = Filter()
    core.rest()
    assert turned(core, 1.0, 0.0, 10.0, driven=False)
    assert core.s.pose.theta == pytest.approx(0.0, abs=1e-3)
    assert turned(core, 0.5, 0.5, 2.0)


@pytest.mark.parametrize("share", [0.12, 0.3, -0.5, 3.0])
def test_a_gyro_that_has_agreed_is_believed_though_wheels_skid(share: float) -> None:
    core = Filter()
    core.rest()
    assert turned(core, 0.5, 0.5, 1.0)
    assert turned(core, 1.0, share, 60.0)
    assert core.gyro.turn.overrides_wheels


def test_a_held_robot_keeps_its_heading_for_nine_radians_of_its_wheels() -> None:
    core = Filter()
    core.rest()
    assert turned(core, 0.5, 0.5, 1.0)
    heading = core.s.pose.theta
    assert turned(core, 1.0, 0.0, 8.0)
    assert core.s.pose.theta == pytest.approx(heading, abs=2e-3)
    assert not turned(core, 1.0, 0.0, 2.5), "it may be blind as well"
    assert math.sqrt(core.p[2][2]) > 1.5, "either the wheels or the gyro are right, so the heading is not known"
    assert not turned(core, 0.5, 0.45, 12.0)
    assert turned(core, 0.5, 0.45, 4.0), "it sees again"
    assert core.gyro.turn.overrides_wheels


def test_a_gyro_with_a_wrong_sign_leaves_the_heading_sure() -> None:
    """It turns as far as the wheels, the other way: nothing speaks against the wheels."""
    core = Filter(axis=-3)
    for tick in range(1100):
        core.tick(0.0, 0.004 + 1e-4 * (tick % 3 - 1), axis=3)
    turned(core, 0.5, 0.5, 1.0)
    assert core.gyro.rejected
    assert math.sqrt(core.p[2][2]) < 0.05


def hold(core: Filter, step_rad_s: float, seconds: float) -> tuple[float, int]:
    """Let a robot hold its estimated heading with ideal wheels, its bias having stepped; return its true turn.

    And for how many ticks the readings were not used.
    """
    each = noise(3)
    heading, wanted, refused = 0.0, core.s.pose.theta, 0
    for _ in range(round(seconds / TICK_S)):
        rate = 4.0 * (wanted - core.s.pose.theta)
        heading += rate * TICK_S
        refused += not core.tick(rate, 0.004 + step_rad_s + rate + each())
    return heading, refused


@pytest.mark.full
@pytest.mark.parametrize("step_rad_s", [0.03, -0.05, 0.1, 0.19])
def test_a_bias_that_steps_does_not_turn_a_robot_that_holds_its_heading(step_rad_s: float) -> None:
    core = Filter()
    core.rest(seconds=2.0)
    assert turned(core, 0.5, 0.5, 1.0)
    heading, refused = hold(core, step_rad_s, 60.0)
    assert abs(heading) < 0.05 + abs(step_rad_s), "it goes on for ten seconds, and is put back"
    assert refused >= lib.OMNI_GYRO_WARNING_TICKS, "it is said"
    assert core.bias[0] == pytest.approx(0.004 + step_rad_s, abs=0.005)
    assert math.sqrt(core.p[2][2]) > 5.0 * abs(step_rad_s), "the heading is as unsure as it was wrong"


def turned_unseen(core: Filter, wheels_rad_s: float, seconds: float, share: float = 1.0) -> bool:
    """Turn the wheels during a share of each second; the gyro sees none of it. Return whether it was used all along.

    In ticks of 20 ms, without the pose filter's.
    """
    each, usable = noise(4), True
    for tick in range(round(seconds / 0.02)):
        core.time_us += 20_000
        rate = wheels_rad_s if tick % 50 < 50 * share else 0.0
        values = {"time_us": core.time_us, "reading": ffi.new("float[3]", [0.0, 0.0, 0.004 + each()]), "valid": 7}
        values |= {"interval_valid": True, "duration_s": 0.02, "wheel_yaw_rate_rad_s": rate}
        values |= {"wheels_still": rate == 0.0, "motors_driven": rate != 0.0}
        told = ffi.new("omni_gyro_tick_t *", values)
        usable &= bool(lib.omni_gyro_step(core.gyro, core.gyro_config, told, core.s, core.config, core.k))
    return usable


@pytest.mark.parametrize(("wheels_rad_s", "shifts"), [(0.15, True), (0.3, False)])
def test_only_a_slow_turn_is_a_bias_also_if_the_wheels_turn_half_of_the_time(wheels_rad_s: float, shifts: bool) -> None:
    core = Filter()
    core.rest()
    assert turned(core, 0.5, 0.5, 1.0)
    assert turned_unseen(core, wheels_rad_s, 14.0, share=0.5) != shifts
    assert core.bias[0] == pytest.approx(0.004 - wheels_rad_s if shifts else 0.004, abs=2e-3)


def test_a_bias_that_has_stepped_is_unsure_and_says_nothing_of_the_scale() -> None:
    """The old one had something in common with the scale, as after turns with pose fixes."""
    core = Filter()
    core.rest()
    assert turned(core, 0.5, 0.5, 1.0)
    core.s.p[7][8] = core.s.p[8][7] = 0.5 * math.sqrt(core.s.p[7][7] * core.s.p[8][8])
    scale_variance = core.s.p[8][8]
    assert not turned_unseen(core, 0.1, 12.0)
    assert core.bias == pytest.approx((-0.096, 0.025), rel=0.05)
    np.testing.assert_allclose(core.p[7:, 7:], np.diag([core.bias[1] ** 2, scale_variance]), rtol=1e-6)


def test_wheels_that_slip_while_they_drive_move_no_bias() -> None:
    """One wheel slips by a third on a straight way, so the wheels say that the robot turns, slowly and steadily."""
    core = Filter()
    core.rest(seconds=2.0)
    bias, each = core.bias[0], noise(5)
    for _ in range(40_000):
        assert core.tick(0.05, 0.004 + each(), speed_m_s=0.3)
    assert core.bias[0] == pytest.approx(bias, abs=1e-3)
