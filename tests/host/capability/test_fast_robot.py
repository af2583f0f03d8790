# SPDX-License-Identifier: MIT
"""The fast robot that comes with the project: its file is what its data sheet gives, and it is fast."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.summary import summarize
from omniwheel.datasheet import RobotAnswers, find_motor, write_designed_robot
from omniwheel.robots import read_robot


def test_its_numbers_are_those_of_the_command_in_its_first_lines(tmp_path: Path) -> None:
    answers = RobotAnswers(3, 0.096, 0.16, 4.0, find_motor("pololu_37d_30"))
    made = read_robot(write_designed_robot("made", answers, tmp_path)).parameter_values()
    shipped = read_robot("fast_three_wheel").parameter_values()
    assert {name: value for name, value in made.items() if shipped[name] != pytest.approx(value, rel=1e-3)} == {}


def test_it_drives_its_path_at_more_than_a_metre_per_second() -> None:
    run = run_in_process(load_scenario("fast"))
    assert run.done
    way = np.linalg.norm(np.diff(run.record["truth"][::20, :2], axis=0), axis=1)
    assert way.max() / 0.02 > 1.05
    summary = summarize(run)
    assert summary["faults"] == []
    assert summary["rmse"]["position_m"] < 0.005
