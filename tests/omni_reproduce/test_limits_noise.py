# SPDX-License-Identifier: MIT
from __future__ import annotations

import numpy as np
import pytest

from omni_reproduce import limits, limits_noise
from omni_reproduce.posterior_bound import Array


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, float]]:
    """Stand-ins for runs: the error is least with EKF_Q_TH halved. Returns what was changed in each run."""
    changes: list[dict[str, float]] = []

    def over_bound(_key: str, changed: dict[str, float], _bound: Array, _seeds: int, _wheels: str) -> Array:
        changes.append(changed)
        factor = changed.get("EKF_Q_TH", 1.0)
        return np.array([1.5, 1.0 + abs(factor - 0.5)])

    monkeypatch.setattr(limits_noise, "over_bound", over_bound)
    monkeypatch.setattr(limits, "bound_and_informed_filter", lambda *_: (np.ones(2), np.ones(2)))
    return changes


def test_each_parameter_is_changed_alone_and_the_best_factor_is_told(
    asked: list[dict[str, float]], capsys: pytest.CaptureFixture[str]
) -> None:
    limits_noise.main(["demo", "--seeds", "2"])
    row = capsys.readouterr().out.splitlines()[-1]
    same = "1.50 / 1.50 (x 1)"
    assert row == f"| demo | 1.50 / 1.50 | {same} | 1.50 / 1.00 (x 0.5) | {same} | {same} |"
    assert asked[0] == {}
    assert [list(changed) for changed in asked[1:]] == [[name] for name in limits_noise.PARAMETERS for _ in range(4)]


def test_a_parameter_is_multiplied_in_the_robot() -> None:
    """The same seed, another filter: another error."""
    bound = np.ones(2)
    shipped = limits_noise.over_bound("fast", {}, bound, 1)
    assert (limits_noise.over_bound("fast", {"EKF_Q_TH": 1.0}, bound, 1) == shipped).all()
    assert (limits_noise.over_bound("fast", {"EKF_Q_TH": 4.0}, bound, 1) != shipped).all()
