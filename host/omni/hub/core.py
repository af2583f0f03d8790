# SPDX-License-Identifier: MIT
"""The hub without sockets: bytes from the port and from clients in, bytes for them out, the clock an argument.

The rules for people are in docs/guides/hub.md.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from omni.hub import wire
from omni.hub.client import Client
from omni.hub.followed import FollowedRobot
from omni.hub.in_command import InCommand
from omni.hub.outbox import NEWEST_COUNTS, Outbox, Waiting
from omni.hub.own_messages import OwnMessages
from omni.hub.parameter_requests import ParameterRequests
from omni.hub.pending import Pending
from omni.hub.rules import (
    HANDED_OVER,
    HELLO,
    NO_CLIENT,
    Kind,
    is_disarm,
    kind_of,
    receipt_of,
    source_of,
    target_of,
    wish_of,
)
from omni.hub.streams import Streams
from omni.hub.trials import TIMEOUT, Trials
from omni.hub.waiting_path import WaitingPath
from omniwheel.byte_budget import ByteBudget
from omniwheel.dialect import TRIAL_ASK, Message, is_autopilot, is_command, mavlink, take_bytes
from omniwheel.hub import notices
from omniwheel.signing import Signer
from omniwheel.stops import Stop, stop_of

NAME_CHARACTERS = 25
"""Of a client's name in a status text."""
HEARTBEAT_S = 0.9
"""While no client is in command, one heartbeat per this time is passed on, from any client."""
RESTART_MS = 1000
"""A clock that goes back by more than this is a restart."""
_TRIAL = mavlink.MAV_CMD_OMNI_TRIAL
_ACCEPTED, _DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
_LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
_CRITICAL, _WARNING, _NEWS = mavlink.MAV_SEVERITY_CRITICAL, mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_INFO
_MOVES = (Kind.MOVE, Kind.SETPOINT)
_ASKED_OF_ONE = (Kind.INTERVAL, Kind.STREAM, Kind.LIST, Kind.READ)
"""Requests that are not passed on if the robot that is followed has had them already."""


@dataclass(frozen=True)
class HubSettings:
    """``name`` is what clients are told of the port; ``bytes_s`` and ``burst_bytes`` are what it may be given."""

    name: str
    bytes_s: float
    burst_bytes: float
    system_id: int | None = None
    """Of the robot that is served; None: the one that is heard first."""


class Hub:
    """Feed it with :meth:`from_port` and :meth:`from_client`; send what :meth:`to_port` and :meth:`to_client` return.

    ``clock`` gives seconds. ``signer`` signs what goes to the port and checks what comes from it. ``events`` are lines
    for a person, oldest first; the reader removes them.
    """

    def __init__(self, settings: HubSettings, clock: Callable[[], float], signer: Signer | None = None) -> None:
        self.settings = settings
        self.clients: dict[int, Client] = {}
        self.command = InCommand()
        self.streams = Streams()
        self.events: deque[str] = deque(maxlen=1000)
        self.is_open = False
        self._clock = clock
        self._outbox = Outbox(ByteBudget(settings.bytes_s, settings.burst_bytes, clock), clock)
        self._pending = Pending()
        self._parameters = ParameterRequests()
        self._signer = signer
        self._stamp = None if signer is None else wire.Stamp(signer)
        self._port: Any = self._new_parser()
        self._own = OwnMessages()
        self._robot = FollowedRobot(settings.system_id)
        self._line_systems: set[int] = set()
        """System ids that have been heard from the port."""
        self._boot_ms = 0
        self._sequence = 0
        self._beaten_s: dict[tuple[int, int], float] = {}
        self._handed_over: int | None = None
        self._trials = Trials(clock, self._send_trial)
        self._path = WaitingPath(self._send_hold)
        self._is_new_robot = True
        self._next = 1

    # ---- clients

    def join(self, name: str) -> int:
        """Take a client and return its number; ``name`` stands for it until it says its own."""
        number = self._next
        self._next += 1
        self.clients[number] = Client(number, name)
        if not self.is_open:
            self._send_text(self.clients[number], f"hub: waiting for {self.settings.name}", _CRITICAL)
        return number

    def leave(self, number: int) -> None:
        """Forget a client: nothing of it is sent any more, except a stop."""
        client = self.clients.pop(number)
        self._outbox.forget(number)
        self._pending.forget(number)
        self.streams.leave(number)
        self._say(f"{client.name} has gone")
        self._trials.leave(number)
        self._path.leave(number, armed=self.command.armed)
        if self.command.leave(number):
            self._released(client, "has gone")

    def to_client(self, number: int) -> bytes:
        """Drain the client's send buffer."""
        out = self.clients[number].out
        data = bytes(out)
        out.clear()
        return data

    # ---- the port

    def port_opened(self, *, quiet: bool = False) -> None:
        """Handle the port's opening. ``quiet``: without a text to the clients, as it may close at once."""
        self.is_open = True
        self._port = self._new_parser()
        self.streams.restart()
        self._is_new_robot = True
        if not quiet:
            self.announce_open()

    def announce_open(self) -> None:
        """Tell everybody that the port is there."""
        self._say(f"{self.settings.name} is open")
        self._send_text_to_all(f"hub: {self.settings.name} is connected", _NEWS)

    def port_lost(self, *, quiet: bool = False) -> None:
        """The port has gone. What waited for it is thrown away, and its senders are told."""
        self.is_open = False
        self.command.armed = False
        self._robot.lose()
        if self.command.holder is not None:
            self._released(self.clients[self.command.holder], "has lost the port")
            self.command.release()
        for frame in self._outbox.clear():
            self._refuse(frame.client, frame.message, _LATER)
        if not quiet:
            self._say(f"{self.settings.name} is gone")
            self._send_text_to_all(f"hub: {self.settings.name} is disconnected, waiting for it", _CRITICAL)

    def from_port(self, data: bytes) -> None:
        """Take what came from the robot and hand it to the clients."""
        for message in take_bytes(self._port, data):
            if message.get_type() == "BAD_DATA":
                continue
            if self._stamp is not None and wire.is_signed(message):
                self._stamp.follow(self._port.signing.timestamp)
            self._watch(message)
            self._fan_out(message)

    def to_port(self) -> bytes:
        """Return the next frame for the port, b"" if none may be sent now. Call it again until there is none."""
        self._do_due()
        if not self.is_open:
            return b""
        frame = self._outbox.next(self.command.holder)
        if frame is None:
            return b""
        return bytes(frame.message.get_msgbuf()) if self._stamp is None else self._stamp.signed(frame.message)

    @property
    def waits(self) -> bool:
        """Whether something waits for the port."""
        return not self._outbox.is_empty

    # ---- from clients

    def from_client(self, number: int, data: bytes) -> None:
        """Take what a client sent."""
        client = self.clients[number]
        self._take_all(client, client.parse(data, self._clock()))

    def _take_all(self, client: Client, messages: list[Message]) -> None:
        for message in messages:
            client.raw = client.raw or wire.is_signed(message)
            client.systems.add(message.get_srcSystem())
            self._take(client, message)

    def _take(self, client: Client, message: Message) -> None:
        now_s = self._clock()
        self.command.hear(client.number, now_s)
        kind = kind_of(message)
        self._robot.watch_request(message, now_s)
        if kind is Kind.NAME:
            self._introduce(client, str(message.text))
            return
        for_robot = self._route(client, message)
        if not for_robot and kind is not Kind.STOP:  # the robot may be on the line, and not be heard yet
            return
        if kind in _ASKED_OF_ONE and target_of(message).system not in (0, self._robot.source[0]):
            kind = Kind.OTHER  # what is known of one robot's parameters and rates says nothing of another's
        if kind is Kind.STOP:
            self._stop(client, message)
        elif not self.is_open:
            self._refuse(client.number, message, _LATER)
            self._send_text(client, f"hub: {self.settings.name} is disconnected, waiting for it", _CRITICAL, "port")
        elif kind in _MOVES:
            self._move(client, message, kind)
        elif kind is Kind.HEARTBEAT:
            self._beat(client, message)
        elif kind is Kind.INTERVAL and (wish := wish_of(message)) is not None:
            if self.streams.is_new(client.number, *wish, set(self.clients), now_s):
                self._ask(client, message, Kind.INTERVAL)
            else:
                self._acknowledge(client, message, _ACCEPTED)  # another client has an equal or higher rate
        elif kind is Kind.STREAM:
            self.streams.group(client.number, message)
        elif self._parameters.is_new(client.number, message, kind, now_s) and self._may_try(client, message):
            self._ask(client, message, kind)

    def _introduce(self, client: Client, text: str) -> None:
        handed_over = text.startswith(HANDED_OVER)
        name = text.removeprefix(HANDED_OVER if handed_over else HELLO)
        client.name = "".join(character for character in name if character.isprintable())[:NAME_CHARACTERS]
        self._say(f"{client.name} is here")
        if handed_over:
            self._trials.had_port(client.number)
        if handed_over and self.command.may_move(client.number, self._clock(), stream=False):
            client.raw = True
            self._handed_over = client.number  # it may be driving: the robot's next heartbeat tells

    def _route(self, origin: Client, message: Message) -> bool:
        """Hand a message to other clients as MAVLink routes it; return whether it is for the robot, too.

        A client may have the system id of a robot: a companion computer has. Both get what is for it then.
        """
        system = target_of(message).system
        others = [client for client in self.clients.values() if client is not origin and system in (0, *client.systems)]
        for other in others:
            other.out += wire.unsigned(message)
        return not others or system in (0, self._robot.source[0], *self._line_systems)

    def _stop(self, client: Client, message: Message) -> None:
        now_s = self._clock()
        system = target_of(message).system
        for frame in self._outbox.remove(_MOVES, system):
            self._refuse(frame.client, frame.message, _DENIED)
            self._send_text(self.clients[frame.client], "hub: cancelled by a stop", _WARNING, "overtaken")
        if not self.is_open:
            self._refuse(client.number, message, _LATER)
            self._send_text(client, f"hub: {self.settings.name} is disconnected: stop not sent", _CRITICAL, "port")
            return
        self._pending.overtake(system, now_s)
        if is_command(message):
            self._pending.ask(client.number, message, False, now_s)
        self._outbox.stop(self._waiting(client.number, message, Kind.STOP))
        if self.command.holder == client.number and is_disarm(message) and not self.command.armed:
            self.command.finish()
            self._released(client, "has disarmed")
        elif self.command.is_ended_by(client.number, system):
            self._end_drive(client, held=stop_of(message) is Stop.HOLD)

    def _end_drive(self, by: Client, *, held: bool) -> None:
        """A client has stopped another one's drive: notify that client, which may only send setpoints or listen."""
        driver = self.command.revoke(self._clock())
        self._send_text_to_all(notices.stopped(by.name, held=held), _WARNING, but=by.number)
        if driver is not None:
            self._released(self.clients[driver], f"was {'held' if held else 'stopped'} by {by.name}")

    def _move(self, client: Client, message: Message, kind: Kind) -> None:
        now_s = self._clock()
        before = self.command.holder
        if is_command(message) and self._pending.is_overtaken(client.number, message, now_s):
            self._send_text(client, "hub: cancelled by a stop", _WARNING, "overtaken")
            self._refuse(client.number, message, _DENIED)
        elif not self.command.may_move(
            client.number, now_s, stream=kind is Kind.SETPOINT, system=target_of(message).system
        ):
            self._refuse_move(client, message)
        else:
            if before is None:
                self._say(f"{client.name} is in command")
                self._send_text_to_all(notices.commands(client.name), _NEWS, but=client.number)
                if client.beat is not None:  # the robot refuses a station that it has not heard
                    self._ask(client, client.beat, Kind.HEARTBEAT)
            self._path.moves(client.number, message, self._robot.source, armed=self.command.armed)
            self._ask(client, message, kind)

    def _refuse_move(self, client: Client, message: Message) -> None:
        holder = self.command.holder
        if holder is not None:
            text = notices.refused(self.clients[holder].name)
        elif self.command.has_ended(client.number, self._clock()):
            text = notices.DRIVE_ENDED
        else:
            text = notices.PAUSE_FIRST
        self._send_text(client, text, _WARNING, "" if is_command(message) else "setpoints")
        self._refuse(client.number, message, _DENIED)

    def _beat(self, client: Client, message: Message) -> None:
        """Pass on a station's heartbeat if it keeps the robot going; those of other components do nothing there."""
        if message.type != mavlink.MAV_TYPE_GCS:
            return
        now_s, client.beat = self._clock(), message
        self._trials.heard(client.number)
        alone = client.number == self.command.holder
        station = source_of(message)
        due = now_s - self._beaten_s.get(station, float("-inf")) >= HEARTBEAT_S
        if self.command.hears_heartbeat_of(client.number, now_s) and (alone or due):
            self._beaten_s[station] = now_s
            self._ask(client, message, Kind.HEARTBEAT)

    def _ask(self, client: Client, message: Message, kind: Kind) -> None:
        """Let a frame wait for the port; say so if there is no room for it."""
        if not self._outbox.add(self._waiting(client.number, message, kind)):
            client.left_out += 1
            self._send_text(client, f"hub: link is full, {client.left_out} dropped", _WARNING, "full")
            self._refuse(client.number, message, _LATER)
        elif is_command(message):
            self._pending.ask(client.number, message, kind is Kind.MOVE, self._clock())

    def _waiting(self, number: int, message: Message, kind: Kind) -> Waiting:
        signature = wire.SIGNATURE_BYTES if self._stamp is not None and not wire.is_signed(message) else 0
        slot: object = None
        target = target_of(message).system
        if kind is Kind.STOP:
            slot = (target, message.command if is_command(message) else message.get_type())
        elif kind is Kind.HEARTBEAT:
            slot = (kind, source_of(message))
        elif kind in NEWEST_COUNTS:
            slot = (target, message.get_type())
        elif is_command(message) and receipt_of(message):
            slot = (target, message.command, receipt_of(message))
        elif kind in (Kind.LIST, Kind.READ):
            slot = (kind, str(message.to_dict()))
        return Waiting(number, kind, message, len(message.get_msgbuf()) + signature, self._clock(), slot)

    # ---- from the robot

    def _watch(self, message: Message) -> None:
        source = source_of(message)
        self._line_systems.add(source[0])
        if is_autopilot(message):
            self._watch_heartbeat(source, bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED))
        if source != self._robot.source:
            return
        self._sequence = message.get_seq()
        self._watch_clock(getattr(message, "time_boot_ms", self._boot_ms))
        self.streams.hear(message.get_msgId(), self._boot_ms)
        if message.get_type() == "PARAM_VALUE":
            self._robot.watch_parameter(message)
            self._trials.watch_parameter(message)
            self._parameters.seen(message, self._clock())

    def _watch_heartbeat(self, source: tuple[int, int], armed: bool) -> None:
        now_s, before = self._clock(), self._robot.source
        if not self._robot.accept_heartbeat(source, now_s):
            if armed:
                self.command.record_other_armed_robot(now_s)
            return
        if source != before:
            self._trials.moved(before, source)
        if self._is_new_robot or source != before:
            self._is_new_robot = False
            self._trials.look(source)
        holder = self.command.holder
        if self.command.update_from_robot(armed, now_s) and holder is not None:
            self._released(self.clients[holder], "ended: the robot is not armed")
        if not armed and holder is not None and holder == self._handed_over:
            self.command.finish()
        self._handed_over = None

    def _watch_clock(self, boot_ms: int) -> None:
        """A clock that goes back is a robot that has restarted: it does not know the wishes any more."""
        if boot_ms + RESTART_MS < self._boot_ms:
            self.streams.restart()
            self._is_new_robot = True
        self._boot_ms = boot_ms

    def _fan_out(self, message: Message) -> None:
        others = set[int]()
        if message.get_type() == "COMMAND_ACK":
            question, others = self._pending.answered(message, self._robot.source)
            if question is not None:
                self.streams.answered(question, message.result)
                self._trials.answered(question, message, self._robot.source)
                if question.client == NO_CLIENT:
                    return
        plain, raw = wire.unsigned(message), bytes(message.get_msgbuf())
        for client in self.clients.values():
            if client.number not in others and not self.streams.is_muted(client.number, message.get_msgId()):
                client.out += raw if client.raw else plain

    # ---- what is due

    def _do_due(self) -> None:
        now_s = self._clock()
        for client in self.clients.values():
            self._take_all(client, client.parse_rest(now_s))
        if self.command.is_idle(now_s):
            holder = self.command.holder
            self.command.release()
            if holder is not None:
                self._released(self.clients[holder], "is idle")
        for frame in self._outbox.stale():
            client = self.clients[frame.client]
            client.left_out += 1
            self._send_text(client, f"hub: link is full, {client.left_out} dropped", _WARNING, "full")
        if self.is_open:
            for number, interval_us in self.streams.due(set(self.clients), now_s):
                self._send_own(self._own.interval(self._robot.source, number, interval_us), Kind.INTERVAL)
            self._trials.serve()

    def _may_try(self, client: Client, message: Message) -> bool:
        """Return whether a request may go to the robot: the trial of one client is kept from the others."""
        if not is_command(message) or message.command != _TRIAL:
            return True
        if self._trials.may_try(client.number, message, self._robot.source):
            return True
        number = self._trials.owner(target_of(message).or_robot(self._robot.source))
        owner = None if number is None else self.clients.get(number)
        if owner is None:
            self._send_text(client, "hub: trial ended: its program disconnected", _WARNING)
        else:
            self._send_text(client, f"hub: {owner.name} began a parameter trial", _WARNING)
        self._refuse(client.number, message, _LATER if owner is None else _DENIED)
        return False

    def _send_trial(self, robot: tuple[int, int], action: float) -> None:
        if action == TRIAL_ASK:
            self._send_own(self._own.read(robot, TIMEOUT), Kind.READ)
        self._send_own(self._own.trial(robot, action), Kind.OTHER)

    def _send_hold(self, robot: tuple[int, int]) -> None:
        if self.is_open:
            hold = self._own.hold(robot)
            self._outbox.stop(self._waiting(NO_CLIENT, hold, Kind.STOP))
            self._pending.ask(NO_CLIENT, hold, False, self._clock())

    def _send_own(self, message: Message, kind: Kind) -> None:
        """Send what the hub asks by itself. The answer to a command is for no client."""
        frame = self._waiting(NO_CLIENT, message, kind)
        if is_command(message):
            frame.slot = (target_of(message), message.command, message.param1)  # asked again, it has another number
        if self._outbox.add(frame) and is_command(message):
            self._pending.ask(NO_CLIENT, message, False, self._clock())

    # ---- saying things

    def _refuse(self, number: int, message: Message, result: int) -> None:
        """Answer what is not passed on; only commands have an answer."""
        if number in self.clients and is_command(message):
            self._acknowledge(self.clients[number], message, result)

    def _acknowledge(self, client: Client, message: Message, result: int) -> None:
        source = target_of(message).or_robot(self._robot.source)
        client.acknowledge(message, result, receipt_of(message), source, self._sequence)

    def _send_text(self, client: Client, text: str, severity: int, about: str = "") -> None:
        client.queue_text(self._robot.source[0], text, severity, self._clock(), about)

    def _send_text_to_all(self, text: str, severity: int, but: int = NO_CLIENT) -> None:
        for client in self.clients.values():
            if client.number != but:
                self._send_text(client, text, severity)

    def _released(self, client: Client, why: str) -> None:
        self._say(f"{client.name} {why}; no client is in command")
        self._send_text_to_all(notices.NO_CLIENT_IN_COMMAND, _NEWS)

    def _say(self, line: str) -> None:
        self.events.append(line)

    def _new_parser(self) -> Any:
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        if self._signer is not None:
            self._signer.attach(parser)
        return parser
