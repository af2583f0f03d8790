# SPDX-License-Identifier: MIT
"""What an experiment gets and gives: context, rows, result; and where its settings are read from."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from omni_schema.toml_file import read_toml

Item = TypeVar("Item")
Answer = TypeVar("Answer")

EXPERIMENTS_FOLDER = Path(__file__).parent / "experiments"


@dataclass(frozen=True)
class Row:
    """One figure of one experiment, beside the published one.

    ``ours`` is the mean over ``seeds`` seeds (0: nothing random) and ``sd`` their standard deviation, in ``unit``;
    ``limit`` is the theoretical bound where there is one; ``explanation`` says what explains a difference.
    """

    experiment: str
    setting: str
    quantity: str
    unit: str
    ours: float | None
    sd: float | None = None
    seeds: int = 0
    published: float | None = None
    published_sd: float | None = None
    limit: float | None = None
    explanation: str = ""


@dataclass(frozen=True)
class Result:
    """What an experiment leaves: rows, pictures below the context's folder, and paragraphs of Markdown."""

    rows: tuple[Row, ...]
    figures: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()


def _ignore(share: float) -> None:
    pass


@dataclass(frozen=True)
class Context:
    """What an experiment is told: where pictures go, how thorough to be, and whom to tell how far it is (0..1)."""

    folder: Path
    quick: bool = False
    seeds: int | None = None
    workers: int = field(default_factory=lambda: os.cpu_count() or 1)
    progress: Callable[[float], None] = _ignore

    def count(self, full: int, quick: int) -> int:
        """Return the number of seeds: what the user asked for, else that of a full or a quick run."""
        return self.seeds if self.seeds is not None else (quick if self.quick else full)

    def map(self, function: Callable[[Item], Answer], items: Iterable[Item]) -> list[Answer]:
        """Return ``function`` of each item, in their order, computed by several processes.

        ``function`` and the items must be picklable; results must not depend on the process they are computed in.
        """
        work = list(items)
        answers: list[Answer] = []
        if self.workers == 1 or len(work) < 2:
            for item in work:
                answers.append(function(item))
                self.progress(len(answers) / len(work))
            return answers
        with ProcessPoolExecutor(min(self.workers, len(work)), mp_context=get_context("spawn")) as pool:
            for answer in pool.map(function, work, chunksize=max(1, len(work) // (8 * self.workers))):
                answers.append(answer)
                self.progress(len(answers) / len(work))
        return answers


def read_spec(name: str) -> dict[str, Any]:
    """Return the settings of an experiment: seeds, parameter sets and published figures."""
    return read_toml(EXPERIMENTS_FOLDER / f"{name}.toml")
