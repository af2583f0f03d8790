# SPDX-License-Identifier: MIT
"""A simulated robot for the page: ``omni sitl`` as a child process, and what is broken there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni.studio.actions import BadRequestError, number_of
from omni.studio.processors import EMULATED, IMAGE, PC, SHORT
from omniwheel.errors import FirmwareStartError, LinkError

_END_S = 5.0


@dataclass(frozen=True)
class Simulation:
    """What to simulate: a scenario, the robot (None: the scenario's), the seed, and what runs the firmware.

    ``processor`` is one of :mod:`omni.studio.processors`; ``image`` the file for IMAGE.
    """

    scenario: str
    robot: str | None = None
    seed: int = 1
    processor: str = PC
    image: str = ""

    def command(self) -> list[str]:
        """Return the command line, without the interpreter."""
        words = ["sitl", self.scenario, "--port", "0", "--json"]
        words += ["--seed", str(self.seed), "--end-with-stdin"]  # it ends with this program, however that ends
        words += [] if self.processor == IMAGE else ["--commands"]
        words += ["--image", self.image] if self.processor == IMAGE else []
        words += ["--board", "cortex-m7"] if self.processor == EMULATED else []
        return words + (["--robot", self.robot] if self.robot else [])

    def __str__(self) -> str:
        return self.scenario if self.processor == PC else f"{self.scenario}, {SHORT[self.processor]}"


class SimulatedRobot:
    """A firmware with its world in real time, until :meth:`close`. Raises FirmwareStartError if it does not start.

    ``memory`` is the file of its non-volatile memory. Without one it forgets what it stores.
    ``catalogue`` has what can be broken and how fast the world can run, in words, as ``omni sitl --commands`` says.
    It is None for the flashed image, whose world takes no commands. ``now`` is what is on. It is None until the world
    has said so.
    """

    def __init__(self, wanted: Simulation, memory: Path | None = None) -> None:
        self.wanted = wanted
        command = [sys.executable, "-m", "omni", *wanted.command()]
        command += [] if memory is None else ["--storage", str(memory)]
        self.now: dict[str, Any] | None = None
        self.refusal = ""
        """What the world said last against a command."""
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.url, self.robot, self.catalogue = self._ready(command)
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._listen, self._listen_to_errors)]
        for reader in self._readers:
            reader.start()

    def _ready(self, command: Sequence[str]) -> tuple[str, str, dict[str, Any] | None]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        try:
            ready = json.loads(line)
            return str(ready["links"][0]), str(ready["robot"]), ready.get("world")
        except (ValueError, KeyError, IndexError, TypeError) as error:
            answer = line + self._process.stdout.read()
            _, said = self._process.communicate()
            raise _why(answer, said or f"{' '.join(command)} did not start") from error

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.now = json.loads(line)["now"]

    def _listen_to_errors(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self.refusal = line.strip()

    def change(self, request: Mapping[str, Any]) -> None:
        """Break or mend something in the world, or let it run at another speed.

        ``request`` is a command of ``omni sitl --commands``; other keys are left out. Waits for nothing. Raises
        BadRequestError if the world has nothing like that, LinkError if it takes no commands.
        """
        if self.catalogue is None:
            raise BadRequestError(
                "the world around an emulated image cannot be changed", hint="choose another processor"
            )
        line = json.dumps(_command(self.catalogue, request)) + "\n"
        assert self._process.stdin is not None
        self.refusal = ""
        try:
            os.write(self._process.stdin.fileno(), line.encode())  # so short a line goes whole or not at all
        except (OSError, ValueError) as error:  # full, broken or closed
            raise LinkError("the simulated world does not accept commands", hint="restart the simulation") from error

    def state(self) -> dict[str, Any] | None:
        """Return what is on in the world, its speed, and what it said last against a command; None if it takes none."""
        return None if self.catalogue is None else {**(self.now or {}), "refusal": self.refusal}

    @property
    def speed(self) -> float:
        """How fast the world runs, times real time."""
        return 1.0 if self.now is None else float(self.now["speed"])

    @property
    def slowness(self) -> float:
        """How many times longer than on a real robot everything takes, at least 1."""
        return max(1.0, 1.0 / self.speed)

    @property
    def process_id(self) -> int:
        """The child's number."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether it has not ended by itself."""
        return self._process.poll() is None

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        try:
            self._process.wait(timeout=_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for reader in self._readers:
            reader.join(_END_S)
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()


def _command(catalogue: Mapping[str, Any], request: Mapping[str, Any]) -> dict[str, Any]:
    if request.get("mend") is True:
        return {"mend": True}
    if "speed" in request:
        speed = request["speed"]
        if isinstance(speed, bool) or speed not in catalogue["speeds"]:
            raise BadRequestError(f"unsupported simulation speed: {speed!r} times real time")
        return {"speed": speed}
    name, wheel, on = (request.get(key) for key in ("fault", "wheel", "on"))
    fault = next((one for one in catalogue["faults"] if one["name"] == name), None)
    if fault is None:
        raise BadRequestError(f"unknown fault {name!r}")
    if not isinstance(on, bool):
        raise BadRequestError(f"on must be true or false, not {on!r}")
    duration = {"duration_s": number_of(request, "duration_s")} if "duration_s" in request else {}
    if not fault["wheels"]:
        return {"fault": name, "on": on, **duration}
    if isinstance(wheel, bool) or wheel not in fault["wheels"]:
        raise BadRequestError(f"unknown wheel {wheel!r}")
    return {"fault": name, "wheel": wheel, "on": on, **duration}


def _why(answer: str, said: str) -> FirmwareStartError:
    """Return why a simulation did not start, from its answer in JSON or else its words."""
    try:
        error = json.loads(answer)["error"]
        return FirmwareStartError(str(error["message"]), hint=str(error["hint"]))
    except (ValueError, KeyError, TypeError):
        return FirmwareStartError(said.strip().splitlines()[0])
