# SPDX-License-Identifier: MIT
from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.record import sample_dtype


def record(rows: int) -> NDArray[Any]:
    """Samples of an armed robot on its path, one a millisecond, everything else zero."""
    samples = np.zeros(rows, dtype=sample_dtype())
    samples["time_s"] = np.arange(rows) * 1e-3
    samples["state"], samples["phase"] = metrics.STATE_ARMED, metrics.PHASE_PATH
    samples["wheel_scale"] = samples["duty_scale"] = 1.0
    return samples


def test_rmse_of_known_errors() -> None:
    samples = record(2)
    samples["truth"] = [[0.003, 0.0, 0.01], [-0.003, 0.004, -0.01]]
    found = metrics.tracking_rmse(samples)
    assert found.x_m == pytest.approx(0.003)
    assert found.y_m == pytest.approx(0.004 / math.sqrt(2))
    assert found.theta_rad == pytest.approx(0.01)
    assert found.position_m == pytest.approx(math.hypot(found.x_m, found.y_m))


def test_heading_errors_are_compared_across_whole_turns() -> None:
    samples = record(1)
    samples["truth"][:, 2], samples["reference"][:, 2] = 4 * math.pi + 0.01, -0.01
    assert metrics.tracking_rmse(samples).theta_rad == pytest.approx(0.02)


def test_only_the_driven_path_counts() -> None:
    samples = record(4)
    samples["truth"][:, 0] = [0.001, 5.0, 5.0, 0.001]
    samples["phase"][1] = metrics.PHASE_DONE
    samples["state"][2] = 3
    assert metrics.tracking_rmse(samples).x_m == pytest.approx(0.001)


def test_before_and_after_share_no_sample() -> None:
    samples = record(4)
    samples["truth"][:, 1] = [0.001, 0.001, 0.002, 0.002]
    assert metrics.tracking_rmse(samples, stop_s=0.002).y_m == pytest.approx(0.001)
    assert metrics.tracking_rmse(samples, start_s=0.002).y_m == pytest.approx(0.002)


def test_a_run_without_a_path_has_no_numbers() -> None:
    samples = record(3)
    samples["phase"] = 0
    assert math.isnan(metrics.tracking_rmse(samples).position_m)
    assert math.isnan(metrics.effort(samples, 3).chatter)


def test_effort_looks_at_the_robot_s_wheels_only() -> None:
    samples = record(4)
    samples["wheel_rad_s"] = [-2.5, 1.0, 0.0, 99.0]
    samples["duty"] = [[0.5, 0.5, 0.5, 9.0], [-0.5, -0.5, -0.5, 9.0]] * 2
    samples["wheel_scale"][0] = 0.9
    found = metrics.effort(samples, 3)
    assert (found.peak_wheel_rad_s, found.peak_duty) == (2.5, 0.5)
    assert found.saturated_share == 0.25
    assert found.chatter == pytest.approx(2.0)


def test_steady_duties_do_not_chatter() -> None:
    samples = record(5)
    samples["duty"] = 0.3
    assert metrics.effort(samples, 3).chatter == 0.0


def test_spread_gives_mean_and_sample_standard_deviation() -> None:
    found = metrics.spread([{"a": 1.0}, {"a": 2.0}, {"a": 6.0}])
    assert found["a"]["mean"] == pytest.approx(3.0)
    assert found["a"]["sd"] == pytest.approx(np.std([1, 2, 6], ddof=1))
    assert metrics.spread([{"a": 1.0}])["a"]["sd"] == 0.0
