# SPDX-License-Identifier: MIT
"""The shipped pose filter on runs of real robots, beside the plain sum of their counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from omniwheel.replay import Fixes, replay
from tests.host.logs import optiodom


def worst(found: optiodom.Array, true: optiodom.Array) -> tuple[float, float]:
    """Largest error of position [m] and heading [rad]."""
    off = np.abs(found - true)
    return float(np.max(np.hypot(off[:, 0], off[:, 1]))), float(np.max(off[:, 2]))


@pytest.mark.parametrize("name", ["080920201911_run-01", "231220200510_run-02", "080920201205_run-03"])
def test_four_real_wheels_without_fixes_are_no_worse_than_the_plain_sum(
    tmp_path: Path, real_runs: Path, name: str
) -> None:
    """Slip ratios from the null direction made these three worse: 0.58 m for 0.18, 0.36 for 0.11, 0.26 for 0.24."""
    (path,) = real_runs.glob(f"omni4/*/*/{name}.csv")
    run, robot = optiodom.read_run(path), optiodom.documented_robot(path, tmp_path)
    assert robot.parameter_values()["EKF_MODE"] == 2.0
    true = optiodom.from_its_start(run.pose)
    found, plain = (
        worst(pose, true) for pose in (replay(run.log, robot).pose, optiodom.plain_sum(run, robot, start=np.zeros(3)))
    )
    assert found[0] <= 1.05 * plain[0]
    assert found[1] <= 1.05 * plain[1]


@pytest.mark.parametrize(("rate_Hz", "name"), [(0.5, "221220202228_run-04"), (1.0, "221220202235_run-05")])
def test_real_wheels_get_better_by_fixes_however_rare(
    tmp_path: Path, real_runs: Path, rate_Hz: float, name: str
) -> None:
    """Of the position alone. The gate used to refuse most of them, and the pose got worse than without any."""
    (path,) = real_runs.glob(f"omni3/*/*/{name}.csv")
    run, robot = optiodom.read_run(path), optiodom.documented_robot(path, tmp_path)
    true = optiodom.from_its_start(run.pose)
    rows = np.arange(1, len(true), round(1.0 / (rate_Hz * run.log.period_s)))
    found = replay(run.log, robot, fixes=Fixes(run.log.time_s[rows], true[rows, :2]))
    assert found.refused <= 0.01 * len(rows)
    rms = [float(np.sqrt(np.mean((pose - true)[:, :2] ** 2))) for pose in (replay(run.log, robot).pose, found.pose)]
    assert rms[1] < 0.5 * rms[0]
