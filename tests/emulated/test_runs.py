# SPDX-License-Identifier: MIT
"""The demo's scenario on the emulated processor: the same bytes as the firmware on this computer gives."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil_sim.hil import run_hil
from hil_sim.scenario import load_scenario
from tests.arm import need_emulated_firmware

SHORT_S = 12.0


@pytest.fixture(scope="module", autouse=True)
def _emulator() -> None:
    need_emulated_firmware()


def test_the_demo_leaves_the_same_log_byte_for_byte_on_both_processors(tmp_path: Path) -> None:
    scenario = load_scenario("fault_pose_loss")
    logs = []
    for emulated in (False, True):
        folder = tmp_path / str(emulated)
        folder.mkdir()
        run = run_hil(scenario, out_dir=folder, emulated=emulated)
        logs.append((folder / "telemetry.tlog").read_bytes())
        assert len(run.record) > 5000
    assert logs[0] == logs[1]
