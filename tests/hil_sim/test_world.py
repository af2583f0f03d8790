# SPDX-License-Identifier: MIT
"""Configuration errors, I2C transactions, and the robot file on its way into the world."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil_sim.faults import Fault
from hil_sim.world import NO_POSE_SENSOR, PoseSensor, World, WorldError, world_config
from omni_schema import Robot
from omniwheel._core import ffi, lib
from omniwheel.robots import read_robot

CHIP = 0x40
WAKE = bytes([CHIP, 2, 0x00, 0x21, 0])


def channel(number: int, on: int, off: int) -> bytes:
    """One transaction that sets a channel."""
    return bytes([CHIP, 5, 6 + 4 * number, on & 0xFF, on >> 8, off & 0xFF, off >> 8, 0])


POSITIVE = [
    "motor_inertia_kg_m2",
    "motor_constant_N_m_A",
    "motor_resistance_ohm",
    "motor_inductance_H",
    "battery_V",
    "mass_kg",
    "inertia_kg_m2",
    "friction_coefficient",
    "slip_stiffness_N_s_m",
    "slip_time_s",
]
NOT_NEGATIVE = [
    "motor_viscous_N_m_s",
    "motor_coulomb_N_m",
    "battery_resistance_ohm",
    "roller_friction_N_s_m",
    "slip_max",
]


@pytest.mark.parametrize("field", POSITIVE + NOT_NEGATIVE)
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_nonsense_numbers_are_refused_by_name(make_world: Any, field: str, value: float) -> None:
    with pytest.raises(WorldError, match=rf"^{field} is {value:g}; allowed: "):
        make_world(**{field: value})


@pytest.mark.parametrize("field", POSITIVE)
def test_zero_is_refused_where_it_divides(make_world: Any, field: str) -> None:
    with pytest.raises(WorldError, match=f"^{field} is 0; allowed: "):
        make_world(**{field: 0.0})


@pytest.mark.parametrize(
    ("field", "index", "value"),
    [
        ("wheel_radius_m", 2, 0.0),
        ("wheel_distance_m", 0, -1.0),
        ("wheel_angle_rad", 1, math.nan),
        ("encoder_direction", 0, 0),
        ("motor_direction", 2, 2),
        ("in1_channel", 1, 16),
        ("in2_channel", 2, 9),
        ("start_pose", 2, math.inf),
    ],
)
def test_nonsense_elements_are_refused_by_index(robots: dict[str, Robot], field: str, index: int, value: float) -> None:
    config = world_config(robots["three_wheel"])
    getattr(config, field)[index] = value
    with pytest.raises(WorldError) as refused:
        World(config)
    assert str(refused.value).startswith(f"{field}[{index}] is ")


@pytest.mark.parametrize(
    ("field", "value"),
    [("wheels", 2), ("wheels", 5), ("counts_per_revolution", 0), ("pca9685_address", 0), ("fault_count", 17)],
)
def test_nonsense_counts_are_refused(make_world: Any, field: str, value: int) -> None:
    with pytest.raises(WorldError, match=f"^{field} is {value}; allowed: "):
        make_world(**{field: value})


def test_more_fixes_on_their_way_than_fit_are_refused(make_world: Any) -> None:
    with pytest.raises(WorldError, match=r"^fix_delay_s is 1; allowed: at most 63 fixes"):
        make_world(pose_sensor=PoseSensor(rate_Hz=100, delay_s=1.0))


def test_unknown_override_is_refused(robots: dict[str, Robot]) -> None:
    with pytest.raises(WorldError, match=r"mass .*world.toml"):
        world_config(robots["three_wheel"], mass=3.0)


def test_missing_simulation_number_names_file_and_key(robots: dict[str, Robot]) -> None:
    robot = robots["three_wheel"]
    rest = {key: value for key, value in robot.simulation.items() if key != "mass_kg"}
    with pytest.raises(WorldError, match=r"three_wheel\.toml: simulation\.mass_kg is None"):
        world_config(Robot(**{**vars(robot), "simulation": rest}))


def test_short_text_buffer_is_respected(robots: dict[str, Robot]) -> None:
    config = world_config(robots["three_wheel"], mass_kg=-1.0)
    why = ffi.new("char[]", b"#" * 20)
    assert lib.hil_world_init(ffi.new("hil_world_t *"), config, why, 8) == lib.HIL_ERR_CONFIG
    assert ffi.buffer(why)[:] == b"mass_kg\0" + b"#" * 12 + b"\0"
    assert lib.hil_world_init(ffi.new("hil_world_t *"), config, ffi.NULL, 0) == lib.HIL_ERR_CONFIG


def test_config_follows_the_robot_file(any_robot: Robot) -> None:
    config = world_config(any_robot, pose_sensor=NO_POSE_SENSOR)
    assert config.wheels == any_robot.wheels
    assert config.mass_kg == any_robot.simulation["mass_kg"]
    assert config.motor_viscous_N_m_s == any_robot.motor["viscous_friction_N_m_s"]
    angles = [math.degrees(angle) for angle in list(config.wheel_angle_rad)[: any_robot.wheels]]
    assert angles == pytest.approx(any_robot.geometry["wheel_angle_deg"])


def test_chip_drives_the_motors_of_its_channels(make_world: Any) -> None:
    """Wheel 0 is on channels 9 and 8, wheel 1 on 13 and 14: forward in drive-brake, and brake."""
    world = make_world()
    world.output_enable(True)
    world.i2c(WAKE + channel(9, 0x1000, 0) + channel(8, 0, 1024) + channel(13, 0x1000, 0) + channel(14, 0x1000, 0))
    assert list(world.c.in1)[:3] == [1.0, 1.0, 0.0]
    assert list(world.c.in2)[:3] == [0.25, 1.0, 0.0]
    world.step(300)
    assert world.wheel_rad_s[0] > 0.5
    assert world.c.voltage_V[0] == pytest.approx(0.75 * world.c.supply_V)
    assert world.c.voltage_V[1] == 0.0


def test_chip_and_direct_inputs_are_the_same_world(make_world: Any) -> None:
    chip, direct = make_world(), make_world()
    chip.output_enable(True)
    setup = bytes([CHIP, 2, 0xFE, 3, 0])
    writes = [channel(n, 0x1000, 0) for n in (9, 13, 3)] + [channel(n, 0, 4096 - 2867) for n in (8, 14, 2)]
    chip.i2c(setup + WAKE + b"".join(writes))
    direct.set_duty([2867 / 4096] * 3)
    for world in (chip, direct):
        world.step(500)
    assert chip.truth.tolist() == direct.truth.tolist()


def drive_forward(world: World) -> None:
    world.i2c(WAKE + channel(9, 0x1000, 0) + channel(8, 0, 1024))


def test_the_output_enable_pin_is_off_at_first_and_coasts_whatever_the_chip_says(make_world: Any) -> None:
    world = make_world(output_enable_wired=True)
    drive_forward(world)
    assert list(world.c.in1) == [0.0] * 4
    world.output_enable(True)
    assert (world.c.in1[0], world.c.in2[0]) == (1.0, 0.25)
    world.step(300)
    assert world.wheel_rad_s[0] > 0.5
    world.output_enable(False)
    world.step()
    assert world.c.voltage_V[0] == 0.0
    assert list(world.c.in1) + list(world.c.in2) == [0.0] * 8


def test_the_pin_works_while_the_bus_is_stuck(make_world: Any) -> None:
    ends = []
    for wired in (True, False):
        world = make_world(output_enable_wired=wired, faults=[Fault("i2c_stuck", 0.1)])
        world.output_enable(True)
        drive_forward(world)
        world.step(100)
        world.output_enable(False)
        world.step()
        ends.append(world.c.in1[0])
    assert ends == [0.0, 1.0], "without the pin the chip keeps driving"


def test_a_robot_without_the_pin_does_not_mind_it(make_world: Any) -> None:
    world = make_world(output_enable_wired=False)
    drive_forward(world)
    world.output_enable(False)
    assert world.c.in1[0] == 1.0


def test_read_transaction_returns_with_the_next_sensors(make_world: Any) -> None:
    world = make_world()
    world.i2c(bytes([CHIP, 1, 0x00, 2]))
    sensors = world.sense()
    assert list(sensors.i2c_read)[: sensors.i2c_read_length] == [0x11, 0x11], "no auto-increment yet"
    assert sensors.i2c_status == 0


def test_wrong_address_is_not_acknowledged(make_world: Any) -> None:
    world = make_world()
    world.i2c(bytes([0x41, 1, 0x00, 2]) + WAKE)
    sensors = world.sense()
    assert sensors.i2c_status == 1
    assert sensors.i2c_read_length == 0
    assert world.c.chip.registers[0] == 0x21


@pytest.mark.parametrize(
    "garbage",
    [b"\x40", b"\x40\x05", b"\x40\x02\x00\x21", WAKE + b"\x40", b"\x40\x01\x00\x09", WAKE + b"\x40\xff\x00", WAKE * 26],
)
def test_unparsable_bytes_change_nothing(make_world: Any, garbage: bytes) -> None:
    world = make_world()
    with pytest.raises(ValueError, match="I2C transactions"):
        world.i2c(garbage)
    assert world.c.chip.registers[0] == 0x11
    assert list(world.c.in1) == [0.0] * 4


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.binary(max_size=140))
def test_any_bytes_are_safe(make_world: Any, data: bytes) -> None:
    world = make_world()
    lib.hil_world_i2c(world.c, data, len(data))
    world.step(3)
    assert all(0.0 <= share <= 1.0 for share in [*world.c.in1, *world.c.in2])
    assert all(math.isfinite(value) for value in [*world.c.pose, *world.c.current_A])


def test_bridge_steps_beyond_the_period_are_clamped(make_world: Any) -> None:
    world = make_world()
    world.set_bridges([65535, 0, 0], [0, 4097, 0])
    assert list(world.c.in1)[:3] == [1.0, 0.0, 0.0]
    assert list(world.c.in2)[:3] == [0.0, 1.0, 0.0]


def test_a_hand_turns_one_wheel_and_lets_it_run_out() -> None:
    hand = Fault("wheel_turned", 0.1, 2.1, wheel=1, value=math.pi)
    world = World(world_config(read_robot("three_wheel"), friction_coefficient=1e-3, faults=[hand]))
    world.step(3000)
    assert list(world.c.counts)[:3] == pytest.approx([0, 10000, 0], abs=80)
    assert world.c.wheel_rad_s[1] == pytest.approx(0.0, abs=1e-3)


def test_a_stranger_on_the_bus_acknowledges_its_own_address_only() -> None:
    world = World(world_config(read_robot("three_wheel"), i2c_stranger=0x68))
    for address, status in ((0x68, 0), (0x69, 1), (CHIP, 0)):
        world.i2c(bytes([address, 0, 0]))
        assert world.sense().i2c_status == status


@pytest.mark.parametrize("address", [CHIP, 0x80])
def test_a_stranger_has_an_address_of_its_own(address: int) -> None:
    with pytest.raises(WorldError, match="i2c_stranger"):
        World(world_config(read_robot("three_wheel"), i2c_stranger=address))
