# SPDX-License-Identifier: MIT
from __future__ import annotations

import math
from typing import Any

import pytest

from hil_sim.faults import Fault
from omniwheel.bringup import Result, check_encoders
from tests.host.bringup.conftest import Bench, MakeBench


def failures(result: Result) -> dict[str, str]:
    return {finding.name: finding.advice for finding in result.findings if not finding.ok}


def check(bench: Bench) -> Result:
    return check_encoders(bench.robot, bench, begin_timeout_s=6.0)


@pytest.mark.full
@pytest.mark.parametrize("robot", ["three_wheel", "four_wheel"])
def test_good_encoders_pass_and_nothing_is_armed(make_bench: MakeBench, robot: str) -> None:
    bench = make_bench(robot=robot)
    result = check(bench)
    assert result.ok, failures(result)
    assert not bench.armed
    assert abs(result.measured["wheel_2_counts"][1]) == pytest.approx(10000, abs=100)


@pytest.mark.full
def test_exchanged_a_and_b_name_the_line_of_the_robot_file(make_bench: MakeBench) -> None:
    result = check(make_bench(faults=[Fault("encoder_reversed", 0.0, wheel=1)]))
    assert list(failures(result)) == ["encoder 2 direction"]
    assert "section [encoder]: direction = [1, -1, 1]" in result.advice[0]
    assert "W2_ENC_DIR=-1" in result.advice[0]


@pytest.mark.full
@pytest.mark.parametrize(("counts", "line"), [(2500, 2500), (40000, 40000), (20000, 20000), (8192, 8192)])
def test_other_counts_per_turn_are_told(make_bench: MakeBench, counts: int, line: int) -> None:
    def change(config: Any) -> None:
        config.counts_per_revolution = counts

    result = check(make_bench(change=change))
    assert set(failures(result)) == {f"encoder {wheel} revolution" for wheel in (1, 2, 3)}
    number = int(result.advice[0].split("counts_per_revolution = ")[1].split(":")[0].split(";")[0])
    assert number == pytest.approx(line, rel=0.01)


@pytest.mark.full
def test_a_stuck_encoder_sends_to_its_wires(make_bench: MakeBench) -> None:
    result = check(make_bench(faults=[Fault("encoder_stuck", 0.0, wheel=2)]))
    assert list(failures(result)) == ["encoder 3"]
    assert "A and B at the pins" in result.advice[0]


@pytest.mark.full
def test_exchanged_encoders_are_named_both(make_bench: MakeBench) -> None:
    bench = make_bench()
    turn = bench._turn
    bench._turn = lambda wheel: turn({0: 1, 1: 0, 2: 2}[wheel])  # type: ignore[method-assign]
    result = check(bench)
    assert set(failures(result)) == {"encoder 1", "encoder 2"}
    assert "encoders 1 and 2 are exchanged" in result.advice[0]


@pytest.mark.full
def test_a_hand_that_did_not_turn_a_whole_revolution_is_asked_again(bench: Bench) -> None:
    bench.hands[0] = 0.8 * 2 * math.pi
    result = check(bench)
    assert list(failures(result)) == ["encoder 1 revolution"]
    assert "else repeat the check" in result.advice[0]
