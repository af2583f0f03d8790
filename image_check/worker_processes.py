# SPDX-License-Identifier: MIT
"""Calls in separate processes: a crash or an endless loop of one does not affect the others."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any


@dataclass(frozen=True)
class ProcessFailure:
    """A process that ended without a result; ``why`` is a sentence."""

    why: str


@dataclass(frozen=True)
class _Call:
    number: int
    process: Any


def call_in_processes(
    function: Callable[..., Any], calls: Sequence[tuple[Any, ...]], workers: int, limit_s: int | None = None
) -> Iterator[tuple[int, Any]]:
    """Call ``function`` with each of these arguments, ``workers`` at a time, begun in this order.

    Yields the number of a call and its result, or :class:`ProcessFailure`, as they end. A call is ended after
    ``limit_s`` of processor time, which may last longer on a busy computer. ``function`` must not raise.
    """
    waiting = list(enumerate(calls))[::-1]
    running: dict[Connection, _Call] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                _begin(function, *waiting.pop(), limit_s, running)
            for receiver in wait(list(running)):
                call = running.pop(receiver)  # type: ignore[call-overload]
                yield call.number, _result(receiver, call)  # type: ignore[arg-type]
    finally:
        for call in running.values():
            call.process.terminate()
            call.process.join()


def _begin(
    function: Callable[..., Any],
    number: int,
    arguments: tuple[Any, ...],
    limit_s: int | None,
    running: dict[Connection, _Call],
) -> None:
    receiver, sender = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.Process(target=_send, args=(sender, function, arguments, limit_s))
    process.start()
    sender.close()
    running[receiver] = _Call(number, process)


def _send(sender: Connection, function: Callable[..., Any], arguments: tuple[Any, ...], limit_s: int | None) -> None:
    if limit_s is not None:
        import resource  # Unix only, as the limit is

        _, most = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, most))
    sender.send(function(*arguments))


def _result(receiver: Connection, call: _Call) -> Any:
    """Return a process's result, and wait for its end."""
    result: Any = None
    with contextlib.suppress(EOFError):
        result = receiver.recv()
    call.process.join()
    receiver.close()
    return ProcessFailure(_cause(call.process.exitcode)) if result is None else result


def _cause(code: int) -> str:
    if code >= 0:
        return f"its process ended by itself with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = str(-code)
    if name == "SIGXCPU":
        return "it exceeded its limit of processor time"
    hint = "; perhaps there was not enough memory" if name == "SIGKILL" else ""
    return f"its process was ended by signal {name}{hint}"
