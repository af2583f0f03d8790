# SPDX-License-Identifier: MIT
"""A hub whose lines nobody reads, as on a terminal that was paused with Ctrl-S: stops go through all the same."""

from __future__ import annotations

import os
import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from omniwheel.hub import places
from omniwheel.robot import connect
from tests.hub.parts import PROGRAM, WAIT_S, Cable

OUR_HUBS = {
    "omni link": (PROGRAM, "link", "--listen", "tcp:127.0.0.1:0", "--link"),
    "in the background": (sys.executable, "-m", "omni.hub.background"),
}


@contextmanager
def full_pipe() -> Iterator[int]:
    """Yield the end of a pipe that takes no byte more."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    while select.select([], [writing], [], 0.0)[1]:
        os.write(writing, bytes(4096))
    os.set_blocking(writing, True)
    yield writing
    os.close(writing)
    os.close(reading)


@pytest.mark.full
@pytest.mark.parametrize("hub", OUR_HUBS)
@pytest.mark.parametrize("where", ["a pipe that nobody reads", "/dev/full"])
def test_a_hub_that_cannot_say_anything_passes_stops_on(cable: Cable, hub: str, where: str) -> None:
    with full_pipe() as pipe, open("/dev/full", "wb", buffering=0) as full:
        output = pipe if where.startswith("a pipe") else full.fileno()
        started = subprocess.Popen(
            [*OUR_HUBS[hub], str(cable.path)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=output,
        )
        try:
            _await_hub(cable)
            done = subprocess.run(
                [PROGRAM, "stop", "--link", str(cable.path)],
                capture_output=True,
                text=True,
                timeout=WAIT_S,
                check=False,
            )
            assert done.returncode == 0, done.stderr
            assert "is shared" in done.stderr
            with connect(str(cable.path)) as robot:
                robot.wait_until(lambda status: status.state == "estop", WAIT_S, "stopped")
        finally:
            started.kill()
            started.wait()


@pytest.mark.full
def test_a_disarm_does_not_wait_for_what_its_command_says(cable: Cable, hub_url: str) -> None:
    with connect(hub_url) as robot, open("/dev/full", "wb", buffering=0) as full:
        robot.arm()
        robot.parameters.set_many({"SAFE_CMD_TO": 60.0, "SAFE_LINK_TO": 600.0})  # nothing else is to stop it
        words = (PROGRAM, "stop", "--disarm", "--link", str(cable.path))
        with subprocess.Popen(words, stdout=full, stderr=full) as stop:
            robot.wait_until(lambda status: not status.armed, WAIT_S, "disarmed")
            stop.wait(WAIT_S)


def _await_hub(cable: Cable) -> None:
    for _ in range(600):
        if places.find(places.HUB, str(cable.path)) is not None:
            return
        select.select([], [], [], 0.1)
    raise AssertionError("the hub did not start")
