# SPDX-License-Identifier: MIT
"""Whose question an acknowledgement answers: COMMAND_ACK tells the command only, and several clients may ask."""

from __future__ import annotations

from dataclasses import dataclass

from omni.hub.rules import Target, may_be_same, receipt_of, source_of, target_of, wish_of
from omniwheel.dialect import Message, mavlink

FORGET_S = 15.0
"""A question without answer is forgotten after this time: longer than a client tries."""
KEPT = 50
"""Of one client's questions: more than any program asks at once."""


@dataclass
class Question:
    """A command that went out, or waits to. ``receipt`` 0: it has no number."""

    client: int
    command: int
    receipt: int
    moves: bool
    asked_s: float
    target: Target
    about: tuple[int, float] | None = None
    """Of a wish for telemetry: the message and its interval."""
    action: float = 0.0
    """Of any other command: its first parameter."""

    def is_like(self, other: Question) -> bool:
        """Return whether this is the same, asked again."""
        mine = (self.client, self.command, self.receipt, self.about, self.target)
        return mine == (other.client, other.command, other.receipt, other.about, other.target)


class Pending:
    """Commands that have no answer yet, and those that a stop has overtaken."""

    def __init__(self) -> None:
        self._questions: list[Question] = []
        self._overtaken: list[Question] = []

    def ask(self, client: int, message: Message, moves: bool, now_s: float) -> None:
        """Take note of a command; one that is said again counts once."""
        target, action = target_of(message), float(message.param1)
        new = Question(client, message.command, receipt_of(message), moves, now_s, target, wish_of(message), action)
        self._expire(now_s)
        for question in self._questions:
            if question.is_like(new):
                question.asked_s = now_s
                return
        self._questions.append(new)
        mine = [question for question in self._questions if question.client == client]
        if len(mine) > KEPT:
            self._questions.remove(mine[0])

    def answered(self, ack: Message, robot: tuple[int, int]) -> tuple[Question | None, set[int]]:
        """Return what ``ack`` answers (None: nothing known), and which other clients wait for such an answer.

        They must not take this one for theirs. What another component answers than the one that was asked is none;
        ``robot`` is the (system, component) of the robot.
        """
        same = [
            question
            for question in self._questions
            if question.command == ack.command and question.target.or_robot(robot) == source_of(ack)
        ]
        exact = [question for question in same if question.receipt and question.receipt == ack.result_param2]
        unnumbered = [question for question in same if not question.receipt or not ack.result_param2]
        found = next(iter(exact or unnumbered), None)
        if found is not None and ack.result != mavlink.MAV_RESULT_IN_PROGRESS:
            self._questions.remove(found)
        asker = None if found is None else found.client
        return found, {question.client for question in same if question.client != asker}

    def overtake(self, system: int, now_s: float) -> None:
        """A stop for this robot came (0: for all): what moves it and has no answer must not be repeated behind it."""
        self._expire(now_s)
        overtaken = [q for q in self._questions if q.moves and may_be_same(system, q.target.system)]
        self._overtaken += [question for question in overtaken if question not in self._overtaken]

    def is_overtaken(self, client: int, message: Message, now_s: float) -> bool:
        """Return whether a client repeats a command that a stop has overtaken."""
        self._expire(now_s)
        receipt = receipt_of(message)
        repeated = bool(receipt) or getattr(message, "confirmation", 0) > 0
        key = (client, message.command, receipt, target_of(message))
        return repeated and any((old.client, old.command, old.receipt, old.target) == key for old in self._overtaken)

    def forget(self, client: int) -> None:
        """Forget a client."""
        self._questions = [question for question in self._questions if question.client != client]
        self._overtaken = [question for question in self._overtaken if question.client != client]

    def _expire(self, now_s: float) -> None:
        since_s = now_s - FORGET_S
        self._questions = [question for question in self._questions if question.asked_s >= since_s]
        self._overtaken = [question for question in self._overtaken if question.asked_s >= since_s]
