# SPDX-License-Identifier: MIT
"""Runs on a firmware that is somebody else's: it is given back disarmed and as it was, whatever ends the run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import omniwheel.robot
from hil_sim import hil
from hil_sim.hil import AfterRunError, run_hil
from hil_sim.scenario import Event, Scenario, load_scenario
from hil_sim.summary import summarize
from hil_sim.timeline import RunError
from omni.cli import app
from omniwheel import FirmwareProcess
from omniwheel.errors import CommandRefusedError, OmniError, OutsideLoopError
from omniwheel.robot import Robot

NAME = "ISMC_LAM_XY"
OWN = 7.0


@pytest.fixture
def quick(tmp_path: Path) -> Scenario:
    path = tmp_path / "quick.toml"
    path.write_text(
        '[scenario]\nname = "quick"\ndescription = "half a second"\nextends = "demo"\nduration_s = 0.5\n'
        '[[event]]\nat_s = 0.05\ncommand = "trajectory_start"\n[[event]]\nat_s = 0.05\ncommand = "arm"\n'
    )
    return load_scenario(str(path))


@pytest.fixture
def url() -> Iterator[str]:
    """A firmware in real time with a gain of its own."""
    with FirmwareProcess("three_wheel") as firmware:
        with omniwheel.robot.connect(firmware.urls[0]) as robot:
            robot.parameters[NAME] = OWN
        yield firmware.urls[0]


def given_back(url: str) -> bool:
    with omniwheel.robot.connect(url) as robot:
        beat = robot.status.heartbeat
        return beat is not None and not beat.armed and not beat.hil and robot.parameters[NAME] == OWN


def test_a_good_run_gives_the_robot_back(quick: Scenario, url: str) -> None:
    assert run_hil(quick, url).parameters[NAME] != OWN
    assert given_back(url)


def test_an_error_of_the_scenario_is_the_one_that_is_told_and_the_robot_is_disarmed(quick: Scenario, url: str) -> None:
    bad = replace(quick, events=(*quick.events, Event(at_s=0.3, settings={"WHEELS": 9.0})))
    with pytest.raises(OmniError) as caught:
        run_hil(bad, url)
    assert "WHEELS" in str(caught.value)
    assert given_back(url)


def test_an_interrupted_run_gives_the_robot_back(quick: Scenario, url: str) -> None:
    def interrupt(time_s: float, _: float | None) -> None:
        if time_s > 0.1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_hil(quick, url, progress=interrupt)
    assert given_back(url)


def test_a_firmware_in_lockstep_is_refused_before_the_run(quick: Scenario, tmp_path: Path) -> None:
    with FirmwareProcess("three_wheel", lockstep=True, parameters={NAME: OWN}) as firmware:
        words = ["run", quick.source, "--link", firmware.urls[0], "--out", str(tmp_path / "runs")]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 1
        assert "without --lockstep" in result.output
        assert not (tmp_path / "runs").exists()
        with omniwheel.robot.connect(firmware.urls[0]) as robot:
            assert robot.parameters[NAME] == OWN


@pytest.mark.full
def test_a_run_is_kept_if_the_robot_cannot_be_given_back(
    quick: Scenario, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    real = Robot.leave_hil

    def refuse_second(robot: Robot) -> None:
        calls.append(robot)
        if len(calls) > 1:
            raise CommandRefusedError("to leave host-in-the-loop", "DENIED", ["for a test"])
        real(robot)

    monkeypatch.setattr(Robot, "leave_hil", refuse_second)
    result = CliRunner().invoke(app, ["run", quick.source, "--link", url, "--out", str(tmp_path / "runs")])
    assert result.exit_code == 1
    assert "error after the end of the run" in result.output
    assert "position RMSE" in result.output
    stored = json.loads((tmp_path / "runs" / "quick-seed1" / "summary.json").read_text())
    assert stored["ticks"] == 601


def test_a_full_disk_in_a_run_disarms_and_says_so(
    quick: Scenario, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("omniwheel.growing_file.FLUSH_S", 0.0)
    monkeypatch.setattr("omniwheel.growing_file.os.write", fail)
    with pytest.raises(OmniError, match="No space left"):
        run_hil(quick, url, out_dir=tmp_path)
    monkeypatch.undo()
    assert given_back(url)
    assert not (tmp_path / "telemetry.tlog").exists()


def test_a_path_without_end_has_no_duration(quick: Scenario) -> None:
    endless = quick.with_parameters({"TRJ_LAPS": 0.0})
    plan = summarize(hil.run_hil(endless))["plan"]
    assert plan["duration_s"] is None
    assert plan["scale"] > 0.0
    bounded = summarize(hil.run_hil(quick))["plan"]
    assert bounded["duration_s"] > 0.0
    assert np.isfinite(bounded["duration_s"])


def test_errors_after_a_run_hold_it(quick: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("omniwheel.growing_file.os.fsync", fail)
    with pytest.raises(AfterRunError) as caught:
        run_hil(quick, out_dir=tmp_path)
    assert caught.value.run.ticks == 601
    assert isinstance(caught.value, RunError)


def test_a_robot_that_another_program_takes_out_of_the_loop_ends_the_run(quick: Scenario, tmp_path: Path) -> None:
    links = ["tcp:127.0.0.1:0", "tcp:127.0.0.1:0"]
    taken = False

    with FirmwareProcess("three_wheel", links=links) as firmware, omniwheel.robot.connect(firmware.urls[1]) as other:

        def take_out(now_s: float, end_s: float | None) -> None:
            nonlocal taken
            if not taken:
                taken = True
                other.leave_hil()

        with pytest.raises(OutsideLoopError, match="has left host-in-the-loop") as caught:
            run_hil(quick, firmware.urls[0], progress=take_out)
        assert "another program ended it" in caught.value.hint
