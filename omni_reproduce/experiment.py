# SPDX-License-Identifier: MIT
"""What an experiment gets and gives: context, rows, result; and where its settings are read from."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from hil_sim.processes import usable_processors
from omni_schema.toml_file import read_toml

Item = TypeVar("Item")
Answer = TypeVar("Answer")

CHUNKS = 16
"""How many parts a map is cut into, so that no process is left with a long rest."""

EXPERIMENTS_FOLDER = Path(__file__).parent / "experiments"


@dataclass(frozen=True)
class Row:
    """One figure of one experiment, beside the published one.

    ``ours`` is the mean over ``seeds`` seeds (0: nothing random) and ``sd`` their standard deviation, in ``unit``.
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
    """What an experiment leaves: rows, pictures below the context's folder, and paragraphs of Markdown.

    ``incomplete`` says which of the measured data were missing; empty where all were there.
    """

    rows: tuple[Row, ...]
    pictures: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    incomplete: str = ""


def _ignore(share: float) -> None:
    pass


@dataclass(frozen=True)
class Context:
    """What an experiment is told: where pictures go, how thorough to be, and whom to tell how far it is (0..1).

    ``workers`` is the number of threads for what computes outside of Python. Without a ``pool`` everything else is
    computed in this process. ``data`` is the folder of measured logs, in place of the one that the environment names.
    """

    folder: Path
    quick: bool = False
    seeds: int | None = None
    workers: int = field(default_factory=usable_processors)
    pool: Executor | None = None
    data: Path | None = None
    progress: Callable[[float], None] = _ignore

    def count(self, full: int, quick: int) -> int:
        """Return the number of seeds: what the user asked for, else that of a full or a quick run."""
        return self.seeds if self.seeds is not None else (quick if self.quick else full)

    def map(self, function: Callable[[Item], Answer], items: Iterable[Item]) -> list[Answer]:
        """Return ``function`` of each item, in their order, computed by the processes of ``pool`` if there is one.

        ``function`` and the items must be picklable; results must not depend on the process they are computed in.
        """
        work = list(items)
        answers: list[Answer] = []
        chunk = max(1, len(work) // CHUNKS)
        for answer in map(function, work) if self.pool is None else self.pool.map(function, work, chunksize=chunk):
            answers.append(answer)
            self.progress(len(answers) / len(work))
        return answers


def read_spec(name: str) -> dict[str, Any]:
    """Return the settings of an experiment: seeds, parameter sets and published figures."""
    return read_toml(EXPERIMENTS_FOLDER / f"{name}.toml")
