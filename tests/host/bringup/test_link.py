# SPDX-License-Identifier: MIT
from __future__ import annotations

from dataclasses import replace

from omniwheel.bringup import Result, check_link
from omniwheel.firmware_version import RobotVersion
from omniwheel.robots import read_robot
from tests.host.bringup.conftest import Bench, MakeBench, frames_of


def failures(result: Result) -> dict[str, str]:
    return {finding.name: finding.advice for finding in result.findings if not finding.ok}


def test_a_healthy_robot_passes(bench: Bench) -> None:
    result = check_link(bench.robot, read_robot("three_wheel"))
    assert result.ok, failures(result)
    assert result.measured["reset_cause"] == "power"
    assert any("three_wheel" in finding.seen for finding in result.findings)


def test_another_robot_than_the_file_says_is_named_value_by_value(make_bench: MakeBench) -> None:
    bench = make_bench(parameters={"WHEEL_DIST": 0.29, "W2_MOT_DIR": -1.0})
    result = check_link(bench.robot, read_robot("three_wheel"))
    assert list(failures(result)) == ["robot"]
    assert result.measured["differences"] == ["W2_MOT_DIR", "WHEEL_DIST"]
    assert "omni params reset" in result.advice[0]


def test_a_firmware_of_another_version_is_to_be_flashed(bench: Bench) -> None:
    version: RobotVersion = bench.robot.version
    bench.robot._version = replace(version, firmware="0.0.1", schema_crc=1)
    result = check_link(bench.robot)
    assert list(failures(result)) == ["firmware", "parameter table"]
    assert "make flash" in result.advice[0]


def test_two_links_to_two_robots(make_bench: MakeBench) -> None:
    bench, other = make_bench(), make_bench(parameters={"SYS_ID": 7})
    result = check_link(bench.robot, radio=other.robot)
    assert list(failures(result)) == ["same robot"]
    assert "PAN id" in result.advice[0]


def test_an_emergency_stop_left_behind_is_noticed(bench: Bench) -> None:
    bench.robot.estop()
    assert list(failures(check_link(bench.robot))) == ["state"]


def test_lost_heartbeats_are_noticed(bench: Bench) -> None:
    read = bench.link.read

    def without_heartbeats(timeout_s: float) -> bytes:
        return b"".join(frame for frame in frames_of(read(timeout_s)) if any(frame[7:10]))

    bench.link.read = without_heartbeats  # type: ignore[method-assign]
    result = check_link(bench.robot)
    assert list(failures(result)) == ["heartbeat"]
