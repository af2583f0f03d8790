# SPDX-License-Identifier: MIT
"""From parameters to the tick's configuration: what is refused, and that each number arrives where it is used."""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench

COUNT = int(lib.OMNI_PARAM_COUNT)
ARRIVES = {
    "MASS": ("direct_torque.mass_kg", 3.25),
    "INERTIA": ("direct_torque.inertia_kg_m2", 0.125),
    "MOT_J": ("direct_torque.wheel_inertia_kg_m2", 0.03125),
    "DT_GRIP": ("direct_torque.grip", 0.375),
    "DT_SLIP": ("direct_torque.slip_limit_m_s", 0.25),
    "DT_EMF": ("emf_compensation", 0.5),
    "LIM_V": ("limits.speed_m_s", 0.75),
    "LIM_W": ("limits.turn_rad_s", 1.25),
    "LIM_A": ("limits.acceleration_m_s2", 1.5),
    "LIM_WHEEL": ("direct_torque.wheel_limit_rad_s", 12.5),
    "TRJ_MARGIN": ("limits.wheel_speed_fraction", 0.625),
    "SAFE_ERR_XY": ("limits.error_m", 0.5),
    "SAFE_ERR_TH": ("limits.error_rad", 0.75),
    "WS_FF_S": ("wheel_speed.ff_static_V", 0.5),
    "WS_D_TC": ("wheel_speed.pid.derivative_time_s", 0.25),
    "TRJ_RAMP": ("trajectory.ramp_s", 2.5),
    "TRJ_ROT_AMP": ("trajectory.rotation_amplitude_rad", 0.75),
}


@pytest.mark.parametrize("name", ARRIVES)
def test_a_parameter_arrives_in_the_stage_that_uses_it(name: str) -> None:
    place, value = ARRIVES[name]
    assert reduce(getattr, place.split("."), Bench().configure(**{name: value})) == value


def test_a_plan_asks_for_the_voltage_that_the_motor_needs() -> None:
    """At a constant turn rate that is K + R b / K per rad/s of the wheel [report eq. 24 and 25]."""
    bench = Bench(MOT_B=0.5)
    bench.arm()
    bench.follow(TRJ_TYPE=0.0, TRJ_ROT=1.0, TRJ_ROT_AMP=6.0, TRJ_PERIOD=20.0, TRJ_LAPS=1.0)
    k, r, b = (bench.values[p] for p in (lib.OMNI_PARAM_MOT_K, lib.OMNI_PARAM_MOT_R, lib.OMNI_PARAM_MOT_B))
    assert bench.plan.peak_wheel_rad_s > 0.5
    assert bench.plan.peak_voltage_V == pytest.approx((k + r * b / k) * bench.plan.peak_wheel_rad_s, rel=1e-4)


def test_the_wheel_filter_moves_what_it_is_told_and_the_feed_forward_does_not() -> None:
    """KF_J is the inertia of the filter's model alone; 0 leaves it to MOT_J."""
    plain, floor = Bench().configure(MOT_J=0.01), Bench().configure(MOT_J=0.01, KF_J=0.025)
    heavy = Bench().configure(MOT_J=0.025)
    model = [[list(row) for row in config.motor_kf.model.a] for config in (plain, floor, heavy)]
    assert model[1] == model[2] != model[0]
    assert floor.wheel_speed.ff_acceleration_V_s2 == plain.wheel_speed.ff_acceleration_V_s2
    assert Bench().configure(MOT_J=0.01, KF_J=0.0).motor_kf.model.a[1][1] == plain.motor_kf.model.a[1][1]


def test_the_body_is_counted_in_the_wheel_s_own_inertia_by_loops_and_plans() -> None:
    config = Bench().configure(WS_FF_BODY=0.5, MASS=4.0, INERTIA=0.0625, MOT_J=0.03125)
    for load in (config.body_load, config.trajectory.body_load):
        assert (load.used, load.mass_m2, load.inertia) == (True, 64.0, 1.0)
    assert not Bench().configure(MASS=4.0).body_load.used


def test_every_value_out_of_its_range_is_refused_and_named() -> None:
    bench = Bench()
    config, bad = ffi.new("omni_robot_config_t *"), ffi.new("int32_t *", 7)
    for index in range(COUNT):
        kept = bench.values[index]
        bench.values[index] = lib.omni_param_table[index].maximum * 2 + 1
        assert lib.omni_robot_config(config, bench.values, bad) == lib.OMNI_ERR_RANGE
        assert bad[0] == index
        bench.values[index] = kept
    assert lib.omni_robot_config(config, bench.values, bad) == lib.OMNI_OK
    assert bad[0] == -1, "nothing is to blame"


@pytest.mark.parametrize("wheels", [3, 4])
def test_opposed_voltages_move_no_body(wheels: int) -> None:
    """At equal motors they are torques t: the body feels J^T t, where J gives the wheels' speeds per body rate."""
    config = Bench().configure(WHEELS=float(wheels), WHEEL_RADIUS=0.04)
    opposed = np.array(list(config.wheel_speed.null_direction))
    columns = []
    for rate in np.eye(3):
        speeds = ffi.new("float[4]")
        lib.omni_kinematics_inverse(
            ffi.addressof(config, "kinematics"), ffi.new("omni_twist_t *", rate.tolist()), ffi.NULL, speeds
        )
        columns.append(list(speeds))
    assert np.linalg.norm(opposed) == pytest.approx(1.0 if wheels == 4 else 0.0, abs=1e-6)
    np.testing.assert_allclose(np.array(columns) @ opposed, 0.0, atol=1e-4)


def test_four_wheels_that_creep_against_each_other_are_noise_along_the_null_direction() -> None:
    """Rubber gives way by 2000 N s/m under 3 N, for about a second: the way's variance grows by the sum of all lags."""
    config = Bench("four_wheel").config.pose_ekf
    lag_s = np.arange(-20.0, 20.0, 1e-3)
    density_m2_s = np.sum((3.0 / 2000.0) ** 2 * np.exp(-np.abs(lag_s))) * 1e-3
    slot_s = lib.OMNI_EKF_SLOT_TICKS * config.step_s
    assert config.r_null - config.r_count == pytest.approx(density_m2_s * slot_s, rel=1e-3)
