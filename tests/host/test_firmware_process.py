# SPDX-License-Identifier: MIT
"""The API against the real PC firmware over TCP and a pseudo-terminal, in real time."""

from __future__ import annotations

import json
import math
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from omniwheel import FirmwareProcess
from omniwheel.errors import (
    ArmingRefusedError,
    FirmwareStartError,
    LinkLostError,
    ParameterRangeError,
    ParameterRefusedError,
    RobotFileError,
)
from omniwheel.robot import Robot, connect
from omniwheel.telemetry import Heartbeat, LocalPosition, Status, Tracking
from tests.waiting import wait_until


@pytest.mark.full
def test_the_firmware_serves_over_tcp_and_a_pseudo_terminal_at_once() -> None:
    with FirmwareProcess("three_wheel", links=["tcp:127.0.0.1:0", "pty"]) as firmware:
        assert len(firmware.urls) == 2
        tcp, pty = firmware.urls
        assert stat.S_ISCHR(os.stat(pty).st_mode)
        with connect(tcp) as one, connect(pty) as two:
            assert one.parameters.download() == two.parameters.download()
            two.parameters["ISMC_LAM_XY"] = 17.0
            assert one.parameters.read("ISMC_LAM_XY") == 17.0


def test_the_robot_file_and_overrides_reach_the_firmware() -> None:
    process = FirmwareProcess("four_wheel", parameters={"ISMC_LAM_XY": 7.0, "CTL_MODE": "pid"})
    with process as firmware, connect(firmware.urls[0]) as robot:
        assert robot.parameters["ISMC_LAM_XY"] == 7.0
        assert robot.parameters["CTL_MODE"] == 4.0
        assert robot.parameters["WHEELS"] == 4.0
        assert robot.parameters["WHEEL_DIST"] == firmware.robot.parameter_values()["WHEEL_DIST"]


def test_the_version_and_the_parameter_table_agree(url: str) -> None:
    with connect(url) as robot:
        robot.require_same_parameters()
        assert robot.version.firmware.count(".") == 2


def test_arming_driving_and_disarming_show_in_telemetry(url: str) -> None:
    with connect(url) as robot:
        robot.set_message_interval("HEARTBEAT", 20.0)
        robot.arm()
        armed = next(beat for beat in robot.telemetry(Heartbeat) if beat.armed)
        assert armed.armed
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 0.2)
        position = robot.wait_for(LocalPosition)
        assert math.isfinite(position.x_m)
        robot.disarm()
        assert not next(beat for beat in robot.telemetry(Heartbeat) if not beat.armed).armed


def test_the_pose_estimate_can_be_set_while_disarmed(url: str) -> None:
    with connect(url) as robot:
        robot.set_pose_estimate(1.0, -2.0, 0.5)
        tracking = next(t for t in robot.telemetry(Tracking) if abs(t.pose.x - 1.0) < 1e-3)
        assert tracking.pose == pytest.approx((1.0, -2.0, 0.5), abs=1e-3)
        assert robot.wait_for(LocalPosition).y_m == pytest.approx(-2.0, abs=1e-3)


def test_an_emergency_stop_is_latched_until_it_is_released(url: str) -> None:
    with connect(url) as robot:
        robot.estop()
        next(status for status in robot.telemetry(Status) if status.state == "estop")
        with pytest.raises(ArmingRefusedError, match="release it first"):
            robot.arm()
        robot.estop_clear()
        next(status for status in robot.telemetry(Status) if status.state == "disarmed")
        robot.arm()


def test_a_locked_parameter_is_refused_while_armed_and_nothing_changes(url: str) -> None:
    with connect(url) as robot:
        robot.arm()
        next(beat for beat in robot.telemetry(Heartbeat) if beat.armed)
        with pytest.raises(ParameterRefusedError, match="disarm first"):
            robot.parameters["WHEELS"] = 4
        assert robot.parameters.read("WHEELS") == 3.0


def test_values_out_of_range_never_reach_the_firmware(url: str) -> None:
    with connect(url) as robot, pytest.raises(ParameterRangeError):
        robot.parameters["ISMC_LAM_XY"] = math.nan


def test_stored_parameters_outlive_the_process(tmp_path: Path) -> None:
    storage = tmp_path / "memory"
    for expected in (12.0, 21.0):
        with FirmwareProcess("three_wheel", storage=storage) as firmware, connect(firmware.urls[0]) as robot:
            assert robot.parameters["ISMC_LAM_XY"] == expected
            robot.parameters["ISMC_LAM_XY"] = 21.0
            robot.store()
            robot.parameters["ISMC_LAM_XY"] = 33.0
            robot.restore()
            assert robot.parameters["ISMC_LAM_XY"] == 21.0


def test_reset_brings_back_the_robot_file(url: str) -> None:
    with connect(url) as robot:
        before = robot.parameters.download()
        robot.parameters.set_many({"ISMC_LAM_XY": 1.0, "WHEEL_RADIUS": 0.1})
        robot.reset_parameters()
        assert robot.parameters.download() == before


def test_a_saved_file_sets_another_robot_up_the_same(url: str, tmp_path: Path) -> None:
    with connect(url) as robot:
        robot.parameters.set_many({"ISMC_LAM_XY": 0.1, "TRJ_TYPE": "circle"})
        robot.parameters.save(tmp_path / "p.toml")
        saved = robot.parameters.download()
    with FirmwareProcess("four_wheel") as other, connect(other.urls[0]) as robot:
        robot.parameters.load(tmp_path / "p.toml", force=True)
        assert robot.parameters.download() == saved


def test_a_second_client_is_turned_away_and_the_first_goes_on(url: str) -> None:
    with connect(url) as robot:
        with pytest.raises(LinkLostError, match="closed the connection") as caught:
            connect(url)
        assert "one client" in caught.value.hint
        assert robot.parameters.read("WHEELS") == 3.0


def test_the_end_of_the_firmware_is_a_lost_link(firmware: FirmwareProcess) -> None:
    with connect(firmware.urls[0]) as robot:
        firmware.stop()
        with pytest.raises(LinkLostError):
            robot.pump(5.0)


def test_stopping_ends_the_process_and_can_be_repeated(firmware: FirmwareProcess) -> None:
    assert firmware.running
    assert firmware.stop() == 0
    assert not firmware.running
    assert firmware.stop() is None


def test_a_port_in_use_is_a_start_error_with_the_firmwares_words() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(FirmwareStartError, match=str(port)):
            FirmwareProcess(links=[f"tcp:127.0.0.1:{port}"]).__enter__()


def test_a_program_that_is_not_the_firmware_is_a_start_error() -> None:
    with pytest.raises(FirmwareStartError, match="did not start"):
        FirmwareProcess(program="/bin/true").__enter__()
    with pytest.raises(FirmwareStartError, match="cannot start"):
        FirmwareProcess(program="/nonexistent/program").__enter__()


def test_an_unknown_robot_comes_with_the_known_ones() -> None:
    with pytest.raises(RobotFileError, match="did you mean three_wheel") as caught:
        FirmwareProcess("three_whel")
    assert "four_wheel" in caught.value.hint


def test_two_robots_run_at_once(robot_file: Path) -> None:
    four_wheel, mine = FirmwareProcess("four_wheel"), FirmwareProcess(robot_file)
    with four_wheel, mine, connect(four_wheel.urls[0]) as one, connect(mine.urls[0]) as two:
        assert (one.parameters["WHEELS"], two.parameters["WHEELS"]) == (4.0, 3.0)


def test_a_hung_program_is_stopped_by_the_robots_link_loss(firmware: FirmwareProcess) -> None:
    with connect(firmware.urls[0], heartbeat=False) as robot:
        _arm_with_one_heartbeat(robot)
        failed = next(s for s in robot.telemetry(Status, timeout_s=15.0) if s.state == "failsafe")
        assert any("link" in fault for fault in failed.fault_history)


def _arm_with_one_heartbeat(robot: Robot) -> None:
    from omniwheel.dialect import mavlink

    robot.parameters["SAFE_LINK_TO"] = 0.5
    gcs, invalid = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
    robot.send(mavlink.MAVLink_heartbeat_message(gcs, invalid, 0, 0, 4, 3))
    robot.arm()


@pytest.mark.full
def test_a_killed_sitl_takes_its_firmware_along(tmp_path: Path) -> None:
    command = [str(Path(sys.executable).with_name("omni")), "sitl", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        assert process.stdout is not None
        _, host, port = json.loads(process.stdout.readline())["links"][0].split(":")
        process.kill()
        process.wait(60.0)
    wait_until(lambda: is_gone((host, int(port))), "the firmware goes on")


def is_gone(address: tuple[str, int]) -> bool:
    """Whether nobody listens there."""
    try:
        socket.create_connection(address, timeout=1.0).close()
    except ConnectionRefusedError:
        return True
    return False


def test_a_full_folder_for_temporary_files_is_an_error_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("omniwheel.firmware_child.tempfile.TemporaryDirectory", fail)
    with pytest.raises(FirmwareStartError, match="No space left") as caught, FirmwareProcess():
        pass
    assert "TMPDIR" in caught.value.hint
