# SPDX-License-Identifier: MIT
"""The simulated world for Python: built from a robot file, stepped by hand or handed to a runner."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hil_sim.faults import MAX_FAULTS, Fault
from hil_sim.patches import MAX_PATCHES, FloorPatch
from hil_sim.robot_sensors import sensor_numbers
from hil_sim.schema import WORLD
from omni_schema import Robot
from omni_schema.errors import did_you_mean
from omni_schema.world import Quantity
from omniwheel._core import ffi, lib
from omniwheel.errors import OmniError

TICK_US: int = lib.OMNI_TICK_US
GRAVITY_M_S2 = 9.80665
"""Standard gravity, as the world in C has it."""

DEFAULT_PLANT = "full"
PLANTS: dict[str, int] = {name: plant.number for name, plant in WORLD.plants.items()}
"""What can stand in for the robot, by its number in ``hil_plant_kind_t``; ``world.toml`` says what each is."""


class WorldError(OmniError, ValueError):
    """The world cannot be built; the message names the field, its value and what is allowed."""

    exit_code = 2


def _default(name: str) -> float:
    default = WORLD.numbers[name].default
    assert isinstance(default, float)
    return default


IDEAL_WHEELS: Mapping[str, float] = {
    "rollers_per_row": 0,
    "roller_bushing_friction": 0.0,
    "wheel_stiffness_N_m": 0.0,
}
"""Numbers that make wheels perfectly round, with a constant lever arm and load, as textbooks have them."""


@dataclass(frozen=True)
class PoseSensor:
    """A motion-capture system: rate [Hz] (0: none), noise [m, rad], delay [s] and share of fixes that get lost."""

    rate_Hz: float = 50.0
    sd_xy_m: float = _default("fix_sd_xy_m")
    sd_theta_rad: float = _default("fix_sd_theta_rad")
    delay_s: float = _default("fix_delay_s")
    drop_probability: float = _default("fix_drop_probability")


NO_POSE_SENSOR = PoseSensor(rate_Hz=0.0)


def _robot_number(robot: Robot, quantity: Quantity, value: Any) -> float:
    if not isinstance(value, (int, float)):
        raise WorldError(
            f"{robot.source}: {quantity.robot_key} is {value!r}; the simulated world needs a number",
            hint=f"add {quantity.robot_key} to the robot file, or copy a section [simulation] from another robot",
        )
    if not quantity.holds(value):
        raise WorldError(f"{robot.source}: {quantity.robot_key} is {value:g}; must be {quantity.allowed}")
    return int(value) if quantity.kind == "int" else float(value)


def _robot_value(robot: Robot, quantity: Quantity) -> Any:
    """Return what the robot file says, its number or list, else the default."""
    section, _, leaf = str(quantity.robot_key).partition(".")
    value = getattr(robot, section).get(leaf, quantity.default)
    if quantity.elements:
        if isinstance(value, float) or len(value) != len(quantity.elements):
            needed = ", ".join(quantity.elements)
            raise WorldError(f"{robot.source}: {quantity.robot_key} is {value!r}; three numbers are needed: {needed}")
        return [_robot_number(robot, quantity, item) for item in value]
    if quantity.per_wheel:
        if isinstance(value, (list, tuple)) and len(value) != robot.wheels:
            raise WorldError(
                f"{robot.source}: {quantity.robot_key} has {len(value)} numbers; "
                f"{robot.wheels} are needed, one per wheel, or one number for all"
            )
        return [_robot_number(robot, quantity, item) for item in _per_wheel(value, robot.wheels)]
    return _robot_number(robot, quantity, value)


def _per_wheel(values: Any, wheels: int) -> list[Any]:
    """One value per wheel from a list or from one number for all."""
    return list(values) if isinstance(values, (list, tuple)) else [values] * wheels


def _radii(robot: Robot) -> list[float]:
    scales = _per_wheel(robot.geometry.get("wheel_radius_scale", 1.0), robot.wheels)
    return [robot.geometry["wheel_radius_m"] * scale for scale in scales]


def _angles(robot: Robot) -> list[float]:
    return [math.radians(angle) for angle in robot.geometry["wheel_angle_deg"]]


_TURNED: dict[str, Callable[[Robot], Any]] = {
    "wheel_radius_m": _radii,
    "wheel_angle_rad": _angles,
    "motor_pwm_Hz": lambda robot: robot.board.motor_pwm_Hz,
    "in1_channel": lambda robot: robot.wiring.get("in1_channel", [0] * robot.wheels),
    "in2_channel": lambda robot: robot.wiring.get("in2_channel", [0] * robot.wheels),
    "output_enable_wired": lambda robot: "output_enable_pin" in robot.wiring,
}
"""Numbers that the robot file says in another way."""


_SIMULATION = "simulation."
_OF_MODELS = ("roller_radius_m", "wheel_mass_kg")
"""Keys of that section which only models for other simulators need (hil_sim/models)."""
SIMULATION_KEYS = frozenset(
    quantity.robot_key.removeprefix(_SIMULATION)
    for quantity in WORLD.numbers.values()
    if quantity.robot_key is not None and quantity.robot_key.startswith(_SIMULATION)
).union(_OF_MODELS)
"""Keys that a robot file's section simulation may have."""


def _refuse_unknown(robot: Robot) -> None:
    """A misspelt key would silently have no effect."""
    for name in robot.simulation:
        if name not in SIMULATION_KEYS:
            raise WorldError(
                f"{robot.source}: simulation.{name} is an unknown key{did_you_mean(name, SIMULATION_KEYS)}",
                hint="docs/guides/robot-file.md lists the keys of [simulation]",
            )


def _fill_numbers(config: Any, robot: Robot) -> None:
    _refuse_unknown(robot)
    for quantity in WORLD.numbers.values():
        if quantity.robot_key is None:
            value: Any = quantity.default
        elif quantity.name in _TURNED:
            value = _TURNED[quantity.name](robot)
        else:
            value = _robot_value(robot, quantity)
        _set(config, quantity.field, value)


def _set(config: Any, field: str, value: Any) -> None:
    place = getattr(config, field)
    if isinstance(value, Sequence):
        for number, item in enumerate(value):
            place[number] = item
    else:
        setattr(config, field, int(value) if isinstance(place, int) else value)


def plant_number(name: str) -> int:
    """Return the ``hil_plant_kind_t`` of a plant's name; WorldError if there is none of that name."""
    if name not in PLANTS:
        raise WorldError(f"plant is {name!r}{did_you_mean(name, PLANTS)}; must be one of {', '.join(PLANTS)}")
    return int(PLANTS[name])


def _fill_pose_sensor(config: Any, sensor: PoseSensor) -> None:
    config.fix_rate_Hz = sensor.rate_Hz
    config.fix_sd_xy_m = sensor.sd_xy_m
    config.fix_sd_theta_rad = sensor.sd_theta_rad
    config.fix_delay_s = sensor.delay_s
    config.fix_drop_probability = sensor.drop_probability


def _fill_faults(config: Any, faults: Sequence[Fault]) -> None:
    if len(faults) > MAX_FAULTS:
        raise WorldError(f"{len(faults)} faults; must be at most {MAX_FAULTS}")
    config.fault_count = len(faults)
    for slot, fault in zip(config.fault, faults, strict=False):
        slot.kind = fault.kind
        slot.wheel = fault.wheel
        slot.start_s = fault.start_s
        slot.stop_s = fault.stop_s
        slot.value = fault.value


def _fill_patches(config: Any, patches: Sequence[FloorPatch]) -> None:
    if len(patches) > MAX_PATCHES:
        raise WorldError(f"{len(patches)} patches; must be at most {MAX_PATCHES}")
    config.patch_count = len(patches)
    for slot, patch in zip(config.patch, patches, strict=False):
        slot.x_m, slot.y_m = patch.x_m, patch.y_m
        slot.radius_m, slot.friction = patch.radius_m, patch.friction


def world_config(
    robot: Robot,
    *,
    plant: str = DEFAULT_PLANT,
    seed: int = 1,
    pose_sensor: PoseSensor = PoseSensor(),
    faults: Sequence[Fault] = (),
    patches: Sequence[FloorPatch] = (),
    **numbers: float | Sequence[float],
) -> Any:
    """Return a new ``hil_world_config_t *`` for this robot; change its fields freely, :class:`World` checks them.

    ``plant`` is one of :data:`PLANTS`. ``numbers`` are those of ``world.toml`` by name, or other number fields of
    ``hil_world_config_t``: ``slip_max=0.1``, ``start_pose=(0.5, 0.0, 0.0)``. They replace the robot file's and the
    defaults. Sensors that the robot file names are there. Raises WorldError.
    """
    config = ffi.new("hil_world_config_t *")
    config.wheels = robot.wheels
    _fill_numbers(config, robot)
    config.plant = plant_number(plant)
    config.driver = robot.board.motor_driver.number
    config.seed = seed
    if patches and plant != DEFAULT_PLANT:
        raise WorldError(
            f"plant {plant} does not support [[patch]]",
            hint=f"remove the patches from the scenario, or use {DEFAULT_PLANT}",
        )
    _fill_pose_sensor(config, pose_sensor)
    _fill_faults(config, faults)
    _fill_patches(config, patches)
    for name, value in {**sensor_numbers(robot), **numbers}.items():
        field = WORLD.numbers[name].field if name in WORLD.numbers else name
        if field not in dir(config):
            raise WorldError(f"{name} is not a field of the world; see world.toml and hil_world_config_t in world.h")
        _set(config, field, value)
    if config.rollers_per_row in (1, 2):
        raise WorldError(f"rollers_per_row is {config.rollers_per_row}; must be 0 (ideal wheels) or 3 to 60")
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

    def set_faults(self, faults: Sequence[Fault]) -> None:
        """Let these faults act instead of those before, from the next step on. Raises WorldError; nothing changes."""
        _fill_faults(self.c.config, faults)

    def set_friction(self, coefficient: float) -> None:
        """Give the floor another friction coefficient (above 0), from the next step on; plants full and slip."""
        config = self.c.config
        for wheel in range(self.wheels):
            self.c.plant.inverse_limit_N[wheel] *= config.friction_coefficient / coefficient
            self.c.plant.friction[wheel] *= coefficient / config.friction_coefficient
        config.friction_coefficient = coefficient

    def sense(self) -> Any:
        """Return what the sensors show now, a ``hil_sensors_t`` that the next call overwrites."""
        lib.hil_world_sense(self.c, self._sensors)
        return self._sensors[0]

    def i2c(self, transactions: bytes) -> None:
        """Apply I2C transactions, coded as in OMNI_HIL_ACTUATORS; raises ValueError if they do not parse."""
        if lib.hil_world_i2c(self.c, transactions, len(transactions)) != lib.HIL_OK:
            raise ValueError("the bytes are not I2C transactions of: address, count, bytes, count to read")

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

    def motor_pins(self, steps: Sequence[tuple[int, int]]) -> None:
        """Set how long the two motor pins of each wheel are high, 0..4096 steps; a robot with a chip has none."""
        flat = [step for pair in steps for step in pair]
        padding = [0] * (2 * lib.HIL_MAX_WHEELS - len(flat))
        lib.hil_world_motor_pins(self.c, ffi.new("uint16_t[]", [*flat, *padding]))

    def lockstep(self, link: Any, ticks: int, record: Any, done: Any) -> int:
        """Run ticks with the robot behind a ``hil_lockstep_t`` and return a ``hil_result_t``; see runner.h."""
        return int(lib.hil_lockstep_run(link, self.c, ticks, record, done))

    def step(self, ticks: int = 1, step_us: int = TICK_US) -> None:
        """Advance by some ticks."""
        for _ in range(ticks):
            lib.hil_world_step(self.c, step_us)
