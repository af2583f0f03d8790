# SPDX-License-Identifier: MIT
"""The face for programs with ``await``: the methods of :class:`omniwheel.Robot`, made of the very same code.

>>> from omniwheel import aio
>>> async def main():
...     async with aio.connect() as robot:
...         await robot.arm()
...         await robot.drive_to(0.5, 0.0)
...         async for tracking in robot.telemetry(Tracking):
...             print(tracking.pose)
...         async with robot.parameters.changed(LIM_V=0.3):
...             await robot.drive_to(0.0, 0.0)

Methods are awaited; the event loop goes on meanwhile. Each call has a thread of its own, so a stop waits for none.
Generators become asynchronous ones. Properties stay as they are: ``robot.pose``. A motion that is cancelled brings
the robot to rest first. ``robot.threaded`` is the same robot without ``await``.
"""

from __future__ import annotations

import asyncio
import contextvars
import inspect
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from contextlib import AbstractAsyncContextManager, AbstractContextManager, asynccontextmanager, suppress
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from omni_schema import Parameter
from omniwheel.background import connect as _connect
from omniwheel.background import simulate as _simulate
from omniwheel.errors import OmniError
from omniwheel.parameter_types import ParameterEnum
from omniwheel.parameters import Parameters as ThreadedParameters
from omniwheel.parameters import ParameterValue
from omniwheel.robot import Robot as ThreadedRobot
from omniwheel.robot_state import RobotState
from omniwheel.simulation import SimulatedRobot as ThreadedSimulatedRobot
from omniwheel.status import RobotStatus
from omniwheel.telemetry import TelemetryT

if TYPE_CHECKING:
    from omniwheel.firmware_version import RobotVersion
    from omniwheel.run import Run
    from omniwheel.simulation import Simulation

__all__ = ["Parameters", "Robot", "SimulatedRobot", "connect", "simulate"]

_END = object()
_AGAIN_S = 0.1
T = TypeVar("T")
P = ParamSpec("P")
FaceT = TypeVar("FaceT", bound="Robot")


# ---- how a method becomes one that is awaited


def _awaited(method: Callable[Concatenate[Any, P], T]) -> Callable[Concatenate[Any, P], Coroutine[Any, Any, T]]:
    """Return the method of a class here for one of the class that it stands for, ``self.threaded``."""
    name = method.__name__

    @wraps(method)
    async def call(self: Any, /, *arguments: P.args, **named: P.kwargs) -> T:
        made: T = await _in_thread(getattr(self.threaded, name), *arguments, **named)
        return made

    return call


def _motion(method: Callable[Concatenate[Any, P], T]) -> Callable[Concatenate[Any, P], Coroutine[Any, Any, T]]:
    """Do as :func:`_awaited` for a method that drives. A motion that is cancelled brings the robot to rest first."""
    name = method.__name__

    @wraps(method)
    async def call(self: Any, /, *arguments: P.args, **named: P.kwargs) -> T:
        robot: ThreadedRobot = self.threaded
        motion = asyncio.ensure_future(_in_thread(getattr(robot, name), *arguments, **named))
        try:
            made: T = await asyncio.shield(motion)
        except asyncio.CancelledError:
            while not motion.done():  # its thread may only be about to begin it
                with suppress(OmniError):
                    await _in_thread(robot.stop)
                await asyncio.wait({motion}, timeout=_AGAIN_S)
            with suppress(OmniError):  # the one that stop() ended
                motion.result()
            raise
        return made

    return call


def _iterated(method: Callable[Concatenate[Any, P], Iterator[T]]) -> Callable[Concatenate[Any, P], AsyncIterator[T]]:
    """Do as :func:`_awaited` for a generator: the result is used with ``async for``."""
    name = method.__name__

    @wraps(method)
    async def call(self: Any, /, *arguments: P.args, **named: P.kwargs) -> AsyncIterator[T]:
        iterator = getattr(self.threaded, name)(*arguments, **named)
        try:
            while (value := await _in_thread(next, iterator, _END)) is not _END:
                yield value
        finally:
            with suppress(ValueError):  # it still runs in its thread
                iterator.close()

    return call


@asynccontextmanager
async def _entered(make: Callable[[], AbstractContextManager[T]]) -> AsyncIterator[T]:
    """Enter and leave in a thread what ``make`` returns."""
    context = await _in_thread(make)
    entered = await _in_thread(context.__enter__)
    try:
        yield entered
    except BaseException as error:
        if not await _in_thread(context.__exit__, type(error), error, error.__traceback__):
            raise
    else:
        await _in_thread(context.__exit__, None, None, None)


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


# ---- the classes


class Parameters:
    """The parameters of a robot, as :class:`omniwheel.parameters.Parameters`; what asks the robot is awaited."""

    def __init__(self, parameters: ThreadedParameters) -> None:
        self.threaded = parameters

    async def get(self, name: str) -> float:
        """Return a value, as ``robot.parameters[name]`` does without ``await``."""
        return await _in_thread(self.threaded.__getitem__, name)

    async def set(self, name: str, value: ParameterValue) -> None:
        """Set a value, as ``robot.parameters[name] = value`` does without ``await``."""
        await _in_thread(self.threaded.__setitem__, name, value)

    def changed(self, **values: ParameterValue) -> AbstractAsyncContextManager[None]:
        """Set several parameters while the ``async with`` block lasts; then set the old values back."""
        return _entered(partial(self.threaded.changed, **values))

    @property
    def known(self) -> Mapping[str, float]:
        """The values that have come so far, without asking for more."""
        return self.threaded.known

    def info(self, name: str) -> Parameter | None:
        """Return what is known of a parameter: ``unit``, ``minimum``, ``maximum``, ``default``, ``values``, ``doc``."""
        return self.threaded.info(name)

    def enum(self, name: str) -> type[ParameterEnum]:
        """Return the enumeration of an enum parameter."""
        return self.threaded.enum(name)

    read = _awaited(ThreadedParameters.read)
    download = _awaited(ThreadedParameters.download)
    set_many = _awaited(ThreadedParameters.set_many)
    diff = _awaited(ThreadedParameters.diff)
    save = _awaited(ThreadedParameters.save)
    load = _awaited(ThreadedParameters.load)


class Robot(RobotState):
    """A robot whose methods are awaited; get one from :func:`connect`. ``threaded`` is the one without ``await``."""

    def __init__(self, robot: ThreadedRobot) -> None:
        self.threaded = robot
        self.parameters = Parameters(robot.parameters)

    @property
    def status(self) -> RobotStatus:
        """The latest of everything, as a snapshot."""
        return self.threaded.status

    @property
    def run(self) -> Run:
        """Everything since the connection, so far. Raises LogError if it is not recorded."""
        return self.threaded.run

    @property
    def url(self) -> str:
        """The link."""
        return self.threaded.url

    async def version(self) -> RobotVersion:
        """Return the firmware version, asked for once."""
        return await _in_thread(lambda: self.threaded.version)

    def _latest(self, kind: type[TelemetryT]) -> TelemetryT:
        return self.threaded._latest(kind)

    def _newest_status(self) -> RobotStatus:
        return self.threaded._newest_status()

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

        return self.threaded.on(kind, lambda value: loop.call_soon_threadsafe(call, value))

    # motions
    drive = _motion(ThreadedRobot.drive)
    drive_to = _motion(ThreadedRobot.drive_to)
    turn_to = _motion(ThreadedRobot.turn_to)
    follow = _motion(ThreadedRobot.follow)
    follow_trajectory = _motion(ThreadedRobot.follow_trajectory)
    velocity = _awaited(ThreadedRobot.velocity)
    stop = _awaited(ThreadedRobot.stop)
    hold = _awaited(ThreadedRobot.hold)
    sleep = _awaited(ThreadedRobot.sleep)

    # arming and stopping
    arm = _awaited(ThreadedRobot.arm)
    disarm = _awaited(ThreadedRobot.disarm)
    estop = _awaited(ThreadedRobot.estop)
    estop_clear = _awaited(ThreadedRobot.estop_clear)
    close = _awaited(ThreadedRobot.close)

    # what it can follow
    goal = _awaited(ThreadedRobot.goal)
    travel_time_s = _awaited(ThreadedRobot.travel_time_s)
    allowed_time_s = _awaited(ThreadedRobot.allowed_time_s)
    drive_model = _awaited(ThreadedRobot.drive_model)
    require_velocity = _awaited(ThreadedRobot.require_velocity)
    require_pose = _awaited(ThreadedRobot.require_pose)
    require_duty = _awaited(ThreadedRobot.require_duty)
    require_same_parameters = _awaited(ThreadedRobot.require_same_parameters)

    # telemetry
    telemetry = _iterated(ThreadedRobot.telemetry)
    messages = _iterated(ThreadedRobot.messages)
    wait_for = _awaited(ThreadedRobot.wait_for)
    wait_until = _awaited(ThreadedRobot.wait_until)
    set_message_interval = _awaited(ThreadedRobot.set_message_interval)
    record = _awaited(ThreadedRobot.record)
    pump = _awaited(ThreadedRobot.pump)

    # setpoints and messages of one's own
    set_velocity = _awaited(ThreadedRobot.set_velocity)
    set_pose = _awaited(ThreadedRobot.set_pose)
    set_duty = _awaited(ThreadedRobot.set_duty)
    drive_duty = _motion(ThreadedRobot.drive_duty)
    repeat = _motion(ThreadedRobot.repeat)
    send = _awaited(ThreadedRobot.send)
    send_pose_fix = _awaited(ThreadedRobot.send_pose_fix)
    set_pose_estimate = _awaited(ThreadedRobot.set_pose_estimate)

    # the on-board trajectory
    start_trajectory = _awaited(ThreadedRobot.start_trajectory)
    stop_trajectory = _awaited(ThreadedRobot.stop_trajectory)
    set_waypoints = _awaited(ThreadedRobot.set_waypoints)

    # bursts of the control tick, and excitation
    start_burst = _awaited(ThreadedRobot.start_burst)
    fetch_burst = _awaited(ThreadedRobot.fetch_burst)
    record_burst = _awaited(ThreadedRobot.record_burst)
    excite = _awaited(ThreadedRobot.excite)
    end_excitation = _awaited(ThreadedRobot.end_excitation)

    # parameters' storage, signing, restart, hardware-in-the-loop
    store = _awaited(ThreadedRobot.store)
    restore = _awaited(ThreadedRobot.restore)
    reset_parameters = _awaited(ThreadedRobot.reset_parameters)
    signing_status = _awaited(ThreadedRobot.signing_status)
    setup_signing = _awaited(ThreadedRobot.setup_signing)
    reboot = _awaited(ThreadedRobot.reboot)
    enter_hil = _awaited(ThreadedRobot.enter_hil)
    leave_hil = _awaited(ThreadedRobot.leave_hil)


class SimulatedRobot(Robot):
    """A robot whose world is simulated: everything of :class:`Robot`, and :attr:`simulation`."""

    threaded: ThreadedSimulatedRobot

    @property
    def simulation(self) -> Simulation:
        """The world: ``true_pose``, ``fault("encoder_stuck", wheel=1)``, ``mend()``, ``urls`` for other programs."""
        return self.threaded.simulation


def _opened(
    open_robot: Callable[P, ThreadedRobot], face: Callable[[Any], FaceT]
) -> Callable[P, AbstractAsyncContextManager[FaceT]]:
    @wraps(open_robot)
    @asynccontextmanager
    async def opened(*arguments: P.args, **named: P.kwargs) -> AsyncIterator[FaceT]:
        async with _entered(partial(open_robot, *arguments, **named)) as robot:
            yield face(robot)

    return opened


connect = _opened(_connect, Robot)
simulate = _opened(_simulate, SimulatedRobot)
