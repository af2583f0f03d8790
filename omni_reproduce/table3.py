# SPDX-License-Identifier: MIT
"""Table 3 and figure 11: the ISMC over a loop per motor, as published and with this project's loops."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil_sim.world import World
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.loops import (
    NO_LIMIT,
    Array,
    Path,
    Track,
    law_of,
    make_kinematics,
    make_world,
    one_step_limit,
    rmse_rows,
    share_row,
    track,
)
from omni_reproduce.track_picture import View, draw_tracks
from omniwheel._core import ffi, lib

NAME = "table3"
FIGURE = "fig11.png"
COMPARED = ("published", "position_first", "ours_slowed")
"""Settings that stand beside the published figures."""


@dataclass(frozen=True)
class Case:
    """One run: the experiment's file, the name of the setting, the seed."""

    spec: Mapping[str, Any]
    setting: str
    seed: int

    @property
    def supply_V(self) -> float:
        """Largest voltage of a motor."""
        return float(self.spec["setting"][self.setting].get("supply_V", self.spec["experiment"]["supply_V"]))


class MotorLoops:
    """The wheel-speed loops of the core on a world's motors, every ``step_s``.

    Without ``keep_direction`` each motor's voltage is cut at the supply by itself, as a bridge does it.
    """

    def __init__(self, spec: Mapping[str, Any], motor: Any, supply_V: float, step_s: float, wheels: int) -> None:
        self._supply_V = supply_V
        self._limits_alone = not spec["keep_direction"]
        self._step_s = step_s
        self._step_us = round(1e6 * step_s)
        self._state = ffi.new("omni_wheel_speed_state_t *")
        self._config = ffi.new("omni_wheel_speed_config_t *")
        self._config.wheels = wheels
        self._config.pid = [spec["kp"], spec["ki"], 0.0, step_s, supply_V, step_s]
        self._config.ff_speed_V_s = lib.omni_motor_speed_gain(motor) if spec["feed_forward"] else 0.0
        self._config.duty_limit = 1.0
        self._still = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._measured = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._duty = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._volts = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._applied = ffi.new("double[]", lib.OMNI_MAX_WHEELS)
        lib.omni_wheel_speed_reset(self._state)

    def __call__(self, world: World, wheels: Any, step_s: float) -> bool:
        """Drive the world through a step of the position controller; return whether a voltage was cut in it."""
        cut = False
        for _ in range(round(step_s / self._step_s)):
            cut |= self._tick(world, wheels)
        return cut

    def _tick(self, world: World, wheels: Any) -> bool:
        state, count = world.c, world.c.config.wheels
        self._measured[0:count] = state.wheel_rad_s[0:count]
        supply_V = NO_LIMIT if self._limits_alone else self._supply_V
        factor = lib.omni_wheel_speed_step(
            self._state, self._config, wheels, self._still, self._measured, supply_V, self._duty, self._volts
        )
        volts, limit_V = list(self._volts[0:count]), self._supply_V
        self._applied[0:count] = [min(max(volt, -limit_V), limit_V) for volt in volts] if self._limits_alone else volts
        lib.hil_world_drive_voltage(state, self._applied)
        lib.hil_world_step(state, self._step_us)
        return bool(factor < 1.0) or list(self._applied[0:count]) != volts


def motor_of(spec: Mapping[str, Any]) -> Any:
    """Return the motor of the experiment, ``omni_motor_config_t *``."""
    robot = spec["robot"]
    names = ("inertia_kg_m2", "viscous_N_m_s", "constant_N_m_A", "resistance_ohm", "inductance_H")
    return ffi.new("omni_motor_config_t *", {name: robot[f"motor_{name}"] for name in names})


def top_speed_rad_s(spec: Mapping[str, Any]) -> float:
    """Return the wheel speed that the supply can hold."""
    return float(spec["experiment"]["supply_V"] / lib.omni_motor_speed_gain(motor_of(spec)))


def world_of(spec: Mapping[str, Any], seed: int, start: Array) -> World:
    """Return the world of the experiment at a pose."""
    head = spec["experiment"]
    return make_world(
        spec["robot"], "kinematic+motors", seed, start, slip_speed_max_m_s=head["slip_m_s"], slip_time_s=head["step_s"]
    )


def path_of(spec: Mapping[str, Any], slowed: bool) -> Path:
    """Return the path as published, or slowed to what the motors can do."""
    kinematics = make_kinematics(world_of(spec, 1, np.zeros(3)))
    if not slowed:
        return Path(spec["path"], kinematics)
    return Path(spec["path"], kinematics, top_speed_rad_s(spec), spec["slowed"]["margin"])


def drive(case: Case) -> Track:
    """Run one case."""
    head, setting = case.spec["experiment"], case.spec["setting"][case.setting]
    law = law_of(case.spec["law"][setting["law"]], case.spec["robot"])
    references = path_of(case.spec, setting.get("slowed", False)).sampled(head["step_s"], law.feed_forward)
    world = world_of(case.spec, case.seed, references[0][0])
    motor = case.spec["motor"][setting["motor"]]
    loops = MotorLoops(motor, motor_of(case.spec), case.supply_V, head["motor_step_s"], world.wheels)
    return track(world, law, references, head["step_s"], head["slip_error"], case.seed, loops)


def measure(case: Case) -> tuple[Array, float]:
    """Return a run's RMSE per axis and the share of steps with a voltage at its limit."""
    run_ = drive(case)
    return run_.rmse, float(run_.limited.mean())


def turning_limit_rad(spec: Mapping[str, Any]) -> float:
    """Return the smallest RMS heading error that wheels at their top speed allow a robot that does nothing but turn.

    The best answer to a sine too steep to follow has the largest slope wherever it differs from the sine. Where its
    peaks stay below the sine's it never meets the sine but at zero: a triangle. (Else 0 is returned, a weaker bound.)
    """
    path, robot = spec["path"], spec["robot"]
    amplitude, rate = path["rotation_amplitude_rad"], path["rotation_cycles"] / path["period_s"]
    slope = top_speed_rad_s(spec) * robot["wheel_radius_m"] / robot["wheel_distance_m"]
    peak = slope / (4.0 * rate)
    if peak >= amplitude:
        return 0.0
    return math.sqrt(amplitude**2 / 2.0 + peak**2 / 3.0 - 8.0 * amplitude * peak / math.pi**2)


_EXPLANATIONS = {
    "published": "Motor, λ, K and P are a fit. The path needs {need:.0f} rad/s at the wheels, the motors reach "
    "{top:.0f}: the voltages are at their limit all the time, and the heading can only follow as a triangle.",
    "supply": "With more voltage what is left is the P alone: at its tick it is unstable and jumps between the limits.",
    "slowed": "The path's clock is slowed {scale:.1f} times, and nothing else changed.",
    "ours": "Where the voltage is missing, better feed-forward does not help; the factor common to all wheels keeps "
    "the direction and gives up speed on all axes.",
    "position_first": "With a low λ_θ the error of the heading, which no law can avoid, no longer takes the voltage "
    "from x and y.",
    "ours_supply": "With the voltage that the path needs, the same law comes near the one-step limit.",
    "ours_slowed": "The plan knows the motors' limit and slows the clock {scale:.1f} times; model feed-forward instead "
    "of P alone, derivative and heading of the middle of the step, λ near 1/T, K as (44) asks for inside a boundary "
    "layer.",
}
_TURNING = "The limit on θ: wheels at their top speed, were the robot to do nothing but turn."
_ONE_STEP = "The limit: the part of the slip that its estimate misses, over one step."


def run(context: Context) -> Result:
    """Run all settings over the seeds."""
    spec = read_spec(NAME)
    head = spec["experiment"]
    seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))
    cases = [Case(spec, setting, seed) for setting in spec["setting"] for seed in seeds]
    found = context.map(measure, cases)
    rows: list[Row] = []
    for number, (name, setting) in enumerate(spec["setting"].items()):
        part = found[number * len(seeds) : (number + 1) * len(seeds)]
        published = spec["published"]["rmse"] if name in COMPARED else None
        limit, why = _limit(spec, name)
        rmse = np.array([rmse for rmse, _ in part])
        rows += rmse_rows(NAME, setting["title"], rmse, published, limit, f"{_explanation(spec, name)} {why}")
        rows.append(
            share_row(NAME, setting["title"], "steps with a voltage at its limit", [share for _, share in part])
        )
    picture = context.folder / FIGURE
    tracks = {spec["setting"][name]["title"]: drive(Case(spec, name, head["seed"])) for name in head["drawn"]}
    draw_tracks(tracks, _view(head["step_s"], spec["path"]["size_m"]), picture)
    return Result(tuple(rows), (picture,), (_note(spec),))


def _limit(spec: Mapping[str, Any], name: str) -> tuple[Sequence[float | None], str]:
    head, setting = spec["experiment"], spec["setting"][name]
    if setting.get("slowed", False) or "supply_V" in setting:
        world = world_of(spec, head["seed"], np.zeros(3))
        return list(one_step_limit(world, head["step_s"], head["slip_m_s"], head["slip_error"])), _ONE_STEP
    return [None, None, turning_limit_rad(spec)], _TURNING


def _explanation(spec: Mapping[str, Any], name: str) -> str:
    need, scale = path_of(spec, slowed=False).peak_wheel_rad_s, path_of(spec, slowed=True).scale
    return _EXPLANATIONS[name].format(need=need, top=top_speed_rad_s(spec), scale=scale)


def _view(step_s: float, size_m: float) -> View:
    title = "Figure 11: ISMC over motor loops, four-petal rose while rotating"
    return View(title, step_s, from_s=10.0, until_s=15.0, centre_m=(0.0, size_m - 0.012), half_width_m=0.09)


def _note(spec: Mapping[str, Any]) -> str:
    head, path, robot = spec["experiment"], spec["path"], spec["robot"]
    top = top_speed_rad_s(spec)
    factor = path_of(spec, slowed=False).peak_wheel_rad_s / top
    return (
        f"Rose of {path['petals']} petals, {path['size_m']} m, in {path['period_s']:.0f} s, θ = "
        f"{path['rotation_amplitude_rad']} sin(2π t); position controller every {head['step_s']} s, motor loops every "
        f"{head['motor_step_s']} s; slip ±{head['slip_m_s']} m/s per wheel, estimate off by up to "
        f"{100 * head['slip_error']:.0f} % and of the coming step, as in Table 2. Motor: J = "
        f"{robot['motor_inertia_kg_m2']} kg m², b = {robot['motor_viscous_N_m_s']} N m s, K = "
        f"{robot['motor_constant_N_m_A']} N m/A, R = {robot['motor_resistance_ohm']} Ω, L = "
        f"{robot['motor_inductance_H']} H: a fit, not an identification. With a top speed of {top:.1f} rad/s the path "
        f"is infeasible by a factor of {factor:.1f}, slip not counted."
    )
