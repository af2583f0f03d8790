# SPDX-License-Identifier: MIT
"""A Dask cluster of four processes computes the local pool's bytes, also when one of them is killed on the way."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dask
import distributed
import pytest

from hil_sim.scenario import Scenario
from hil_sim.studies import cluster, engine
from hil_sim.studies.cluster import DaskPool
from hil_sim.studies.errors import ClusterError, StudyError
from hil_sim.studies.montecarlo import Plan, open_study, run_study
from hil_sim.studies.plan import Batch, Point
from hil_sim.studies.pools import LocalPool, Pool
from omniwheel.errors import MissingPackageError

NOBODY = "tcp://127.0.0.1:9"
make_cluster: Any = distributed.LocalCluster
FILES = ("summary.json", "runs.npy", "study.json")


@pytest.fixture(scope="module")
def dask_cluster() -> Iterator[Any]:
    settings = {
        "distributed.worker.multiprocessing-method": "forkserver",  # the packages are loaded once for all workers
        "distributed.worker.preload": ["hil_sim.studies.cluster"],
    }
    with (
        dask.config.set(settings),
        make_cluster(n_workers=4, threads_per_worker=1, dashboard_address=":0") as running,
    ):
        yield running


@pytest.fixture
def pool(dask_cluster: Any) -> Iterator[DaskPool]:
    made = DaskPool(dask_cluster.scheduler_address, connect_s=60.0)
    yield made
    made.close()


def do(plan: Plan, folder: Path, pool: Pool, progress: Any = lambda runs, simulated_s, kept: None) -> dict[str, bytes]:
    with open_study(plan, folder) as study:
        run_study(plan, study, pool, progress)
    return {name: (folder / name).read_bytes() for name in FILES}


@pytest.mark.full
def test_the_cluster_gives_the_local_pools_bytes_though_a_worker_is_killed(
    quick: Scenario, tmp_path: Path, pool: DaskPool, dask_cluster: Any
) -> None:
    plan = Plan(quick, 120, 1, 8, worst=2)
    killed: list[int] = []

    def kill_one(runs: int, simulated_s: float, kept: bool) -> None:
        if not killed:
            killed.append(next(iter(dask_cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    assert pool.workers == 4
    remote = do(plan, tmp_path / "cluster", pool, kill_one)
    assert killed
    assert remote == do(plan, tmp_path / "local", LocalPool(2))


def test_a_refused_batch_and_one_that_fails_are_told_apart(quick: Scenario, pool: DaskPool) -> None:
    refused = Batch(Point(quick, {"W1_ANGLE": 120.0}), 1, 8)
    (done,) = pool.results([refused])
    assert done.refusal
    assert done.batch is refused
    with pytest.raises(StudyError, match=r"seeds 16 to 23 failed 4 times"):
        list(pool.results([Batch(_Broken(quick), 16, 8)]))


class _Broken(Point):
    def applied(self) -> Scenario:
        raise RuntimeError("this breaks")


def test_workers_that_compute_other_numbers_are_refused(dask_cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    own = engine.identity()
    for name, message in (("probe", "computes different results"), ("omniwheel", "has omniwheel")):
        monkeypatch.setattr("hil_sim.studies.engine.identity", lambda name=name: {**own, name: "another"})
        with pytest.raises(ClusterError, match=message):
            DaskPool(dask_cluster.scheduler_address, connect_s=60.0)


def test_no_scheduler_and_no_address_are_clear_errors() -> None:
    for address in (NOBODY, "tcp://127.0.0.1:99999", "nonsense"):
        with pytest.raises(ClusterError, match="no Dask scheduler"):
            DaskPool(address, connect_s=1.0)


def test_a_cluster_without_workers_is_not_waited_for_for_ever() -> None:
    with make_cluster(n_workers=0, dashboard_address=":0") as empty, pytest.raises(ClusterError, match="no workers"):
        DaskPool(empty.scheduler_address, connect_s=1.0)


def test_when_the_last_worker_goes_the_study_ends(quick: Scenario) -> None:
    with make_cluster(n_workers=1, processes=False, dashboard_address=":0") as small:
        pool = DaskPool(small.scheduler_address, connect_s=60.0, no_worker_s=0.5)
        plan = (Batch(Point(quick), 1 + 8 * number, 8) for number in range(10_000))
        results = pool.results(plan)
        next(results)
        small.scale(0)
        with pytest.raises(ClusterError, match="no worker for"):
            list(results)
        pool.close()


def test_without_dask_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(cluster, "import_module", refuse)
    with pytest.raises(MissingPackageError) as caught:
        DaskPool(NOBODY)
    assert "omniwheel[cluster]" in caught.value.hint
