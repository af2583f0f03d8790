# SPDX-License-Identifier: MIT
"""The real, unmodified MAVSDK against `omni sitl`: it takes every robot that is not ArduPilot for PX4.

Each program runs in a process of its own, because MAVSDK's threads cannot be ended from outside.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from omniwheel.robot import Robot, connect
from tests import needs
from tests.hub.parts import omni
from tests.waiting import wait_until

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "mavsdk.md"
DOCUMENTED_URL = "tcpout://127.0.0.1:5760"
LIMIT_S = 50.0
FULL = """
import sys, time
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.offboard import Offboard, PositionNedYaw, VelocityBodyYawspeed, VelocityNedYaw
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

def until(condition, what):
    end = time.monotonic() + 15.0
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"{what}: {telemetry.flight_mode()!r} {place()} {telemetry.attitude_euler().yaw_deg}")
        time.sleep(0.05)

def place():
    now = telemetry.position_velocity_ned().position
    return now.north_m, now.east_m

def is_at(x, y, yaw):
    off = [abs(place()[0] - x), abs(place()[1] - y), abs(telemetry.attitude_euler().yaw_deg - yaw) / 100.0]
    return max(off) < 0.03

mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
mavsdk.add_any_connection(URL)
robot = mavsdk.first_autopilot(timeout_s=15.0)
action, offboard, param, telemetry = Action(robot), Offboard(robot), Param(robot), Telemetry(robot)
param.set_param_float("ISMC_LAM_XY", 15.0)
assert param.get_param_float("ISMC_LAM_XY") == 15.0
offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
offboard.start()
until(lambda: telemetry.flight_mode().name == "OFFBOARD", "not shown before arming")
action.arm()
until(telemetry.armed, "not armed")
time.sleep(4.0)  # longer than MAVSDK follows a robot that is not in its mode
offboard.set_velocity_body(VelocityBodyYawspeed(0.1, 0.0, 0.0, 0.0))
until(lambda: place()[0] > 0.1, "no body velocity")
offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.1, 0.0, 30.0))
until(lambda: place()[1] > 0.1 and abs(telemetry.attitude_euler().yaw_deg - 30.0) < 5.0, "no velocity with a heading")
offboard.set_position_ned(PositionNedYaw(0.2, -0.1, 0.0, -20.0))
until(lambda: is_at(0.2, -0.1, -20.0), "no position")
assert offboard.is_active(), "MAVSDK went on sending"
offboard.stop()
until(lambda: telemetry.flight_mode().name == "HOLD", "no hold")
assert telemetry.armed()
offboard.set_velocity_body(VelocityBodyYawspeed(0.05, 0.0, 0.0, 0.0))
offboard.start()
until(lambda: telemetry.flight_mode().name == "OFFBOARD", "not the second time")
offboard.stop()  # setpoints are not needed now, heartbeats are
print("drives", flush=True)
import os
os._exit(0)  # as if it had crashed
"""
GRPC = """
import asyncio
from mavsdk_grpc import System
from mavsdk_grpc.offboard import PositionNedYaw, VelocityBodyYawspeed

async def until(stream, condition, what):
    async def wait():
        async for value in stream:
            if condition(value):
                return value
    try:
        return await asyncio.wait_for(wait(), 15.0)
    except asyncio.TimeoutError:
        raise SystemExit(what)

async def main():
    robot = System()
    await robot.connect(system_address=URL)
    await until(robot.core.connection_state(), lambda state: state.is_connected, "not connected")
    await robot.param.set_param_float("ISMC_LAM_XY", 15.0)
    await robot.offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
    await robot.action.arm()
    await robot.offboard.start()
    await until(robot.telemetry.flight_mode(), lambda mode: mode.name == "OFFBOARD", "not offboard")
    await robot.offboard.set_velocity_body(VelocityBodyYawspeed(0.1, 0.0, 0.0, 0.0))
    await until(robot.telemetry.position_velocity_ned(), lambda now: now.position.north_m > 0.1, "no velocity")
    await robot.offboard.set_position_ned(PositionNedYaw(0.0, 0.0, 0.0, 0.0))
    await until(robot.telemetry.odometry(), lambda now: abs(now.position_body.x_m) < 0.03, "no position")
    await robot.offboard.stop()
    await until(robot.telemetry.flight_mode(), lambda mode: mode.name == "HOLD", "no hold")
    await robot.action.disarm()

asyncio.run(main())
"""


@pytest.fixture
def url() -> Iterator[str]:
    with omni("sitl", "--link", "tcp:127.0.0.1:0", "--link", "tcp:127.0.0.1:0", "--json") as (_, ready):
        yield ready["links"][0]


def need(module: str, package: str) -> None:
    if find_spec(module) is None:
        needs.refuse(f"pip install '{package}'")


def lost_its_link(robot: Robot) -> bool:
    """Return whether the robot stopped because nobody commands it any more."""
    safety = robot.status.safety
    return safety is not None and "link loss" in " ".join(safety.fault_history).replace("_", " ").lower()


def run(program: str, url: str) -> str:
    """Run a program of MAVSDK against the robot; return what it printed."""
    program = program.replace(DOCUMENTED_URL, url.replace("tcp:", "tcpout://"))
    program = program.replace("URL", repr(url.replace("tcp:", "tcpout://")))
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.full
@pytest.mark.timeout(120)
def test_mavsdk_drives_offboard_and_its_end_is_a_lost_link() -> None:
    need("mavsdk", "mavsdk>=4.1,<5")
    with omni("sitl", "--link", "tcp:127.0.0.1:0", "--link", "tcp:127.0.0.1:0", "--json") as (_, ready):
        assert "drives" in run(FULL, ready["links"][0])
        with connect(ready["links"][1]) as robot:
            wait_until(lambda: lost_its_link(robot), "no link loss", pause=lambda: robot.pump(0.1))
            assert not robot.status.armed
            assert robot.parameters["ISMC_LAM_XY"] == 15.0


@pytest.mark.full
@pytest.mark.timeout(120)
def test_the_older_interface_of_mavsdk_drives_offboard(url: str) -> None:
    need("mavsdk_grpc", "mavsdk-grpc>=4,<5")
    run(GRPC, url)


@pytest.mark.full
@pytest.mark.timeout(120)
def test_the_documented_program_of_mavsdk_works(url: str) -> None:
    need("mavsdk", "mavsdk>=4.1,<5")
    (program,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert DOCUMENTED_URL in program
    assert "PositionVelocityNed" in run(program, url)
