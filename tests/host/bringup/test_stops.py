# SPDX-License-Identifier: MIT
from __future__ import annotations

import pytest

from hil_sim.faults import Fault
from omniwheel.bringup import Result, check_stops
from omniwheel.dialect import mavlink
from tests.host.bringup.conftest import Bench, MakeBench


def failures(result: Result) -> dict[str, str]:
    return {finding.name: finding.advice for finding in result.findings if not finding.ok}


@pytest.mark.full
def test_all_three_stops_work_in_time_and_the_robot_is_left_ready(bench: Bench) -> None:
    result = check_stops(bench.robot, bench)
    assert result.ok, failures(result)
    assert result.measured["emergency_stop_s"] < 0.2
    assert 0.3 < result.measured["setpoint_loss_s"] < 0.7
    assert 1.5 < result.measured["link_loss_s"] < 3.2
    assert not bench.armed
    bench.robot.arm()  # the emergency stop is released


def beaten_by(bench: Bench, system: int) -> None:
    """Let another ground station send heartbeats on the robot's link."""
    connection = bench.robot.connection
    stranger = mavlink.MAVLink(None, system, connection._codec.srcComponent)

    def keep_alive(message: object) -> None:
        gcs = (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID)
        frame = mavlink.MAVLink_heartbeat_message(*gcs, 0, 0, mavlink.MAV_STATE_ACTIVE, 3).pack(stranger)
        connection.link.write(bytes(frame))

    connection.add_listener(lambda m: keep_alive(m) if m.get_type() == "HEARTBEAT" else None)


@pytest.mark.full
def test_another_ground_station_keeps_no_robot_alive(make_bench: MakeBench) -> None:
    bench = make_bench()
    beaten_by(bench, 250)
    result = check_stops(bench.robot, bench)
    assert result.ok, failures(result)


@pytest.mark.full
def test_a_ground_station_of_the_same_numbers_keeps_a_robot_alive_and_is_suspected(make_bench: MakeBench) -> None:
    bench = make_bench()
    beaten_by(bench, bench.robot.connection._codec.srcSystem)
    result = check_stops(bench.robot, bench)
    assert "link loss" in failures(result)
    assert "link loss: failsafe" in failures(result)
    assert "other ground stations" in failures(result)["link loss"]
    assert not bench.armed


def test_wheels_that_do_not_turn_prove_nothing(make_bench: MakeBench) -> None:
    dead = [Fault("motor_dead", 0.0, wheel=wheel) for wheel in range(3)]
    bench = make_bench(faults=dead)
    result = check_stops(bench.robot, bench)
    assert set(failures(result)) == {"emergency stop", "setpoint loss", "link loss"}
    assert "omni bringup motors" in result.advice[0]


@pytest.mark.parametrize("parameter", ["SAFE_CMD_TO", "SAFE_LINK_TO"])
def test_a_time_out_of_a_minute_is_no_stop(make_bench: MakeBench, parameter: str) -> None:
    bench = make_bench(parameters={parameter: 60.0})
    result = check_stops(bench.robot, bench)
    assert len(failures(result)) == 1
    assert f"omni params set {parameter}=3" in result.advice[0]


def test_a_chip_that_keeps_driving_is_noticed(make_bench: MakeBench) -> None:
    """The bus dies in the moment of the stop, and nobody wired the output-enable pin."""
    bench = make_bench()
    estop = bench.robot.estop

    def late() -> None:
        config = bench.world.c.config
        config.fault[0] = {"kind": Fault("i2c_nack", 0.0).kind, "start_s": bench.link.clock_s(), "stop_s": 1e9}
        config.fault_count = 1
        estop()

    bench.robot.estop = late  # type: ignore[method-assign]
    with pytest.raises(Exception, match="driver"):
        check_stops(bench.robot, bench)
