# SPDX-License-Identifier: MIT
"""A study's folder of which a file was cut off, lost or changed: good batches stay, for their own study only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hil_sim.scenario import Scenario
from hil_sim.studies.errors import StudyFolderError
from hil_sim.studies.folder import DEFINITION_FILE, DIGEST_FILE
from hil_sim.studies.montecarlo import Plan, open_study, run_study
from hil_sim.studies.pools import LocalPool

RUNS = 24


@pytest.fixture
def plan(quick: Scenario) -> Plan:
    return Plan(quick, RUNS, 5, 8, worst=1)


@pytest.fixture
def folder(plan: Plan, tmp_path: Path) -> Path:
    """A finished study."""
    with open_study(plan, tmp_path / "study", fresh=False) as study:
        run_study(plan, study, LocalPool(1))
    return tmp_path / "study"


def refusal(plan: Plan, folder: Path) -> StudyFolderError:
    before = (folder / "batches.bin").read_bytes()
    with pytest.raises(StudyFolderError) as caught:
        open_study(plan, folder, fresh=False)
    assert (folder / "batches.bin").read_bytes() == before
    return caught.value


DAMAGES: dict[str, Callable[[str], str]] = {
    "cut": lambda text: text[: len(text) // 2],
    "empty": lambda _: "",
    "nested": lambda _: "[" * 100_000,
    "no text": lambda _: "\x00" * 100,
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_definition_is_written_anew_by_its_own_study(
    plan: Plan, folder: Path, counting: Any, damage: Callable[[str], str]
) -> None:
    file = folder / DEFINITION_FILE
    whole = file.read_text()
    file.write_text(damage(whole))
    with open_study(plan, folder, fresh=False) as study:
        run_study(plan, study, counting)
    assert counting.asked == []
    assert file.read_text() == whole


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_another_study_does_not_use_the_batches_of_a_damaged_one(
    plan: Plan, folder: Path, damage: Callable[[str], str]
) -> None:
    other = replace(plan, scenario=plan.scenario.with_duration(0.4))
    (folder / DEFINITION_FILE).write_text(damage((folder / DEFINITION_FILE).read_text()))
    error = refusal(other, folder)
    assert "damaged" in str(error)
    assert "--fresh" not in error.hint
    assert "batches are kept" in error.hint


def test_a_lost_definition_is_damaged_too(plan: Plan, folder: Path, counting: Any) -> None:
    (folder / DEFINITION_FILE).unlink()
    refusal(replace(plan, scenario=plan.scenario.with_duration(0.4)), folder)
    with open_study(plan, folder, fresh=False) as study:
        run_study(plan, study, counting)
    assert counting.asked == []


def test_without_any_proof_whose_it_is_a_damaged_study_is_refused(plan: Plan, folder: Path) -> None:
    (folder / DEFINITION_FILE).write_text("")
    (folder / DIGEST_FILE).unlink()
    assert "copy its study.json" in refusal(plan, folder).hint


def test_batches_of_another_size_are_not_taken_for_torn_ones(plan: Plan, folder: Path) -> None:
    for name in (DEFINITION_FILE, DIGEST_FILE):
        (folder / name).unlink()
    for batch in (16, 32):
        assert "--batch 8" in refusal(replace(plan, batch_runs=batch), folder).hint
