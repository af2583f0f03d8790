# SPDX-License-Identifier: MIT
"""Noise levels that follow the innovations: the law in float64, what it finds, what freezes it, what it survives."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil_sim.faults import Fault
from hil_sim.runs import new_world, run_in_process
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
from omniwheel.core_config import robot_config
from omniwheel.pose_quality import NOISE_MOST
from omniwheel.presets import read_preset
from omniwheel.robots import parameter_table
from tests.core.test_pose_ekf import GEOMETRY, POSE, SLIP, TICK_US, Array, Ekf, assert_same, drive, float32, reference

RATE = 0.1


class Adaptive:
    """The filter in float64 that goes back to a fix's time, each tick with the noise factor it had, and the law."""

    def __init__(self, wheels: int, states: int) -> None:
        p = np.diag([1e-4, 1e-4, 1e-4, *[0.0064] * (states - 3)])
        self.past = reference.Filter(GEOMETRY[wheels], reference.Noise(), np.zeros(states), p)
        self.motion: list[tuple[Array, float, float]] = []
        self.noise, self.fix = 1.0, 1.0
        self.measured = np.zeros(3)

    def predict(self, turned: Array, slip_noise: float = 1.0) -> None:
        self.motion.append((turned, self.noise, slip_noise))

    def _carry(self, filter_: Any, motion: list[tuple[Array, float, float]]) -> None:
        plain = reference.Noise()
        for turned, factor, slip_noise in motion:
            filter_.noise = reference.Noise(
                plain.q_xy * factor, plain.q_theta * factor, plain.q_slip * min(factor, 4.0) * slip_noise
            )
            filter_.predict(turned)

    def update(self, fix: Array, age_ticks: int) -> None:
        split = len(self.motion) - age_ticks
        self._carry(self.past, self.motion[:split])
        self.motion = self.motion[split:]
        past = self.past
        plain = reference.Noise()
        past.noise = reference.Noise(r_xy=plain.r_xy * self.fix, r_theta=plain.r_theta * self.fix)
        r = np.array([past.noise.r_xy, past.noise.r_xy, past.noise.r_theta])
        low = np.linalg.cholesky(past.p[:3, :3] + np.diag(r))
        white = np.linalg.solve(low, fix - past.x[:3])
        kept = r / np.diag(low) ** 2
        past.update(fix)
        change = np.clip(RATE * float((1.0 - kept) * white @ self.measured), -0.3, 0.3)
        self.measured = kept * self.measured + white
        self.noise = float(np.clip(self.noise * (1.0 + change), 1.0 / 64.0, 1024.0))
        excess = min(float(white @ white), 12.0) / 3.0 - 1.1
        self.fix = float(np.clip(self.fix * (1.0 + RATE / 20.0 * excess), 1.0, 16.0))

    def now(self) -> Any:
        filter_now = copy.deepcopy(self.past)
        self._carry(filter_now, self.motion)
        return filter_now


@pytest.mark.full
@pytest.mark.reference
@pytest.mark.parametrize(("wheels", "mode"), [(3, POSE), (3, SLIP), (4, SLIP)])
@pytest.mark.parametrize("delay", [(0, 1), (13, 60)])
def test_late_fixes_are_exact_while_the_levels_change(wheels: int, mode: int, delay: tuple[int, int]) -> None:
    """Fixes with three times the noise that is believed: both levels move."""
    ekf = Ekf(wheels, mode, adapt_rate=RATE)
    exact = Adaptive(wheels, ekf.states)
    rng = np.random.default_rng(3)
    truth = np.concatenate([np.zeros(3), rng.normal(0, 0.04, ekf.states - 3)])
    arrivals: dict[int, tuple[Array, int]] = {}
    last = 0
    tolerance = 5e-3  # both linearise, at slightly different states, and the innovations are large
    for tick, turned in enumerate(drive(wheels, 1500, 4)):
        truth = reference.move(GEOMETRY[wheels], truth, turned)
        ekf.predict(turned)
        ekf.config.p_slip = 0.25
        exact.predict(turned, 0.0 if tick == 0 else 1.0)
        if tick % 20 == 10:
            last = max(last + 1, tick + int(rng.integers(*delay)))
            arrivals[last] = float32(truth[:3] + rng.normal(0, 0.015, 3)), tick
        if tick in arrivals:
            fix, taken = arrivals.pop(tick)
            assert ekf.correct(fix, (tick - taken) * TICK_US) == lib.OMNI_OK
            exact.update(fix, tick - taken)
            assert_same(ekf, exact.now(), mean_sd=tolerance, relative=tolerance)
            assert ekf.s.noise_factor == pytest.approx(exact.noise, rel=5e-3)
            assert ekf.s.fix_noise_factor == pytest.approx(exact.fix, rel=5e-3)
    assert exact.noise != 1.0
    assert exact.fix > 2.0


def walk(ekf: Ekf, scale: float, seconds: float, seed: int, fix_sd: float = 0.005) -> tuple[Array, Array]:
    """Drive a body that walks as if q were ``scale`` times what is configured; return errors and factors by second."""
    rng = np.random.default_rng(seed)
    noise = reference.Noise()
    sd = np.sqrt(np.array([noise.q_xy, noise.q_xy, noise.q_theta]) * scale * 20)
    truth = np.zeros(3)
    straight = float32(GEOMETRY[3].matrix @ [0.1, 0.05, 0.1] / 0.0508 * 1e-3)
    moved = np.zeros(3)  # between two fixes, seen from the heading at the first
    for _ in range(20):
        moved = reference.move(GEOMETRY[3], moved, straight)
    errors, factors = [], []
    for _ in range(round(seconds * 50)):
        sine, cosine = np.sin(truth[2]), np.cos(truth[2])
        turned = np.array([cosine * moved[0] - sine * moved[1], sine * moved[0] + cosine * moved[1], moved[2]])
        truth = truth + turned + rng.normal(0.0, sd)
        ekf.predict(straight, 20)
        assert ekf.correct(truth + rng.normal(0.0, fix_sd, 3)) == lib.OMNI_OK
        error = ekf.x[:3] - truth
        error[2] = reference.wrap(error[2])
        errors.append(error)
        factors.append((float(ekf.s.noise_factor), float(ekf.s.fix_noise_factor)))
    return np.array(errors), np.array(factors)


@pytest.mark.parametrize("scale", [1 / 16, 1.0, 16.0])
def test_it_finds_how_noisy_the_motion_is(scale: float) -> None:
    """The factor's logarithm is within what the rate leaves open (sqrt(rate / 2) times 3); the error is no larger."""
    errors, factors = walk(Ekf(adapt_rate=RATE), scale, 60.0, 1)
    late = slice(1000, None)
    assert np.log(factors[late, 0]).mean() == pytest.approx(np.log(scale), abs=3.0 * np.sqrt(RATE / 2.0))
    fixed, still = walk(Ekf(), scale, 60.0, 1)
    assert (still == 1.0).all()
    ratio = np.sqrt(np.mean(errors[late] ** 2) / np.mean(fixed[late] ** 2))
    assert ratio < (1.03 if scale == 1.0 else 0.9), ratio


def test_fixes_worse_than_believed_make_it_less_sure() -> None:
    """With three times the deviation that is believed the mean square over the variance comes to one."""
    ekf = Ekf(adapt_rate=RATE)
    errors, factors = walk(ekf, 1.0, 60.0, 2, fix_sd=0.015)
    assert factors[1500:, 1].mean() == pytest.approx(9.0, rel=0.25)
    sure = np.mean(errors[1500:, 0] ** 2) / ekf.p[0, 0]
    plain = Ekf()
    fixed, _ = walk(plain, 1.0, 60.0, 2, fix_sd=0.015)
    assert sure < 2.0 < np.mean(fixed[1500:, 0] ** 2) / plain.p[0, 0]


def levels(ekf: Ekf) -> tuple[float, ...]:
    return (
        float(ekf.s.noise_factor),
        float(ekf.s.fix_noise_factor),
        *(float(value) for value in ekf.s.whitened_innovation_sum),
    )


def test_without_information_they_stand_still() -> None:
    ekf = Ekf(3, SLIP, adapt_rate=RATE, gate=25.0)
    walk(ekf, 16.0, 2.0, 3)
    before = levels(ekf)
    assert before[0] != 1.0
    here = ekf.x[:3]
    ekf.predict([0.0] * 3, 40)
    for _ in range(20):  # it stands: the fixes' noise says nothing of the wheels
        ekf.predict([0.0] * 3, 20)
        assert ekf.correct(np.add(here, [0.003, -0.002, 0.001])) == lib.OMNI_OK
    assert levels(ekf) == before
    ekf.predict([0.01] * 3, 1000)  # no fixes
    assert levels(ekf) == before
    assert ekf.correct((9.0, 9.0, 0.0)) == lib.OMNI_ERR_RANGE
    assert ekf.correct(tuple(ekf.x[:3]), 900_000) == lib.OMNI_ERR_TIME
    assert ekf.correct((np.nan, 0.0, 0.0)) == lib.OMNI_ERR_NOT_FINITE
    assert levels(ekf) == before


def test_a_restart_begins_as_configured() -> None:
    fresh = (1.0, 1.0, 0.0, 0.0, 0.0)
    ekf = Ekf(adapt_rate=RATE, gate=25.0, gate_restart=3)
    walk(ekf, 16.0, 1.0, 4)
    assert levels(ekf) != fresh
    for _ in range(3):
        ekf.predict([0.001] * 3, 20)
        ekf.correct((5.0, 5.0, 0.0))
    assert ekf.s.restarts == 1
    assert levels(ekf) == fresh
    ekf = Ekf(adapt_rate=RATE)
    walk(ekf, 16.0, 1.0, 4)
    assert levels(ekf) != fresh
    lib.omni_pose_ekf_set_pose(ekf.s, ekf.config, ffi.new("omni_pose_t *"), 5)
    assert levels(ekf) == fresh


def test_switched_off_under_way_it_is_the_filter_that_never_had_it() -> None:
    ekf = Ekf(adapt_rate=RATE)
    walk(ekf, 16.0, 1.0, 4)
    assert levels(ekf)[0] != 1.0
    ekf.config.adapt_rate = 0.0
    ekf.predict([0.001] * 3, 20)
    assert ekf.correct((9.0, np.nan, 0.0)) == lib.OMNI_ERR_NOT_FINITE  # also a fix that is refused
    assert levels(ekf) == (1.0, 1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("far", [0.1, 1e3, 1e15])
def test_they_stay_within_their_bounds_whatever_comes(far: float) -> None:
    """No gate, fixes that are anywhere: levels, covariance and pose stay finite, and good fixes bring it back."""
    rng = np.random.default_rng(6)
    ekf = Ekf(3, SLIP, adapt_rate=1.0)
    for _ in range(300):
        ekf.predict([0.01, 0.02, -0.01], 20)
        ekf.correct(rng.normal(0.0, far, 3) * [1.0, 1.0, 1e-3])
        assert 1.0 / 64.0 <= ekf.s.noise_factor <= 1024.0
        assert 1.0 <= ekf.s.fix_noise_factor <= 16.0
        assert np.isfinite(ekf.p).all()
        assert (np.diag(ekf.p) >= 0.0).all()


@pytest.mark.parametrize(("late_s", "least", "most"), [(0.0, 0.4, 2.0), (0.02, 4.0, 32.0)])
def test_a_delay_that_nobody_told_shows_in_the_level(late_s: float, least: float, most: float) -> None:
    """On the fast robot: the innovations then fit again, so only the level tells (NOISE_MOST)."""
    scenario = load_scenario("fast").with_duration(16.0)
    delayed = replace(scenario, faults=(Fault("pose_delay", 1.0, value=late_s),) if late_s else ())
    world = new_world(delayed).c
    config = robot_config(delayed.parameter_values(), delayed.robot.table, 0)
    run, why = ffi.new("hil_run_t *"), ffi.new("char[]", 160)
    assert lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) == lib.HIL_OK
    lib.hil_run_advance(run, 2000)
    assert lib.hil_run_start_trajectory(run) == lib.OMNI_OK
    run.inputs.events |= lib.OMNI_EVENT_ARM
    lib.hil_run_advance(run, 14_000)
    assert least < float(run.robot.estimator.pose_ekf.noise_factor) ** 0.5 < most
    assert NOISE_MOST == 4.0


FAULTS = {
    "fixes that jump by 0.3 m": [Fault("pose_jump", 6.0 + 0.5 * i, 6.05 + 0.5 * i, value=0.3) for i in range(16)],
    "a kidnapped robot": [Fault("pose_jump", 8.0, value=0.5)],
    "fixes 60 ms late, unsaid": [Fault("pose_delay", 6.0, value=0.06)],
    "fixes that repeat": [Fault("pose_freeze", 8.0, 10.0)],
    "no fixes for 5 s": [Fault("pose_loss", 7.0, 12.0)],
    "an encoder that stands": [Fault("encoder_stuck", 9.0, 9.1, wheel=1)],
    "a wheel that is blocked": [Fault("motor_stalled", 9.0, 9.15, wheel=1)],
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("robot", ["demo", "fast"])
def test_a_fault_is_no_worse_as_shipped_than_with_levels_that_stay(name: str, robot: str) -> None:
    """The largest and the mean error over 16 s, beside the preset's; 25 % or 2 mm is luck of a seed."""
    scenario = replace(load_scenario(robot).with_duration(16.0), faults=tuple(FAULTS[name]))
    fixed = read_preset("fixed_noise", parameter_table()).parameters
    found = []
    for parameters in (fixed, {}):
        record = run_in_process(scenario.with_parameters(parameters)).record
        off = record["estimate"] - record["truth"]
        apart = np.hypot(off[:, 0], off[:, 1])[1000:]
        found.append((apart.max(), np.sqrt(np.mean(apart**2)), np.abs(off[1000:, 2]).max()))
    plain, adaptive = np.array(found)
    assert (adaptive < 1.25 * plain + 0.002).all(), (plain, adaptive)
