# SPDX-License-Identifier: MIT
"""Who commands the robot: the first client that moves it, until it disarms, goes away or is idle."""

from __future__ import annotations

IDLE_S = 3.0
"""A client in command that is silent for so long, or does not move a disarmed robot for so long, is not any more."""
PAUSE_S = 1.0
"""A stream that was refused does not become the command in its middle: it must pause for so long first."""
ENDED_PAUSE_S = 10.0
"""... and for so long if another client has ended its drive, as at the robot (Stations::away_us)."""


class InCommand:
    """Who commands. Clients are numbers; times are seconds of the hub's clock.

    ``holder`` is the client in command, None if there is none. ``armed`` is what the robot's heartbeat said last.
    """

    def __init__(self) -> None:
        self.holder: int | None = None
        self.armed = False
        self._other_armed_s = float("-inf")
        self._moved_s = float("-inf")
        self._heard_s = float("-inf")
        self._pauses: dict[int, tuple[float, float]] = {}
        """Of clients whose stream was refused: when it was last, and how long it must pause from then on."""

    def hear(self, client: int, now_s: float) -> None:
        """Take note that a client has said something."""
        if client == self.holder:
            self._heard_s = now_s

    def may_move(self, client: int, now_s: float, *, stream: bool) -> bool:
        """Ask for the command: True if the client has it now. ``stream`` marks a set-point of a stream."""
        refused_s, pause_s = self._pauses.get(client, (float("-inf"), PAUSE_S))
        must_pause = stream and now_s - refused_s < pause_s
        if self.holder not in (None, client) or (self.holder is None and must_pause):
            self._pauses[client] = (now_s, pause_s if must_pause else PAUSE_S)
            return False
        self.holder = client
        self._moved_s = self._heard_s = now_s
        self._pauses.pop(client, None)
        return True

    def hears_heartbeat_of(self, client: int, now_s: float) -> bool:
        """Return whether the robot may hear this client's heartbeats: they keep it driving.

        While a robot is armed only those of the client in command, so that nobody else's hide that this one is gone.
        """
        return client == self.holder or (self.holder is None and not self._any_is_armed(now_s))

    def note_other_armed_robot(self, now_s: float) -> None:
        """Take note that another robot on the line is armed: the client in command may drive that one."""
        self._other_armed_s = now_s

    def _any_is_armed(self, now_s: float) -> bool:
        return self.armed or now_s - self._other_armed_s < IDLE_S

    def robot_says(self, armed: bool, now_s: float) -> bool:
        """Take the robot's heartbeat; return whether the command was released by it."""
        was, self.armed = self.armed, armed
        return was and not armed and self.revoke(now_s)

    def revoke(self, now_s: float) -> bool:
        """End the command although its client may still stream; return whether there was one."""
        if self.holder is not None:
            self._pauses[self.holder] = (now_s, ENDED_PAUSE_S)
        return self.release()

    def leave(self, client: int) -> bool:
        """Forget a client; return whether the command was released by it."""
        self._pauses.pop(client, None)
        return client == self.holder and self.release()

    def is_idle(self, now_s: float) -> bool:
        """Return whether the client in command is silent, or does nothing with a robot that is disarmed."""
        since_s = self._heard_s if self._any_is_armed(now_s) else self._moved_s
        return self.holder is not None and now_s - since_s >= IDLE_S

    def release(self) -> bool:
        """End the command; return whether there was one."""
        had, self.holder = self.holder is not None, None
        return had
