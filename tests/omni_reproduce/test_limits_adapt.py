# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from omni_reproduce import limits, limits_adapt, limits_noise, limits_walk
from omni_reproduce.posterior_bound import Array


def test_a_row_has_a_cell_for_each_column(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Stand-ins for runs: the error is 2 - rate; the bound is 1 mm and 0.5 mrad."""

    def errors_of(_key: str, parameters: Mapping[str, float], seeds: int, wheels: str) -> Array:
        assert (seeds, wheels) == (2, "real")
        return np.full(2, 2.0 - parameters["EKF_ADAPT"])

    monkeypatch.setattr(limits_adapt, "errors_of", errors_of)
    monkeypatch.setattr(limits, "bound_and_informed_filter", lambda *_: (np.array([1.0, 0.5]), np.ones(2)))
    limits_adapt.main(["demo", "no_fixes", "--seeds", "2", "--wheels", "real"])
    head, _, demo, without = capsys.readouterr().out.splitlines()
    assert head == "| setting | preset `fixed_noise` | EKF_ADAPT = 0 | EKF_ADAPT = 0.05 | EKF_ADAPT = 0.2 |"
    assert demo.startswith(
        "| demo | 2.00 / 2.00 (2.00 / 4.00) | 2.00 / 2.00 (2.00 / 4.00) | 1.95 / 1.95 (1.95 / 3.90) |"
    )
    assert without.startswith("| no fixes | 2.00 / 2.00 | 2.00 / 2.00 | 1.95 / 1.95 |")


def test_the_rate_reaches_the_robot_and_outliers_the_world() -> None:
    """The same seed: another rate or other wheels, another error."""
    plain = limits_adapt.errors_of("fast", {}, 1)
    assert (limits_adapt.errors_of("fast", {"EKF_ADAPT": 0.1}, 1) != plain).all()
    assert (limits_adapt.errors_of("fast", {}, 1, "real") != plain).all()
    assert {fault.name for fault in limits_adapt.scenario_of("outliers", "ideal").faults} == {"pose_jump"}


def test_each_noise_parameter_has_a_cell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(limits, "bound_and_informed_filter", lambda *_: (np.array([1.0, 0.5]), np.ones(2)))
    monkeypatch.setattr(limits_noise, "over_bound", lambda *_: np.array([1.5, 1.25]))
    limits_noise.main(["demo", "--seeds", "2"])
    head, _, demo = capsys.readouterr().out.splitlines()
    assert head == f"| setting | as shipped | {' | '.join(limits_noise.PARAMETERS)} |"
    assert demo.count("1.50 / 1.25") == 1 + len(limits_noise.PARAMETERS)


@pytest.mark.parametrize("table", [limits_adapt, limits_noise, limits_walk])
@pytest.mark.parametrize(("arguments", "says"), [(["dema"], "demo"), (["demo", "--seeds", "0"], "1 or more")])
def test_wrong_arguments_are_refused(
    table: Any, arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as refused:
        table.main(arguments)
    assert refused.value.code == 2
    assert says in capsys.readouterr().err
