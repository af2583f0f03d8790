# SPDX-License-Identifier: MIT
"""The bring-up step on the stop button: somebody presses it in the simulated world, or does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.faults import Fault
from omniwheel.bringup import check_stop_button
from omniwheel.bringup.person import NotReadyError
from omniwheel.bringup.sequence import bring_up
from omniwheel.robots import read_robot
from tests.host.bringup.conftest import Bench, MakeBench
from tests.host.bringup.test_stops import failures


def at_rest_and_disarmed(bench: Bench) -> bool:
    bench.robot.pump(1.0)
    still = float(np.abs(bench.world.wheel_rad_s).max()) < 1e-2
    return still and not bench.armed and bench.robot.status.state == "disarmed"


def test_a_button_that_is_pressed_and_let_go_passes(bench: Bench) -> None:
    bench.presses = True
    result = check_stop_button(bench.robot, bench)
    assert result.ok, failures(result)
    assert [finding.name for finding in result.findings] == ["press", "held", "latch", "release"]
    assert result.measured["rest_s"] < 0.3
    assert at_rest_and_disarmed(bench)
    bench.robot.arm()  # nothing is left over


def test_a_button_that_nobody_hears_of_fails_and_the_wheels_are_stopped(bench: Bench) -> None:
    result = check_stop_button(bench.robot, bench, wait_s=3.0)
    assert list(failures(result)) == ["press"]
    assert "normally closed" in result.advice[0]
    assert at_rest_and_disarmed(bench)


def test_an_open_contact_is_noticed_before_anything_moves(make_bench: MakeBench) -> None:
    """A normally-open button, or no button at the pin."""
    bench = make_bench(faults=[Fault("stop_button", 0.0)])
    bench.robot.pump(0.1)
    result = check_stop_button(bench.robot, bench)
    assert list(failures(result)) == ["at rest"]
    assert bench.robot.status.state == "estop"
    assert not bench.armed


def test_a_button_that_is_let_go_too_early_is_told(make_bench: MakeBench) -> None:
    bench = make_bench(faults=[Fault("stop_button", 2.5, 2.6)])
    result = check_stop_button(bench.robot, bench, wait_s=5.0)
    assert list(failures(result)) == ["held"]
    assert "keep it pressed" in result.advice[0]
    assert at_rest_and_disarmed(bench)


def test_a_robot_file_without_the_pin_passes_with_a_word_and_moves_nothing(bench: Bench) -> None:
    result = check_stop_button(bench.robot, bench, file=read_robot("three_wheel"))
    assert result.ok
    assert "no stop_button_pin" in result.findings[0].seen
    assert bench.questions == []


def test_nobody_agrees_nothing_moves(bench: Bench) -> None:
    bench.agrees = False
    with pytest.raises(NotReadyError):
        check_stop_button(bench.robot, bench)
    assert not bench.armed


@pytest.mark.full
@pytest.mark.parametrize("wired", [True, False])
def test_the_walk_presses_it_only_where_the_file_has_one(make_bench: MakeBench, wired: bool) -> None:
    bench = make_bench()
    bench.presses = True
    file = read_robot("three_wheel")
    file = replace(file, board=replace(file.board, stop_button_pin=10 if wired else None))
    seen = [result.check for result in bring_up(bench.robot, bench, file=file, keep_going=True)]
    assert ("button" in seen) == wired
