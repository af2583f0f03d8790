# SPDX-License-Identifier: MIT
"""The face for programs with ``await``: the methods of :class:`omniwheel.Robot`, made of the very same code.

>>> from omniwheel import aio
>>> async def main():
...     async with aio.connect() as robot:
...         await robot.arm()
...         await robot.drive_to(0.5, 0.0)
...         async for tracking in robot.telemetry(Tracking):
...             print(tracking.pose)

Every method is awaited; the event loop goes on meanwhile. Each call has a thread of its own, so a stop waits for none.
Generators become asynchronous ones. Properties stay as they are: ``robot.pose``. A motion that is cancelled brings
the robot to rest first.
"""

from __future__ import annotations

import asyncio
import contextvars
import inspect
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, asynccontextmanager, suppress
from functools import partial, wraps
from typing import Any, TypeVar

from omniwheel.background import connect as _connect
from omniwheel.background import simulate as _simulate
from omniwheel.errors import OmniError
from omniwheel.parameters import Parameters
from omniwheel.robot import Robot as ThreadedRobot
from omniwheel.telemetry import TelemetryT

MOTIONS = ("drive", "drive_to", "follow", "follow_trajectory", "turn_to")
"""Methods that are still at it when they are cancelled, and the robot with them."""
_END = object()
_AGAIN_S = 0.1
T = TypeVar("T")


class _Awaited:
    """Something whose methods are awaited."""

    def __init__(self, wrapped: Any) -> None:
        self._wrapped = wrapped

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._wrapped, name)
        if not inspect.ismethod(value):
            return value
        if inspect.isgeneratorfunction(value.__func__):
            return wraps(value)(partial(_iterated, value))
        return wraps(value)(partial(self._await, name, value))

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *dir(self._wrapped)})

    async def _await(self, name: str, method: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        return await _in_thread(method, *arguments, **named)


class AwaitedParameters(_Awaited):
    """The parameters: ``await robot.parameters.read(name)``, ``await robot.parameters.set_many({...})``."""

    def __init__(self, parameters: Parameters) -> None:
        super().__init__(parameters)

    async def get(self, name: str) -> float:
        """Return a value, as ``robot.parameters[name]``."""
        return float(await _in_thread(self._wrapped.__getitem__, name))

    async def set(self, name: str, value: Any) -> None:
        """Set a value, as ``robot.parameters[name] = value``."""
        await _in_thread(self._wrapped.__setitem__, name, value)


class Robot(_Awaited):
    """A robot whose methods are awaited; get one from :func:`connect` or :func:`simulate`."""

    def __init__(self, robot: ThreadedRobot) -> None:
        super().__init__(robot)
        self.parameters = AwaitedParameters(robot.parameters)

    async def _await(self, name: str, method: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        if name not in MOTIONS:
            return await super()._await(name, method, *arguments, **named)
        motion = asyncio.ensure_future(_in_thread(method, *arguments, **named))
        try:
            return await asyncio.shield(motion)
        except asyncio.CancelledError:
            while not motion.done():  # its thread may only be about to begin it
                with suppress(OmniError):
                    await _in_thread(self._wrapped.stop)
                await asyncio.wait({motion}, timeout=_AGAIN_S)
            with suppress(OmniError):  # the one that stop() ended
                motion.result()
            raise

    def on(self, kind: type[TelemetryT], callback: Callable[[TelemetryT], Any]) -> Callable[[], None]:
        """Call ``callback``, a function or coroutine function, in the event loop with each telemetry of a ``kind``.

        The returned function ends that.
        """
        loop = asyncio.get_running_loop()
        tasks: set[asyncio.Future[Any]] = set()

        def call(value: TelemetryT) -> None:
            result = callback(value)
            if inspect.isawaitable(result):
                tasks.add(task := asyncio.ensure_future(result))
                task.add_done_callback(tasks.discard)

        remove: Callable[[], None] = self._wrapped.on(kind, lambda value: loop.call_soon_threadsafe(call, value))
        return remove


async def _in_thread(method: Callable[..., T], *arguments: Any, **named: Any) -> T:
    """Await a call, as asyncio.to_thread does, in a new thread.

    The threads of a pool may all wait for telemetry: an emergency stop would wait for one of them.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()
    call = partial(contextvars.copy_context().run, method, *arguments, **named)

    def settle(result: Any, error: BaseException | None) -> None:
        if not future.done():
            future.set_result(result) if error is None else future.set_exception(error)

    def run() -> None:
        result, failed = None, None
        try:
            result = call()
        except BaseException as error:
            failed = error
        with suppress(RuntimeError):  # the loop is closed: nothing awaits this any more
            loop.call_soon_threadsafe(settle, result, failed)

    threading.Thread(target=run, name="omniwheel call", daemon=True).start()
    return await future


async def _iterated(method: Callable[..., Iterator[Any]], *arguments: Any, **named: Any) -> AsyncIterator[Any]:
    iterator = method(*arguments, **named)
    try:
        while (value := await _in_thread(next, iterator, _END)) is not _END:
            yield value
    finally:
        with suppress(ValueError, AttributeError):  # it still runs in its thread
            iterator.close()  # type: ignore[attr-defined]


@asynccontextmanager
async def _entered(make: Callable[[], AbstractContextManager[ThreadedRobot]]) -> AsyncIterator[Robot]:
    context = await _in_thread(make)
    robot = await _in_thread(context.__enter__)
    try:
        yield Robot(robot)
    except BaseException as error:
        if not await _in_thread(context.__exit__, type(error), error, error.__traceback__):
            raise
    else:
        await _in_thread(context.__exit__, None, None, None)


@wraps(_connect)
def connect(*arguments: Any, **named: Any) -> Any:
    """Connect to a robot, as :func:`omniwheel.connect`: ``async with aio.connect(...) as robot``."""
    return _entered(partial(_connect, *arguments, **named))


@wraps(_simulate)
def simulate(*arguments: Any, **named: Any) -> Any:
    """Simulate a robot, as :func:`omniwheel.simulate`: ``async with aio.simulate(...) as robot``."""
    return _entered(partial(_simulate, *arguments, **named))
