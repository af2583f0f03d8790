# SPDX-License-Identifier: MIT
"""docs/how-to-add/sensor.md, followed word by word, gives a sensor of the world that shows what it should."""

from __future__ import annotations

import json
import subprocess
import sys

from tests.recipes.recipe import Scratch

_LOOK = """
import json, sys
sys.meta_path = [finder for finder in sys.meta_path if "Editable" not in type(finder).__name__
                 and "ScikitBuild" not in type(finder).__name__]
sys.path.insert(0, sys.argv[1])
from pathlib import Path
import omniwheel._core
from hil_sim.world import World, world_config
from omniwheel.robots import read_robot
assert Path(omniwheel._core.__file__).is_relative_to(sys.argv[1]), omniwheel._core.__file__
def readings(**numbers):
    world = World(world_config(read_robot("three_wheel"), **numbers))
    world.set_duty([0.3] * 3)
    world.step(500)
    seen = []
    for _ in range(500):
        world.step()
        seen.append(world.sense().gyro_rad_s - world.twist[2])
    return seen, world.twist[2]
print(json.dumps([readings(gyro_sd_rad_s=0.0), readings(gyro_sd_rad_s=0.1)]))
"""


def check(copy: Scratch) -> None:
    """Look at what it shows of a turning robot, without its noise and with it."""
    command = [sys.executable, "-c", _LOOK, str(copy.packages())]
    said = subprocess.run(command, cwd=copy.root, capture_output=True, text=True, check=True).stdout
    (exact, turning_rad_s), (noisy, _) = json.loads(said)
    assert abs(turning_rad_s) > 0.1
    assert max(map(abs, exact)) == 0.0
    assert 0.08 < (sum(error * error for error in noisy) / len(noisy)) ** 0.5 < 0.12
