# SPDX-License-Identifier: MIT
"""Processors that may be used, and a pool of processes that Ctrl-C ends without a traceback."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from threading import Thread

DRAIN_S = 0.3
"""What the pool's thread takes to drop the work that waits."""


def usable_processors() -> int:
    """Return on how many processors this process may run, 1 or more."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def worker_pool(workers: int | None = None) -> Iterator[Executor]:
    """Yield a pool of processes, by default as many as there are processors."""
    # Not forked: other threads of this process may hold locks. Ctrl-C reaches the whole process group. The workers
    # leave it to this process, which drops what waits before it ends them. Otherwise the pool prints tracebacks.
    context = get_context("spawn")
    ignore = (signal.SIGINT, signal.SIG_IGN)
    count = workers or usable_processors()
    with ProcessPoolExecutor(count, context, signal.signal, ignore) as pool:
        # They start with the first work and inherit what is ignored: the initializer alone comes after their imports.
        before = signal.signal(*ignore)
        try:
            for _ in range(count):
                pool.submit(int)
        finally:
            signal.signal(signal.SIGINT, before)
        try:
            yield pool
        except BaseException:
            # Waited for in the end: a pool that is still closing when Python ends prints a traceback of its own.
            closing = Thread(target=pool.shutdown, kwargs={"cancel_futures": True})
            closing.start()
            time.sleep(DRAIN_S)
            for worker in active_children():
                worker.terminate()
            closing.join()
            raise
