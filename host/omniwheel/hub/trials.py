# SPDX-License-Identifier: MIT
"""Whose trial of parameters goes on. To the robot all clients are one link: it cannot know that one of them is gone."""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.dialect import TRIAL_BACK, TRIAL_BEGIN, TRIAL_KEEP, Message, mavlink
from omniwheel.hub.pending import Question

RETRY_S = 1.0
_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
_GO_ON = (_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED, mavlink.MAV_RESULT_IN_PROGRESS)


class Trials:
    """One trial at a time. ``end`` tells the robot to take back what a client that is gone has tried.

    It is called until the robot acknowledges it. ``hub`` is the number by which the hub itself asks the robot.
    """

    def __init__(self, clock: Callable[[], float], end: Callable[[], None], hub: int) -> None:
        self._clock = clock
        self._end = end
        self._hub = hub
        self._sent_s = float("-inf")
        self.client: int | None = None
        """Whose trial goes on; the hub's number: its client is gone, and the end is not acknowledged yet."""

    @property
    def end_pending(self) -> bool:
        """Whether the robot has not acknowledged the end yet of a trial whose client is gone."""
        return self.client == self._hub

    def may_try(self, client: int, action: float) -> bool:
        """Return whether a client's command may go to the robot, and remember a trial that begins."""
        if self.client not in (None, client):
            return False
        if action == TRIAL_BEGIN:
            self.client = client
        return True

    def leave(self, client: int) -> None:
        """Forget a client: what it has tried is taken back."""
        if self.client == client:
            self.client = self._hub
            self._send_end()

    def serve(self) -> None:
        """Say the end again if it is due."""
        if self.end_pending and self._clock() - self._sent_s >= RETRY_S:
            self._send_end()

    def answered(self, question: Question, ack: Message) -> None:
        """A trial ends when the robot says so: by its acknowledgement of the end, or because it refuses the rest."""
        if question.command != mavlink.MAV_CMD_OMNI_TRIAL or question.client != self.client:
            return
        if ack.result not in _GO_ON or (ack.result == _ACCEPTED and question.action in (TRIAL_KEEP, TRIAL_BACK)):
            self.client = None

    def _send_end(self) -> None:
        self._sent_s = self._clock()
        self._end()
