# SPDX-License-Identifier: MIT
"""What waits for the robot's port: stops first, then the clients in turn, within a byte budget."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

from omni.hub.rules import Kind, may_be_same, target_of
from omniwheel.byte_budget import ByteBudget
from omniwheel.dialect import Message
from omniwheel.stops import Stop, stop_of

STALE_S = 0.25
"""A setpoint or pose fix that has waited for so long is not sent any more."""
QUEUE_S = 2.0
"""A client's queue holds what the whole budget carries in this time,"""
QUEUE_MIN_BYTES = 1200
"""... and at least so much."""
STOP_BURST_BYTES = 300.0
"""Stops have a second budget as large as the first, and at least so much at once: five of them never wait."""
REPEAT_S = 1.0
"""A stop that its client has sent within this time is a repetition."""
HOLDER_SHARE = 3
"""While others wait, too, the commanding client gets so many bytes for each one of theirs."""
_CREDIT_BYTES = 100
_HANDICAP = {Stop.ESTOP: 0, Stop.DISARM: 2, Stop.HOLD: 4}
"""Clients take turns with their stops. One of this kind waits as if its client had sent so many stops before it, so an
urgent one goes before others, but not an endless row of them from one client."""
_REPEAT_HANDICAP = 4
NEWEST_COUNTS = (Kind.SETPOINT, Kind.FIX)
"""Of a client's frames of these kinds only the newest waits, and not for longer than STALE_S."""


@dataclass
class Waiting:
    """A frame that waits. A newer frame with the same ``slot`` takes its place."""

    client: int
    kind: Kind
    message: Message
    size: int
    since_s: float
    slot: Hashable = None
    handicap: int = 0
    """Of a stop: the smallest goes first, for each client plus the number of stops that it has sent already."""


class Outbox:
    """Frames on their way to the port, no more than ``budget`` admits. Stops have a budget of their own beside it."""

    def __init__(self, budget: ByteBudget, clock: Callable[[], float]) -> None:
        self.superseded = 0
        self._budget = budget
        self._clock = clock
        self._stop_budget = ByteBudget(budget.bytes_s, max(STOP_BURST_BYTES, budget.burst_bytes), clock)
        self._stops: list[Waiting] = []
        self._stops_sent: Counter[int] = Counter()
        """Per client, since stops began to wait."""
        self._last_was_hold = False
        self._stopped_s: dict[tuple[int, Hashable], float] = {}
        self._queues: dict[int, deque[Waiting]] = {}
        self._turns: deque[int] = deque()
        self._ahead_bytes = 0  # of the commanding client, beyond its share

    def stop(self, frame: Waiting) -> None:
        """Let a stop go before everything but stops, an emergency stop before a disarm before a hold.

        The clients take turns, so however many stops one of them sends, to whatever robots, they hold back no other's.
        Of the stops of one command and client, whatever their unused fields hold, only the newest waits. One that was
        sent just now and comes again goes behind those of other clients: a flood of stops holds no stop back.
        """
        now_s = self._clock()
        self._stopped_s = {key: at_s for key, at_s in self._stopped_s.items() if now_s - at_s < REPEAT_S}
        repeated = (frame.client, frame.slot) in self._stopped_s
        frame.handicap = _HANDICAP[_urgency(frame)] + (_REPEAT_HANDICAP if repeated else 0)
        for at, other in enumerate(self._stops):
            if (other.client, other.slot) == (frame.client, frame.slot):
                frame.handicap = other.handicap
                self._stops[at] = frame
                return
        self._stops.append(frame)

    def add(self, frame: Waiting) -> bool:
        """Let a frame wait for its client's turn. Return False if its client's queue is full: it is not taken then."""
        queue = self._queues.setdefault(frame.client, deque())
        if frame.client not in self._turns:
            self._turns.append(frame.client)
        if frame.slot is not None:
            for at, other in enumerate(queue):
                if other.slot == frame.slot:
                    self.superseded += 1
                    queue[at] = frame
                    return True
        if sum(other.size for other in queue) + frame.size > max(QUEUE_MIN_BYTES, QUEUE_S * self._budget.bytes_s):
            return False
        queue.append(frame)
        return True

    def forget(self, client: int) -> None:
        """Throw away what waits of one client, but no stop."""
        self._queues.pop(client, None)
        if client in self._turns:
            self._turns.remove(client)

    def remove(self, kinds: Iterable[Kind], system: int) -> list[Waiting]:
        """Take all frames of these kinds out that are for the robot ``system``, and return them; 0 is every robot."""
        wanted = tuple(kinds)

        def stays(frame: Waiting) -> bool:
            return frame.kind not in wanted or not may_be_same(system, target_of(frame.message).system)

        removed = [frame for queue in self._queues.values() for frame in queue if not stays(frame)]
        for client, queue in self._queues.items():
            self._queues[client] = deque(filter(stays, queue))
        return removed

    def clear(self) -> list[Waiting]:
        """Take everything out, stops too, and return it."""
        everything = [*self._stops, *(frame for queue in self._queues.values() for frame in queue)]
        self._stops.clear()
        self._queues.clear()
        self._turns.clear()
        return everything

    def stale(self) -> list[Waiting]:
        """Take out and return setpoints and pose fixes that have become too old."""
        oldest_s = self._clock() - STALE_S
        old = []
        for client, queue in self._queues.items():
            late = [frame for frame in queue if frame.kind in NEWEST_COUNTS and frame.since_s < oldest_s]
            if late:
                old += late
                self._queues[client] = deque(frame for frame in queue if frame not in late)
        return old

    def next(self, holder: int | None) -> Waiting | None:
        """Take the frame that may be sent now, None if there is none. ``holder`` is the commanding client."""
        if self._stops:
            return self._next_stop()
        self._stops_sent.clear()
        client = self._turn(holder)
        if client is None or not self._admits(self._queues[client][0].size):
            return None
        if client != holder:
            self._turns.remove(client)
            self._turns.append(client)
        frame = self._queues[client].popleft()
        ahead = self._ahead_bytes + (frame.size if client == holder else -HOLDER_SHARE * frame.size)
        self._ahead_bytes = max(-_CREDIT_BYTES, min(_CREDIT_BYTES, ahead))
        return self._charged(frame)

    def _next_stop(self) -> Waiting | None:
        """Take the first stop. Between two holds a heartbeat may go: without any the robot would lose its link."""
        first = min(self._stops, key=lambda stop: (stop.handicap + self._stops_sent[stop.client], _urgency(stop)))
        is_hold = _urgency(first) is Stop.HOLD
        queue = self._queue_of_a_heartbeat() if self._last_was_hold and is_hold else None
        frame = first if queue is None else next(f for f in queue if f.kind is Kind.HEARTBEAT)
        if not self._stop_budget.admits(frame.size):
            return None
        (self._stops if queue is None else queue).remove(frame)
        self._last_was_hold = is_hold and queue is None
        if queue is None:
            self._stopped_s[frame.client, frame.slot] = self._clock()
            self._stops_sent[frame.client] += 1
        self._stop_budget.charge(frame.size)
        return self._charged(frame)

    def _queue_of_a_heartbeat(self) -> deque[Waiting] | None:
        return next((q for q in self._queues.values() if any(f.kind is Kind.HEARTBEAT for f in q)), None)

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits."""
        return not self._stops and not any(self._queues.values())

    def _turn(self, holder: int | None) -> int | None:
        waiting = [client for client in self._turns if self._queues[client]]
        others = [client for client in waiting if client != holder]
        if holder in waiting and not (others and self._ahead_bytes > 0):
            return holder
        return others[0] if others else None

    def _admits(self, size: int) -> bool:
        return self._budget.admits(min(size, int(self._budget.burst_bytes)))

    def _charged(self, frame: Waiting) -> Waiting:
        self._budget.charge(frame.size)
        return frame


def _urgency(stop: Waiting) -> Stop:
    return stop_of(stop.message) or Stop.HOLD
