# SPDX-License-Identifier: MIT
"""The margins that autotune computes, against the robot's own code on a motor that is really that much stronger."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from omniwheel._core import ffi, lib
from omniwheel.autotune.gains import Requirements, design_position, design_wheels, position_margins, worst
from omniwheel.errors import AutotuneError
from omniwheel.wheel_loop import LOWEST_HZ, Filter, Motor, WheelLoop, loaded, turns_around

FAST = Motor(0.00116979, 0.00073572, 0.33462, 2.87154, 0.00143577)
COUNT_RAD = 2.0 * math.pi / 1920.0
TICKS = 4000


def loop(motor: Motor, believed: Motor, count_rad: float = COUNT_RAD) -> WheelLoop:
    return WheelLoop(motor, Filter(believed, count_rad, 4e-3, 16e-3, 0.5))


def swing(motor: Motor, believed: Motor, proportional: float, integral: float, strength: float) -> float:
    """Return the share of its swing that a disturbed wheel keeps: the core's filter and PI, without rounding."""
    a, b = motor.discrete()
    config = ffi.new("omni_motor_kf_config_t *")
    motor_config = ffi.new("omni_motor_config_t *", list(vars(believed).values()))
    assert lib.omni_motor_discretise(motor_config, 1e-3, ffi.addressof(config.model)) == lib.OMNI_OK
    config.mode, config.step_s, config.rad_per_count = 2, 1e-3, 1e-6  # fine counts stand for an angle without rounding
    config.q_speed, config.q_current, config.r_angle = 4e-3, 16e-3, (0.5 * COUNT_RAD) ** 2
    state = ffi.new("omni_motor_kf_state_t *")
    lib.omni_motor_kf_reset(state, config)
    pid_config = ffi.new("omni_pid_config_t *")
    pid_config.kp, pid_config.ki, pid_config.step_s = proportional, integral, 1e-3
    pid_config.derivative_time_s, pid_config.integral_limit = 0.005, 1e6
    pid = ffi.new("omni_pid_state_t *")
    x, volts, counts, speeds = np.array([0.0, 5.0, 0.0]), 0.0, 0, []
    for _ in range(TICKS):
        moved = round(x[0] / 1e-6) - counts
        counts += moved
        speed = lib.omni_motor_kf_step(state, config, volts, moved, True)
        volts = lib.omni_pid_step(pid, pid_config, 0.0, speed, 0.0)
        x = a @ x + b * strength * volts
        speeds.append(abs(x[1]))
        if speeds[-1] > 1e4:
            return math.inf
    return float(max(speeds[-TICKS // 4 :]) / max(speeds[: TICKS // 4]))


@pytest.mark.parametrize(
    ("inertia", "proportional", "integral"), [(0.00117, 4.0, 120.0), (0.00731, 4.0, 120.0), (0.00731, 2.0, 300.0)]
)
def test_the_gain_margin_is_where_the_core_begins_to_swing(
    inertia: float, proportional: float, integral: float
) -> None:
    motor = loaded(FAST, inertia)
    margin = loop(motor, FAST).margins(proportional, integral).gain
    assert 1.0 < margin < 50.0
    assert swing(motor, FAST, proportional, integral, 0.97 * margin) < 0.5
    assert swing(motor, FAST, proportional, integral, 1.05 * margin) > 1.0


def test_an_unstable_loop_has_no_margins() -> None:
    found = loop(FAST, FAST).margins(200.0, 90000.0)
    assert not found.stable
    assert found.gain == found.phase_rad == 0.0


@pytest.mark.full
def test_the_noise_is_that_of_rounded_angles() -> None:
    """Simulated: a standing wheel whose angle is measured with white noise as large as the rounding."""
    wheel = loop(FAST, FAST)
    a, b = FAST.discrete()
    model, volts, gain = wheel._filter
    draw = np.random.default_rng(1)
    noise = COUNT_RAD / math.sqrt(12.0) * draw.standard_normal(60000)
    x, z, total, voltage, seen = np.zeros(3), np.zeros(3), 0.0, 0.0, []
    for angle_noise in noise:
        z = model @ z + volts * voltage + gain * (x[0] + angle_noise)
        total += 120.0 * 1e-3 * z[1]
        voltage = -4.0 * z[1] - total
        x = a @ x + b * voltage
        seen.append(voltage)
    assert np.std(seen[1000:]) == pytest.approx(wheel.noise_V(4.0, 120.0), rel=0.05)


@pytest.mark.full
@settings(deadline=None, max_examples=15)
@given(
    inertia=st.floats(1e-4, 3e-2),
    load=st.floats(1.2, 6.0),
    gain=st.floats(0.05, 4.0),
    share=st.floats(0.5, 0.99),
    counts=st.sampled_from([192, 1920, 10000]),
)
def test_designed_gains_keep_what_is_required(
    inertia: float, load: float, gain: float, share: float, counts: int
) -> None:
    """Any motor: volts per speed, the share of it that is back-EMF, inertia, load and encoder."""
    constant = share * gain
    motor = Motor(inertia, (gain - constant) * constant / 2.0, constant, 2.0, 1e-3)
    believed = loaded(motor, load * inertia)
    floor = [loop(loaded(motor, factor * inertia), believed, 2.0 * math.pi / counts) for factor in (1.0, load)]
    required = replace(Requirements(), noise=0.05)
    try:
        gains = design_wheels(floor, loop(motor, believed, 2.0 * math.pi / counts), 12.0, required)
        lam, stiffness = design_position(floor, gains, 3.0, required)
    except AutotuneError:
        reject()  # a motor with which nothing keeps the margins is said to be one
    assert required.kept_by(gains.margins)
    assert gains.noise_V <= 0.05 * 12.0
    assert 0.0 < stiffness <= min(3.0, lam)
    assert all(required.kept_by(position_margins(wheel, gains, lam, stiffness)) for wheel in floor)


@pytest.mark.parametrize("delay_s", [0.02, 0.1])
@pytest.mark.parametrize("share", [0.3, 0.9, 1.1, 1.5, 4.0])
def test_a_position_loop_goes_around_where_it_becomes_unstable(delay_s: float, share: float) -> None:
    """An integrator behind a delay swings from lambda = pi / 2 / delay on, whatever its phase margin looks like."""
    s = 2j * np.pi * np.geomspace(LOWEST_HZ, 499.0, 600)
    loop = np.exp(-s * delay_s) * share * 0.5 * math.pi / delay_s / s
    assert turns_around(loop) is (share > 1.0)


def test_an_unstable_position_loop_has_no_margins() -> None:
    """The phase margin alone has no sign: 20 degrees too much and 20 degrees too little look alike."""
    heavy = loaded(FAST, 8.0 * FAST.inertia)
    wheel = loop(heavy, heavy)
    wheels = worst([wheel], 0.1, 0.2)
    found = [position_margins(wheel, wheels, lam, 3.0) for lam in (40.0, 400.0)]
    assert [entry.stable for entry in found] == [True, False]
    assert found[1].phase_rad == 0.0
