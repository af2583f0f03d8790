# SPDX-License-Identifier: MIT
"""One robot, served by a thread of its own: what it says is gathered, what is asked of it is done in turn."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from omni.studio.edits import Edits
from omni.studio.error_text import in_words
from omni.studio.last_stop import LastStop
from omni.studio.link_quality import LinkQuality
from omni.studio.marks import Marks
from omni.studio.samples import SampleStore
from omni.studio.signals import KINDS
from omni.studio.urgent_link import UrgentLink
from omni.studio.work_queue import DISARM, SETPOINT, STOP, WorkQueue
from omniwheel.connection import Recorder
from omniwheel.dialect import Message, mavlink
from omniwheel.drive_log import is_slow
from omniwheel.errors import CommandRefusedError, LinkError, LinkLostError, OmniError, StoppedError
from omniwheel.history import ChangeRecorder, RobotHistory, history_of
from omniwheel.hub.shared_link import open_shared
from omniwheel.robot import FORCE, Robot, connect
from omniwheel.sensor_messages import RADIO_RATE_HZ, ask_for
from omniwheel.sensor_quality import Sensor, sensors_of
from omniwheel.telemetry import Control, Fix, Status, StatusText, Telemetry, decode

_LOG = logging.getLogger(__name__)
CONNECT_TIMEOUT_S = 3.0
RETRY_S = 1.0
"""After unplugging, how often the port is looked for."""
_PUMP_S = 0.01
_SILENT_S = 5.0
"""Without a heartbeat for so long, the robot counts as gone."""
_LONGEST_LISTENED_S = 0.5
"""Largest listening time counted for one pass of the loop, so that a suspended computer counts no silence."""
PAGE_SILENT_S = 2.0
"""A page that says nothing for so long is closed, frozen or lost."""
TEXTS_KEPT = 200
FIXES_KEPT = 200
_BYTES_OVER_S = 1.0
PLOT_MESSAGES, PLOT_RATE_HZ = ("OMNI_TRACKING", "OMNI_WHEELS", "OMNI_CONTROL"), 100.0
"""What a link that is no slow radio is asked for, as long as the studio is connected."""
FIX_MESSAGE = "OMNI_FIX_RESULT"
"""The same. An older firmware does not have it."""

T = TypeVar("T")


def set_rate(robot: Robot, rate_hz: float | None) -> None:
    """Set the rate of what is plotted; None restores the rates at boot."""
    for name in PLOT_MESSAGES:
        robot.set_message_interval(name, rate_hz)
    with suppress(CommandRefusedError):
        robot.set_message_interval(FIX_MESSAGE, rate_hz)
    ask_for(robot, sensors_of(robot.parameters.known), rate_hz)


def begin_telemetry(robot: Robot) -> None:
    """Set the rate that plots want. A slow radio keeps its own rates, and tells of the robot's sensors now and then."""
    if is_slow(robot.url):
        ask_for(robot, sensors_of(robot.parameters.known), RADIO_RATE_HZ)
    else:
        set_rate(robot, PLOT_RATE_HZ)


def set_automatic_rate(robot: Robot) -> None:
    """The same after another rate was chosen."""
    if is_slow(robot.url):
        set_rate(robot, None)
    begin_telemetry(robot)


def end_telemetry(robot: Robot) -> None:
    """Restore the rates at boot."""
    if is_slow(robot.url):
        ask_for(robot, sensors_of(robot.parameters.known), None)
    else:
        set_rate(robot, None)


class _Silence:
    """Time for which a robot was silent while the studio listened.

    A computer that was suspended, or given to other programs, finds an old heartbeat when it wakes up. The robot's
    newer ones may wait in the link, or the robot was simulated and stood still, too.
    """

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._silent_s = 0.0

    def seconds(self, now_s: float, heartbeat_age_s: float) -> float:
        """Return the silence [s]. Call it in every pass: ``now_s`` is its time, never decreasing."""
        passed_s = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        self._silent_s = min(heartbeat_age_s, self._silent_s + min(passed_s, _LONGEST_LISTENED_S))
        return self._silent_s


class WorkEndedError(LinkError):
    """Long work was ended from outside: by a stop, or because the page in command was closed."""


class Session:
    """The connection to one link, from the first attempt to :meth:`close`. It connects again after a loss.

    Everything that touches the robot runs in this object's thread; other threads hand it work by :meth:`do`. A stop
    (:meth:`stop_now`) waits for none of that work. ``lock`` guards :attr:`store`, :attr:`marks`, :attr:`texts` and
    :attr:`fixes`.
    ``slowness`` says how many times slower than real time the robot lives, if it is simulated. ``system_id`` chooses a
    robot where several share the link.
    """

    def __init__(self, url: str, slowness: Callable[[], float] = lambda: 1.0, system_id: int | None = None) -> None:
        self.url = url
        self._system_id = system_id
        self._slowness = slowness
        self.lock = threading.Lock()
        self.store = SampleStore()
        self.marks = Marks()
        self.texts: deque[tuple[int, StatusText]] = deque(maxlen=TEXTS_KEPT)
        self.text_count = 0
        self.fixes: deque[tuple[int, Fix]] = deque(maxlen=FIXES_KEPT)
        """Pose fixes that the robot has looked at, with our own count of them: the robot's begins anew."""
        self.fix_count = 0
        self.mark_changes = 0
        self.phase = "connecting"
        """connecting, connected, lost or closed."""
        self.trouble = ""
        """Why there is no connection, in words."""
        self.robot: Robot | None = None
        self.edits: Edits | None = None
        self.history: Path | None = None
        """Where the changes of this robot's parameters are kept; None before it is known."""
        self.page_heard_s = float("-inf")
        """When the page that commands was heard last, on the monotonic clock."""
        self.page_commands = False
        self.sensors: tuple[Sensor, ...] = ()
        """Those of the robot, as they were asked for."""
        self.rx_bytes_s = 0.0
        self.quality: LinkQuality | None = None
        self.last_stop = LastStop()
        self.connections = 0
        """How often it has been connected: after a loss, everything may be another robot's."""
        self.drive_ended = ""
        """Why the drive that was begun here is over, in words, until the next one; "": it is not, or there is none."""
        self.stops = 0
        """How often something was to be stopped or disarmed: what was asked for before is not to be begun any more."""
        self._stop_wanted = False
        self._long_work = False
        self._link: UrgentLink | None = None
        self._work = WorkQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"robot {url}", daemon=True)

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def close(self) -> None:
        """Disarm the robot if this program armed it, and let go of the link."""
        self._closing.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def do(self, work: Callable[[Robot], T], *, is_setpoint: bool = False) -> Future[T]:
        """Have ``work`` done by the robot's thread, after what was asked for before.

        A setpoint that still waits when a newer one comes is left out.
        """
        if self.phase == "connected":
            return self._work.put(work, kind=SETPOINT if is_setpoint else "")
        future: Future[T] = Future()
        future.set_exception(LinkLostError("no robot is connected", hint=self.trouble))
        return future

    def do_long(self, work: Callable[[Robot], T]) -> Future[T]:
        """The same for work that takes long and moves the robot: a stop or the loss of the page end it at once.

        It ends by a :class:`WorkEndedError` wherever it waits for the robot, once. Cleaning up can wait as usual.
        """
        return self.do(lambda robot: self._do_long(robot, work))

    def come_to_rest(self) -> None:
        """End a stream of setpoints whose page repeats them no more: without this, the robot ends it by a failsafe."""
        self.do_long(Robot.stop)

    def stop_now(self) -> bool:
        """Send an emergency stop before anything else that waits; return whether there is a robot to hear it now.

        If there is none, the next one that is heard on this link is stopped.
        """
        self._stop_wanted = True
        return self._at_once(STOP, mavlink.MAV_CMD_OMNI_ESTOP, (1.0, 0.0), self._confirm_stop)

    def _confirm_stop(self, robot: Robot) -> None:
        robot.estop()
        self._stop_wanted = False

    def disarm_now(self) -> bool:
        """The same with disarming."""
        return self._at_once(DISARM, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, FORCE), Robot.disarm)

    def record(self, recorder: Recorder) -> Robot:
        """Give every frame of this connection to ``recorder`` from now on; return the robot. Raises LinkLostError."""
        robot, link = self.robot, self._link
        if robot is None or link is None or self.phase != "connected":
            raise LinkLostError("no robot is connected", hint="connect to one at the top of the page")
        link.interrupt(lambda: setattr(robot.connection, "recorder", recorder))
        return robot

    def _at_once(
        self, kind: str, command: int, numbers: tuple[float, float], until_confirmed: Callable[[Robot], None]
    ) -> bool:
        self.stops += 1
        robot, link = self.robot, self._link
        if robot is None or link is None:
            self._work.drop()
            return False
        to = robot.connection
        message = mavlink.MAVLink_command_long_message(
            to.target_system, to.target_component, command, 0, *numbers, *[0.0] * 5
        )

        def urgent() -> None:
            to.send(message)
            self._end_long_work("stopped")

        link.interrupt(urgent)
        self._work.drop()
        self._work.put(until_confirmed, kind=kind)
        return True

    # ---- the robot's thread

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                self._serve()
            except OmniError as error:
                self.phase, self.trouble = "lost", in_words(error)
            except Exception as error:
                _LOG.exception("the robot's thread failed")
                self.phase = "lost"
                self.trouble = f"internal error: {type(error).__name__}: {error}"
            finally:
                self.robot = self._link = self.quality = None
                self._work.drop()
            self._closing.wait(RETRY_S)
        self.phase = "closed"

    def _serve(self) -> None:
        link = UrgentLink(open_shared(self.url, timeout_s=CONNECT_TIMEOUT_S))
        stop = self._stop_wanted
        with connect(link, timeout_s=CONNECT_TIMEOUT_S, system_id=self._system_id, stop_at_once=stop) as robot:
            self._link, self.robot = link, robot
            if self._stop_wanted:
                self._confirm_stop(robot)
            robot.require_same_parameters()
            robot.connection.add_listener(self._take)
            robot.connection.on_other_robot = self._say_other
            history = history_of(robot)
            if history.path != self.history:
                self.last_stop = LastStop()  # of another robot
            self.last_stop.expect_status()
            robot.parameters.download()
            self.edits = Edits(robot.parameters)
            self._keep_history(robot, history)
            begin_telemetry(robot)
            self.sensors = sensors_of(robot.parameters.known)
            self.connections += 1
            self.trouble, self.phase = link.notice, "connected"  # last: from here on, pages are told of this robot
            counted_s, counted = time.monotonic(), robot.connection.rx_bytes
            self.quality = quality = LinkQuality(robot)
            silence = _Silence()
            while not self._closing.is_set():
                self._stop_if_page_is_gone(robot)
                self._watch_drive(robot)
                self._update_sensor_streams(robot)
                self._do_next(robot)
                quality.serve()
                now_s = time.monotonic()
                if now_s - counted_s >= _BYTES_OVER_S:
                    self.rx_bytes_s = (robot.connection.rx_bytes - counted) / (now_s - counted_s)
                    counted_s, counted = now_s, robot.connection.rx_bytes
                if silence.seconds(now_s, robot.status.heartbeat_age_s) > _SILENT_S * self._slowness():
                    raise LinkLostError(f"the robot at {self.url} is silent", hint="is it switched on?")
                with self.lock:
                    self.mark_changes += self.marks.overdue(self.store.now_s) is not None
            end_telemetry(robot)

    def _stop_if_page_is_gone(self, robot: Robot) -> None:
        """Send heartbeats only while the page lives that moves the robot: a dead page is a lost link to the robot."""
        mute = self._lost_page_in_command() and robot.status.armed
        connection = robot.connection
        if mute:
            connection.next_heartbeat_s = float("inf")
        elif connection.next_heartbeat_s == float("inf"):
            connection.next_heartbeat_s = connection.clock()

    def _watch_drive(self, robot: Robot) -> None:
        """Note why the drive that was begun here is over; setpoints are refused then."""
        try:
            robot.guard.check()
        except StoppedError as error:
            self.drive_ended = in_words(error)
        else:
            self.drive_ended = ""

    def _update_sensor_streams(self, robot: Robot) -> None:
        """A parameter says whether the robot has a sensor, and may be set while it is connected."""
        parameters = robot.parameters
        if not parameters.complete or sensors_of(parameters.known) == self.sensors:
            return
        ask_for(robot, self.sensors, None)
        self.sensors = sensors_of(parameters.known)
        ask_for(robot, self.sensors, RADIO_RATE_HZ if is_slow(robot.url) else PLOT_RATE_HZ)

    def _lost_page_in_command(self) -> bool:
        return self.page_commands and time.monotonic() - self.page_heard_s > PAGE_SILENT_S

    def _do_long(self, robot: Robot, work: Callable[[Robot], T]) -> T:
        link = self._link
        assert link is not None
        self._long_work, link.between = True, self._supervise_long_work
        try:
            return work(robot)
        finally:
            self._long_work, link.between = False, None

    def _supervise_long_work(self) -> None:
        if self._closing.is_set():
            self._end_long_work("the studio disconnected from the robot")
        if self._lost_page_in_command():
            self._end_long_work("the page in command was closed")

    def _end_long_work(self, why: str) -> None:
        if self._long_work:
            self._long_work = False
            raise WorkEndedError(why)

    def _do_next(self, robot: Robot) -> None:
        """Do one thing that was asked for, or listen to the robot for a moment."""
        work = self._work.get()
        if work is None:
            robot.pump(_PUMP_S)
            return
        try:
            work.future.set_result(work.call(robot))
        except OmniError as error:
            work.future.set_exception(error)
            if isinstance(error, LinkLostError):
                raise
        except Exception as error:
            work.future.set_exception(error)
        robot.pump(0.0)

    def _take(self, message: Message) -> None:
        name = message.get_type()
        for kind in KINDS:
            if kind.message == name:
                telemetry = decode(kind, message)
                assert telemetry is not None
                with self.lock:
                    self._keep(telemetry)
                if isinstance(telemetry, Status):
                    self.last_stop.update(telemetry)
        text = decode(StatusText, message)
        if text is not None:
            self.last_stop.take(text)
            with self.lock:
                self.text_count += 1
                self.texts.append((self.text_count, text))

    def _keep(self, telemetry: Telemetry) -> None:
        if isinstance(telemetry, Fix):
            if telemetry.number == (self.fixes[-1][1].number if self.fixes else 0):
                return  # the same fix once more: there is no newer one
            self.fix_count += 1
            self.fixes.append((self.fix_count, telemetry))
        time_s = self.store.take(telemetry)
        if isinstance(telemetry, Control):
            self.mark_changes += self.marks.sequence(telemetry.config_sequence, time_s) is not None

    def _keep_history(self, robot: Robot, history: RobotHistory) -> None:
        self.history = history.path
        recorder = ChangeRecorder(robot, history, "omni studio", "", self._warn)
        write = recorder.changed

        def changed(changes: Any) -> None:
            with self.lock:
                self.mark_changes += self.marks.changed(changes, self.store.now_s) is not None
            write(changes)

        robot.parameters.on_change = changed

    def _warn(self, error: OmniError) -> None:
        self._say(f"the change is not in the history: {error}")

    def _say_other(self, system: int) -> None:
        if self._system_id is None:
            self._say(f"another robot, system id {system}, is on this link, commanded by another program")

    def _say(self, text: str) -> None:
        with self.lock:
            self.text_count += 1
            self.texts.append((self.text_count, StatusText(4, text)))
