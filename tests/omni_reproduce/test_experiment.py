# SPDX-License-Identifier: MIT
from contextlib import nullcontext
from pathlib import Path

from omni_reproduce.experiment import Context, worker_pool


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
