# SPDX-License-Identifier: MIT
"""Whether the robot's pose is as good as its filter says: python -m omni_reproduce.estimate_consistency [SETTING]...

NEES is the squared error of x, y and heading over the filter's covariance, NIS that of a fix before it is used. Both
have a mean of 3 if the covariance is true. "Error over claim" is the root of NEES / 3: 2 says that the pose is half as
good as claimed. "Looks inside": share of the moments, 20 ms apart, at which the mean NEES of all seeds is inside its
95 % band of chi-square. "Runs inside": share of the runs whose mean NIS is inside its own. Both should be 95 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil_sim import core
from hil_sim.faults import Fault
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import IDEAL_WHEELS
from omni_reproduce.consistency import inside
from omni_reproduce.limits_table import print_table
from omni_reproduce.posterior_bound import Array
from omniwheel._core import ffi, lib
from omniwheel.presets import read_preset
from omniwheel.robots import parameter_table

AXES, SHARE = 3, 0.95
FIRST_SEED = 5000
"""No noise level but EKF_ALONE was chosen with these seeds."""
LOOK_TICKS, STAND_TICKS, WARM_UP_S = 20, 3000, 5.0
"""One fix comes between two looks. What a run shows in its first seconds on the path does not count."""
LOST = (Fault("pose_loss", 1e-3 * STAND_TICKS + WARM_UP_S),)
"""No fixes any more from the first look on."""
FIXED = "fixed_noise"
HEADINGS = ("NEES (right: 3)", "error over claim", "looks inside", "NIS (right: 3)", "runs inside")
_EXACTLY = 1e-10


@dataclass(frozen=True)
class Setting:
    """Sensors, filter and wheels of a row."""

    title: str
    scenario: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    ideal: bool = True
    seconds: int = 30
    faults: tuple[Fault, ...] = ()

    @property
    def begins_with_fixes(self) -> bool:
        """Whether pose fixes come before the first look."""
        return "no_fixes" not in self.scenario

    @property
    def has_fixes(self) -> bool:
        """Whether pose fixes come while it is looked at."""
        return self.begins_with_fixes and self.faults != LOST


@dataclass(frozen=True)
class Looks:
    """What runs showed: ``nees`` (runs, looks), ``nis`` (runs, fixes); no fixes: (runs, 0)."""

    nees: Array
    nis: Array

    @property
    def ratio(self) -> float:
        """How many times larger the error is than claimed."""
        return math.sqrt(float(self.nees.mean()) / AXES)

    @property
    def looks_inside(self) -> float:
        """Share of the looks whose mean over the runs is inside its band."""
        return float(inside(self.nees.mean(axis=0) / AXES, AXES * len(self.nees), SHARE).mean())

    @property
    def runs_inside(self) -> float:
        """Share of the runs whose mean NIS is inside its band."""
        return float(inside(self.nis.mean(axis=1) / AXES, AXES * self.nis.shape[1], SHARE).mean())


def settings() -> dict[str, Setting]:
    """Return every row, by its key."""
    out = {}
    sensors = {
        "fixes": ("wheels + fixes", "demo", 30, ()),
        "gyro": ("wheels + fixes + gyro", "gyro", 30, ()),
        "flow": ("wheels + fixes + floor motion", "flow", 30, ()),
        "lost": ("wheels, fixes lost", "demo", 60, LOST),
        "gyro_lost": ("wheels + gyro, fixes lost", "gyro", 60, LOST),
        "flow_lost": ("wheels + floor motion, fixes lost", "flow", 60, LOST),
        "alone": ("wheels alone", "no_fixes", 60, ()),
        "gyro_alone": ("wheels + gyro", "gyro_no_fixes", 60, ()),
        "flow_alone": ("wheels + floor motion", "flow_no_fixes", 60, ()),
    }
    for key, (title, scenario, seconds, faults) in sensors.items():
        for mode, number in (("slip", lib.OMNI_EKF_MODE_SLIP), ("pose", lib.OMNI_EKF_MODE_POSE)):
            for wheels in ("ideal", "real"):
                out[f"{key}_{mode}_{wheels}"] = Setting(
                    f"{title}, {mode} mode, {wheels} wheels",
                    scenario,
                    {"EKF_MODE": float(number)},
                    wheels == "ideal",
                    seconds,
                    faults,
                )
    fixed = read_preset(FIXED, parameter_table()).parameters
    for key in ("fixes_slip_real", "fixes_pose_real", "gyro_slip_real", "lost_slip_real", "alone_slip_real"):
        plain = out[key]
        with_fixed = {**plain.parameters, **fixed}
        out[f"{key}_fixed"] = replace(plain, title=f"{plain.title}, preset {FIXED}", parameters=with_fixed)
    for key in ("alone_slip_real", "lost_slip_real", "gyro_lost_slip_real"):
        plain = out[key]
        without_more = {**plain.parameters, "EKF_ALONE": 1.0}
        out[f"{key}_no_more"] = replace(plain, title=f"{plain.title}, EKF_ALONE 1", parameters=without_more)
    return out


def scenario_of(setting: Setting, seed: int) -> Scenario:
    """Return the scenario of one run; it drives on as long as it is looked at."""
    found = load_scenario(setting.scenario).with_seed(seed).with_world(IDEAL_WHEELS if setting.ideal else {})
    parameters = {**found.parameters, **setting.parameters, "TRJ_LAPS": 0.0}
    return replace(found, parameters=parameters, faults=setting.faults)


def drive(setting: Setting, seed: int) -> Looks:
    """Stand for three seconds, then drive. A robot that gets no fixes is told exactly where it begins.

    Raises RuntimeError if the path cannot be driven, or the robot stops.
    """
    scenario = scenario_of(setting, seed)
    world = new_world(scenario).c
    config = core.robot_config(scenario.parameter_values(), scenario.robot.table, 0)
    run, why = ffi.new("hil_run_t *"), ffi.new("char[]", 160)
    if lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) != lib.HIL_OK:
        raise RuntimeError(ffi.string(why).decode())
    lib.hil_run_advance(run, 1)
    run.inputs.pose.x, run.inputs.pose.y, run.inputs.pose.theta = run.world.pose
    run.inputs.events |= lib.OMNI_EVENT_SET_POSE
    lib.hil_run_advance(run, 1)
    for axis in range(AXES) if not setting.begins_with_fixes else ():
        run.robot.estimator.pose_ekf.p[axis][axis] = _EXACTLY
    lib.hil_run_advance(run, STAND_TICKS)
    if lib.hil_run_start_trajectory(run) != lib.OMNI_OK:
        raise RuntimeError(f"{setting.title}: the path cannot be driven")
    run.inputs.events |= lib.OMNI_EVENT_ARM
    lib.hil_run_advance(run, round(1000 * WARM_UP_S))
    found = look(run, setting.seconds * 1000 // LOOK_TICKS)
    if run.outputs.state != lib.OMNI_STATE_ARMED:
        raise RuntimeError(f"{setting.title}, seed {seed}: the robot stopped")
    return found


def look(run: object, count: int) -> Looks:
    """Let a ``hil_run_t`` drive on, and look at it ``count`` times."""
    held = ffi.cast("hil_run_t *", run)
    ekf, outputs, truth = held.robot.estimator.pose_ekf, held.outputs, held.world.pose
    matrix = np.frombuffer(ffi.buffer(ekf.p), np.float32).reshape(len(ekf.p), -1)[:AXES, :AXES]
    errors, covariances, nis = np.empty((count, AXES)), np.empty((count, AXES, AXES)), []
    accepted = int(outputs.fixes_accepted)
    for row in range(count):
        lib.hil_run_advance(held, LOOK_TICKS)
        heading = math.remainder(ekf.pose.theta - truth[2], 2.0 * math.pi)
        errors[row] = ekf.pose.x - truth[0], ekf.pose.y - truth[1], heading
        covariances[row] = matrix
        if outputs.fixes_accepted != accepted:
            accepted = int(outputs.fixes_accepted)
            nis.append(float(outputs.nis))
    return Looks(nees_of(errors, covariances)[None], np.array([nis]))


def nees_of(errors: Array, covariances: Array) -> Array:
    """Return the normalised squared errors (n,) of errors (n, 3) with covariances (n, 3, 3)."""
    solved = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return np.asarray((errors * solved).sum(axis=1))


def measure(setting: Setting, seeds: int) -> Looks:
    """Drive a setting with so many seeds."""
    runs = [drive(setting, seed) for seed in range(FIRST_SEED, FIRST_SEED + seeds)]
    fixes = min(run.nis.shape[1] for run in runs)
    return Looks(np.concatenate([run.nees for run in runs]), np.concatenate([run.nis[:, :fixes] for run in runs]))


def line(key: str, seeds: int) -> str:
    """Return a setting's row of the table."""
    setting = settings()[key]
    found = measure(setting, seeds)
    cells = [setting.title, f"{found.nees.mean():.2f}", f"{found.ratio:.2f}", f"{100 * found.looks_inside:.0f} %"]
    if setting.has_fixes:
        cells += [f"{found.nis.mean():.2f}", f"{100 * found.runs_inside:.0f} %"]
    else:
        cells += ["", ""]
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    program = ("python -m omni_reproduce.estimate_consistency", __doc__)
    print_table(program, list(settings()), list(HEADINGS), line, arguments)


if __name__ == "__main__":
    main()
