# SPDX-License-Identifier: MIT
"""Calls in processes of their own: one that dies, or never ends, takes no other's result with it."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any


@dataclass(frozen=True)
class Died:
    """A process that gave no result; ``why`` is a sentence."""

    why: str


@dataclass(frozen=True)
class _Call:
    number: int
    process: Any
    give_up_s: float


def call_apart(
    function: Callable[..., Any], calls: Sequence[tuple[Any, ...]], workers: int, limit_s: float | None = None
) -> Iterator[tuple[int, Any]]:
    """Call ``function`` with each of these arguments, ``workers`` at a time, begun in this order.

    Yields the number of a call and its result, or :class:`Died`, as they end. A call that takes longer than ``limit_s``
    on this computer is ended. ``function`` must not raise.
    """
    waiting = list(enumerate(calls))[::-1]
    running: dict[Connection, _Call] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                _begin(function, *waiting.pop(), limit_s, running)
            ready = wait(list(running), _rest_s(running))
            for receiver in [other for other in running if other in ready or _is_late(running[other])]:
                call = running.pop(receiver)
                yield call.number, _result(receiver, call, receiver in ready)
    finally:
        for receiver, call in running.items():
            _result(receiver, call, False)


def _begin(
    function: Callable[..., Any],
    number: int,
    arguments: tuple[Any, ...],
    limit_s: float | None,
    running: dict[Connection, _Call],
) -> None:
    receiver, sender = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.Process(target=_send, args=(sender, function, arguments))
    process.start()
    sender.close()
    running[receiver] = _Call(number, process, float("inf") if limit_s is None else time.monotonic() + limit_s)


def _send(sender: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    sender.send(function(*arguments))


def _rest_s(running: dict[Connection, _Call]) -> float | None:
    rest_s = min(call.give_up_s for call in running.values()) - time.monotonic()
    return None if rest_s == float("inf") else max(rest_s, 0.0)


def _is_late(call: _Call) -> bool:
    return time.monotonic() >= call.give_up_s


def _result(receiver: Connection, call: _Call, ready: bool) -> Any:
    """Take what a process has to say, and end it."""
    result: Any = Died("it did not end in time")
    if ready:
        try:
            result = receiver.recv()
        except EOFError:
            result = None
    else:
        call.process.terminate()
    call.process.join()
    receiver.close()
    return Died(_cause(call.process.exitcode)) if result is None else result


def _cause(code: int) -> str:
    if code >= 0:
        return f"its process ended by itself with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = str(-code)
    hint = "; perhaps there was not enough memory" if name == "SIGKILL" else ""
    return f"its process was ended by signal {name}{hint}"
