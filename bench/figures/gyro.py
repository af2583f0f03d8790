# SPDX-License-Identifier: MIT
"""What a gyro is worth, for docs/guides/gyro.md: python -m bench.figures.gyro [--seeds 50] [--first 1000].

Each world is driven twice with the same seeds, without and with the gyro. Only the demo's was looked at while the
filter was made.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import IDEAL_WHEELS
from omniwheel._core import ffi, lib
from omniwheel.robots import parameter_table

Array = NDArray[np.float64]
STAND_TICKS, LOOK_TICKS = 3000, 500
SEEDS = range(1000, 1050)
"""Of the page's table."""


@dataclass(frozen=True)
class Setting:
    """A world: a scenario, and what is different in it. ``scale_sd`` is drawn for each seed."""

    title: str
    scenario: str = "no_fixes"
    robot: str | None = None
    world: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    scale_sd: float = 0.0
    seconds: int = 120
    stand_s: int = STAND_TICKS // 1000


def noise_of(name: str) -> Setting:
    """Return the world whose gyro is this chip: noise, offset, scale and delay as its row in shared/params.toml has."""
    chip = parameter_table().gyro_chips[name]
    return Setting(
        f"no fixes, {name}",
        world={
            "gyro_noise_density": math.radians(chip.noise_dps),
            "gyro_bias_rad_s": math.radians(chip.offset_dps),
            "gyro_lag_s": 1e-3 * chip.delay_ms,
        },
        parameters={"GYRO_ND": math.radians(chip.noise_dps), "GYRO_S_SD": chip.scale_error},
        scale_sd=chip.scale_error,
    )


_NONE, _WARM = {"fix_rate_Hz": 0.0}, {"gyro_warm_up_K": 10.0}
SETTINGS = (
    Setting("no fixes"),
    Setting("no fixes, slip to 30 %", world={"slip_max": 0.3}),
    Setting("no fixes, slip drawn each 0.5 s", world={"slip_time_s": 0.5}),
    Setting("no fixes, scale off by 0.5 %, tilt 2°", world={"gyro_tilt_rad": 0.035}, scale_sd=0.005),
    Setting("no fixes, chip warms up by 10 K", world=_WARM),
    Setting("no fixes, the same with `GYRO_BRW` 5e-5", world=_WARM, parameters={"GYRO_BRW": 5e-5}),
    Setting("no fixes, the same after ten minutes at rest", world=_WARM, stand_s=600),
    *(noise_of(name) for name in parameter_table().gyro_chips),
    Setting("no fixes, four wheels", robot="four_wheel"),
    Setting("no fixes, ideal wheels", world=IDEAL_WHEELS),
    Setting("no fixes, fast robot", scenario="fast", world=_NONE, seconds=40),
    Setting("fixes", scenario="demo", seconds=60),
    Setting("fixes, slip to 30 %", scenario="demo", world={"slip_max": 0.3}, seconds=60),
    Setting("fixes, four wheels", scenario="demo", robot="four_wheel", seconds=60),
    Setting("fixes, fast robot", scenario="fast", seconds=25),
    Setting("no fixes, 7 min", seconds=420),
)


@dataclass(frozen=True)
class Errors:
    """Of all looks at all runs: heading [rad], position [m], and NEES of the heading, which should be 1."""

    heading: Array
    position: Array
    nees: Array
    warned: int

    @property
    def rms_heading(self) -> float:
        """Root mean square [rad]."""
        return float(np.sqrt(np.mean(self.heading**2)))

    @property
    def rms_position(self) -> float:
        """Root mean square [m]."""
        return float(np.sqrt(np.mean(self.position**2)))


def scenario_of(setting: Setting, seed: int, gyro: bool) -> Scenario:
    """Return the scenario of one run."""
    found = load_scenario(setting.scenario, setting.robot).with_seed(seed)
    world = {**found.world, **setting.world}
    parameters = {**found.parameters, **setting.parameters, "TRJ_LAPS": 0.0, "GYRO_AXIS": 3.0 if gyro else 0.0}
    if gyro:
        scale = float(np.random.default_rng(seed).normal(0.0, setting.scale_sd)) if setting.scale_sd else 0.0
        world |= {"gyro_rate_Hz": 1000.0, "gyro_scale_error": scale}
    return replace(found, world=world, parameters=parameters)


def drive(setting: Setting, seed: int, gyro: bool) -> tuple[Array, bool]:
    """Drive a setting with a seed. Return a row per look, and whether the gyro's warning showed."""
    title = f"{setting.title}, seed {seed}"
    rows, faults = drive_scenario(scenario_of(setting, seed, gyro), title, setting.seconds, 1000 * setting.stand_s)
    return rows, bool(faults & lib.OMNI_WARN_GYRO)


def start_run(scenario: Scenario, title: str, stand_ticks: int = STAND_TICKS) -> tuple[Any, Any]:
    """Begin a run, tell the robot where it is, let it stand, and send it on its way. Raises RuntimeError.

    The second value is the run's configuration; keep it for as long as the run.
    """
    world = new_world(scenario).c
    config = core.robot_config(scenario.parameter_values(), scenario.robot.table, 0)
    run, why = ffi.new("hil_run_t *"), ffi.new("char[]", 160)
    if lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) != lib.HIL_OK:
        raise RuntimeError(ffi.string(why).decode())
    lib.hil_run_advance(run, 1)
    run.inputs.pose.x, run.inputs.pose.y, run.inputs.pose.theta = run.world.pose
    run.inputs.events |= lib.OMNI_EVENT_SET_POSE
    lib.hil_run_advance(run, 1)
    for axis in range(3):  # it is told exactly, not as well as a fix
        run.robot.estimator.pose_ekf.p[axis][axis] = 1e-10
    lib.hil_run_advance(run, stand_ticks)
    if lib.hil_run_start_trajectory(run) != lib.OMNI_OK:
        raise RuntimeError(f"{title}: the path cannot be driven")
    run.inputs.events |= lib.OMNI_EVENT_ARM
    return run, config


def drive_scenario(
    scenario: Scenario, title: str, seconds: int, stand_ticks: int = STAND_TICKS, last_fix_s: int | None = None
) -> tuple[Array, int]:
    """Stand for ``stand_ticks``, then drive. Return a row per look, and the fault bits that showed.

    After ``last_fix_s`` of driving no fix is taken any more.

    A row is heading error [rad], its variance as the filter has it, x and y error [m], the sum of their variances. The
    last two are x and y of the robot [m]. Raises RuntimeError.
    """
    run, _config = start_run(scenario, title, stand_ticks)
    rows, faults = [], 0
    for look in range(seconds * 1000 // LOOK_TICKS):
        if last_fix_s is not None and look * LOOK_TICKS == last_fix_s * 1000:
            run.world.config.fix_rate_Hz = 0.0
        lib.hil_run_advance(run, LOOK_TICKS)
        ekf, truth = run.robot.estimator.pose_ekf, run.world.pose
        heading = math.remainder(ekf.pose.theta - truth[2], 2.0 * math.pi)
        off = [ekf.pose.x - truth[0], ekf.pose.y - truth[1]]
        rows.append([heading, ekf.p[2][2], *off, ekf.p[0][0] + ekf.p[1][1], truth[0], truth[1]])
        faults |= int(run.outputs.faults)
    if faults & lib.OMNI_FAULT_STOP_MASK:
        raise RuntimeError(f"{title}: stopped by faults {faults:#x}")
    return np.array(rows), faults


def measure(setting: Setting, seeds: range, gyro: bool) -> Errors:
    """Drive all seeds; the first two seconds of each count for nothing."""
    runs, warned = zip(*(drive(setting, seed, gyro) for seed in seeds), strict=True)
    looks = np.concatenate([rows[2000 // LOOK_TICKS :] for rows in runs])
    nees = looks[:, 0] ** 2 / looks[:, 1]
    return Errors(looks[:, 0], np.hypot(looks[:, 2], looks[:, 3]), nees, sum(warned))


def table(seeds: range) -> Iterator[str]:
    """Yield the page's lines: without / with the gyro."""
    yield f"Seeds {seeds.start} to {seeds.stop - 1}, without / with the gyro:"
    yield ""
    yield "| World | heading, RMS [mrad] | position, RMS [mm] | NEES of heading (right: 1) | warned |"
    yield "|---|---|---|---|---|"
    for setting in SETTINGS:
        yield row(setting, seeds)


def row(setting: Setting, seeds: range) -> str:
    """Return a world's line of the table."""
    old, new = (measure(setting, seeds, gyro) for gyro in (False, True))
    return (
        f"| {setting.title} | {1e3 * old.rms_heading:.2f} / {1e3 * new.rms_heading:.2f} | "
        f"{1e3 * old.rms_position:.2f} / {1e3 * new.rms_position:.2f} | "
        f"{np.mean(old.nees):.2f} / {np.mean(new.nees):.2f} | {new.warned} of {len(seeds)} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="what a gyro is worth")
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--first", type=int, default=SEEDS.start)
    options = parser.parse_args()
    for line in table(range(options.first, options.first + options.seeds)):
        print(line, flush=True)


if __name__ == "__main__":
    main()
