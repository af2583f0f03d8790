# SPDX-License-Identifier: MIT
"""Batches on a Dask cluster that is already there. A worker that gets lost costs the batches it was at."""

from __future__ import annotations

import logging
import queue
import time
import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError
from dataclasses import replace
from importlib import import_module
from typing import Any
from urllib.parse import urlsplit

from hil_sim.studies import engine
from hil_sim.studies.errors import ClusterError, StudyError
from hil_sim.studies.plan import Batch
from hil_sim.studies.pools import Done, perform
from omniwheel.errors import MissingPackageError

CONNECT_S = 10.0
NO_WORKER_S = 30.0
"""A study gives up when the cluster has had no worker for so long; the finished batches are kept."""
RETRIES = 3
_LOOK_S = 1.0
_FETCH_S = 5.0
_PER_THREAD = 2
_ASK_EVERY_S = 5.0
_IN_PROCESS = "inproc"
_START = "start one with `dask scheduler`; it prints its address, such as tcp://192.168.1.10:8786"
_INSTALL = "install the same omniwheel on every worker's machine, then restart the workers"


class DaskPool:
    """The workers of a Dask scheduler, ``tcp://host:port``. Raises ClusterError, MissingPackageError."""

    def __init__(self, address: str, *, connect_s: float = CONNECT_S, no_worker_s: float = NO_WORKER_S) -> None:
        self._distributed = _load()
        self._address = address
        self._no_worker_s = no_worker_s
        self._threads = 0
        self._seen_s = 0.0
        self._asked_s = float("-inf")
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        _check_address(address)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about versions: what matters is compared below
                self._client = self._distributed.Client(address, timeout=connect_s, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise ClusterError(
                f"no Dask scheduler responds at {address}: {error}",
                hint=_START,
            ) from error
        try:
            self._wait_for_a_worker(connect_s)
            self._check_workers(connect_s)
        except BaseException:
            self.close()
            raise

    @property
    def workers(self) -> int:
        """Threads of all workers now."""
        return self._count_threads()

    def results(self, batches: Iterable[Batch]) -> Iterator[Done]:
        """Do batches on all workers, those that join later too."""
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        under_way: dict[Any, Batch] = {}
        waiting = iter(batches)
        try:
            while True:
                while len(under_way) < self._room() and (batch := next(waiting, None)) is not None:
                    future = self._client.submit(perform_remotely, batch, pure=False, retries=RETRIES)
                    under_way[future] = batch
                    future.add_done_callback(done.put)
                if not under_way:
                    return
                future = self._next(done)
                batch = under_way.pop(future)
                yield self._taken(future, batch)
        finally:
            self._give_up(list(under_way))

    def close(self) -> None:
        """Leave the cluster; its workers stay."""
        self._client.close(timeout=2.0)

    def _wait_for_a_worker(self, limit_s: float) -> None:
        try:
            self._client.wait_for_workers(1, timeout=limit_s)
        except (TimeoutError, self._distributed.TimeoutError) as error:
            hint = f"start some with `dask worker {self._address}`"
            raise ClusterError(f"the scheduler at {self._address} has no workers", hint=hint) from error

    def _check_workers(self, limit_s: float) -> None:
        """Ask every worker what it computes with; one that is silent is looked at with its first batch."""
        asked = {
            worker: self._client.submit(worker_identity, workers=[worker], allow_other_workers=False, pure=False)
            for worker in self._client.nthreads()
        }
        deadline_s = time.monotonic() + limit_s
        for worker, future in asked.items():
            try:
                found = future.result(timeout=max(0.1, deadline_s - time.monotonic()))
            except (TimeoutError, self._distributed.TimeoutError):
                future.cancel()
                continue
            except Exception as error:  # whatever a worker without this package comes up with
                raise ClusterError(f"the worker {worker} cannot run omniwheel: {error}", hint=_INSTALL) from error
            _refuse_other_engine(worker, found)

    def _room(self) -> int:
        """Return how many batches may be under way; asks the scheduler now and then, because workers come and go."""
        if time.monotonic() > self._asked_s + _ASK_EVERY_S:
            self._asked_s = time.monotonic()
            self._threads = self._count_threads()
        return max(1, _PER_THREAD * self._threads)

    def _count_threads(self) -> int:
        try:
            return sum(self._client.nthreads().values()) if self._client.status == "running" else 0
        except (OSError, TimeoutError):
            return 0

    def _next(self, done: queue.SimpleQueue[Any]) -> Any:
        """Wait for a batch, as long as there are workers."""
        self._seen_s = time.monotonic()
        while True:
            try:
                return done.get(timeout=_LOOK_S)
            except queue.Empty:
                self._watch_workers()

    def _watch_workers(self) -> None:
        """Raise ClusterError if the cluster has no workers any more."""
        if self._client.status not in ("running", "connecting"):
            raise self._lost(f"the connection to the scheduler at {self._address} was lost")
        if self._count_threads():
            self._seen_s = time.monotonic()
        elif time.monotonic() > self._seen_s + self._no_worker_s:
            raise self._lost(f"the cluster has had no worker for {self._no_worker_s:g} s")

    def _lost(self, message: str) -> ClusterError:
        return ClusterError(message, hint="the finished batches are kept: repeat the command to continue")

    def _taken(self, future: Any, batch: Batch) -> Done:
        done: Done
        try:
            worker, found, done = self._result(future)
        except StudyError:
            raise
        except CancelledError as error:
            raise self._lost(f"the scheduler at {self._address} dropped {batch}") from error
        except Exception as error:  # whatever a worker comes up with, or how it ended
            what = f"{batch} failed {RETRIES + 1} times: {type(error).__name__}: {error}"
            raise StudyError(what, hint="see the workers' output; finished batches are kept") from error
        _refuse_other_engine(worker, found)
        return replace(done, batch=batch)

    def _result(self, future: Any) -> Any:
        """Fetch a result. Its worker may have gone since it was done: then another one has to do it again."""
        self._seen_s = time.monotonic()
        while True:
            try:
                return future.result(timeout=_FETCH_S)
            except (TimeoutError, self._distributed.TimeoutError):
                if future.status == "error":  # the batch's own
                    raise
                self._watch_workers()

    def _give_up(self, futures: list[Any]) -> None:
        if futures and self._client.status == "running":
            self._client.cancel(futures, force=True)


def perform_remotely(batch: Batch) -> tuple[str, dict[str, Any], Done]:
    """Do a batch on a worker; says which one, and what it computes with."""
    distributed = _load()
    return distributed.get_worker().address, worker_identity(), perform(batch)


def worker_identity() -> dict[str, Any]:
    """Return what a worker computes with."""
    return engine.identity()


def _refuse_other_engine(worker: str, found: dict[str, Any]) -> None:
    own = engine.identity()
    for name, value in own.items():
        if found.get(name) != value:
            what = "computes different results" if name == "probe" else f"has {name} {found.get(name)}, not {value}"
            raise ClusterError(f"the worker {worker} {what}", hint=_INSTALL)


def _check_address(address: str) -> None:
    """Refuse what is no address before a client is made, which would not get over it."""
    try:
        parts = urlsplit(address if "://" in address else f"tcp://{address}")
        known = parts.scheme == _IN_PROCESS or (bool(parts.hostname) and parts.port is not None)
    except ValueError:
        known = False
    if not known:
        raise ClusterError(f"no Dask scheduler responds at {address}: it lacks a host and a port", hint=_START)


def _load() -> Any:
    try:
        return import_module("distributed")
    except ImportError as error:
        hint = "pip install 'omniwheel[cluster]', or in a clone: make setup"
        raise MissingPackageError("--cluster needs Dask's distributed, which is not installed", hint=hint) from error
