# SPDX-License-Identifier: MIT
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim import metrics
from omni_reproduce import controllers
from omni_reproduce.experiment import Context, read_spec

SPEC = read_spec("controllers")
ROOT = Path(__file__).resolve().parents[2]


def case(robot: str, controller: str, path: str) -> controllers.Case:
    settings = {**SPEC["controller"][controller], **SPEC["path"][path]}
    return controllers.Case(robot, controller, path, settings, SPEC["experiment"]["scenario"], seed=2)


@pytest.mark.full
@pytest.mark.parametrize("robot", SPEC["experiment"]["robots"])
@pytest.mark.parametrize("controller", list(SPEC["controller"]))
def test_every_controller_drives_every_robot_stably(robot: str, controller: str) -> None:
    for path in ("line", "circle"):
        found = controllers.measure(case(robot, controller, path))
        assert found["completed"] == 1.0
        assert found["position_m"] < 0.02
        assert found["theta_rad"] < 0.03


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 3, 4, 5])
def test_references_of_wheels_that_chatter_are_no_overspeed(seed: int) -> None:
    """They are low in half of the ticks: seen twice a comparison, four of five seeds were stopped by chance."""
    chattering = replace(case("four_wheel", "ISMC, sign", "line"), seed=seed)
    assert controllers.measure(chattering)["completed"] == 1.0


def test_a_run_without_an_end_counts_from_when_it_has_settled() -> None:
    found = controllers.measure(case("three_wheel", "P", "hold"))
    assert found["completed"] == 1.0
    assert 0.0 < found["position_m"] < 0.005


@pytest.mark.full
def test_rows_are_means_over_paths_and_the_picture_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(case: controllers.Case) -> dict[str, float]:
        value = 0.001 * (1 + list(SPEC["path"]).index(case.path)) + 1e-4 * case.seed
        keys = (*metrics.as_dict(metrics.Rmse(0.0, 0.0, 0.0, 0.0)), "estimate_m", "estimate_rad")
        return dict.fromkeys((*keys, "rms_duty", "saturated_share", "chatter", "completed"), value)

    assert {SPEC["path"][path].get("TRJ_PETALS") for path in SPEC["path"]} >= {3, 4, 5, 6, 7, 8}
    monkeypatch.setattr(controllers, "measure", fake)
    result = controllers.run(Context(tmp_path, seeds=2))
    paths = len(SPEC["path"])
    row = next(row for row in result.rows if row.quantity == "position RMSE")
    assert row.ours == pytest.approx((paths + 1) / 2 + 0.15)
    assert row.sd == pytest.approx(0.1 / 2**0.5)
    assert row.seeds == 2
    assert all(row.limit is None for row in result.rows)
    assert all(figure.is_file() for figure in result.pictures)


@pytest.mark.parametrize(("estimate", "says"), [(0.51, True), (0.49, False)])
def test_tracking_better_than_the_estimate_says_that_the_estimate_is_not_the_best(estimate: float, says: bool) -> None:
    """The reference is known, too: if it lies closer to the truth, it is the better estimate of the two."""
    text = controllers._about_estimate(np.array([estimate]), np.array([0.50]))
    assert ("not the best" in text) is says


def test_on_the_kept_page_every_estimate_is_better_than_the_reference() -> None:
    page = (ROOT / "docs/report/results.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| (.+?) \| (position RMSE.*?) \| mm \| ([\d.]+)", page, re.MULTILINE)
    rmse = {(setting, quantity): float(value) for setting, quantity, value in found}
    tracked = {setting: value for (setting, quantity), value in rmse.items() if quantity == "position RMSE"}
    assert len(tracked) == 8
    assert all(rmse[setting, "position RMSE of the estimate"] < value for setting, value in tracked.items())
