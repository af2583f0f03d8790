# SPDX-License-Identifier: MIT
"""The image host-in-the-loop over its USB port: the same telemetry as the PC firmware's, byte for byte."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from hil_sim.hil import run_hil
from hil_sim.runs import Run
from hil_sim.scenario import load_scenario
from hil_sim.summary import TLOG_FILE
from hil_sim.telemetry_compare import Comparison, compare_logs, read_frames
from omniwheel.dialect import mavlink
from omniwheel.firmware_process import FirmwareProcess
from tests.needs import refuse

BUILD = ("_sw_version is", "flight_custom_version is")
"""Fields of AUTOPILOT_VERSION that tell the version, whether the sources were changed since, and the commit."""

Compare = Callable[[str, float], tuple[Run, Comparison]]


@pytest.fixture
def compared(image: Path, tmp_path: Path) -> Compare:
    """Run a scenario on the image and on the PC firmware, both entered over their link, and compare the logs."""

    def run(name: str, duration_s: float) -> tuple[Run, Comparison]:
        scenario = load_scenario(name).with_duration(duration_s)
        folders = tmp_path / "image", tmp_path / "pc"
        for folder in folders:
            folder.mkdir()
        played = run_hil(scenario, out_dir=folders[0], image=image)
        with FirmwareProcess(scenario.robot.source) as firmware:
            run_hil(scenario, firmware.urls[0], out_dir=folders[1])
        comparison = compare_logs(folders[0] / TLOG_FILE, folders[1] / TLOG_FILE)
        if any(field in difference for difference in comparison.differences for field in BUILD):
            refuse("image and PC firmware of one build (make setup && make firmware)")
        return played, comparison

    return run


def test_two_seconds_of_the_demo_are_the_pc_firmwares_byte_for_byte(compared: Compare) -> None:
    run, comparison = compared("demo", 2.0)
    assert comparison.differences == ()
    assert comparison.frames > 250
    assert "armed" in run.messages


@pytest.mark.full
def test_twenty_seconds_of_the_demo_are_the_pc_firmwares_byte_for_byte(compared: Compare) -> None:
    run, comparison = compared("demo", 20.0)
    assert comparison.differences == ()
    assert comparison.frames > 1400
    assert "armed" in run.messages


@pytest.mark.full
@pytest.mark.parametrize("fault", ["fault_encoder_stuck", "fault_i2c_nack", "fault_motor_dead"])
def test_faults_are_told_as_the_pc_firmware_tells_them(compared: Compare, fault: str) -> None:
    _, comparison = compared(fault, 5.0)
    assert comparison.differences == ()


def test_the_image_gives_the_same_log_twice(image: Path, tmp_path: Path) -> None:
    scenario = load_scenario("demo").with_duration(1.0)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        run_hil(scenario, out_dir=tmp_path / name, image=image)
    same = {"OMNI_STATUS": frozenset({"tick_us_mean", "tick_us_max"}), "OMNI_HEALTH": frozenset({"stack_free"})}
    assert compare_logs(tmp_path / "one" / TLOG_FILE, tmp_path / "two" / TLOG_FILE, same).differences == ()


def log(path: Path, *messages: mavlink.MAVLink_message, first: int = 0) -> Path:
    sender = mavlink.MAVLink(None, 1, 1)
    sender.seq = first
    with path.open("wb") as file:
        for number, message in enumerate(messages):
            file.write((1000 * number).to_bytes(8, "big") + bytes(message.pack(sender)))
            sender.seq = (sender.seq + 1) % 256
    return path


def test_the_comparer_finds_what_differs_and_passes_over_what_may(tmp_path: Path) -> None:
    status = mavlink.MAVLink_omni_status_message
    quick = status(100, 100, 0, 0, 0, 0, 0, 0, 10.0, 20.0, 1, 1)
    slow = status(100, 100, 0, 0, 0, 0, 0, 0, 99.0, 99.0, 1, 1)
    late = status(100, 100, 0, 0, 1, 0, 0, 0, 10.0, 20.0, 1, 1)
    one = log(tmp_path / "one", quick, quick)
    assert compare_logs(one, log(tmp_path / "slow", slow, slow, first=77)).same
    overrun = compare_logs(one, log(tmp_path / "late", quick, late))
    assert overrun.differences == ("OMNI_STATUS at 1000 us: overruns is 00000000 in one log, 01000000 in the other",)
    assert "in one log only" in compare_logs(one, log(tmp_path / "short", quick)).differences[0]
    assert not compare_logs(
        one, log(tmp_path / "beat", quick, mavlink.MAVLink_heartbeat_message(2, 0, 0, 0, 4, 3))
    ).same
    assert len(list(read_frames(one))) == 2


def test_the_comparer_sees_that_a_frame_was_lost(tmp_path: Path) -> None:
    beat = mavlink.MAVLink_heartbeat_message(2, 0, 0, 0, 4, 3)
    one = log(tmp_path / "one", beat, beat)
    gap = log(tmp_path / "gap", beat)
    second = log(tmp_path / "second", beat, first=2).read_bytes()
    gap.write_bytes(gap.read_bytes() + (1000).to_bytes(8, "big") + second[8:])
    assert "a frame is missing" in compare_logs(one, gap).differences[0]
