# SPDX-License-Identifier: MIT
"""Table 1: P, PD and PID stabilise a robot with a deadband, and the same with the deadband compensated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hil_sim.world import PoseSensor, World
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.loops import Array, make_kinematics, make_world, share_row, spread
from omniwheel._core import ffi, lib
from omniwheel.files import save_picture
from omniwheel.plot_style import GREY, INK, STYLE, WHEEL_COLOURS

NAME = "table1"
FIGURE = "table1.png"
_CM = 100.0


@dataclass(frozen=True)
class Case:
    """One try: the experiment's file, the controller's name, the share of the deadband compensated, the seed."""

    spec: Mapping[str, Any]
    controller: str
    compensation: float
    seed: int


def dead_voltage_V(robot: Mapping[str, Any]) -> float:
    """Return the voltage that friction takes."""
    return float(robot["supply_V"] * robot["dead_pwm"] / robot["pwm_steps"])


def motor_fields(robot: Mapping[str, Any]) -> dict[str, float]:
    """Return the motor that has this deadband, full speed and lag.

    Without viscous friction: K w = V - R T_c / K, and the time constant is J R / K².
    """
    constant = (robot["supply_V"] - dead_voltage_V(robot)) / robot["full_speed_rad_s"]
    return {
        "motor_constant_N_m_A": constant,
        "motor_coulomb_N_m": dead_voltage_V(robot) * constant / robot["resistance_ohm"],
        "motor_viscous_N_m_s": 0.0,
        "motor_inertia_kg_m2": robot["lag_s"] * constant**2 / robot["resistance_ohm"],
        "motor_resistance_ohm": robot["resistance_ohm"],
        "motor_inductance_H": robot["inductance_H"],
    }


def dead_speed_m_s(robot: Mapping[str, Any]) -> float:
    """Return the speed of a wheel's rim that the controller believes to ask for with the PWM of the deadband."""
    return float(robot["full_speed_rad_s"] * robot["dead_pwm"] / robot["pwm_steps"] * robot["wheel_radius_m"])


def stop_radius_m(spec: Mapping[str, Any], controller: str, compensation: float) -> float:
    """Return the position error [m] below which no wheel gets more than the deadband, whatever its direction.

    The integral adds its limit, and the compensation its share, to what the error asks for.
    """
    gains = spec["controller"][controller]
    missing_m_s = (1.0 - compensation) * dead_speed_m_s(spec["robot"]) - gains["ki"] * gains["integral_limit"]
    return float(max(missing_m_s / gains["kp"], 0.0))


class Drive:
    """The host's side of the report's robot: controller, kinematics, and the PWM of each motor.

    PWM is proportional to the wanted wheel speed, all cut by one factor at full scale; compensation adds to it.
    """

    def __init__(self, case: Case, kinematics: Any) -> None:
        robot, head = case.spec["robot"], case.spec["experiment"]
        gains = case.spec["controller"][case.controller]
        self._kinematics = kinematics
        self._supply_V, self._steps, self._step_s = robot["supply_V"], robot["pwm_steps"], head["step_s"]
        fields = {name: [gains[name]] * lib.OMNI_AXES for name in ("kp", "kd", "ki", "integral_limit")}
        self._config = ffi.new("omni_fl_config_t *", {**fields, "step_s": head["step_s"]})
        self._state = ffi.new("omni_fl_state_t *")
        self._terms = ffi.new("omni_control_terms_t *")
        self._pose, self._last = ffi.new("omni_pose_t *"), ffi.new("omni_pose_t *")
        self._origin = ffi.new("omni_pose_t *")
        self._rate, self._still, self._body = (ffi.new("omni_twist_t *") for _ in range(3))
        self._map = ffi.new("omni_wheel_speed_config_t *")
        self._map.wheels = kinematics.wheels
        self._map.pid = [0.0, 0.0, 0.0, 1.0, 0.0, head["step_s"]]
        self._map.ff_speed_V_s = robot["supply_V"] / robot["full_speed_rad_s"]
        self._map.ff_static_V = case.compensation * dead_voltage_V(robot)
        self._map.duty_limit = 1.0
        self._loops = ffi.new("omni_wheel_speed_state_t *")
        self._speed, self._zero, self._duty, self._volts = (ffi.new("float[]", lib.OMNI_MAX_WHEELS) for _ in range(4))
        self._hold = gains["hold"]
        self._started = False
        self._cut = False

    def step(self, pose: Sequence[float]) -> list[float]:
        """Return the motor voltages [V] for the latest pose."""
        self._pose[0] = tuple(pose)
        self._rate[0] = self._difference()
        wanted = lib.omni_fl_step(
            self._state, self._config, self._pose, self._rate, self._origin, self._still, self._cut, self._terms
        )
        self._rate[0] = wanted
        self._body[0] = lib.omni_twist_to_body(self._rate, self._pose.theta)
        lib.omni_kinematics_inverse(self._kinematics, self._body, ffi.NULL, self._speed)
        factor = lib.omni_wheel_speed_step(
            self._loops, self._map, self._speed, self._zero, self._zero, self._supply_V, self._duty, self._volts
        )
        self._cut = self._hold and factor < 1.0
        duties = list(self._duty)[: self._map.wheels]
        return [self._supply_V * round(self._steps * duty) / self._steps for duty in duties]

    def _difference(self) -> tuple[float, float, float]:
        """Rate of the pose over the last sample; 0 for the first."""
        now, before = self._pose, self._last
        moved = (now.x - before.x, now.y - before.y, lib.omni_wrap_pi(now.theta - before.theta))
        started, self._started = self._started, True
        self._last[0] = self._pose[0]
        return (
            (moved[0] / self._step_s, moved[1] / self._step_s, moved[2] / self._step_s) if started else (0.0, 0.0, 0.0)
        )


def start_pose(spec: Mapping[str, Any], seed: int) -> tuple[float, float, float]:
    """Return where a try begins: any direction and heading, distance as the experiment says."""
    rng = np.random.default_rng((seed, 2))
    distance, bearing, heading = rng.uniform(*spec["experiment"]["distance_m"]), *rng.uniform(-np.pi, np.pi, 2)
    return float(distance * np.cos(bearing)), float(distance * np.sin(bearing)), float(heading)


def world_of(case: Case) -> World:
    """Return the world of a try."""
    robot = case.spec["robot"]
    values = {**motor_fields(robot), **{name: robot[name] for name in ("wheel_radius_m", "wheel_distance_m")}}
    sensor = PoseSensor(**case.spec["pose"])
    return make_world(values, "kinematic+motors", case.seed, start_pose(case.spec, case.seed), sensor)


def measure(case: Case) -> Array:
    """Return the distance from the origin [m] after each step of a try."""
    world, head = world_of(case), case.spec["experiment"]
    drive = Drive(case, make_kinematics(world))
    distance = np.empty(round(head["duration_s"] / head["step_s"]))
    volts = [0.0] * world.wheels
    for step in range(len(distance)):
        sensors = world.sense()
        if sensors.has_fix:
            volts = drive.step(list(sensors.fix.pose))
        world.drive_voltage(volts)
        world.step(1, round(1e6 * head["step_s"]))
        distance[step] = np.hypot(world.c.pose[0], world.c.pose[1])
    return distance


_EXPLANATIONS = {
    "P": "The robot stops where no motor gets more than the dead-band: the smaller the gain, the farther away. The "
    "limit is that distance in the worst direction for the wheels; in others it is up to √2 times that, and a robot "
    "that coasts gets nearer.",
    "PD": "With the derivative against lag and delay the gain can be {gain:.1f} times that of P, which makes the "
    "distance as much smaller.",
    "PID": "The integral, limited to {share:.0f} % of the dead-band, takes the rest.",
    "PID as printed (38), no limit": "Without a limit the integral of a try that starts metres away swings the robot "
    "to and fro, long after: what the report calls oscillations.",
}
_COMPENSATED = (
    "The dead-band is added to every PWM in the wanted direction (the static feed-forward of the core's wheel loops), "
    "with the same gains: a dead-band that is known costs no accuracy."
)
_PARTLY = (
    "A dead-band known to {miss:.0f} % stops the robot at the limit, that share of the distance. This world's friction "
    "is smooth within 0.01 rad/s: below the dead-band the robot creeps the rest of the way in seconds, which stiction "
    "would not allow."
)
_DEVIATION = (
    "Only start, heading and the noise of the poses differ between tries; the report's floor, battery and motors did "
    "too."
)


def run(context: Context) -> Result:
    """Run all controllers over the tries, without and with compensation."""
    spec = read_spec(NAME)
    head = spec["experiment"]
    seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))
    sets = [(name, 0.0) for name in spec["controller"]]
    sets += [(name, share) for share in head["compensations"] for name in spec["published"]]
    found = context.map(measure, [Case(spec, name, share, seed) for name, share in sets for seed in seeds])
    distances = {key: _CM * np.array(found[i * len(seeds) : (i + 1) * len(seeds)]) for i, key in enumerate(sets)}
    rows = [row for (name, share), distance in distances.items() for row in _rows(spec, name, share, distance)]
    picture = context.folder / FIGURE
    draw(spec, {key: distance[:, -1] for key, distance in distances.items()}, picture)
    return Result(tuple(rows), (picture,), (_note(spec, len(seeds)),))


def _rows(spec: Mapping[str, Any], name: str, compensation: float, distance_cm: Array) -> list[Row]:
    head, final = spec["experiment"], distance_cm[:, -1]
    title = f"{name}, {_how(compensation)}"
    mean, sd = spec["published"].get(name, (None, None))
    tail = distance_cm[:, -round(5.0 / head["step_s"]) :].max(axis=1)
    limit = _CM * stop_radius_m(spec, name, compensation)
    rows = [
        Row(
            NAME, title, "final position error", "cm", float(final.mean()), spread(final), len(final), mean, sd,
            limit if limit > 0.0 else None, _explanation(spec, name, compensation),
        ),
        Row(NAME, title, "largest error in the last 5 s", "cm", float(tail.mean()), spread(tail), len(tail)),
    ]  # fmt: skip
    if compensation == 0.0 and mean is not None:
        rows += _group_rows(title, final, head["group"], mean, sd)
    return rows


def _group_rows(title: str, final_cm: Array, size: int, mean: float, sd: float) -> list[Row]:
    """Rows of the tries in groups as large as the report's; none if there is no whole group."""
    groups = final_cm[: len(final_cm) // size * size].reshape(-1, size)
    if not len(groups):
        return []
    inside, within = np.abs(groups.mean(axis=1) - mean) <= sd, groups.std(axis=1, ddof=1)
    return [
        share_row(NAME, title, f"means of {size} tries inside the published ±", inside),
        Row(
            NAME, title, f"deviation within {size} tries", "cm", float(within.mean()), spread(within), len(within), sd,
            explanation=_DEVIATION,
        ),
    ]  # fmt: skip


def _how(compensation: float) -> str:
    if compensation == 0.0:
        return "dead-band as it is"
    return (
        "dead-band compensated" if compensation == 1.0 else f"{100 * compensation:.0f} % of the dead-band compensated"
    )


def _explanation(spec: Mapping[str, Any], name: str, compensation: float) -> str:
    if compensation > 0.0:
        return _COMPENSATED if compensation == 1.0 else _PARTLY.format(miss=100.0 * abs(1.0 - compensation))
    all_gains = spec["controller"]
    gains = all_gains[name]
    share = 100.0 * gains["ki"] * gains["integral_limit"] / dead_speed_m_s(spec["robot"])
    return _EXPLANATIONS[name].format(gain=gains["kp"] / all_gains["P"]["kp"], share=share)


def _note(spec: Mapping[str, Any], tries: int) -> str:
    head, robot, pose = spec["experiment"], spec["robot"], spec["pose"]
    near, far = head["distance_m"]
    return (
        f"{tries} tries per controller of {head['duration_s']:.0f} s from {near:.0f} to {far:.0f} m away, any heading, "
        f"{1 / head['step_s']:.0f} Hz; poses {1e3 * pose['delay_s']:.0f} ms late with {1e3 * pose['sd_xy_m']} mm of "
        f"noise. One robot for all: full speed {robot['full_speed_rad_s']:.0f} rad/s at {robot['supply_V']:.0f} V, lag "
        f"{robot['lag_s']} s, friction that takes PWM {robot['dead_pwm']} of {robot['pwm_steps']}. Robot and gains are "
        "a fit with many solutions: what the table needs is a dead-band, and a gain that lag and delay keep small."
    )


def draw(spec: Mapping[str, Any], final_cm: Mapping[tuple[str, float], Array], path: Path) -> None:
    """Draw the final error [cm] of every try, by controller and compensation, into a PNG file."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.5, 6.0), dpi=120)
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        names = list(spec["controller"])
        for place, (mean, sd) in enumerate(spec["published"].values()):
            ends = [place - 0.45, place + 0.45]
            label = "published ±" if place == 0 else None
            axes.fill_between(ends, mean - sd, mean + sd, color=GREY, alpha=0.3, linewidth=0.0, label=label)
            axes.plot(ends, [mean, mean], color=INK, linewidth=1.5)
        shares = sorted({share for _, share in final_cm})
        for (name, share), values in final_cm.items():
            offset = 0.9 * ((shares.index(share) + 0.5) / len(shares) - 0.5)
            spots = names.index(name) + offset + 0.16 * (np.arange(len(values)) / max(len(values) - 1, 1) - 0.5)
            colour = WHEEL_COLOURS[shares.index(share) % len(WHEEL_COLOURS)]
            text = _how(share) if names.index(name) == 0 else None
            axes.plot(spots, values, "o", color=colour, markersize=3.0, label=text)
        axes.set_yscale("log")
        axes.set_xticks(range(len(names)), names)
        axes.set_xlim(-0.55, len(names) - 0.45)
        axes.set(ylabel="position error at the end of a try [cm]")
        axes.set_title("Table 1: stabilisation from 1 to 3 m away, each point a try", pad=26)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, borderaxespad=0.2, columnspacing=1.0)
        axes.grid(axis="x", visible=False)
        figure.tight_layout()
        save_picture(figure, path)
