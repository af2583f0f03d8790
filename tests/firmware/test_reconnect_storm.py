# SPDX-License-Identifier: MIT
"""Hundreds of connections and half frames on another link while the robot drives: it takes no notice, leaks nothing."""

from __future__ import annotations

import os
import random
import socket
from pathlib import Path

import pytest

from tests.firmware.client import WAIT_S, Client, Firmware, connect, firmware, mav
from tests.firmware.test_commands import ARMED, send_velocity

ROUNDS = 200
TURN = 0.2 * 0.2632 / 0.0508


def open_files(robot: Firmware) -> int:
    return len(os.listdir(f"/proc/{robot.process.pid}/fd"))


def resident_kb(robot: Firmware) -> int:
    lines = Path(f"/proc/{robot.process.pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def frames() -> bytes:
    sender = mav.MAVLink(None, srcSystem=255, srcComponent=190)
    heartbeat = mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
    arm = mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0)
    return bytes(heartbeat.pack(sender) + arm.pack(sender)[:-3])


def storm(robot: Firmware, count: int, chance: random.Random) -> None:
    """Connect, say a part of something, and go, politely or not."""
    for _ in range(count):
        with socket.create_connection(robot.address(1), timeout=WAIT_S) as visitor:
            if chance.random() < 0.5:
                visitor.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            said = frames()
            visitor.sendall(chance.choice([b"", said[: chance.randrange(len(said))], chance.randbytes(300)]))


def run(driver: Client, ticks: int) -> None:
    driver.heartbeat()
    send_velocity(driver, 0, 0, -0.2)
    for tick in driver.ticks(ticks):
        assert tick.actuators.state == ARMED
        assert list(tick.actuators.wheel_reference)[:3] == pytest.approx([TURN] * 3, abs=1e-3)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="looks at /proc")
def test_the_robot_keeps_its_path_and_its_memory() -> None:
    chance = random.Random(1)
    with firmware("--lockstep", links=("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")) as robot:
        driver = connect(robot, 0).armed()
        send_velocity(driver, 0, 0, -0.2)
        driver.ticks(400)
        storm(robot, 20, chance)
        run(driver, 50)
        files, memory = open_files(robot), resident_kb(robot)
        for _ in range(ROUNDS // 10):
            storm(robot, 10, chance)
            run(driver, 20)
        with socket.create_connection(robot.address(1), timeout=WAIT_S) as last:
            last_client = Client(last)
            last_client.wait("HEARTBEAT")
        run(driver, 200)
        assert open_files(robot) <= files + 1
        if not os.environ.get("OMNI_SANITIZED"):  # the sanitizers keep books of their own
            assert resident_kb(robot) <= memory + 256
        driver.socket.close()
