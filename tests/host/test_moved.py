# SPDX-License-Identifier: MIT
"""Names that have moved still work in their old places, and say where they are now."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

MOVED = [
    ("omniwheel.legacy", "omniwheel.host_control", "PwmRadio"),
    ("omniwheel.legacy.controller", "omniwheel.host_control.controller", "pwm_of"),
    ("omniwheel.legacy.loop", "omniwheel.host_control.loop", "Goal"),
    ("omniwheel.legacy.pwm_line", "omniwheel.host_control.pwm_line", "parse_line"),
    ("omniwheel.identification.simulation", "hil_sim.known_robot", "SimulatedRobot"),
    ("omniwheel.identification.simulation", "hil_sim.known_robot", "MOTION_CAPTURE"),
    ("omniwheel.legacy.simulated_robot", "hil_sim.pwm_robot", "SimulatedRobot"),
    ("omniwheel.legacy.simulated_robot", "hil_sim.pwm_robot", "SimulatedLink"),
    ("omniwheel.image_firmware", "hil_sim.image_firmware", "ImageFirmware"),
    ("omniwheel.logs.sources", "omniwheel.log_sources", "open_log"),
    ("omniwheel.logs.sources", "omniwheel.log_sources", "read_tlog"),
    ("omniwheel.mocap.source", "omniwheel.mocap.streams", "open_source"),
    ("omniwheel.signing", "omniwheel.default_key", "set_default_key"),
    ("hil_sim.report", "omniwheel.plot_style", "GREY"),
    ("hil_sim.studies.statistics", "hil_sim.studies.study_summary", "wilson"),
    ("hil_sim.summary", "omniwheel.logs.run_folder", "load_run"),
]


@pytest.mark.parametrize(("old", "new", "name"), MOVED)
def test_an_old_name_gives_the_new_one_and_a_warning(old: str, new: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"^{old}.{name} is now {new}.{name}") as warned:
        found = getattr(import_module(old), name)
    assert found is getattr(import_module(new), name)
    assert warned[0].filename == __file__


RENAMED = [
    ("omniwheel.errors", "LegacyStopError", "omniwheel.errors", "HostControlStopError"),
    ("omniwheel.legacy", "LegacyRun", "omniwheel.host_control", "HostControlRun"),
    ("omniwheel.legacy.controller", "LegacyController", "omniwheel.host_control.controller", "HostController"),
    ("omniwheel.legacy.loop", "LegacyLoop", "omniwheel.host_control.loop", "HostControlLoop"),
    ("hil_sim.report", "draw_report", "hil_sim.run_picture", "draw_run"),
    ("hil_sim.studies.report", "write_montecarlo_report", "hil_sim.studies.tables", "write_montecarlo_page"),
    ("omniwheel.bringup.report", "write_report", "omniwheel.bringup.results_page", "write_results"),
    ("omniwheel.files", "save_figure", "omniwheel.files", "save_picture"),
    ("omniwheel.identification.log_report", "study_report", "omniwheel.identification.log_page", "study_page"),
    ("omniwheel.logs.importer", "ImportReport", "omniwheel.logs.importer", "ImportSummary"),
    ("omniwheel.mocap", "BridgeStatistics", "omniwheel.mocap.bridge", "BridgeCounts"),
    ("omniwheel.legacy.picture", "draw_legacy_run", "omniwheel.host_control.picture", "draw_host_control_run"),
]


@pytest.mark.parametrize(("old", "name", "new", "new_name"), RENAMED)
def test_an_old_name_gives_what_has_another_name_now(old: str, name: str, new: str, new_name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"^{old}.{name} is now {new}.{new_name};"):
        found = getattr(import_module(old), name)
    assert found is getattr(import_module(new), new_name)


@pytest.mark.parametrize("old", sorted({old for old, *_ in (*MOVED, *RENAMED)}))
def test_a_name_that_never_was_is_an_ordinary_error(old: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{old}' has no attribute 'nothing'"):
        _ = import_module(old).nothing


def test_an_old_place_loads_nothing_of_the_simulation() -> None:
    program = "import sys, omniwheel.legacy.simulated_robot, omniwheel.plot_style; print('hil_sim' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "False\n"
