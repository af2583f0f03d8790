# SPDX-License-Identifier: MIT
"""The image says for which wiring it was built: in its .hex file, and over its link."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from hil_sim.hil import run_hil
from hil_sim.scenario import load_scenario
from hil_sim.summary import TLOG_FILE
from hil_sim.telemetry_compare import read_frames
from omni_schema import wiring_id
from omniwheel.dialect import mavlink
from omniwheel.flashing.hex_file import read_hex
from omniwheel.robots import read_robot


def test_the_file_that_is_uploaded_has_the_robots_wiring_id(image: Path) -> None:
    assert read_hex(image.with_suffix(".hex")).wiring_id == wiring_id(read_robot("three_wheel"))


def test_the_firmware_says_the_same_of_itself(image: Path, tmp_path: Path) -> None:
    run_hil(load_scenario("demo").with_duration(0.5), out_dir=tmp_path, image=image)
    frames = [mavlink.MAVLink(None).decode(bytearray(logged.data)) for logged in read_frames(tmp_path / TLOG_FILE)]
    said = {message.board_version for message in frames if message.get_type() == "AUTOPILOT_VERSION"}
    assert said == {wiring_id(read_robot("three_wheel"))}
