# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from hil_sim.processes import worker_pool
from omni_reproduce.experiment import Context
from tests.waiting import LONGEST_S, wait_until


def square(number: int) -> int:
    return number * number


def test_map_keeps_the_order_and_ends_at_all_done(tmp_path: Path) -> None:
    for pool_of in (nullcontext, worker_pool):
        shares: list[float] = []
        with pool_of() as pool:
            context = Context(tmp_path, pool=pool, progress=shares.append)
            assert context.map(square, range(7)) == [0, 1, 4, 9, 16, 25, 36]
        assert shares == sorted(shares)
        assert shares[-1] == 1.0


def test_number_of_seeds_is_the_users_choice_first(tmp_path: Path) -> None:
    assert Context(tmp_path).count(400, 16) == 400
    assert Context(tmp_path, quick=True).count(400, 16) == 16
    assert Context(tmp_path, quick=True, seeds=3).count(400, 16) == 3


def hold(mark: Path) -> None:
    mark.touch()
    signal.pause()


def hold_all(folder: str) -> None:
    with worker_pool(2) as pool:
        Context(Path(folder), pool=pool).map(hold, [Path(folder) / f"{number}" for number in range(40)])


@pytest.mark.full
def test_ctrl_c_ends_the_workers_without_a_traceback_of_theirs(tmp_path: Path) -> None:
    """As a terminal does: the signal goes to all processes of the group."""
    call = f"hold_all({str(tmp_path)!r})"
    script = f"from {__name__} import hold_all\ntry: {call}\nexcept KeyboardInterrupt: print('end')"
    command = [sys.executable, "-c", script]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    wait_until(lambda: process.poll() is not None or len(list(tmp_path.iterdir())) >= 2, "no two workers began")
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=LONGEST_S) == ("end\n", "")
