# SPDX-License-Identifier: MIT
"""Runs on the emulated processor give what the firmware on this computer gives, byte for byte."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from hil_sim.faults import KINDS
from hil_sim.hil import run_hil
from hil_sim.pins import PinsLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from hil_sim.sitl import start_sitl
from hil_sim.soak import ICOUNT_SHIFT, run_soak
from omniwheel.bringup.other_stops import safety_of
from omniwheel.connection import Connection
from omniwheel.emulated_firmware import EmulatedFirmware
from omniwheel.errors import CommandRefusedError, StoppedError
from omniwheel.robot import Robot, connect
from omniwheel.telemetry import LocalPosition
from tests.arm import need_emulated_firmware
from tests.firmware.client import connect as connect_client
from tests.firmware.client import firmware, mav, on_board


@pytest.fixture(scope="module", autouse=True)
def _emulator() -> None:
    need_emulated_firmware()


def actuators(board: str, links: tuple[str, ...], ticks: int) -> list[bytes]:
    """Arm, drive a path, change a gain; return all of each OMNI_HIL_ACTUATORS."""
    with on_board(board), firmware("--lockstep", links=links) as running:
        robot = connect_client(running, len(links) - 1)
        robot.armed()
        robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 3, -1)
        answers = [bytes(tick.actuators.get_payload()) for tick in robot.ticks(ticks)]
        robot.set("ISMC_LAM_XY", 7.0)
        answers += [bytes(tick.actuators.get_payload()) for tick in robot.ticks(ticks)]
        robot.socket.close()
        return answers


def test_every_answer_is_the_same_on_both_processors_and_over_both_kinds_of_link() -> None:
    expected = actuators("pc", ("tcp:127.0.0.1:0",), 200)
    assert len(set(expected)) == 400
    assert actuators("emulated", ("tcp:127.0.0.1:0",), 200) == expected
    assert actuators("emulated", ("tcp:127.0.0.1:0", "tcp:127.0.0.1:0"), 200) == expected


def test_a_driven_scenario_leaves_the_same_log_and_the_same_path(tmp_path: Path) -> None:
    scenario = load_scenario("fault_pose_loss")
    logs, records = [], []
    for emulated in (False, True):
        folder = tmp_path / str(emulated)
        folder.mkdir()
        records.append(run_hil(scenario, out_dir=folder, emulated=emulated).record)
        logs.append((folder / "telemetry.tlog").read_bytes())
    assert len(records[0]) > 5000
    assert np.array_equal(records[0], records[1])
    assert logs[0] == logs[1]


def test_others_talk_to_it_while_a_world_drives_its_ticks() -> None:
    scenario = load_scenario("sitl")
    with start_sitl(scenario, ["tcp:127.0.0.1:0"], emulated=True, realtime_factor=0.0) as running:
        done = threading.Event()

        def go_on() -> None:
            while not done.is_set():
                running.advance()

        world = threading.Thread(target=go_on)
        world.start()
        try:
            with connect(running.urls[0]) as robot:
                assert robot.wait_for(LocalPosition, 60.0).time_s > 0.0
                assert robot.parameters.read("WHEELS") == 3.0
        finally:
            done.set()
            world.join()


def test_a_soak_on_its_own_timing_misses_no_tick_and_keeps_the_time() -> None:
    result = run_soak(load_scenario("demo"), 20.0 / 60.0)
    assert result.failures == ()
    assert result.simulated_s >= 20.0
    assert result.overruns == 0
    assert abs(result.drift_us) <= 100.0
    assert result.distance_m > 1.0


def test_the_stop_button_at_the_boards_pin_stops_within_two_ticks() -> None:
    """By the board's own interrupt, with the world at its pins; the motors' power is what the world gets of it."""
    scenario = load_scenario("stand")
    world = new_world(scenario)
    enabled: list[tuple[int, bool]] = []

    def on_tick(_: int) -> None:
        enabled.append((int(world.c.time_us), not world.c.chip.output_enable_high))

    values = scenario.parameter_values()
    with EmulatedFirmware(parameters=values, pins=True, icount_shift=ICOUNT_SHIFT) as running:
        link = PinsLink(running.open_pins(), world, on_tick)
        connection = Connection(link, clock=link.clock_s)
        connection.target_system, connection.target_component = int(values["SYS_ID"]), 1
        robot = Robot(connection, table=scenario.robot.table)
        robot.pump(2.0)
        robot.arm()
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.5), 0.3)
        assert enabled[-1][1]
        fault, world.c.config.fault_count = world.c.config.fault[0], 1
        fault.kind, fault.start_s, fault.stop_s = KINDS["stop_button"], world.c.time_us * 1e-6 + 0.05, 1e6
        with pytest.raises(StoppedError):
            robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.5), 0.3)
        on = [time_us for time_us, is_on in enabled if is_on]
        assert on[-1] - fault.start_s * 1e6 <= 2000, "the world hears of a tick in the next one"
        with pytest.raises(CommandRefusedError, match="stop button is still open"):
            robot.estop_clear()
        world.c.config.fault_count = 0
        robot.pump(0.1)
        assert safety_of(robot).state == "estop"
        robot.estop_clear()
        robot.pump(0.1)
        assert safety_of(robot).state == "disarmed"
