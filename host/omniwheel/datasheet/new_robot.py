# SPDX-License-Identifier: MIT
"""A robot file from a person's answers: motor, wheels, mass. Each number says where it came from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from omni_schema import Robot
from omniwheel import files
from omniwheel.capability import DriveModel, drive_model
from omniwheel.capability.speeds import TURNING, directions, limit_speed, motor_speed, top_acceleration
from omniwheel.datasheet.motor import (
    DRY_SHARE,
    ELECTRICAL_S,
    MECHANICAL_S,
    NO_LOAD_SHARE,
    GearMotor,
    MotorModel,
    encoder_doubt,
    motor_model,
)
from omniwheel.errors import DataSheetError, OmniError, RobotFileError
from omniwheel.robot_text import Changes, Value, edited, section_text, written
from omniwheel.robots import find_robot_file, free_robot_path, read_robot

WHEEL_SHARE = 0.85
"""LIM_WHEEL by what a loaded wheel reaches: the rest is for the control and for an emptier battery."""
ACCELERATION_SHARE = 0.5
"""LIM_A by what motors and floor allow at half the speed."""
SLIP_SHARE = 0.1
"""ISMC_K_XY and ISMC_K_TH by the speed limits: a switching gain that covers wheels which slip by so much."""
ROW_DISTANCE_RADII = 0.354
"""Distance between the rows of a double wheel of 4 inches: 18 mm on a radius of 50.8 mm."""
BRIDGE_SHARE = 0.9
"""LIM_I by the current at which a bridge chops: the PWM's ripple and the estimate's error are in the rest."""
DIRECTIONS = 36
DEFAULT_LINES = 2500.0
TEMPLATES = {3: "three_wheel", 4: "four_wheel"}
ANGLES_DEG = {3: (0.0, 120.0, 240.0), 4: (45.0, 135.0, 225.0, 315.0)}


@dataclass(frozen=True)
class RobotAnswers:
    """What a person knows of a robot.

    ``supply_V``: the battery, None for the motor's rated voltage. ``bridge_A``: at which a bridge chops, None: unknown.
    """

    wheels: int
    wheel_diameter_m: float
    wheel_distance_m: float
    mass_kg: float
    motor: GearMotor
    supply_V: float | None = None
    bridge_A: float | None = None


def write_designed_robot(name: str, answers: RobotAnswers, folder: Path) -> Path:
    """Write NAME.toml and return its path; never overwrites.

    Raises DataSheetError for numbers that contradict, RobotFileError for those that no robot file takes; there is no
    file then.
    """
    path = free_robot_path(name, folder)
    text = robot_file_text(name, answers)
    currents = current_limits(answers)
    try:
        files.create(path, text.encode("utf-8"))
        limited = edited(text, derived_limits(drive_model(read_robot(path))))
        files.write_text(path, limited)
        robot = read_robot(path)
        files.write_text(path, edited(limited, {**supply_limits(robot), **derived_gains(robot), **currents}))
        read_robot(path)
    except FileExistsError:
        raise RobotFileError(f"{path} exists already", hint="choose another name") from None
    except OmniError:
        path.unlink(missing_ok=True)
        raise
    return path


def sheet_warnings(answers: RobotAnswers) -> list[str]:
    """Return what to know of a data sheet's numbers: an unlikely encoder, and the current that a fuse has to carry."""
    motor = answers.motor
    doubts = [doubt] if (doubt := encoder_doubt(motor)) else []
    if motor.stall_current_A is not None:
        supply_V = motor.voltage_V if answers.supply_V is None else answers.supply_V
        stall_A = motor.stall_current_A * supply_V / motor.voltage_V
        doubts.append(
            f"Choose fuses and bridges by the data sheet's stall current: {stall_A:.3g} A per motor at {supply_V:g} V, "
            f"{answers.wheels * stall_A:.3g} A for all. The card's current is that of the model, which has less: its "
            "resistance includes the gear's losses."
        )
    return doubts


def robot_file_text(name: str, answers: RobotAnswers) -> str:
    """Return the file without its derived limits."""
    if answers.wheels not in TEMPLATES:
        raise DataSheetError(f"{answers.wheels} wheels; must be 3 or 4")
    model = motor_model(answers.motor)
    template = find_robot_file(TEMPLATES[answers.wheels])
    wiring = section_text(template.read_text(encoding="utf-8-sig"), "wiring")
    head = (
        f"# SPDX-License-Identifier: MIT\n# {name}: written by `omni robots new` from data-sheet numbers.\n"
        "# Each line names the source of its number.\n# Measure the assumed numbers: omni identify.\n"
    )
    return "".join(
        (
            head,
            written(_body(name, answers, model)),
            f"\n[wiring]  # as {template.stem} is wired: change it to your wires\n{wiring}",
            "\n[parameters]\n",
            written(_world(answers, model)),
        )
    )


def _body(name: str, answers: RobotAnswers, model: MotorModel) -> Changes:
    motor, wheels = answers.motor, answers.wheels
    sheet = motor.source or "the data sheet"
    torque = f"{motor.stall_torque_N_m:.3g} N m at stall, {motor.no_load_rad_s * 30.0 / math.pi:.4g} rpm without load"
    counts = motor.counts_per_revolution
    encoder = f"4 x {motor.encoder_lines or DEFAULT_LINES:g} lines x gear {motor.gear:g}"
    idle = f"whose current is assumed: {NO_LOAD_SHARE:.0%} of stall" if model.idle_assumed else "from its current"
    supply_V = motor.voltage_V if answers.supply_V is None else answers.supply_V
    return {
        "robot.name": (name, ""),
        "robot.description": (f"{wheels} omni wheels, {motor.name or 'gear motors'}", ""),
        "geometry.wheels": (wheels, "given"),
        "geometry.wheel_radius_m": (0.5 * answers.wheel_diameter_m, "half the given diameter"),
        "geometry.wheel_distance_m": (answers.wheel_distance_m, "given: centre to wheel's contact point"),
        "geometry.wheel_angle_deg": (ANGLES_DEG[wheels], "assumed: evenly spread"),
        "encoder.counts_per_revolution": (
            round(4.0 * DEFAULT_LINES) if counts is None else counts,
            f"assumed: {encoder}" if counts is None else encoder,
        ),
        "encoder.direction": ([1] * wheels, "`omni bringup` finds the signs"),
        "motor.inertia_kg_m2": (
            model.inertia_kg_m2,
            f"assumed: rotor and gear alone run up in {MECHANICAL_S * 1e3:g} ms",
        ),
        "motor.viscous_friction_N_m_s": (
            model.viscous_N_m_s,
            f"assumed: {1.0 - DRY_SHARE:.0%} of the friction without load, {idle}",
        ),
        "motor.constant_N_m_A": (model.constant_N_m_A, f"{sheet}: {torque}"),
        "motor.resistance_ohm": (
            model.resistance_ohm,
            "so that torque at stall is the data sheet's: winding and gear losses",
        ),
        "motor.inductance_H": (model.inductance_H, f"assumed: {ELECTRICAL_S * 1e3:g} ms times the resistance"),
        "motor.supply_V": (supply_V, "the motor's rated voltage" if answers.supply_V is None else "given"),
        "motor.direction": ([1] * wheels, "`omni bringup` finds the signs"),
    }


def _world(answers: RobotAnswers, model: MotorModel) -> Changes:
    inertia = 0.5 * answers.mass_kg * answers.wheel_distance_m**2
    return {
        "simulation.mass_kg": (answers.mass_kg, "given"),
        "simulation.inertia_kg_m2": (inertia, "assumed: a disc of that mass as wide as the wheels"),
        "simulation.coulomb_friction_N_m": (
            model.coulomb_N_m,
            f"assumed: {DRY_SHARE:.0%} of the friction without load",
        ),
        "simulation.friction_coefficient": (0.6, "assumed: rubber rollers on a smooth floor"),
        "simulation.slip_stiffness_N_s_m": (2000.0, "assumed"),
        "simulation.roller_friction_N_s_m": (0.3, "assumed"),
        "simulation.battery_resistance_ohm": (0.05, "assumed"),
        **_rollers(0.5 * answers.wheel_diameter_m),
    }


def _rollers(radius_m: float) -> Changes:
    """Real wheels for the simulated world, in the proportions of a common double wheel of 4 inches."""
    return {
        "simulation.rollers_per_row": (9, "assumed: a common double wheel"),
        "simulation.wheel_rows": (2, "assumed: rows side by side"),
        "simulation.row_distance_m": (ROW_DISTANCE_RADII * radius_m, f"assumed: {ROW_DISTANCE_RADII:g} wheel radii"),
        "simulation.roller_dip_m": (1e-4, "assumed: how much lower it stands between two rollers"),
        "simulation.roller_bushing_friction": (0.02, "assumed: plastic on steel"),
        "simulation.wheel_stiffness_N_m": (1e5, "assumed: hard rubber and a stiff frame"),
        "simulation.wheel_damping_N_s_m": (100.0, "assumed"),
        "simulation.centre_of_mass_height_m": (1.5 * radius_m, "assumed: one and a half wheel radii"),
    }


def derived_limits(model: DriveModel) -> Changes:
    """Return the limits that follow from motors and floor; see WHEEL_SHARE and ACCELERATION_SHARE."""
    ways = directions(DIRECTIONS)
    loaded = min(motor_speed(model, way) / limit_speed(model, way) for way in ways)
    wheel = WHEEL_SHARE * loaded * model.wheel_limit_rad_s
    share = wheel / model.wheel_limit_rad_s
    speed = min(limit_speed(model, way) for way in ways) * share
    turn = limit_speed(model, TURNING) * share
    acceleration = min(top_acceleration(model, way, 0.5 * speed).value for way in ways)
    return {
        "parameters.LIM_WHEEL": (wheel, f"rad/s: {WHEEL_SHARE:.0%} of what a loaded wheel reaches"),
        "parameters.LIM_V": (speed, "m/s: that wheel speed, in the slowest direction"),
        "parameters.LIM_W": (turn, "rad/s: that wheel speed, turning on the spot"),
        "parameters.LIM_A": (
            ACCELERATION_SHARE * acceleration,
            f"m/s^2: {ACCELERATION_SHARE:.0%} of what motors and floor allow at half that speed",
        ),
    }


def current_limits(answers: RobotAnswers) -> Changes:
    """Return the limits that follow from the bridge; none if it is unknown or never reached.

    The model's current makes the data sheet's torque, so it is smaller than the winding's by what the gear loses. Only
    the sheet's stall current tells by how much. Raises DataSheetError without it.
    """
    motor, bridge_A = answers.motor, answers.bridge_A
    if bridge_A is None:
        return {}
    if not (math.isfinite(bridge_A) and bridge_A > 0.0):
        raise DataSheetError(f"the bridge's current is {bridge_A:g} A; must be a number above 0")
    if motor.stall_current_A is None:
        raise DataSheetError(
            "the motor's current limit cannot be computed from --bridge-current without --stall-current",
            hint="give --stall-current, or leave --bridge-current out and set LIM_I by hand",
        )
    supply_V = motor.voltage_V if answers.supply_V is None else answers.supply_V
    if bridge_A >= motor.stall_current_A * supply_V / motor.voltage_V:
        return {}
    model_A = bridge_A * motor.voltage_V / motor.stall_current_A / motor_model(motor).resistance_ohm
    return {
        "parameters.LIM_I": (BRIDGE_SHARE * model_A, f"A: {BRIDGE_SHARE:.0%} of simulation.bridge_trip_A"),
        "simulation.bridge_trip_A": (
            model_A,
            f"the bridge's {bridge_A:g} A in the winding, less what the gear loses of its torque",
        ),
    }


def supply_limits(robot: Robot) -> Changes:
    """Return the voltages that go with the supply; none where the defaults fit."""
    table, values = robot.table, robot.parameter_values()
    supply_V, usual_V = values["BAT_V_NOM"], table["BAT_V_NOM"].default
    if supply_V == usual_V:
        return {}
    return {
        f"parameters.{name}": (table[name].default / usual_V * supply_V, "V: the default's share of the supply")
        for name in ("BAT_V_MIN", "SAFE_STALL_V")
    }


def derived_gains(robot: Robot) -> Changes:
    """Return the switching gains that its limits need, and what the wheel filter must know of the body.

    The boundary layers grow with the gains, so that their slope stays. A wheel moves its share
    of the robot. A filter that does not know it has wrong speeds whenever the robot accelerates.
    """
    values, table = robot.parameter_values(), robot.table
    gains: dict[str, tuple[Value, str]] = {}
    for axis, limit, gain_unit, layer_unit in (("XY", "LIM_V", "m/s", "m"), ("TH", "LIM_W", "rad/s", "rad")):
        gain = SLIP_SHARE * values[limit]
        slope = table[f"ISMC_K_{axis}"].default / table[f"ISMC_PHI_{axis}"].default
        gains[f"parameters.ISMC_K_{axis}"] = (gain, f"{gain_unit}: covers a slip of {SLIP_SHARE:.0%} at {limit}")
        gains[f"parameters.ISMC_PHI_{axis}"] = (gain / slope, f"{layer_unit}: as steep as by default")
    body = 2.0 * values["MASS"] * values["WHEEL_RADIUS"] ** 2 / values["WHEELS"]
    gains["parameters.KF_J"] = (
        values["MOT_J"] + body,
        "kg.m^2: motor, gear and wheel, and the wheel's share of the mass when the robot translates",
    )
    return gains
