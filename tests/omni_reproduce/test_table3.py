# SPDX-License-Identifier: MIT
"""Table 3: the published figures, their reason, and what the project's law does on the same plant."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import lsq_linear

from omni_reproduce import table3
from omni_reproduce.experiment import Context, read_spec

SPEC = read_spec("table3")
PUBLISHED = np.array(SPEC["published"]["rmse"])


def rmse(setting: str, seed: int, spec: dict[str, Any] = SPEC) -> Any:
    return table3.measure(table3.Case(spec, setting, seed))[0]


@pytest.mark.full
@pytest.mark.parametrize("seed", [101, 102])
def test_published_figures_come_out_within_a_quarter(seed: int) -> None:
    ratio = rmse("published", seed) / PUBLISHED
    assert np.all(np.abs(ratio - 1.0) < 0.25)


@pytest.mark.full
def test_a_path_that_knows_the_limit_is_followed_far_below_a_fifth_of_the_published_error() -> None:
    run = table3.drive(table3.Case(SPEC, "ours_slowed", 101))
    assert np.all(run.rmse < PUBLISHED / 50.0)
    assert run.limited.mean() < 0.02


def test_position_first_follows_the_same_path_to_a_fifth_in_position() -> None:
    x, y, theta = rmse("position_first", 101)
    assert x < PUBLISHED[0] / 5.0
    assert y < PUBLISHED[1] / 5.0
    assert theta > table3.turning_limit_rad(SPEC)


@pytest.mark.full
def test_the_reason_is_the_voltage() -> None:
    published = rmse("published", 103)
    assert np.all(rmse("supply", 103) < 0.5 * published)
    assert np.all(rmse("ours_supply", 103) < [1e-4, 1e-4, 5e-4])


def test_p_alone_is_unstable_at_its_tick() -> None:
    robot, head = SPEC["robot"], SPEC["experiment"]
    j, b, k = robot["motor_inertia_kg_m2"], robot["motor_viscous_N_m_s"], robot["motor_constant_N_m_A"]
    r, el = robot["motor_resistance_ohm"], robot["motor_inductance_H"]
    block = np.zeros((3, 3))
    block[:2] = [[-b / j, k / j, 0.0], [-k / el, -r / el, 1.0 / el]]
    step = expm(block * head["motor_step_s"])
    for name, stable in (("published", False), ("ours", True)):
        closed = step[:2, :2] - SPEC["motor"][name]["kp"] * np.outer(step[:2, 2], [1.0, 0.0])
        assert bool(np.abs(np.linalg.eigvals(closed)).max() < 1.0) is stable


@pytest.mark.full
def test_the_turning_limit_is_the_best_of_all_signals_with_that_slope() -> None:
    """The same bound by bounded least squares over the slopes of one period."""
    samples, path, robot = 200, SPEC["path"], SPEC["robot"]
    slope = table3.top_speed_rad_s(SPEC) * robot["wheel_radius_m"] / robot["wheel_distance_m"]
    wanted = path["rotation_amplitude_rad"] * np.sin(2.0 * np.pi * np.arange(samples) / samples)
    build = np.hstack([np.tril(np.ones((samples, samples)), -1) / samples, np.ones((samples, 1))])
    closed = 1e3 * np.hstack([np.ones(samples), 0.0]) / samples  # ends where it began
    bound = np.append(np.full(samples, slope), 10.0)
    best = lsq_linear(np.vstack([build, closed]), np.append(wanted, 0.0), (-bound, bound))
    reached = np.sqrt(np.mean((build @ best.x - wanted) ** 2))
    assert table3.turning_limit_rad(SPEC) == pytest.approx(reached, rel=0.01)
    slow = copy.deepcopy(SPEC)
    slow["path"]["rotation_cycles"] = 3.0
    assert table3.turning_limit_rad(slow) == 0.0


@pytest.mark.full
def test_the_experiment_gives_rows_and_figure_11(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short = copy.deepcopy(SPEC)
    short["setting"] = {name: SPEC["setting"][name] for name in ("published", "position_first")}
    short["experiment"]["drawn"] = list(short["setting"])
    monkeypatch.setattr(table3, "read_spec", lambda name: short)
    result = table3.run(Context(tmp_path, seeds=1))
    first = [row for row in result.rows if row.published is not None][:3]
    assert [row.published for row in first] == list(PUBLISHED)
    assert all(row.ours is not None and np.isfinite(row.ours) for row in result.rows)
    assert result.pictures[0].name == "fig11.png"
    assert result.pictures[0].is_file()
