# SPDX-License-Identifier: MIT
"""Table 1: the published figures, their reason, and the deadband compensated."""

import copy
from pathlib import Path

import numpy as np
import pytest

from omni_reproduce import table1
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.loops import make_world

SPEC = read_spec("table1")
SEEDS = range(201, 211)


def final_cm(controller: str, compensation: float = 0.0, spec: dict = SPEC) -> np.ndarray:  # type: ignore[type-arg]
    cases = [table1.Case(spec, controller, compensation, seed) for seed in SEEDS]
    return 100.0 * np.array([table1.measure(case)[-1] for case in cases])


@pytest.mark.parametrize("controller", list(SPEC["published"]))
def test_each_controller_ends_inside_the_published_deviation(controller: str) -> None:
    mean, sd = SPEC["published"][controller]
    assert abs(final_cm(controller).mean() - mean) < sd


@pytest.mark.full
@pytest.mark.parametrize("controller", list(SPEC["published"]))
def test_compensated_every_try_ends_within_a_centimetre(controller: str) -> None:
    assert final_cm(controller, 1.0).max() < 1.0


@pytest.mark.full
def test_without_a_deadband_there_is_nothing_to_explain() -> None:
    spec = copy.deepcopy(SPEC)
    spec["robot"]["dead_pwm"] = 0
    assert final_cm("P", spec=spec).max() < 0.5


@pytest.mark.full
def test_the_error_is_the_deadband_over_the_gain() -> None:
    weak = copy.deepcopy(SPEC)
    weak["controller"]["P"]["kp"] = 0.5 * SPEC["controller"]["P"]["kp"]
    assert final_cm("P", spec=weak).mean() == pytest.approx(2.0 * final_cm("P").mean(), rel=0.15)
    radius = 100.0 * table1.stop_radius_m(SPEC, "P", 0.0)
    assert radius == pytest.approx(100.0 * 20.0 * 60 / 255 * 0.03275 / 1.75)
    assert np.all(final_cm("P") < 1.05 * np.sqrt(2.0) * radius)


@pytest.mark.full
def test_an_integral_without_limit_swings_the_robot() -> None:
    spec_name = "PID as printed (38), no limit"
    assert final_cm(spec_name).mean() > 2.0 * final_cm("PID").mean()


def test_the_motor_has_the_deadband_full_speed_and_lag_it_says() -> None:
    robot = SPEC["robot"]
    world = make_world(
        {**table1.motor_fields(robot), "wheel_radius_m": 0.03275, "wheel_distance_m": 0.195},
        "kinematic+motors",
        1,
        (0.0, 0.0, 0.0),
    )
    world.drive_voltage([robot["supply_V"]] * 4)
    world.step(80)
    assert world.wheel_rad_s == pytest.approx([20.0 * (1.0 - np.exp(-1.0))] * 4, rel=0.03)
    world.step(1500)
    assert world.wheel_rad_s == pytest.approx([20.0] * 4, rel=0.01)
    world.drive_voltage([0.9 * table1.dead_voltage_V(robot)] * 4)
    world.step(2000)
    assert np.abs(world.wheel_rad_s).max() < 0.05


def test_tries_begin_one_to_three_metres_away() -> None:
    starts = np.array([table1.start_pose(SPEC, seed) for seed in range(400)])
    distance = np.hypot(starts[:, 0], starts[:, 1])
    assert 1.0 <= distance.min() < 1.1
    assert 2.9 < distance.max() <= 3.0
    assert np.abs(starts.mean(axis=0)).max() < 0.3


@pytest.mark.full
def test_the_experiment_gives_rows_groups_and_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short = copy.deepcopy(SPEC)
    short["experiment"]["duration_s"] = 6.0
    monkeypatch.setattr(table1, "read_spec", lambda name: short)
    result = table1.run(Context(tmp_path, seeds=5))
    published = [row for row in result.rows if row.published_sd is not None and "as it is" in row.setting]
    assert [row.published for row in published] == [10.0, 4.0, 3.0]
    shares = [row for row in result.rows if row.quantity.startswith("means of 5")]
    assert [row.seeds for row in shares] == [1, 1, 1]
    assert result.pictures[0].is_file()
    few = table1.run(Context(tmp_path, seeds=2))
    assert not [row for row in few.rows if row.quantity.startswith("means of 5")]
