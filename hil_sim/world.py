# SPDX-License-Identifier: MIT
"""The simulated world for Python: built from a robot file, stepped by hand or handed to a runner."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hil_sim.faults import MAX_FAULTS, Fault
from omni_schema import Robot
from omni_schema.errors import did_you_mean
from omniwheel._core import ffi, lib

PCA9685_ADDRESS = 0x40
OUTPUT_ENABLE_REST_V = 3.0
"""OE as advised: 1 kOhm to 3.3 V against the 10 kOhm to ground that many boards have."""
TICK_US: int = lib.OMNI_TICK_US

DEFAULT_PLANT = "full"
PLANTS = {
    DEFAULT_PLANT: lib.HIL_PLANT_FULL,
    "kinematic": lib.HIL_PLANT_KINEMATIC,
    "kinematic+motors": lib.HIL_PLANT_KINEMATIC_MOTORS,
    "slip": lib.HIL_PLANT_SLIP,
    "linear": lib.HIL_PLANT_LINEAR,
}
"""What can stand in for the robot; ``hil_plant_kind_t`` in world.h says what each is."""

_MOTOR_FIELDS = {
    "motor_inertia_kg_m2": "inertia_kg_m2",
    "motor_viscous_N_m_s": "viscous_friction_N_m_s",
    "motor_constant_N_m_A": "constant_N_m_A",
    "motor_resistance_ohm": "resistance_ohm",
    "motor_inductance_H": "inductance_H",
    "battery_V": "supply_V",
}
_SIMULATION_FIELDS = {
    "mass_kg": "mass_kg",
    "inertia_kg_m2": "inertia_kg_m2",
    "motor_coulomb_N_m": "coulomb_friction_N_m",
    "friction_coefficient": "friction_coefficient",
    "slip_stiffness_N_s_m": "slip_stiffness_N_s_m",
    "roller_friction_N_s_m": "roller_friction_N_s_m",
    "battery_resistance_ohm": "battery_resistance_ohm",
}
_LINEAR_FIELDS = ("linear_viscous", "linear_coulomb")
"""Optional in [simulation]: three numbers each, along body x, y, about z; without them, from the motors' friction."""
_FROM_THE_MOTORS = (-1.0, -1.0, -1.0)


class WorldError(ValueError):
    """The world cannot be built; the message names the field, its value and what is allowed."""


@dataclass(frozen=True)
class PoseSensor:
    """A motion-capture system: rate [Hz] (0: none), noise [m, rad], delay [s] and share of fixes that get lost."""

    rate_Hz: float = 50.0
    sd_xy_m: float = 0.005
    sd_theta_rad: float = 0.005
    delay_s: float = 0.02
    drop_probability: float = 0.0


NO_POSE_SENSOR = PoseSensor(rate_Hz=0.0)


def _section_number(robot: Robot, section: str, values: Any, key: str) -> float:
    value = values.get(key)
    if not isinstance(value, (int, float)):
        raise WorldError(f"{robot.source}: {section}.{key} is {value!r}; the simulated world needs a number there")
    return float(value)


def _per_wheel(values: Any, wheels: int) -> list[Any]:
    """One value per wheel from a list or from one number for all."""
    return list(values) if isinstance(values, (list, tuple)) else [values] * wheels


def _fill_wheels(config: Any, robot: Robot) -> None:
    angles = [math.radians(angle) for angle in robot.geometry["wheel_angle_deg"]]
    scales = _per_wheel(robot.geometry.get("wheel_radius_scale", 1.0), robot.wheels)
    columns = {
        "wheel_radius_m": [robot.geometry["wheel_radius_m"] * scale for scale in scales],
        "wheel_distance_m": robot.geometry["wheel_distance_m"],
        "wheel_angle_rad": angles,
        "encoder_direction": robot.encoder["direction"],
        "motor_direction": robot.motor["direction"],
        "in1_channel": robot.wiring["in1_channel"],
        "in2_channel": robot.wiring["in2_channel"],
    }
    for name, values in columns.items():
        field = getattr(config, name)
        for wheel, value in enumerate(_per_wheel(values, robot.wheels)):
            field[wheel] = value


def _fill_linear(config: Any, robot: Robot) -> None:
    for name in _LINEAR_FIELDS:
        values = robot.simulation.get(name, _FROM_THE_MOTORS)
        if isinstance(values, float) or len(values) != 3:
            raise WorldError(
                f"{robot.source}: simulation.{name} is {values!r}; three numbers are needed: along x, y, about z"
            )
        setattr(config, name, values)


def plant_number(name: str) -> int:
    """Return the ``hil_plant_kind_t`` of a plant's name; WorldError if there is none of that name."""
    if name not in PLANTS:
        raise WorldError(f"plant is {name!r}{did_you_mean(name, PLANTS)}; allowed are {', '.join(PLANTS)}")
    return int(PLANTS[name])


def _fill_pose_sensor(config: Any, sensor: PoseSensor) -> None:
    config.fix_rate_Hz = sensor.rate_Hz
    config.fix_sd_xy_m = sensor.sd_xy_m
    config.fix_sd_theta_rad = sensor.sd_theta_rad
    config.fix_delay_s = sensor.delay_s
    config.fix_drop_probability = sensor.drop_probability


def _fill_faults(config: Any, faults: Sequence[Fault]) -> None:
    if len(faults) > MAX_FAULTS:
        raise WorldError(f"{len(faults)} faults are too many; at most {MAX_FAULTS} are allowed")
    config.fault_count = len(faults)
    for slot, fault in zip(config.fault, faults, strict=False):
        slot.kind = fault.kind
        slot.wheel = fault.wheel
        slot.start_s = fault.start_s
        slot.stop_s = fault.stop_s
        slot.value = fault.value


def world_config(
    robot: Robot,
    *,
    plant: str = DEFAULT_PLANT,
    seed: int = 1,
    slip_max: float = 0.0,
    slip_speed_max_m_s: float = 0.0,
    slip_time_s: float = 0.5,
    pose_sensor: PoseSensor = PoseSensor(),
    start_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    faults: Sequence[Fault] = (),
    **overrides: float,
) -> Any:
    """Return a new ``hil_world_config_t *`` for this robot; change its fields freely, :class:`World` checks them.

    ``plant`` is one of :data:`PLANTS`. ``slip_max`` is the largest imposed slip ratio, ``slip_speed_max_m_s`` the
    largest imposed slip speed of a wheel in either direction, both drawn anew every ``slip_time_s``; ``start_pose`` is
    x [m], y [m], theta [rad]; ``overrides`` are number fields of ``hil_world_config_t`` by name. Raises WorldError.
    """
    config = ffi.new("hil_world_config_t *")
    config.wheels = robot.wheels
    config.counts_per_revolution = int(robot.encoder["counts_per_revolution"])
    config.pca9685_address = PCA9685_ADDRESS
    config.output_enable_wired = "output_enable_pin" in robot.wiring
    config.output_enable_rest_V = OUTPUT_ENABLE_REST_V
    _fill_wheels(config, robot)
    for field, key in _MOTOR_FIELDS.items():
        setattr(config, field, _section_number(robot, "motor", robot.motor, key))
    for field, key in _SIMULATION_FIELDS.items():
        setattr(config, field, _section_number(robot, "simulation", robot.simulation, key))
    _fill_linear(config, robot)
    config.plant = plant_number(plant)
    config.seed = seed
    config.slip_max = slip_max
    config.slip_speed_max_m_s = slip_speed_max_m_s
    config.slip_time_s = slip_time_s
    config.start_pose = start_pose
    _fill_pose_sensor(config, pose_sensor)
    _fill_faults(config, faults)
    for field, value in overrides.items():
        if field not in dir(config):
            raise WorldError(f"{field} is no field of the world; see hil_world_config_t in world.h")
        setattr(config, field, int(value) if isinstance(getattr(config, field), int) else value)
    return config


class World:
    """One simulated world. :attr:`c` is the ``hil_world_t *`` that the runners take; all its fields are readable."""

    def __init__(self, config: Any) -> None:
        self.c: Any = ffi.new("hil_world_t *")
        self._sensors = ffi.new("hil_sensors_t *")
        why = ffi.new("char[]", 160)
        if lib.hil_world_init(self.c, config, why, len(why)) != lib.HIL_OK:
            raise WorldError(ffi.string(why).decode())

    @property
    def wheels(self) -> int:
        """Number of wheels."""
        return int(self.c.config.wheels)

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return float(self.c.time_us) * 1e-6

    @property
    def truth(self) -> npt.NDArray[np.float64]:
        """True pose x [m], y [m], theta [rad, not wrapped]."""
        return np.array(list(self.c.pose))

    @property
    def twist(self) -> npt.NDArray[np.float64]:
        """True velocity in the world frame [m/s, m/s, rad/s]."""
        return np.array(list(self.c.twist))

    @property
    def wheel_rad_s(self) -> npt.NDArray[np.float64]:
        """True wheel speeds [rad/s]."""
        return np.array(list(self.c.wheel_rad_s)[: self.wheels])

    @property
    def slip_speed(self) -> npt.NDArray[np.float64]:
        """Slip speeds imposed on the wheels in the next step [m/s]: a wheel moves the robot by r w minus this."""
        return np.array(list(self.c.slip_speed_m_s)[: self.wheels])

    def drive_speed(self, wheel_rad_s: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Give the wheels these speeds [rad/s]; plant kinematic only.

        Holds until the bridges are set again. Raises ValueError.
        """
        self._drive(lib.hil_world_drive_speed, "speeds", wheel_rad_s)

    def drive_voltage(self, volts: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Put these voltages [V] on the windings.

        Holds until the bridges are set again. Raises ValueError.
        """
        self._drive(lib.hil_world_drive_voltage, "voltages", volts)

    def drive_torque(self, torque_N_m: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Put these torques [N m] on the wheels; not on the two kinematic plants.

        Holds until the bridges are set again. Raises ValueError.
        """
        self._drive(lib.hil_world_drive_torque, "torques", torque_N_m)

    def _drive(self, source: Any, what: str, values: Sequence[float] | npt.NDArray[np.float64]) -> None:
        if len(values) != self.wheels:
            raise ValueError(f"{len(values)} {what} for {self.wheels} wheels; give one per wheel")
        if source(self.c, ffi.new("double[]", [float(value) for value in values])) != lib.HIL_OK:
            plant = next(name for name, number in PLANTS.items() if number == self.c.config.plant)
            raise ValueError(f"{what} {list(values)} are not all finite, or the plant {plant} does not take {what}")

    def sense(self) -> Any:
        """Return what the sensors show now, a ``hil_sensors_t`` that the next call overwrites."""
        lib.hil_world_sense(self.c, self._sensors)
        return self._sensors[0]

    def i2c(self, transactions: bytes) -> None:
        """Apply I2C transactions, coded as in OMNI_HIL_ACTUATORS; raises ValueError if they do not parse."""
        if lib.hil_world_i2c(self.c, transactions, len(transactions)) != lib.HIL_OK:
            raise ValueError("the bytes are no I2C transactions; each is: address, count, bytes, count to read")

    def output_enable(self, on: bool) -> None:
        """Set the PWM chip's output-enable pin; released at first, and of no effect on a robot without one."""
        lib.hil_world_output_enable(self.c, lib.HIL_OE_ON if on else lib.HIL_OE_OFF)

    def release_output_enable(self) -> None:
        """Drive that pin no more, as a processor in reset does: its pull-up decides."""
        lib.hil_world_output_enable(self.c, lib.HIL_OE_RELEASED)

    def set_duty(self, duty: Sequence[float]) -> None:
        """Set the bridges to drive-brake with these duties, -1..1 in each motor's own direction."""
        steps = lib.OMNI_PWM_STEPS
        low = [round(steps * min(abs(d), 1.0)) for d in duty]
        in1 = [steps if d >= 0 else steps - n for d, n in zip(duty, low, strict=True)]
        in2 = [steps - n if d >= 0 else steps for d, n in zip(duty, low, strict=True)]
        self.set_bridges(in1, in2)

    def set_bridges(self, in1_steps: Sequence[int], in2_steps: Sequence[int]) -> None:
        """Set how long IN1 and IN2 of each wheel are high, 0..4096 steps of the PWM period; the outputs are enabled."""
        self.output_enable(True)
        padding = [0] * (lib.HIL_MAX_WHEELS - len(in1_steps))
        first = ffi.new("uint16_t[]", [*in1_steps, *padding])
        second = ffi.new("uint16_t[]", [*in2_steps, *padding])
        lib.hil_world_bridge(self.c, first, second)

    def step(self, ticks: int = 1, step_us: int = TICK_US) -> None:
        """Advance by some ticks."""
        for _ in range(ticks):
            lib.hil_world_step(self.c, step_us)
