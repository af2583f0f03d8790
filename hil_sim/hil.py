# SPDX-License-Identifier: MIT
"""Host-in-the-loop runs: the world around the real firmware over a link, in lockstep.

The same scenario and seed give the same log, byte for byte. Commands are sent at exact ticks, heartbeats by simulated
time, and time stamps are EPOCH_US plus simulated time. How long the firmware's ticks took by the wall clock, it is
asked now and then. The answers go into the summary and not into the log.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import omniwheel.robot
from hil_sim import core
from hil_sim.external import ExternalWorld, OutsideWorld, outside_world
from hil_sim.image_firmware import ImageFirmware
from hil_sim.lockstep import CHILD_TICK_TIMEOUT_S, MEASURED, ROBOT_TICK_TIMEOUT_S, LockstepLink, Served, Waiting
from hil_sim.runs import Run, finish, new_world
from hil_sim.scenario import Event, Scenario
from hil_sim.summary import TLOG_FILE
from hil_sim.timeline import Progress, RunError, play
from hil_sim.world import World
from omniwheel.connection import Connection
from omniwheel.default_system import default_system
from omniwheel.dialect import Message, mavlink
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from omniwheel.errors import CommandRefusedError, OmniError
from omniwheel.firmware_child import FirmwareChild
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.link import FileLink, open_link
from omniwheel.robot import Robot
from omniwheel.telemetry import Status, decode
from omniwheel.tlog import SIMULATED_EPOCH_US, TlogWriter

EPOCH_US = SIMULATED_EPOCH_US
"""Where simulated time starts in a log."""

SERVICE_TICKS = 10
"""Heartbeats are sent and messages taken this often."""
STREAM_TICKS = 100
"""A velocity or duty is asked for again this often, well within SAFE_CMD_TO."""

MEASURE_TICKS = 5000
"""The firmware is asked for the times of its ticks this often."""

AT_REST = "stand"
"""The world at an image's pins until it is in the loop."""

_ID_BYTES = slice(7, 10)
_UNHEARD = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    mavlink.MAVLINK_MSG_ID_ODOMETRY,
    mavlink.MAVLINK_MSG_ID_OMNI_TRACKING,
    mavlink.MAVLINK_MSG_ID_OMNI_WHEELS,
    mavlink.MAVLINK_MSG_ID_OMNI_CONTROL,
    mavlink.MAVLINK_MSG_ID_OMNI_STATUS,
    mavlink.MAVLINK_MSG_ID_OMNI_HEALTH,
)
"""Streams that are logged, but not decoded while ticks run."""
_STATUS_ID = mavlink.MAVLINK_MSG_ID_OMNI_STATUS.to_bytes(3, "little")


class AfterRunError(RunError):
    """``run`` is over and good; then its log could not be finished, or the robot not be given back."""

    def __init__(self, run: Run, error: OmniError) -> None:
        super().__init__(f"error after the end of the run: {error}", hint=error.hint)
        self.run = run


class HilLoop:
    """The world and the firmware over a lockstep link."""

    def __init__(
        self,
        scenario: Scenario,
        base: FileLink,
        world: World | None = None,
        *,
        waiting: Waiting = MEASURED,
        timeout_s: float = CHILD_TICK_TIMEOUT_S,
    ) -> None:
        """``world`` goes on where an earlier loop left it; without it, the scenario's starts.

        ``waiting`` and ``timeout_s`` as of :class:`~hil_sim.lockstep.LockstepLink`.
        """
        self._table = scenario.robot.table
        self.values = scenario.parameter_values()
        self.link = LockstepLink(base, world or new_world(scenario), waiting=waiting, timeout_s=timeout_s)
        self.measured: list[Status] = []
        connection = Connection(self.link, clock=self.link.clock_s)
        connection.target_system = int(self.values["SYS_ID"])
        connection.target_component = mavlink.MAV_COMP_ID_AUTOPILOT1
        connection.add_listener(self._take_status)
        self.robot = Robot(connection, table=self._table)
        self._stream: Callable[[], None] | None = None
        self._start_pose = scenario.start_pose
        self._next_measurement = MEASURE_TICKS
        self._log: TlogWriter | None = None
        self.link.serve_every(SERVICE_TICKS, _UNHEARD, None)

    @property
    def ticks(self) -> int:
        """Ticks run so far."""
        return self.link.ticks

    def log_to(self, log: TlogWriter) -> None:
        """Keep every frame from now on."""
        self._log = log
        self.robot.connection.recorder = log.write
        self.link.serve_every(SERVICE_TICKS, _UNHEARD, EPOCH_US)

    def advance(self, ticks: int) -> NDArray[Any]:
        """Run ticks and return the samples since the last call.

        Compiled code looks after the robot's messages meanwhile; this returns to Python only to send. What the robot
        streams often is not listened to, so :attr:`robot`'s status has only its heartbeats and texts.
        """
        end = self.link.ticks + ticks
        while self.link.ticks < end:
            self.robot.connection.raise_pending()  # a recorder that failed, as on a full disk
            self.robot.connection.beat()
            self._take(self.link.serve())
            if self.link.ticks >= self._next_measurement and not self.link.silent:
                self._measure()
            if self._stream is not None and self.link.ticks % STREAM_TICKS < SERVICE_TICKS:
                self._stream()
            self.link.run_served(max(min(self._next_sending(), end) - self.link.ticks, 0), self._take)
        return self.link.take_samples()

    def _next_sending(self) -> int:
        """Return the next of the ticks at which messages are taken and there is something to send."""
        now = self.link.ticks // SERVICE_TICKS + 1
        stops = [max(now, -(-self._next_measurement // SERVICE_TICKS)) * SERVICE_TICKS]
        if self._stream is not None:
            stops.append((self.link.ticks // STREAM_TICKS + 1) * STREAM_TICKS)
        due_s = self.robot.connection.next_heartbeat_s
        if math.isfinite(due_s):
            beat = max(now, math.floor(due_s * 1e3 / SERVICE_TICKS))
            while beat * SERVICE_TICKS * 1e-3 < due_s:
                beat += 1
            stops.append(beat * SERVICE_TICKS)
        return min(stops)

    def _take(self, served: Served) -> None:
        if self._log is not None:
            self._log.write_records(served.records, served.record_count)
        if served.frames:
            with self.robot.connection.unrecorded():
                self.robot.connection.feed(served.frames)

    def apply(self, event: Event) -> None:
        """Send what the event says and wait, in simulated time, for the robot's confirmation."""
        if self.link.silent:
            return
        if event.settings is not None:
            self.values.update(event.settings)
            self.robot.parameters.set_many(dict(event.settings))
        elif event.velocity is not None:
            self._stream = partial(self.robot.set_velocity, *event.velocity)
            self._stream()
        elif event.duty is not None:
            self._stream = partial(self.robot.set_duty, event.duty)
            self._stream()
        else:
            self._command(str(event.command))

    def path_ticks(self, share: float) -> int:
        """Return the ticks from the path's start until this share of it is driven."""
        return core.path_ticks(core.robot_config(self.values, self._table, 0), share)

    def place(self) -> None:
        """Tell the robot where it stands."""
        self.robot.set_pose_estimate(*self._start_pose)

    def _command(self, command: str) -> None:
        if command in ("trajectory_start", "trajectory_stop", "estop", "disarm"):
            self._stream = None
        commands = {
            "arm": self.robot.arm,
            "disarm": self.robot.disarm,
            "estop": self.robot.estop,
            "trajectory_start": self.robot.start_trajectory,
            "trajectory_stop": self.robot.stop_trajectory,
        }
        commands[command]()

    def _measure(self) -> None:
        """Ask how long ticks take, past the log."""
        self._next_measurement += MEASURE_TICKS
        connection = self.robot.connection
        recorder = connection.recorder
        if recorder is not None:
            record = recorder
            connection.recorder = lambda frame: None if frame[_ID_BYTES] == _STATUS_ID else record(frame)
        try:
            self.robot.commands.request_message(Status.message, self.robot.timeout_s)
        finally:
            connection.recorder = recorder

    def _take_status(self, message: Message) -> None:
        status = decode(Status, message)
        if status is not None and status.tick_us_max > 0.0:
            self.measured.append(status)


def run_hil(
    scenario: Scenario,
    link: str | None = None,
    *,
    seed: int | None = None,
    out_dir: Path | None = None,
    progress: Progress | None = None,
    emulated: bool = False,
    waiting: Waiting = MEASURED,
    image: Path | None = None,
    world: ExternalWorld | None = None,
) -> Run:
    """Run a scenario with real firmware: the one behind ``link``, or one of its own, as a process or ``emulated``.

    With ``image`` it is the image for a Teensy in that file, on an emulated one, over its USB port.

    With ``out_dir``, the telemetry log is written there. A robot behind a link gets the scenario's parameters for the
    run and its own ones back afterwards; nothing is stored on it. ``waiting`` as of :class:`LockstepLink`, for
    comparison. ``world`` takes the place of the simulated one; it is released at the end of the run, its motors
    coasting.

    Raises RunError before anything is changed on a firmware that was started in lockstep. Whatever ends the run, a
    robot behind a link is disarmed and out of host-in-the-loop then. AfterRunError holds a run that was good to its
    end. ExternalWorldError tells what ``world`` did wrong, ExternalWorldInputError what it cannot do.
    """
    scenario = scenario.with_seed(seed)
    outside = None if world is None else outside_world(scenario, world)
    run: Run | None = None
    try:
        with _closed_loop(
            scenario, link, out_dir, emulated=emulated, waiting=waiting, image=image, world=outside
        ) as loop:
            run = _run(scenario, loop, progress)
    except OmniError as error:
        if run is None:
            raise
        raise AfterRunError(run, error) from error
    return run if outside is None else replace(run, world=outside.name)


@contextmanager
def _closed_loop(
    scenario: Scenario,
    link: str | None,
    out_dir: Path | None,
    *,
    emulated: bool,
    waiting: Waiting,
    image: Path | None,
    world: OutsideWorld | None,
) -> Iterator[HilLoop]:
    with ExitStack() as stack:
        if world is not None:
            stack.callback(world.release)
        timeout_s = CHILD_TICK_TIMEOUT_S if link is None else ROBOT_TICK_TIMEOUT_S
        if image is not None:
            firmware = ImageFirmware(image, scenario.robot.source, lockstep=True, scenario=AT_REST)
            link = stack.enter_context(firmware).urls[0]
        base = stack.enter_context(
            _own_firmware(scenario, emulated) if link is None else _linked_firmware(scenario, link)
        )
        loop = HilLoop(scenario, base, world, waiting=waiting, timeout_s=timeout_s)
        if out_dir is not None:
            log = TlogWriter(out_dir / TLOG_FILE, lambda: EPOCH_US + round(loop.link.clock_s() * 1e6))
            loop.log_to(stack.enter_context(log))
        yield loop


def _run(scenario: Scenario, loop: HilLoop, progress: Progress | None) -> Run:
    start = time.perf_counter()
    played = play(scenario, loop, progress)
    wall_s = time.perf_counter() - start
    silent = loop.link.silent
    version = "" if silent else str(loop.robot.version)
    parameters = loop.values if silent else dict(loop.robot.parameters)
    run = finish(scenario, "hil", played, wall_s, parameters, version)
    texts = tuple(text.text for text in loop.robot.texts.all)
    return replace(run, tick_us=_tick_times(loop.measured), messages=texts)


def _tick_times(statuses: list[Status]) -> dict[str, float]:
    if not statuses:
        return {}
    return {
        "mean": float(np.mean([status.tick_us_mean for status in statuses])),
        "max": max(status.tick_us_max for status in statuses),
    }


@contextmanager
def _own_firmware(scenario: Scenario, emulated: bool) -> Iterator[FileLink]:
    values = scenario.parameter_values()
    own: FirmwareChild = (
        EmulatedFirmware(parameters=values, links=[DIRECT], lockstep=True)
        if emulated
        else FirmwareProcess(parameters=values, links=["tcp:127.0.0.1:0"], lockstep=True)
    )
    with own as firmware:
        base = firmware.open_link()
        try:
            yield base
        finally:
            base.close()


@contextmanager
def _linked_firmware(scenario: Scenario, url: str) -> Iterator[FileLink]:
    base = open_link(url)
    with omniwheel.robot.connect(base, system_id=default_system()) as robot:
        _free(robot)
        wanted = scenario.parameter_values()
        wanted["SYS_ID"] = robot.parameters["SYS_ID"]
        before = dict(robot.parameters)
        changed = {name: value for name, value in wanted.items() if before.get(name) != value}
        own = {name: before[name] for name in changed}
        try:
            robot.parameters.set_many(changed)
            robot.enter_hil()
            yield base
        except BaseException:
            with suppress(OmniError):  # what went wrong first is to be heard
                _give_back(robot, own)
            raise
        _give_back(robot, own)


def _free(robot: Robot) -> None:
    """Take a robot out of the host-in-the-loop of a host that was killed. RunError if it cannot leave, ever."""
    try:
        robot.leave_hil()
    except CommandRefusedError as error:
        hint = "start that firmware without --lockstep: the run enables host-in-the-loop itself"
        raise RunError(f"the firmware behind {robot.url} cannot be used for a run: {error}", hint=hint) from error


def _give_back(robot: Robot, values: Mapping[str, float]) -> None:
    """Leave host-in-the-loop, which disarms whatever the state is, and set the robot's own parameters again."""
    robot.leave_hil()
    robot.parameters.set_many(dict(values))


__all__ = ["EPOCH_US", "AfterRunError", "HilLoop", "RunError", "run_hil"]
