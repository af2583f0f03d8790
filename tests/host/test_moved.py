# SPDX-License-Identifier: MIT
"""Names that have moved still work in their old places, and say where they are now."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

MOVED = [
    ("omniwheel.identification.simulation", "hil_sim.known_robot", "SimulatedRobot"),
    ("omniwheel.identification.simulation", "hil_sim.known_robot", "MOTION_CAPTURE"),
    ("omniwheel.legacy.simulated_robot", "hil_sim.legacy_robot", "SimulatedRobot"),
    ("omniwheel.legacy.simulated_robot", "hil_sim.legacy_robot", "SimulatedLink"),
    ("omniwheel.image_firmware", "hil_sim.image_firmware", "ImageFirmware"),
    ("omniwheel.logs.sources", "omniwheel.log_sources", "open_log"),
    ("omniwheel.logs.sources", "omniwheel.log_sources", "read_tlog"),
    ("omniwheel.mocap.source", "omniwheel.mocap.streams", "open_source"),
    ("omniwheel.signing", "omniwheel.default_key", "set_default_key"),
    ("hil_sim.report", "omniwheel.plot_style", "GREY"),
    ("hil_sim.summary", "omniwheel.logs.run_folder", "load_run"),
]


@pytest.mark.parametrize(("old", "new", "name"), MOVED)
def test_an_old_name_gives_the_new_one_and_a_warning(old: str, new: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"^{old}.{name} is now {new}.{name}") as warned:
        found = getattr(import_module(old), name)
    assert found is getattr(import_module(new), name)
    assert warned[0].filename == __file__


@pytest.mark.parametrize("old", sorted({old for old, _, _ in MOVED}))
def test_a_name_that_never_was_is_an_ordinary_error(old: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{old}' has no attribute 'nothing'"):
        _ = import_module(old).nothing


def test_an_old_place_loads_nothing_of_the_simulation() -> None:
    program = "import sys, omniwheel.legacy.simulated_robot, omniwheel.plot_style; print('hil_sim' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "False\n"
