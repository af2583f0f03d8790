# SPDX-License-Identifier: MIT
"""Whose trial of parameters goes on. To a robot all clients are one link: it cannot know that one of them is gone.

So the hub ends a trial whose client is gone or sends no heartbeats, as the robot does with a link. It asks a robot that
it begins to serve whether a trial goes on, and asks again whenever it cannot be sure.
"""

from __future__ import annotations

from collections.abc import Callable

from omni.hub.pending import Question
from omni.hub.rules import NO_CLIENT, target_of
from omniwheel.dialect import TRIAL_ASK, TRIAL_BACK, TRIAL_BEGIN, TRIAL_KEEP, Message, mavlink
from omniwheel.robots import parameter_table

RETRY_S = 1.0
ASK_TRIES = 10
TIMEOUT = "SAFE_LINK_TO"
"""The parameter: after a silence of so long a robot takes back what the station on a link has tried."""
Address = tuple[int, int]
_TRIAL = mavlink.MAV_CMD_OMNI_TRIAL
_ACCEPTED, _LATER = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
_GO_ON = (_ACCEPTED, _LATER, mavlink.MAV_RESULT_IN_PROGRESS)


class _Trial:
    """What is known of the trial of one robot."""

    def __init__(self, clock: Callable[[], float], send: Callable[[Address, float], None], robot: Address) -> None:
        self.robot = robot
        self._clock = clock
        self._send = send
        self._sent_s = float("-inf")
        self._asks_left = 0
        self._asked_of: int | None = None
        self.client: int | None = None
        """The trial's client; NO_CLIENT: its end was requested and is not acknowledged yet."""
        self.accepted = False
        """Whether the robot has accepted that this client began it."""
        self.candidate: int | None = None
        """To whom a trial of unknown origin belongs, if to anybody."""

    def ask(self, candidate: int | None) -> None:
        """Query the robot for an active trial. One without a client becomes the candidate's."""
        self.candidate = candidate
        self._asks_left = ASK_TRIES
        self._sent_s = float("-inf")

    def end(self) -> None:
        """Let the robot take back what was tried."""
        self.client = NO_CLIENT
        self._sent_s = float("-inf")

    def serve(self) -> None:
        """Send what is due."""
        if self._clock() - self._sent_s < RETRY_S:
            return
        if self.client == NO_CLIENT:
            self._sent_s = self._clock()
            self._send(self.robot, TRIAL_BACK)
        elif self._asks_left > 0:
            self._sent_s = self._clock()
            self._asks_left -= 1
            self._asked_of = self.client
            self._send(self.robot, TRIAL_ASK)

    def answered(self, question: Question, result: int) -> None:
        """Take the robot's answer to the hub or to a client."""
        if question.client == NO_CLIENT and question.action == TRIAL_ASK:
            self._answered_ask(result)
        elif question.action == TRIAL_BEGIN:
            self._answered_begin(question.client, result)
        elif question.action == TRIAL_ASK and result == _ACCEPTED and self.client is None:
            self.client, self.accepted = question.client, True
        elif question.client == self.client and (
            result not in _GO_ON or (result == _ACCEPTED and question.action in (TRIAL_KEEP, TRIAL_BACK))
        ):
            self.client = None

    def _answered_begin(self, client: int, result: int) -> None:
        if result == _ACCEPTED and self.client in (None, client):
            self.client, self.accepted = client, True
        elif result not in _GO_ON and client == self.client:
            # One may go on: that of this client, also if the answer to its first try was lost, or an older one.
            self.client = client if self.accepted else None
            self.ask(client)

    def _answered_ask(self, result: int) -> None:
        if result in (_LATER, mavlink.MAV_RESULT_IN_PROGRESS) or self.client == NO_CLIENT:
            return
        self._asks_left = 0
        if result == _ACCEPTED and self.client is None:
            self.client, self.accepted = self.candidate, True
            if self.client is None:
                self.end()
        elif result != _ACCEPTED and self.client == self._asked_of and self.accepted:
            self.client = None


class Trials:
    """The trials of all robots on the line, one at a time of each.

    ``send`` sends a robot a command of the hub with this action. Times are seconds of ``clock``.
    """

    def __init__(self, clock: Callable[[], float], send: Callable[[Address, float], None]) -> None:
        self._clock = clock
        self._send = send
        self._trials: dict[Address, _Trial] = {}
        self._heard_s: dict[int, float] = {}
        self._had_port: int | None = None
        self._timeout_s = parameter_table()[TIMEOUT].default

    def look(self, robot: Address) -> None:
        """Find out whether a trial goes on, of a robot that is served from now on or has restarted."""
        self._of(robot).ask(self._had_port)
        self._had_port = None

    def moved(self, before: Address, now: Address) -> None:
        """The robot that is followed has another address, or it is another robot."""
        trial = self._trials.pop(before, None)
        if trial is not None:
            trial.robot = now
            self._trials[now] = trial

    def had_port(self, client: int) -> None:
        """Take note that a client had the port itself until now: a trial that goes on is its own."""
        self._had_port = client
        self.heard(client)
        for trial in self._trials.values():
            trial.candidate = client

    def watch_parameter(self, message: Message) -> None:
        """Take a PARAM_VALUE of the robot that is followed."""
        if message.param_id == TIMEOUT:
            self._timeout_s = float(message.param_value)

    def heard(self, client: int) -> None:
        """Take note of a station's heartbeat."""
        self._heard_s[client] = self._clock()

    def owner(self, robot: Address) -> int | None:
        """Return the trial's client; NO_CLIENT: one whose end was requested."""
        trial = self._trials.get(robot)
        return None if trial is None else trial.client

    def may_try(self, client: int, message: Message, robot: Address) -> bool:
        """Return whether a client's command may go to its robot, and remember a trial that begins.

        ``robot`` is the one that is followed.
        """
        trial = self._of(target_of(message).or_robot(robot))
        if trial.client not in (None, client):
            return False
        if message.param1 == TRIAL_BEGIN and trial.client is None:
            trial.client, trial.accepted = client, False
            self.heard(client)
        return True

    def leave(self, client: int) -> None:
        """Forget a client: what it has tried is taken back."""
        self._heard_s.pop(client, None)
        self._had_port = None if self._had_port == client else self._had_port
        for trial in self._trials.values():
            if trial.candidate == client:
                trial.candidate = None
            if trial.client == client:
                trial.end()

    def serve(self) -> None:
        """End the trials of silent clients, and send what is due."""
        now_s = self._clock()
        for trial in self._trials.values():
            client = trial.client
            if client not in (None, NO_CLIENT) and now_s - self._heard_s.get(client, float("-inf")) > self._timeout_s:
                trial.end()
            trial.serve()

    def answered(self, question: Question, ack: Message, robot: Address) -> None:
        """Take the robot's answer to a command of the hub or of a client."""
        if question.command == _TRIAL:
            self._of(question.target.or_robot(robot)).answered(question, ack.result)

    def _of(self, robot: Address) -> _Trial:
        if robot not in self._trials:
            self._trials[robot] = _Trial(self._clock, self._send, robot)
        return self._trials[robot]
