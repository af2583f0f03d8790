# SPDX-License-Identifier: MIT
"""A scenario of half a second that drives, and pools that can be made to fail."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from hil_sim.scenario import Scenario, load_scenario
from hil_sim.studies.plan import Batch
from hil_sim.studies.pools import Done, LocalPool
from tests.quick_scenario import QUICK


class InterruptedPool(LocalPool):
    """Is interrupted, as by Ctrl-C, after a number of batches."""

    def __init__(self, after: int) -> None:
        super().__init__(2)
        self.after = after

    def results(self, batches: Iterable[Batch]) -> Iterator[Done]:
        for number, done in enumerate(super().results(batches)):
            if number == self.after:
                raise KeyboardInterrupt
            yield done


class CountingPool(LocalPool):
    """Says what it was asked to do."""

    def __init__(self) -> None:
        super().__init__(1)
        self.asked: list[Batch] = []

    def results(self, batches: Iterable[Batch]) -> Iterator[Done]:
        for done in super().results(batches):
            self.asked.append(done.batch)
            yield done


@pytest.fixture
def quick_file(tmp_path: Path) -> Path:
    path = tmp_path / "quick.toml"
    path.write_text(QUICK)
    return path


@pytest.fixture
def quick(quick_file: Path) -> Scenario:
    return load_scenario(quick_file)


@pytest.fixture
def interrupted_after() -> type[InterruptedPool]:
    return InterruptedPool


@pytest.fixture
def counting() -> CountingPool:
    return CountingPool()
