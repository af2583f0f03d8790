# SPDX-License-Identifier: MIT
from importlib import import_module
from pathlib import Path

import pytest

from omni_reproduce import diagrams
from omni_reproduce.experiment import EXPERIMENTS_FOLDER, Context
from omni_reproduce.registry import DIAGRAMS, EXPERIMENTS, targets

FIGURES = 16


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda experiment: experiment.name)
def test_every_experiment_has_a_module_that_runs_it(experiment: object) -> None:
    module = getattr(experiment, "module", "")
    assert callable(import_module(f"omni_reproduce.{module}").run)


def test_every_file_of_settings_belongs_to_an_experiment() -> None:
    assert {path.stem for path in EXPERIMENTS_FOLDER.glob("*.toml")} <= {entry.name for entry in EXPERIMENTS}


def test_every_figure_and_table_of_the_report_has_an_answer() -> None:
    names = [f"fig{number}" for number in range(1, FIGURES + 1)] + [f"table{n}" for n in (1, 2, 3, 5, 7, 8, 9)]
    assert set(names) <= {*targets(), *DIAGRAMS}
    assert len(targets()) == len(set(targets()))


def test_the_block_diagrams_are_drawn(tmp_path: Path) -> None:
    result = diagrams.run(Context(tmp_path))
    assert [figure.name for figure in result.pictures] == ["fig9.png", "fig12.png"]
    assert all(figure.stat().st_size > 10_000 for figure in result.pictures)
