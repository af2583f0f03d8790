# SPDX-License-Identifier: MIT
"""What a sensor of motion over the floor is worth, for docs/guides/floor-motion.md.

python -m bench.figures.flow [--seeds 8] [--first 2000]. Each world is driven twice with the same seeds, without and
with the sensor.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bench.figures.gyro import LOOK_TICKS, drive_scenario
from hil_sim.patches import FloorPatch
from hil_sim.scenario import Scenario, load_scenario
from omniwheel._core import lib

Array = NDArray[np.float64]
SEEDS = range(2000, 2008)
"""Of the page's table. Few: it shows sizes, not shades."""


@dataclass(frozen=True)
class Setting:
    """A world: a scenario, and what is different in it. ``sensor`` and ``told`` are the sensor's world and parameters.

    ``gyro``: the robot has a gyro, too, in both of its drives. ``patches``: parts of the floor with another friction.
    """

    title: str
    scenario: str = "no_fixes"
    robot: str | None = None
    world: Mapping[str, float] = field(default_factory=dict)
    sensor: Mapping[str, float] = field(default_factory=dict)
    told: Mapping[str, float] = field(default_factory=dict)
    gyro: bool = False
    patches: tuple[FloorPatch, ...] = ()
    seconds: int = 60


_NONE = {"fix_rate_Hz": 0.0}
ICE = FloorPatch(x_m=(-9.0, 0.0), y_m=(-9.0, 9.0), friction=0.2)
"""Left half of the floor. The robot starts and proves its sensor on the right one."""
OPTICAL = {"flow_turns": 0.0, "flow_step_m": 0.0, "flow_sd_m": 1e-4, "flow_share": 0.02}
"""A chip that measures no turn: a PMW3901's noise is not in its data sheet; this is a guess."""
TOLD_OPTICAL = {"FLOW_MODE": 1.0, "FLOW_SHARE": 0.02}
SETTINGS = (
    Setting("no fixes"),
    Setting("no fixes, slip to 30 %", world={"slip_max": 0.3}),
    Setting("no fixes, slip drawn each 0.5 s", world={"slip_time_s": 0.5}),
    Setting("no fixes, scale off by 1 %, mounted 1° off", sensor={"flow_scale_error": 0.01, "flow_angle_rad": 0.0175}),
    Setting("no fixes, mounted 5° off", sensor={"flow_angle_rad": 0.0873}),
    Setting("no fixes, mounted 20° off", sensor={"flow_angle_rad": 0.349}),
    Setting("no fixes, every fifth reading not valid", sensor={"flow_drop_probability": 0.2}),
    Setting(
        "no fixes, 80 mm off the centre",
        sensor={"flow_x_m": 0.08, "flow_y_m": 0.02},
        told={"FLOW_X": 0.08, "FLOW_Y": 0.02},
    ),
    Setting("no fixes, four wheels", robot="four_wheel"),
    Setting("no fixes, fast robot", scenario="fast", world=_NONE, seconds=30),
    Setting("no fixes, no turn measured", sensor=OPTICAL, told=TOLD_OPTICAL),
    Setting("no fixes, no turn measured, gyro in both", sensor=OPTICAL, told=TOLD_OPTICAL, gyro=True),
    Setting("no fixes, fast robot, ice on half of the floor", scenario="fast", world=_NONE, patches=(ICE,), seconds=25),
    Setting(
        "no fixes, fast robot, ice on half of the floor, gyro in both",
        scenario="fast",
        world=_NONE,
        patches=(ICE,),
        gyro=True,
        seconds=25,
    ),
    Setting(
        "no fixes, fast robot, ice from the start",
        scenario="fast",
        world={**_NONE, "friction_coefficient": 0.15},
        seconds=25,
    ),
    Setting("fixes", scenario="demo"),
    Setting("fixes, fast robot", scenario="fast", seconds=25),
)


@dataclass(frozen=True)
class Errors:
    """Of all looks at all runs: heading [rad], position [m], NEES of heading and position, which should be 1."""

    heading: Array
    position: Array
    nees_heading: Array
    nees_position: Array
    warned: int

    @property
    def rms_heading(self) -> float:
        """Root mean square [rad]."""
        return float(np.sqrt(np.mean(self.heading**2)))

    @property
    def rms_position(self) -> float:
        """Root mean square [m]."""
        return float(np.sqrt(np.mean(self.position**2)))


def scenario_of(setting: Setting, seed: int, flow: bool) -> Scenario:
    """Return the scenario of one run."""
    found = load_scenario(setting.scenario, setting.robot).with_seed(seed)
    world = {**found.world, **setting.world}
    parameters = {**found.parameters, "TRJ_LAPS": 0.0}
    if setting.gyro:
        world |= {"gyro_rate_Hz": 1000.0}
        parameters |= {"GYRO_AXIS": 3.0}
    if flow:
        world |= {"flow_rate_Hz": 50.0, **setting.sensor}
        parameters |= {"FLOW_MODE": 2.0, **setting.told}
    return replace(found, world=world, parameters=parameters, patches=setting.patches)


def measure(setting: Setting, seeds: range, flow: bool) -> Errors:
    """Drive all seeds; the first two seconds of each count for nothing. Raises RuntimeError if a robot stops."""
    runs = [
        drive_scenario(scenario_of(setting, seed, flow), f"{setting.title}, seed {seed}", setting.seconds)
        for seed in seeds
    ]
    looks = np.concatenate([rows[2000 // LOOK_TICKS :] for rows, _ in runs])
    position = np.hypot(looks[:, 2], looks[:, 3])
    warned = sum(bool(faults & lib.OMNI_WARN_FLOW) for _, faults in runs)
    return Errors(looks[:, 0], position, looks[:, 0] ** 2 / looks[:, 1], position**2 / looks[:, 4], warned)


def table(seeds: range) -> Iterator[str]:
    """Yield the page's lines: without / with the sensor."""
    yield f"Seeds {seeds.start} to {seeds.stop - 1}, without / with the sensor:"
    yield ""
    yield "| World | heading, RMS [mrad] | position, RMS [mm] | NEES with it: heading, position | warned |"
    yield "|---|---|---|---|---|"
    for setting in SETTINGS:
        yield row(setting, seeds)


def row(setting: Setting, seeds: range) -> str:
    """Return a world's line of the table."""
    old, new = (measure(setting, seeds, flow) for flow in (False, True))
    return (
        f"| {setting.title} | {1e3 * old.rms_heading:.2f} / {1e3 * new.rms_heading:.2f} | "
        f"{1e3 * old.rms_position:.2f} / {1e3 * new.rms_position:.2f} | "
        f"{np.mean(new.nees_heading):.2f}, {np.mean(new.nees_position):.2f} | {new.warned} of {len(seeds)} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="what a sensor of motion over the floor is worth")
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--first", type=int, default=SEEDS.start)
    options = parser.parse_args()
    for line in table(range(options.first, options.first + options.seeds)):
        print(line, flush=True)


if __name__ == "__main__":
    main()
