# SPDX-License-Identifier: MIT
"""A process beside the server for what computes long: it shares neither memory nor time with the robot's thread."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from omniwheel.errors import LogError, OmniError

T = TypeVar("T")
_NICE = 10
MOST_WAITING = 64
_context = multiprocessing.get_context("spawn")


class Worker:
    """Calls functions of modules, one after another, in a process of its own. It starts with the first call.

    The process ends with :meth:`close`, or with this program, however that ends.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="worker")
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection[Any, Any] | None = None
        self._waiting = 0
        self._closed = False

    def ask(self, function: Callable[..., T], *arguments: Any) -> Future[T]:
        """Have a function called. The future raises its OmniError, or LogError if the process ended meanwhile."""
        if self._waiting >= MOST_WAITING:
            raise LogError("too many logs are being read", hint="try again in a moment")
        self._waiting += 1
        future = self._thread.submit(self._exchange, function, arguments)
        future.add_done_callback(self._done)
        return future

    def close(self) -> None:
        """End the process; what it was asked for fails."""
        self._closed = True
        self._thread.shutdown(wait=False, cancel_futures=True)
        if self._process is not None:
            self._process.kill()

    def _done(self, _future: Future[Any]) -> None:
        self._waiting -= 1

    def _exchange(self, function: Callable[..., T], arguments: tuple[Any, ...]) -> T:
        try:
            pipe = self._pipe if self._pipe is not None else self._start()
            pipe.send((function, arguments))
            result, error = pipe.recv()
        except (EOFError, OSError) as error:
            self._pipe = None
            raise LogError(
                "the process that reads logs has ended", hint="check the free memory and try again"
            ) from error
        if error is not None:
            raise error
        return result  # type: ignore[no-any-return]

    def _start(self) -> Connection[Any, Any]:
        ours, theirs = _context.Pipe()
        process = _context.Process(target=_serve, args=(theirs,), daemon=True)
        process.start()
        theirs.close()
        self._process = process
        if self._closed:  # meanwhile
            process.kill()
        self._pipe = ours
        return ours


def _serve(pipe: Connection[Any, Any]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which then ends this
    os.nice(_NICE)
    with suppress(EOFError, OSError):  # the server has gone
        while True:
            function, arguments = pipe.recv()
            answer: tuple[Any, OmniError | None]
            try:
                answer = (function(*arguments), None)
            except OmniError as error:
                answer = (None, error)
            except Exception as error:  # such as a MemoryError: it is said, and the next log is read
                answer = (None, LogError(f"cannot be read: {error!r}"))
            pipe.send(answer)
