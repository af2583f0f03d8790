# SPDX-License-Identifier: MIT
"""Who does the batches: threads of this process. The engine lets go of the interpreter, so that they do scale."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil_sim.batch import BatchCancelledError, Cancel
from hil_sim.processes import usable_processors
from hil_sim.studies import engine
from hil_sim.studies.plan import Batch
from hil_sim.world import WorldError
from omni_schema import SchemaError
from omniwheel.errors import OmniError

_LOOK_S = 0.2


@dataclass(frozen=True)
class Done:
    """A batch that was done: its rows, or in ``refusal`` why its settings cannot be run, which no repetition mends."""

    batch: Batch
    rows: NDArray[Any] = field(default_factory=lambda: np.empty(0, engine.ROW))
    refusal: str = ""
    hint: str = ""


class Pool(Protocol):
    """Does batches, in any order."""

    def results(self, batches: Iterable[Batch]) -> Iterator[Done]:
        """Do batches and yield each as it gets done; takes only as many as are needed to stay busy."""

    def close(self) -> None:
        """Let go of everything."""


def perform(batch: Batch, cancel: Cancel | None = None) -> Done:
    """Do a batch here and now. Raises BatchCancelledError."""
    try:
        return Done(batch, engine.run_rows(batch.point.applied(), batch.first_seed, batch.runs, cancel))
    except BatchCancelledError:
        raise
    except (OmniError, SchemaError, WorldError) as error:
        return Done(batch, refusal=str(error), hint=getattr(error, "hint", ""))


class LocalPool:
    """Threads of this process. None: as many as there are processors that it may use.

    They are daemons, and are told to stop: Ctrl-C does not wait for the batches under way.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers if workers is not None else usable_processors()

    def results(self, batches: Iterable[Batch]) -> Iterator[Done]:
        """Do batches on all threads."""
        todo: queue.SimpleQueue[Batch | None] = queue.SimpleQueue()
        done: queue.SimpleQueue[Done | BaseException] = queue.SimpleQueue()
        cancel = Cancel()
        waiting = iter(batches)
        for _ in range(self.workers):
            threading.Thread(target=_work, args=(todo, done, cancel), daemon=True).start()
        under_way = 0
        try:
            for batch in _take(waiting, 2 * self.workers):
                todo.put(batch)
                under_way += 1
            while under_way:
                result = _next(done)
                under_way -= 1
                for batch in _take(waiting, 1):
                    todo.put(batch)
                    under_way += 1
                yield result
        finally:
            cancel.set()
            for _ in range(self.workers):
                todo.put(None)

    def close(self) -> None:
        """Nothing is held between two calls of results."""


def _take(source: Iterator[Batch], count: int) -> Iterator[Batch]:
    for _ in range(count):
        batch = next(source, None)
        if batch is None:
            return
        yield batch


def _next(done: queue.SimpleQueue[Done | BaseException]) -> Done:
    while True:
        try:
            result = done.get(timeout=_LOOK_S)  # not for ever: Ctrl-C must get through on every platform
        except queue.Empty:
            continue
        if isinstance(result, BaseException):
            raise result
        return result


def _work(todo: queue.SimpleQueue[Batch | None], done: queue.SimpleQueue[Done | BaseException], cancel: Cancel) -> None:
    while (batch := todo.get()) is not None and not cancel.is_set:
        try:
            done.put(perform(batch, cancel))
        except BaseException as error:  # passed on to the caller that waits for the batch
            done.put(error)
