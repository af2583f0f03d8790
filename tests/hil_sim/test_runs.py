# SPDX-License-Identifier: MIT
"""Runs of scenarios, in process and with the real firmware process in the loop."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil_sim import metrics
from hil_sim.core import CoreError, path_ticks, robot_config
from hil_sim.faults import Fault
from hil_sim.hil import EPOCH_US, run_hil
from hil_sim.run_picture import HEIGHT_PX, WIDTH_PX, draw_run
from hil_sim.runs import Run, faults_seen, run_in_process, run_seeds
from hil_sim.scenario import Event, Scenario, load_scenario
from hil_sim.summary import TLOG_FILE, WALL_TIME_KEYS, save_run, summarize
from hil_sim.timeline import RunError
from hil_sim.world import PLANTS
from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.errors import ArmingRefusedError, LinkError, ParameterRefusedError
from omniwheel.logs.run_folder import load_run, new_run_folder
from omniwheel.robot import connect

SHORT_S = 6.0
ARMED, ESTOP = 2, 4
STOP_FAULTS = {
    "fault_encoder_stuck": "stall",
    "fault_encoder_reversed": "stall",
    "fault_encoder_invalid": "encoder",
    "fault_i2c_nack": "driver",
    "fault_i2c_stuck": "driver",
    "fault_link_silence": "link loss",
    "fault_battery_sag": "battery",
    "fault_motor_dead": "stall",
}
SURVIVED = {"fault_pose_loss": "pose stale", "fault_pose_jump": "fix refused"}


def short(name: str, duration_s: float = SHORT_S) -> Scenario:
    return replace(load_scenario(name), duration_s=duration_s)


def run(way: str, scenario: Scenario) -> Run:
    return run_in_process(scenario) if way == "in-process" else run_hil(scenario)


def test_the_firmware_in_the_loop_drives_as_the_core_in_this_process_does() -> None:
    scenario = short("no_slip")
    one, other = run_in_process(scenario), run_hil(scenario)
    apart = one.record["truth"][: int(SHORT_S * 1e3)] - other.record["truth"][: int(SHORT_S * 1e3)]
    # Commands take a tick or two to reach the firmware: millimetres on the way, not more.
    assert np.max(np.abs(apart[:, :2])) < 0.001
    assert np.max(np.abs(apart[:, 2])) < 0.005
    rmse, rmse_hil = metrics.tracking_rmse(one.record), metrics.tracking_rmse(other.record)
    assert rmse_hil.position_m == pytest.approx(rmse.position_m, abs=5e-5)
    assert rmse_hil.theta_rad == pytest.approx(rmse.theta_rad, abs=1e-4)


@pytest.mark.parametrize("plant", [plant for plant in PLANTS if plant != "full"])
def test_firmware_and_core_drive_every_plant_alike(plant: str) -> None:
    scenario = short("no_slip", 3.0).with_plant(plant)
    one, other = run_in_process(scenario), run_hil(scenario)
    assert np.max(np.abs(one.record["truth"][:3000, :2] - other.record["truth"][:3000, :2])) < 0.001
    assert np.ptp(other.record["truth"][:, 0]) > 0.005, "it has moved"
    assert faults_seen(other)[0] == []


@pytest.mark.full
def test_equal_seeds_give_equal_logs_and_summaries(tmp_path: Path) -> None:
    folders = [tmp_path / "a", tmp_path / "b"]
    runs = []
    for folder in folders:
        folder.mkdir()
        runs.append(run_hil(short("demo"), seed=5, out_dir=folder))
    first, second = ((folder / TLOG_FILE).read_bytes() for folder in folders)
    assert first == second
    assert runs[0].record.tobytes() == runs[1].record.tobytes()
    summaries = [summarize(entry) for entry in runs]
    for summary in summaries:
        for key in WALL_TIME_KEYS:
            del summary[key]
    assert summaries[0] == summaries[1]


def test_another_seed_is_another_world() -> None:
    one, other = (run_in_process(short("demo", 2.0), seed) for seed in (1, 2))
    assert not np.array_equal(one.record["slip_ratio"], other.record["slip_ratio"])
    assert not np.array_equal(one.record["truth"], other.record["truth"])


def test_seeds_run_side_by_side_give_what_they_give_alone() -> None:
    scenario = short("demo", 2.0)
    together = list(run_seeds(scenario, range(1, 5), lambda entry: entry.record["truth"][-1].tolist()))
    assert together == [run_in_process(scenario, seed).record["truth"][-1].tolist() for seed in range(1, 5)]


def frames(path: Path) -> list[tuple[int, Any]]:
    """Read a tlog by hand: time stamp, message."""
    codec = mavlink.MAVLink(None)
    data, at, found = path.read_bytes(), 0, []
    while at < len(data):
        length = 8 + 12 + data[at + 9]
        message = codec.decode(bytearray(data[at + 8 : at + length]))
        found.append((int.from_bytes(data[at : at + 8], "big"), message))
        at += length
    return found


def test_the_log_holds_both_sides_in_simulated_time(tmp_path: Path) -> None:
    change = Event(at_s=2.0, settings={"WS_P": 5.0})
    scenario = replace(short("demo"), events=(*load_scenario("demo").events[:2], change))
    done = run_hil(scenario, out_dir=tmp_path)
    log = frames(tmp_path / TLOG_FILE)
    stamps = [stamp for stamp, _ in log]
    assert stamps == sorted(stamps)
    assert EPOCH_US <= stamps[0] < EPOCH_US + 10_000
    names = {message.get_type() for _, message in log}
    assert {"HEARTBEAT", "OMNI_TRACKING", "OMNI_WHEELS", "PARAM_SET"} <= names
    assert {"PARAM_VALUE", "COMMAND_LONG", "COMMAND_ACK"} <= names
    asked = next(stamp for stamp, message in log if message.get_type() == "PARAM_SET")
    assert asked == pytest.approx(EPOCH_US + 2_000_000, abs=5_000)
    changed = done.record["time_s"][np.flatnonzero(np.diff(done.record["config_sequence"].astype(int)))[0] + 1]
    assert changed * 1e6 + EPOCH_US == pytest.approx(asked, abs=2_000)


def test_a_summary_says_everything_that_is_promised() -> None:
    done = run_hil(short("demo"))
    summary = summarize(done)
    assert summary["rmse"].keys() == {"x_m", "y_m", "theta_rad", "position_m"}
    assert (summary["robot"], summary["controller"], summary["trajectory"]) == ("three_wheel", "ismc", "rose")
    assert (summary["seed"], summary["faults"], summary["way"]) == (1, [], "hil")
    assert summary["ticks"] == len(done.record)
    assert summary["realtime_factor"] > 0.0
    assert summary["firmware_version"].startswith("0.")
    assert summary["tick_us"]["max"] >= summary["tick_us"]["mean"] > 0.0
    assert summary["parameters"] == pytest.approx(done.scenario.parameter_values())
    json.dumps(summary, allow_nan=False)


@pytest.mark.parametrize("way", ["in-process", "hil"])
def test_the_stop_button_is_an_emergency_stop_that_stays(way: str) -> None:
    scenario = replace(short("no_slip", 3.0), faults=(Fault("stop_button", 2.0, 2.1),))
    record = run(way, scenario).record
    state = {round(1e3 * time_s): int(state) for time_s, state in zip(record["time_s"], record["state"], strict=True)}
    assert state[1999] == ARMED
    assert {state[tick] for tick in range(2000, 2999)} == {ESTOP}


@pytest.mark.full
@pytest.mark.parametrize("way", ["in-process", "hil"])
@pytest.mark.parametrize(("name", "fault"), STOP_FAULTS.items())
def test_a_stop_fault_is_named_and_takes_the_motors_off(way: str, name: str, fault: str) -> None:
    done = run(way, load_scenario(name))
    stops, _ = faults_seen(done)
    assert stops == [fault]
    failsafe = np.flatnonzero(done.record["state"] == 3)
    assert len(failsafe)
    start_s = done.scenario.faults[0].start_s
    assert done.record["time_s"][failsafe[0]] >= start_s
    # A bus that is stuck leaves the chip what it was last told: the firmware cannot do better than to keep trying.
    if fault != "driver":
        after = done.record[failsafe[0] + 5 :]
        assert np.all(after["duty"] == 0.0)
        assert np.max(np.abs(after["wheel_rad_s"][500:])) < 0.01


@pytest.mark.parametrize("way", ["in-process", "hil"])
@pytest.mark.parametrize(("name", "warning"), SURVIVED.items())
def test_a_lost_or_jumping_pose_sensor_is_a_warning_only(way: str, name: str, warning: str) -> None:
    done = run(way, load_scenario(name))
    stops, warnings = faults_seen(done)
    assert stops == []
    assert warning in warnings
    assert metrics.tracking_rmse(done.record).position_m < 0.01


def test_a_refused_gain_stops_the_run_and_says_why() -> None:
    demo = load_scenario("demo")
    locked = replace(demo, duration_s=2.0, events=(*demo.events[:2], Event(at_s=1.0, settings={"WHEEL_RADIUS": 0.06})))
    with pytest.raises(ParameterRefusedError, match="WHEEL_RADIUS"):
        run_hil(locked)


def test_a_robot_that_may_not_arm_says_why() -> None:
    sag = replace(load_scenario("fault_battery_sag").faults[0], start_s=0.0)
    scenario = replace(short("fault_battery_sag"), faults=(sag,))
    with pytest.raises(RunError, match="battery"):
        run_in_process(scenario)
    with pytest.raises(ArmingRefusedError, match="battery"):
        run_hil(scenario)


def test_nobody_at_the_link_is_a_clear_error() -> None:
    with pytest.raises(LinkError, match="cannot open"):
        run_hil(short("demo"), "tcp:127.0.0.1:1")


def test_firmware_behind_a_link_gets_its_own_parameters_back() -> None:
    with FirmwareProcess(parameters={"WS_P": 7.0}) as firmware:
        done = run_hil(short("demo", 2.0), firmware.urls[0])
        assert done.parameters["WS_P"] == done.scenario.parameter_values()["WS_P"] != 7.0
        assert metrics.tracking_rmse(done.record).position_m < 0.003
        with connect(firmware.urls[0]) as robot:
            assert robot.parameters["WS_P"] == 7.0
            assert not robot.status.armed


@pytest.mark.parametrize("way", ["in-process", "hil"])
def test_velocities_and_stops_can_be_played(way: str) -> None:
    events = (
        Event(at_s=0.2, command="arm"),
        Event(at_s=0.3, velocity=(0.1, 0.0, 0.0)),
        Event(at_s=2.3, velocity=(0.0, 0.0, 0.0)),
        Event(at_s=3.0, command="estop"),
    )
    done = run(way, replace(load_scenario("no_slip"), events=events, duration_s=4.0, start_pose=(0.0, 0.0, 0.0)))
    x, y, _ = done.record["truth"][2900]
    assert x == pytest.approx(0.2, abs=0.01)
    assert y == pytest.approx(0.0, abs=0.002)
    assert done.record["state"][3500] == 4
    assert np.all(done.record["duty"][3100:] == 0.0)


@pytest.mark.parametrize("way", ["in-process", "hil"])
def test_open_loop_duties_can_be_played(way: str) -> None:
    events = (
        Event(at_s=0.2, command="arm"),
        Event(at_s=0.2, duty=(0.5, 0.5, 0.5)),
        Event(at_s=1.0, duty=(0.0, 0.0, 0.0)),
    )
    done = run(way, replace(load_scenario("no_slip"), events=events, duration_s=2.0, start_pose=(0.0, 0.0, 0.0)))
    np.testing.assert_allclose(done.record["duty"][300:990, :3], 0.5, atol=1e-3)
    assert np.all(done.record["duty"][1010:1900] == 0.0)
    # 6 V less Coulomb friction is 1.6 rad/s at the wheel, 0.3 rad/s at the body
    turned = done.record["truth"][1500, 2] - done.record["truth"][0, 2]
    assert turned == pytest.approx(0.8 * 1.62 * 0.0508 / 0.2632, rel=0.05)
    assert done.record["state"][1500] == 2


def test_half_of_the_path_is_half_of_its_time_without_ramps() -> None:
    scenario = load_scenario("demo")
    values = {**scenario.parameter_values(), "TRJ_RAMP": 0.0}
    config = robot_config(values, scenario.robot.table, 0)
    assert path_ticks(config, 0.5) == pytest.approx(path_ticks(config, 1.0) / 2, abs=2)


def test_a_path_without_end_has_no_half() -> None:
    scenario = load_scenario("demo")
    config = robot_config({**scenario.parameter_values(), "TRJ_LAPS": 0.0}, scenario.robot.table, 0)
    with pytest.raises(CoreError, match="TRJ_LAPS"):
        path_ticks(config, 0.5)


def test_parameters_that_the_core_refuses_are_named() -> None:
    scenario = load_scenario("demo")
    with pytest.raises(CoreError, match="W1_ENC_DIR"):
        robot_config({**scenario.parameter_values(), "W1_ENC_DIR": 0.0}, scenario.robot.table, 0)


def test_run_folders_are_never_shared(tmp_path: Path) -> None:
    names = [new_run_folder(tmp_path / "runs", "demo-seed1").name for _ in range(3)]
    assert names == ["demo-seed1", "demo-seed1-2", "demo-seed1-3"]


@pytest.mark.full
@pytest.mark.parametrize("name", ["demo", "fault_battery_sag", "four_wheel"])
def test_a_stored_run_can_be_drawn_again(name: str, tmp_path: Path) -> None:
    done = run_in_process(short(name))
    summary = summarize(done)
    save_run(done, summary, tmp_path)
    stored, samples = load_run(tmp_path)
    assert stored == json.loads(json.dumps(summary))
    np.testing.assert_array_equal(samples, done.record[::10])
    draw_run(stored, samples, tmp_path / "run.png")
    header = (tmp_path / "run.png").read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert (int.from_bytes(header[16:20], "big"), int.from_bytes(header[20:24], "big")) == (WIDTH_PX, HEIGHT_PX)
