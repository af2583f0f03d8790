# SPDX-License-Identifier: MIT
"""A simulated robot in one line: what can be simulated, what can break, and that leaving ends all of it."""

from __future__ import annotations

import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import omniwheel
from hil_sim.scenario import load_scenario
from omni_schema import SchemaError
from omniwheel import sync
from omniwheel.errors import FirmwareEndedError, LinkUrlError, OmniError, RobotFileError, SetpointError
from omniwheel.ports import Port
from omniwheel.robots import read_robot
from tests.hil_sim.tiny_world import TinyWorld
from tests.waiting import LONGEST_S, pass_time

HEAVY = ("numpy", "pymavlink", "serial", "matplotlib", "hil_sim", "asyncio", "omniwheel._core")


@pytest.mark.full
def test_a_robot_is_a_name_a_file_or_a_description(robot_file: Path) -> None:
    for robot, wheels in (("four_wheel", 4), (robot_file, 3), (replace(read_robot("four_wheel"), name="mine"), 4)):
        with sync.simulate(robot, record=False) as simulated:
            assert simulated.parameters["WHEELS"] == wheels


@pytest.mark.full
def test_a_scenario_is_a_name_or_an_object() -> None:
    for scenario in ("no_fixes", load_scenario("no_fixes")):
        with sync.simulate(scenario=scenario, record=False) as robot:
            robot.sleep(0.5)
            assert robot.simulation.time_s > 0.4


@pytest.mark.full
def test_another_world_takes_the_place_of_ours() -> None:
    scenario = load_scenario("ideal", "fast_three_wheel").with_world({"fix_rate_Hz": 0.0})
    with sync.simulate(world=TinyWorld(scenario), scenario=scenario, record=False) as robot:
        robot.arm()
        robot.drive(0.2, 0.0, 0.0, duration=0.5)
        assert robot.simulation.true_pose.x > 0.05


def test_what_cannot_be_simulated_is_refused_before_anything_starts() -> None:
    with pytest.raises(SetpointError), sync.simulate(speed="fast"):
        pass
    with pytest.raises(RobotFileError), sync.simulate("five_wheel"):
        pass
    with pytest.raises(SchemaError), sync.simulate(scenario="nowhere"):
        pass


@pytest.mark.full
def test_faults_are_switched_on_and_mended() -> None:
    with sync.simulate(record=False) as robot:
        with pytest.raises(OmniError):
            robot.simulation.fault("meteorite")
        robot.simulation.fault("battery_sag", value=7.0)
        robot.sleep(2.0)
        assert robot.battery_V < 8.0
        robot.simulation.mend()
        robot.sleep(2.0)
        assert robot.battery_V > 11.0


@pytest.mark.full
def test_in_real_time_other_programs_may_connect_and_leaving_ends_all() -> None:
    before = set(threading.enumerate())
    with omniwheel.simulate(record=False) as robot:
        with sync.connect(robot.simulation.urls[0], record=False) as other:
            assert other.version == robot.version
        with pytest.raises(OmniError):
            robot.simulation.fault("meteorite")
        firmware = robot.simulation.firmware
        assert firmware.running
    assert not firmware.running
    assert set(threading.enumerate()) == before


@pytest.mark.full
def test_firmware_that_ends_is_the_error_of_the_block() -> None:
    def end_it() -> None:
        with sync.simulate(record=False) as robot:
            process = robot.simulation.firmware._process
            assert process is not None
            process.terminate()
            robot.sleep(5.0)

    with pytest.raises(FirmwareEndedError):
        end_it()


def test_importing_the_package_imports_nothing_heavy() -> None:
    program = f"import sys, omniwheel; print([name for name in {HEAVY} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("count", [0, 2])
def test_without_an_address_there_must_be_one_teensy(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [Port(f"/dev/ttyACM{number}", "", "teensy") for number in range(count)]
    monkeypatch.setattr("omniwheel.ports.serial_ports", lambda: [*ports, Port("/dev/ttyS7", "", "")])
    with pytest.raises(LinkUrlError) as caught:
        omniwheel.connect()
    for port in ports or [Port("/dev/ttyS7", "", "")]:
        assert port.device in str(caught.value)
    assert caught.value.hint


def test_without_an_address_the_only_teensy_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    with sync.simulate(record=False) as simulated:
        link = simulated.connection.link
        monkeypatch.setattr("omniwheel.ports.serial_ports", lambda: [Port("/dev/ttyACM7", "", "teensy")])
        opened: list[str] = []

        def open_shared(url: str, **_: object) -> object:
            opened.append(url)
            return link

        monkeypatch.setattr("omniwheel.robot.open_shared", open_shared)
        robot = sync.connect(clock=simulated.connection.clock, record=False)
        assert opened == ["/dev/ttyACM7"]
        assert robot.connection.target_system == simulated.connection.target_system


@pytest.mark.full
def test_the_run_holds_the_truth_over_time() -> None:
    with sync.simulate() as robot:
        robot.arm()
        robot.drive(0.3, 0.0, 0.4, duration=2.0)
        run = robot.run
    assert run.truth is not None
    assert run.truth_time_s is not None
    assert np.diff(run.truth_time_s) == pytest.approx(0.02)
    truth = np.column_stack([np.interp(run.time_s, run.truth_time_s, axis) for axis in run.truth.T])
    assert np.abs(truth[-1]).max() > 0.3
    assert np.abs(run.pose - truth)[:, :2].max() < 5e-3


class EndError(Exception):
    """Ends the other thread's sleep."""


def test_a_sleep_in_simulated_time_does_not_hold_up_another_thread() -> None:
    with omniwheel.simulate(speed="max", record=False) as robot:
        ended: list[type] = []

        def sleep() -> None:
            try:
                robot.sleep(1e6)
            except EndError as error:
                ended.append(type(error))

        sleeper = threading.Thread(target=sleep)
        sleeper.start()
        while robot.simulation.time_s < 2.0:
            pass_time()
        robot.arm()
        robot.velocity(0.1, 0.0, 0.0)
        robot.sleep(1.0)
        robot.disarm()
        robot.connection.raise_in_pump(EndError())
        sleeper.join(LONGEST_S)
        assert ended == [EndError]
