# SPDX-License-Identifier: MIT
"""Table 2: the published figures, the law that reaches the floor, and the reasons that stand between them."""

import copy
from pathlib import Path

import numpy as np
import pytest

from hil_sim.processes import worker_pool
from omni_reproduce import table2
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.loops import one_step_limit

SPEC = read_spec("table2")
PUBLISHED = np.array(SPEC["published"]["rmse"])


@pytest.mark.parametrize("seed", [101, 102])
def test_published_figures_come_out_within_nine_per_cent(seed: int) -> None:
    rmse = table2.drive(table2.Case(SPEC, "published", seed)).rmse
    np.testing.assert_allclose(rmse, PUBLISHED, rtol=0.09)


@pytest.mark.parametrize("seed", [101, 102])
def test_the_corrected_law_reaches_what_one_step_of_unknown_slip_allows(seed: int) -> None:
    run = table2.drive(table2.Case(SPEC, "corrected", seed))
    limit = one_step_limit(table2.world_of(SPEC, seed, np.zeros(3)), 0.02, 0.1, 0.1)
    np.testing.assert_allclose(run.rmse, limit, rtol=0.08)
    assert np.all(run.rmse <= [2e-4, 2e-4, 1e-3])
    assert run.smallest_margin > 0.0
    assert not run.limited.any()


@pytest.mark.full
def test_each_reason_accounts_for_its_error() -> None:
    rmse = {name: table2.drive(table2.Case(SPEC, name, 7)).rmse for name in SPEC["setting"]}
    assert rmse["feed_forward"][2] < 0.25 * rmse["published"][2]
    assert np.all(rmse["condition"][:2] < 0.6 * rmse["published"][:2])
    assert np.all(rmse["with_r"] > 5.0 * rmse["published"])


@pytest.mark.full
def test_turning_the_world_changes_nothing_but_the_axes() -> None:
    """The rose has a symmetry of 45 degrees: petals and slip statistics are the same, x and y come out alike."""
    rmse = np.mean([table2.drive(table2.Case(SPEC, "corrected", seed)).rmse for seed in range(1, 7)], axis=0)
    assert rmse[0] == pytest.approx(rmse[1], rel=0.05)


def test_less_slip_error_gives_less_error_in_proportion() -> None:
    half = copy.deepcopy(SPEC)
    half["experiment"]["slip_error"] = 0.05
    ratio = table2.drive(table2.Case(half, "corrected", 4)).rmse / table2.drive(table2.Case(SPEC, "corrected", 4)).rmse
    np.testing.assert_allclose(ratio, 0.5, atol=0.06)


@pytest.mark.full
def test_the_experiment_gives_rows_and_figure_10(tmp_path: Path) -> None:
    result = table2.run(Context(tmp_path, seeds=2))
    published = [row for row in result.rows if row.published is not None and "as published" in row.setting]
    assert [row.published for row in published] == list(PUBLISHED)
    assert all(row.seeds == 2 and row.sd is not None for row in published)
    assert [figure.name for figure in result.pictures] == ["fig10.png"]
    assert result.pictures[0].stat().st_size > 50_000
    with worker_pool(2) as pool:
        again = table2.run(Context(tmp_path, seeds=2, pool=pool))
    assert again.rows == result.rows
