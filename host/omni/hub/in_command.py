# SPDX-License-Identifier: MIT
"""The client in command: the first that moves the robot, until it disarms, disconnects or is idle."""

from __future__ import annotations

IDLE_S = 3.0
"""A client in command that is silent for so long, or does not move a disarmed robot for so long, is not any more."""
PAUSE_S = 1.0
"""A stream that was refused does not become the command in its middle: it must pause for so long first."""
ENDED_PAUSE_S = 10.0
"""... and for so long if another client has ended its drive, as at the robot (Stations::away_us)."""


class InCommand:
    """The client in command. Clients are numbers; times are seconds of the hub's clock.

    ``holder`` is the client in command, None if there is none. ``armed`` is what the robot's heartbeat said last.
    """

    def __init__(self) -> None:
        self.holder: int | None = None
        self.driver: int | None = None
        """Whose drive another client's stop ends: that of the one in command, or that was until it fell silent."""
        self.armed = False
        self._moved_systems: set[int] = set()
        """Of the robots that the driver has moved; 0: all."""
        self._other_armed_s = float("-inf")
        self._moved_s = float("-inf")
        self._heard_s = float("-inf")
        self._pauses: dict[int, tuple[float, float]] = {}
        """Of clients whose stream was refused: when it was last, and how long it must pause from then on."""

    def hear(self, client: int, now_s: float) -> None:
        """Take note that a client has said something."""
        if client == self.holder:
            self._heard_s = now_s

    def may_move(self, client: int, now_s: float, *, stream: bool, system: int = 0) -> bool:
        """Ask for the command: True if the client has it now. ``stream`` marks a setpoint of a stream.

        ``system`` is the robot that it moves, 0 all of them.
        """
        refused_s, pause_s = self._pauses.get(client, (float("-inf"), PAUSE_S))
        must_pause = stream and now_s - refused_s < pause_s
        if self.holder not in (None, client) or (self.holder is None and must_pause):
            self._pauses[client] = (now_s, pause_s if must_pause else PAUSE_S)
            return False
        if self.driver != client:
            self._moved_systems.clear()
        self.holder = self.driver = client
        self._moved_systems.add(system)
        self._moved_s = self._heard_s = now_s
        self._pauses.pop(client, None)
        return True

    def hears_heartbeat_of(self, client: int, now_s: float) -> bool:
        """Return whether the robot may hear this client's heartbeats: they keep it driving.

        While a robot is armed only those of the client in command, so that the others' do not hide its loss.
        """
        return client == self.holder or (self.holder is None and not self._any_is_armed(now_s))

    def record_other_armed_robot(self, now_s: float) -> None:
        """Take note that another robot on the line is armed: the client in command may drive that one."""
        self._other_armed_s = now_s

    def _any_is_armed(self, now_s: float) -> bool:
        return self.armed or now_s - self._other_armed_s < IDLE_S

    def update_from_robot(self, armed: bool, now_s: float) -> bool:
        """Take the robot's heartbeat; return whether the command was released by it."""
        was, self.armed = self.armed, armed
        had = self.holder is not None
        return was and not armed and self.revoke(now_s) is not None and had

    def is_ended_by(self, client: int, system: int) -> bool:
        """Return whether a stop of this client, for this robot (0: for all), ends another client's drive."""
        moved = self._moved_systems
        return self.driver not in (None, client) and (0 in (system, *moved) or system in moved)

    def revoke(self, now_s: float) -> int | None:
        """End the driver's drive although it may still stream; return the driver."""
        driver = self.driver
        if driver is not None:
            self._pauses[driver] = (now_s, ENDED_PAUSE_S)
        self.finish()
        return driver

    def has_ended(self, client: int, now_s: float) -> bool:
        """Return whether the setpoints of this client are refused because its drive was ended."""
        refused_s, pause_s = self._pauses.get(client, (float("-inf"), PAUSE_S))
        return pause_s == ENDED_PAUSE_S and now_s - refused_s < pause_s

    def leave(self, client: int) -> bool:
        """Forget a client; return whether the command was released by it."""
        self._pauses.pop(client, None)
        had = client == self.holder
        if client == self.driver:
            self.finish()
        return had

    def is_idle(self, now_s: float) -> bool:
        """Return whether the client in command is silent, or does nothing with a robot that is disarmed."""
        since_s = self._heard_s if self._any_is_armed(now_s) else self._moved_s
        return self.holder is not None and now_s - since_s >= IDLE_S

    def release(self) -> None:
        """Free the command. The drive of its client may still go on."""
        self.holder = None

    def finish(self) -> None:
        """Free the command: the drive of its client is over."""
        self.holder = self.driver = None
        self._moved_systems.clear()
