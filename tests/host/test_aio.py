# SPDX-License-Identifier: MIT
"""The face with ``await``: the same methods in an event loop that goes on, and motions that can be cancelled."""

from __future__ import annotations

import asyncio
import inspect

import pytest

from omniwheel import SimulatedRobot, aio
from omniwheel.errors import DriveError
from omniwheel.parameters import Parameters
from omniwheel.telemetry import GyroState, Tracking
from tests.waiting import LONGEST_S, pass_time

PATIENT = {"SAFE_CMD_TO": 10.0, "SAFE_LINK_TO": LONGEST_S}


@pytest.mark.full
def test_it_drives_while_the_loop_goes_on() -> None:
    async def main() -> None:
        async with aio.simulate() as robot:
            await robot.parameters.set_many(PATIENT)
            await robot.arm()
            seen: list[Tracking] = []
            robot.on(Tracking, seen.append)
            drive = await robot.drive_to(0.2, 0.0)
            assert drive.pose.x == pytest.approx(0.2, abs=0.01)
            assert len(seen) > 5
            async for tracking in robot.telemetry(Tracking):
                assert tracking.pose.x == pytest.approx(0.2, abs=0.02)
                break
            assert robot.pose.x == pytest.approx(0.2, abs=0.02)
            assert await robot.parameters.get("SAFE_CMD_TO") == 10.0

    asyncio.run(main())


@pytest.mark.full
def test_a_motion_that_is_cancelled_brings_the_robot_to_rest() -> None:
    async def main() -> None:
        async with aio.simulate() as robot:
            await robot.parameters.set_many(PATIENT)
            await robot.arm()
            drive = asyncio.ensure_future(robot.drive_to(3.0, 0.0, speed=0.3))
            while robot.pose.x < 0.05:
                await asyncio.to_thread(pass_time)
            drive.cancel()
            with pytest.raises(asyncio.CancelledError):
                await drive
            before = robot.simulation.true_pose.x
            await robot.sleep(1.0)
            assert robot.simulation.true_pose.x == pytest.approx(before, abs=0.02)
            assert robot.armed

    asyncio.run(main())


@pytest.mark.parametrize("motion", ["repeat", "drive_duty"])
def test_what_repeats_a_setpoint_is_cancelled_too(motion: str) -> None:
    async def main() -> None:
        async with aio.simulate() as robot:
            await robot.parameters.set_many(PATIENT)
            await robot.arm()
            if motion == "repeat":
                drive = asyncio.ensure_future(robot.repeat(lambda: robot.threaded.set_velocity(0.3, 0.0, 0.0), 20.0))
            else:
                drive = asyncio.ensure_future(robot.drive_duty([0.2, 0.2, 0.2], 20.0))
            while abs(robot.pose.x) + abs(robot.pose.theta) < 0.05:
                await asyncio.to_thread(pass_time)
            drive.cancel()
            with pytest.raises(asyncio.CancelledError):
                await drive
            before = robot.simulation.true_pose
            await robot.sleep(1.0)
            after = robot.simulation.true_pose
            assert after.x == pytest.approx(before.x, abs=0.02)
            assert after.theta == pytest.approx(before.theta, abs=0.05)

    asyncio.run(main())


def test_a_motion_that_is_cancelled_before_it_has_begun_does_not_drive() -> None:
    async def main() -> None:
        async with aio.simulate() as robot:
            await robot.parameters.set_many(PATIENT)
            await robot.arm()
            drive = asyncio.ensure_future(robot.drive_to(3.0, 0.0, speed=0.3))
            await asyncio.wait(
                {drive}, timeout=0.0
            )  # the call has begun, its thread has not asked the robot for anything yet
            drive.cancel()
            with pytest.raises(asyncio.CancelledError):
                await drive
            assert robot.simulation.true_pose.x < 1.0

    asyncio.run(main())


def test_errors_are_those_of_the_library() -> None:
    async def main() -> None:
        async with aio.simulate() as robot:
            await robot.drive_to(1.0, 0.0)

    with pytest.raises(DriveError):
        asyncio.run(main())


def test_every_method_is_there_with_its_own_help() -> None:
    faces: list[tuple[type, type, set[str]]] = [(aio.SimulatedRobot, SimulatedRobot, {"on"})]
    faces += [(aio.Parameters, Parameters, {"info", "enum", "changed"})]
    for face, threaded, not_awaited in faces:
        for name, _ in inspect.getmembers(threaded, inspect.isfunction):
            if name.startswith("_") or (threaded is Parameters and name not in OWN):
                continue
            found = getattr(face, name)
            assert found.__doc__, name
            awaited = inspect.iscoroutinefunction(found) or inspect.isasyncgenfunction(found)
            assert awaited != (name in not_awaited), name
    assert "speed" in inspect.signature(aio.Robot.drive_to).parameters
    assert aio.Robot.drive_to.__doc__ == SimulatedRobot.drive_to.__doc__


OWN = ("changed", "diff", "download", "enum", "info", "load", "read", "save", "set_many")
"""Methods of the parameters that are not those of every mapping."""


@pytest.mark.full
def test_wrong_names_and_arguments_are_errors() -> None:
    """A type checker finds them as well: it would say of these comments that they are not needed."""

    async def main() -> None:
        async with aio.simulate() as robot:
            with pytest.raises(AttributeError):
                _ = robot.no_such_method  # type: ignore[attr-defined]
            with pytest.raises(TypeError):
                await robot.drive_to(0.0, 0.0, sped=1.0)  # type: ignore[call-arg]
            version: int = await robot.version()  # type: ignore[assignment]
            assert version

    asyncio.run(main())


@pytest.mark.full
def test_parameters_are_changed_for_a_block() -> None:
    async def main() -> None:
        async with aio.simulate() as robot:
            before = await robot.parameters.get("LIM_V")
            async with robot.parameters.changed(LIM_V=0.3):
                assert await robot.parameters.get("LIM_V") == pytest.approx(0.3)
            assert await robot.parameters.get("LIM_V") == before
            with pytest.raises(ZeroDivisionError):
                async with robot.parameters.changed(LIM_V=0.3):
                    _ = 1 / 0
            assert await robot.parameters.get("LIM_V") == before

    asyncio.run(main())


def test_an_emergency_stop_waits_for_no_other_call() -> None:
    """The pool of asyncio has a few threads more than processors; each of these calls holds one."""

    async def main() -> None:
        async with aio.simulate() as robot:
            waiting = [asyncio.ensure_future(robot.wait_for(GyroState, timeout_s=1e6)) for _ in range(60)]
            await asyncio.to_thread(pass_time)
            await asyncio.wait_for(robot.estop(), LONGEST_S)
            for call in waiting:
                call.cancel()

    asyncio.run(main())
