# SPDX-License-Identifier: MIT
"""MAVLink 2 over a link: frames in and out, heartbeats, recording, waiting.

Without a thread the caller pumps: messages come and go only while something waits. Time is whatever ``clock`` says.
With the wall clock a pump waits for bytes; with a simulated link, whose ``read`` advances the simulation, the same code
runs deterministically. After :meth:`Connection.serve_in_background` a thread serves the link, and waiting means to wait
for that thread (:mod:`omniwheel.link_thread`).
"""

from __future__ import annotations

import os
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from omniwheel.default_key import default_key
from omniwheel.dialect import HUB_COMPONENT, Message, is_addressed, is_autopilot, mavlink, take_bytes, tells_time
from omniwheel.errors import OmniError, SetpointError, SeveralRobotsError
from omniwheel.link import Link
from omniwheel.link_thread import LinkThread
from omniwheel.signing import Signer

GROUND_STATION_ID = 255
GROUND_COMPONENT_ID = 190
HEARTBEAT_PERIOD_S = 1.0
_MAVLINK2_MAGIC = 0xFD
_POLL_S = 0.1
_GIVE_WAY_S = 1e-3
"""Longest time without the monitor if the thread that takes it does not wait for messages itself."""

_HEARTBEATS_OF_NEW_NUMBER = 3
"""A robot that is still there under its old number says something before another robot has sent so many heartbeats."""

Listener = Callable[[Message], None]
Recorder = Callable[[bytes], None]


def own_station() -> int:
    """Return this computer's MAVLink system id: ``OMNI_STATION``, or 255. Raises OmniError if it is none.

    To a robot, programs with the same ids on one link are one station. So computers that share a radio channel need
    different ones: else the heartbeats of one keep the robot of another going.
    """
    given = os.environ.get("OMNI_STATION", "")
    if not given:
        return GROUND_STATION_ID
    if not (given.isdecimal() and len(given) <= 3 and 1 <= int(given) <= GROUND_STATION_ID):
        raise OmniError(f"OMNI_STATION is {given!r}; a station's number is 1 to 255", hint="take 255 downwards")
    return int(given)


class Monitor(threading.Condition):
    """A condition that can be given away for a moment to the threads that wait for it, in turn."""

    def __init__(self) -> None:
        super().__init__()
        self._waiting = 0
        self._count = threading.Lock()

    def __enter__(self) -> bool:
        if not self.acquire(blocking=False):
            with self._counted():
                self.acquire()
        return True

    def give_way(self) -> None:
        """Let another thread that waits for the monitor have it first; held before and after."""
        if self._waiting:
            self.notify_all()
            with self._counted():
                self.wait(_GIVE_WAY_S)

    @contextmanager
    def _counted(self) -> Iterator[None]:
        with self._count:
            self._waiting += 1
        try:
            yield
        finally:
            with self._count:
                self._waiting -= 1


@dataclass
class _Claim:
    """A system id that a robot said is its own, and how many heartbeats came from it since."""

    system: int = 0
    heartbeats: int = 0


def _tells_own_number(message: Message) -> bool:
    is_number = message.get_type() == "PARAM_VALUE" and message.param_id == "SYS_ID"
    return is_number and bool(message.param_value == message.get_srcSystem())


class _Output:
    """The file that pymavlink writes frames to."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def write(self, frame: bytes) -> None:
        self._connection.write_frame(bytes(frame))


class Connection:
    """One end of a MAVLink conversation.

    It is to the component ``target_component`` of the system ``target_system``: what others send is recorded only.
    ``recorder`` gets every whole frame of either direction. ``next_heartbeat_s`` is when the next one is due on
    ``clock``. ``signer`` signs what is sent (default: with the process's
    default key, if there is one). ``rx_bytes`` and ``rx_bad_bytes`` count what came and what
    was no MAVLink 2, to tell silence from a wrong baud rate.

    ``monitor`` guards all of it where there are several threads. Whoever sends a request and waits for its answer holds
    it from before the one until the other.
    """

    def __init__(
        self,
        link: Link,
        *,
        clock: Callable[[], float] = time.monotonic,
        system_id: int | None = None,
        component_id: int = GROUND_COMPONENT_ID,
        heartbeat: bool = True,
        recorder: Recorder | None = None,
        signer: Signer | None = None,
    ) -> None:
        self.link = link
        self.clock = clock
        self.monitor = Monitor()
        self._thread: LinkThread | None = None
        self.recorder = recorder
        self.target_system = 0
        self.target_component = 0
        self.other_systems: set[int] = set()
        """System ids of other robots that are on the line, too; nothing here is for them."""
        self._new_system = 0
        self._claim = _Claim()
        self.on_other_robot: Callable[[int], None] | None = None
        """Called with the system id of another robot when it is heard for the first time."""
        self.rx_bytes = 0
        self.rx_bad_bytes = 0
        own_id = own_station() if system_id is None else system_id
        self._codec: Any = mavlink.MAVLink(_Output(self), own_id, component_id)
        self._codec.robust_parsing = True
        key = default_key()
        self.signer = Signer(key) if signer is None and key is not None else signer
        if self.signer is not None:
            self.signer.attach(self._codec)
        self._listeners: list[Listener] = []
        self._raised: Exception | None = None
        """What a callback, a listener or the recorder raised: for the next pump, so that it ends no stop."""
        self._repeated: Callable[[], None] | None = None
        self._repeat_s, self._next_repeat_s = 0.0, float("inf")
        self.next_heartbeat_s = clock() if heartbeat else float("inf")

    def add_listener(self, listener: Listener) -> Callable[[], None]:
        """Call ``listener`` with every message from the robot; the returned function ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    @contextmanager
    def only_listener(self, listener: Listener) -> Iterator[None]:
        """Give messages to this listener alone while the context lasts."""
        before, self._listeners = self._listeners, [listener]
        try:
            yield
        finally:
            self._listeners = before

    @contextmanager
    def without_heartbeats(self) -> Iterator[None]:
        """Send no heartbeats while the context lasts: how a lost link looks to the robot."""
        before, self.next_heartbeat_s = self.next_heartbeat_s, float("inf")
        try:
            yield
        finally:
            self.next_heartbeat_s = before

    def send(self, message: Message) -> None:
        """Send one message.

        Raises SeveralRobotsError for one that another robot on the line would take for its own, SetpointError for a
        number that does not fit its field. Nothing is sent then.
        """
        if self.other_systems and not is_addressed(message):
            systems = sorted({self.target_system, *self.other_systems})
            raise SeveralRobotsError(self.link.url, systems, message.get_type())
        with self.monitor:
            if self._thread is not None:
                self._thread.check()
            if self.signer is not None:
                self.signer.before_sending(self._codec)
            try:
                self._codec.send(message)
            except (struct.error, OverflowError) as error:  # while it packs the fields
                raise SetpointError(f"a number of {message.get_type()} does not fit its field: {error}") from error

    def write_frame(self, frame: bytes) -> None:
        """Send and record one whole frame."""
        self.link.write(frame)
        self._record(frame)

    def _record(self, frame: bytes) -> None:
        """Give a frame to the recorder. One that fails gets no more; the link goes on."""
        if self.recorder is not None:
            try:
                self.recorder(frame)
            except Exception as error:
                self.recorder = None
                self.raise_in_pump(error)

    @property
    def sends_heartbeats(self) -> bool:
        """Whether this end says once a second that it is a ground station."""
        return self.next_heartbeat_s < float("inf")

    @property
    def wrongly_signed(self) -> int:
        """How many frames came that were signed with another key, or were recordings."""
        return int(self._codec.signing.badsig_count)

    def beat(self) -> None:
        """Send the heartbeat if it is due."""
        now = self.clock()
        if now >= self.next_heartbeat_s:
            self.next_heartbeat_s = max(self.next_heartbeat_s + HEARTBEAT_PERIOD_S, now)
            self._send_heartbeat()

    @contextmanager
    def repeating(self, action: Callable[[], None], period_s: float) -> Iterator[None]:
        """Call ``action`` every ``period_s`` while the context lasts, whatever the link is being served for meanwhile.

        Set-points go on so while a command waits for its answer.
        """
        before = (self._repeated, self._repeat_s, self._next_repeat_s)
        self.repeat(action, period_s)
        try:
            yield
        finally:
            with self.monitor:
                self._repeated, self._repeat_s, self._next_repeat_s = before

    def repeat(self, action: Callable[[], None] | None, period_s: float = float("inf")) -> None:
        """Call ``action`` every ``period_s`` from now on, in the place of what was called until now; None: nothing."""
        with self.monitor:
            self._repeated, self._repeat_s = action, period_s
            self._next_repeat_s = float("inf") if action is None else self.clock()

    def end_repeating(self, action: Callable[[], None] | None) -> bool:
        """Call ``action`` no more; return whether it was the one that is repeated."""
        with self.monitor:
            is_repeated = action is not None and self._repeated is action
            if is_repeated:
                self.repeat(None)
            return is_repeated

    def _repeat(self) -> None:
        now = self.clock()
        if self._repeated is not None and now >= self._next_repeat_s:
            self._next_repeat_s = max(self._next_repeat_s + self._repeat_s, now)
            self._repeated()

    @contextmanager
    def unrecorded(self) -> Iterator[None]:
        """Keep what happens while the context lasts from the recorder."""
        before, self.recorder = self.recorder, None
        try:
            yield
        finally:
            self.recorder = before

    def poll(self, timeout_s: float) -> None:
        """Send a due heartbeat, read the link once, hand out what the robot sent; or let the link's thread do so."""
        with self.monitor:
            if self._thread is not None and not self._thread.is_current:
                self._thread.await_messages(min(timeout_s, _POLL_S))
                return
            data = self.read(max(0.0, min(timeout_s, _POLL_S, self.send_due())))
            if data:
                self.feed(data)
            self.monitor.give_way()

    def send_due(self) -> float:
        """Send a heartbeat and what is repeated if they are due; return the time until the next is [s]."""
        now = self.clock()
        self.beat()
        self._repeat()
        return min(self.next_heartbeat_s, self._next_repeat_s) - now

    def read(self, timeout_s: float) -> bytes:
        """Read the link once, for the one who serves it."""
        return self.link.read(timeout_s)

    @property
    def is_served(self) -> bool:
        """Whether a thread serves the link."""
        return self._thread is not None

    def raise_in_pump(self, error: Exception) -> None:
        """Have the next :meth:`pump` raise this, of another thread than the link's if there is one."""
        with self.monitor:
            self._raised = error
            self.monitor.notify_all()

    def raise_pending(self) -> None:
        """Raise what :meth:`raise_in_pump` was given, for a loop that serves the link without :meth:`pump`."""
        raised, self._raised = self._raised, None
        if raised is not None:
            raise raised

    def serve_in_background(self) -> None:
        """Have a thread of its own serve the link from now on, until :meth:`close`."""
        self._thread = LinkThread(self)
        self._thread.start()

    def feed(self, data: bytes) -> list[Message]:
        """Take bytes that were read elsewhere, as if the link had delivered them."""
        self.rx_bytes += len(data)
        received = []
        for message in take_bytes(self._codec, data):
            frame = message.get_msgbuf()
            if message.get_type() == "BAD_DATA" or frame[0] != _MAVLINK2_MAGIC:
                self.rx_bad_bytes += len(frame)
                continue
            self._record(bytes(frame))
            if self._is_renamed(message) or self._has_another_number(message):
                self.target_system = message.get_srcSystem()
                self.other_systems.discard(self.target_system)
            if self.is_from_robot(message):
                received.append(message)
                self.hand_out(message)
            elif is_autopilot(message) or tells_time(message):
                self._note_other(message.get_srcSystem())
        return received

    @contextmanager
    def following(self, system: int) -> Iterator[None]:
        """Follow the robot to another system id while the context lasts, for what sets SYS_ID.

        What comes from the new id is the robot's, unless another robot has been heard there.
        """
        self._new_system = system
        try:
            yield
        finally:
            self._new_system = 0

    def _is_renamed(self, message: Message) -> bool:
        system = message.get_srcSystem()
        if system != self._new_system or system in (self.target_system, *self.other_systems):
            return False
        said_by_robot = message.get_type() in ("PARAM_VALUE", "COMMAND_ACK") or is_autopilot(message)
        return said_by_robot and message.get_srcComponent() == self.target_component

    def _has_another_number(self, message: Message) -> bool:
        """Whether another program gave the robot another SYS_ID: it said so, and speaks under that one alone since.

        A stop would not reach it under the old one.
        """
        system = message.get_srcSystem()
        if message.get_srcComponent() != self.target_component or not self.target_system:
            return False
        if system == self.target_system:
            self._claim = _Claim()
        elif _tells_own_number(message) and system not in self.other_systems:
            self._claim = _Claim(system)
        elif system == self._claim.system and is_autopilot(message):
            self._claim.heartbeats += 1
            return self._claim.heartbeats >= _HEARTBEATS_OF_NEW_NUMBER
        return False

    def _note_other(self, system: int) -> None:
        if system in (self.target_system, *self.other_systems):
            return
        self.other_systems.add(system)
        if self.on_other_robot is not None:
            self.on_other_robot(system)

    def is_from_robot(self, message: Message) -> bool:
        """Return whether the robot sent a message, or its hub or radio did; anybody before there is a robot."""
        if self.target_system not in (0, message.get_srcSystem()):
            return False
        component = message.get_srcComponent()
        if self.target_component in (0, component):
            return True
        from_hub = component == HUB_COMPONENT and message.get_type() == "STATUSTEXT"
        return from_hub or message.get_type() == "RADIO_STATUS"

    def hand_out(self, message: Message) -> None:
        """Give a message to the listeners. What one raises is raised by the next :meth:`pump`."""
        for listener in tuple(self._listeners):
            try:
                listener(message)
            except Exception as error:
                self.raise_in_pump(error)

    def pump(self, duration_s: float) -> None:
        """Serve the link for ``duration_s`` of the connection's clock; raise what :meth:`raise_in_pump` was given."""
        self._serve(duration_s, raises=True)

    def pump_quietly(self, duration_s: float) -> None:
        """Serve the link as :meth:`pump` does, for what stops the robot: no callback's error ends it."""
        self._serve(duration_s, raises=False)

    def _serve(self, duration_s: float, *, raises: bool) -> None:
        end = self.clock() + duration_s
        while True:
            left = end - self.clock()
            self.poll(left)
            if raises and (self._thread is None or not self._thread.is_current):
                self.raise_pending()
            if left <= 0.0:
                return

    def wait(self, wanted: Callable[[Message], bool], timeout_s: float) -> Message | None:
        """Serve the link until a message satisfies ``wanted``; return it, or None after ``timeout_s``.

        ``wanted`` is asked after all listeners have had the message. What it raises is raised here.
        """
        found: list[Message] = []
        failed: list[Exception] = []

        def take(message: Message) -> None:
            try:
                if not found and not failed and wanted(message):
                    found.append(message)
            except Exception as error:
                failed.append(error)

        with self.monitor:
            remove = self.add_listener(take)
            try:
                end = self.clock() + timeout_s
                while True:
                    left = end - self.clock()
                    self.poll(left)
                    if failed:
                        raise failed[0]
                    if found or left <= 0.0:
                        return found[0] if found else None
            finally:
                remove()

    def close(self) -> None:
        """End the thread if there is one, and close the link."""
        if self._thread is not None:
            self._thread.stop()
        self.link.close()

    def _send_heartbeat(self) -> None:
        self.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
        )
