# SPDX-License-Identifier: MIT
"""The real firmware in a simulated world, for a program that wants a robot: in real time, or as fast as it goes.

:func:`omniwheel.simulate` is made of this.
"""

from __future__ import annotations

import json
import math
import threading
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.external import ExternalWorld, load_world, outside_world
from hil_sim.live_world import LiveWorld
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.sitl import Sitl, start_sitl
from hil_sim.world import World
from omni_schema import Robot
from omniwheel.errors import OmniError
from omniwheel.firmware_child import FirmwareChild
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.frames import Pose, Twist
from omniwheel.link import Link

DEFAULT_SCENARIO = "sitl"
LINK = "tcp:127.0.0.1:0"
SLICE_TICKS = 5
"""How often commands to the world are looked at."""
TRUTH_PERIOD_MS = 20
_END_S = 10.0
_ANSWER_S = 10.0


class TruthRecord:
    """True poses every TRUTH_PERIOD_MS of simulated time: 12 MB in four hours."""

    def __init__(self) -> None:
        self._rows = array("d")
        self._lock = threading.Lock()

    def take(self, samples: NDArray[Any]) -> None:
        """Keep what is due of some samples."""
        due = samples[np.rint(samples["time_s"] * 1e3) % TRUTH_PERIOD_MS == 0]
        with self._lock:
            for time_s, pose in zip(due["time_s"], due["truth"], strict=True):
                self._rows.extend((time_s, *pose))

    @property
    def rows(self) -> NDArray[np.float64]:
        """Rows of time [s], x [m], y [m], theta [rad, not wrapped]."""
        with self._lock:
            return np.array(self._rows).reshape(-1, 4)


class Simulation:
    """The world around a simulated robot. ``link`` and ``clock`` are for the program, ``urls`` for other programs.

    ``clock`` is None in real time.
    """

    def __init__(
        self, link: Link | str, clock: Callable[[], float] | None, world: World, firmware: FirmwareChild
    ) -> None:
        self.link = link
        self.clock = clock
        self.urls: tuple[str, ...] = ()
        self.firmware = firmware
        """The process of the firmware."""
        self.truth = TruthRecord()
        """Where the robot has been, on its clock."""
        self._world = world

    @property
    def true_pose(self) -> Pose:
        """Where the robot really is; theta is not wrapped."""
        return Pose(*map(float, self._world.truth))

    @property
    def true_twist(self) -> Twist:
        """Its true velocity in the world's frame."""
        return Twist(*map(float, self._world.twist))

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return self._world.time_s

    def fault(self, name: str, *, wheel: int | None = None, on: bool = True, value: float | None = None) -> None:
        """Break something, or mend it with ``on`` False: the faults of `omni sitl --commands`; ``wheel`` from 1.

        Raises OmniError that says what there is.
        """
        command = {"fault": name, "wheel": wheel, "on": on, "value": value}
        self._apply(json.dumps({key: item for key, item in command.items() if item is not None}))

    def mend(self) -> None:
        """End all faults."""
        self._apply('{"mend": true}')

    def _apply(self, line: str) -> None:
        raise NotImplementedError


class _Stepped(Simulation):
    def __init__(self, link: SteppedLink, world: World, live: LiveWorld, firmware: FirmwareChild) -> None:
        super().__init__(link, link.clock_s, world, firmware)
        self._live = live
        link.on_samples = self.truth.take

    def _apply(self, line: str) -> None:
        self._live.apply_command(line)


class _RealTime(Simulation):
    """Its world runs in a thread of its own."""

    def __init__(self, running: Sitl) -> None:
        super().__init__(running.urls[0], None, running.world, running.firmware)
        self.urls = running.urls[1:]
        running.link.on_samples = self.truth.take
        self._running = running
        self._lines: Queue[tuple[str, Queue[OmniError | None]]] = Queue()
        self._ending = threading.Event()
        self.error: BaseException | None = None
        """Why the world ended by itself."""
        self._thread = threading.Thread(target=self._run, name="simulated world", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                self._running.advance(SLICE_TICKS)
                self._apply_waiting()
        except BaseException as error:
            self.error = error

    def _apply_waiting(self) -> None:
        while not self._lines.empty():
            line, answer = self._lines.get()
            try:
                self._running.live.apply_command(line)
                answer.put(None)
            except OmniError as error:
                answer.put(error)

    def _apply(self, line: str) -> None:
        answer: Queue[OmniError | None] = Queue()
        self._lines.put((line, answer))
        try:
            error = answer.get(timeout=_ANSWER_S)
        except Empty:
            raise OmniError("the simulated world does not answer", hint="did its firmware end?") from self.error
        if error is not None:
            raise error

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        self._thread.join(_END_S)


def scenario_of(robot: str | Path | Robot, scenario: str | Path | Scenario | None, seed: int | None) -> Scenario:
    """Return what is simulated. Raises SchemaError, RobotFileError."""
    name = None if isinstance(robot, Robot) else str(robot)
    given = load_scenario(scenario or DEFAULT_SCENARIO, name) if not isinstance(scenario, Scenario) else scenario
    if isinstance(robot, Robot):
        given = replace(given, robot=robot)
    return given.with_seed(seed)


@contextmanager
def simulated(
    robot: str | Path | Robot,
    *,
    world: str | ExternalWorld | None,
    scenario: str | Path | Scenario | None,
    seed: int | None,
    real_time: bool,
) -> Iterator[Simulation]:
    """Start firmware and world, and end both with the context."""
    plan = scenario_of(robot, scenario, seed)
    outside = load_world(world, plan) if isinstance(world, str) else world
    if real_time:
        with start_sitl(plan, [LINK, LINK], world=outside) as running:
            simulation = _RealTime(running)
            try:
                yield simulation
            finally:
                simulation.close()
        return
    with _stepped(plan, outside) as stepped:
        yield stepped


@contextmanager
def _stepped(plan: Scenario, outside: ExternalWorld | None) -> Iterator[Simulation]:
    around: Any = new_world(plan) if outside is None else outside_world(plan, outside)
    with FirmwareProcess(parameters=plan.parameter_values(), links=[LINK], lockstep=True) as firmware:
        link = SteppedLink(firmware.open_link(), around)
        link.end_s = math.inf
        try:
            yield _Stepped(link, around, LiveWorld(plan, link, around), firmware)
        finally:
            link.close()
            if outside is not None:
                around.release()
