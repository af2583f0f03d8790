# SPDX-License-Identifier: MIT
"""Notices that a drive which was begun here is over: the robot stopped itself, or somebody else stopped it."""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import StoppedError
from omniwheel.hub import notices
from omniwheel.status import RobotStatus
from omniwheel.telemetry import Heartbeat, Status, StatusText
from omniwheel.telemetry_parts import decode
from omniwheel.texts import HELD_BY, STOPPED_BY, TAKEN_OVER_BY, TextLog

LATE_S = 0.5
"""A text of before the arming may come so late after the robot has accepted it."""
REASON_S = 0.1
"""The heartbeat that tells of an end comes first, then its reason."""
STATE_S = 1.0
"""... and the safety state, which tells a failsafe from a disarming; on a slow radio so much later."""
JOIN_S = 2.0
"""For so long after it joined a drive, a text about a takeover is of its own first setpoint."""
_ENDED = "its drive has ended"
"""How the robot refuses set-points of a drive that another station has ended."""


class DriveGuard:
    """Watches one robot from its arming to its disarming by this program.

    ``begun``: it was armed here and has not been disarmed here since. What the robot said before it accepted the
    arming is of an earlier state, however late a radio brings it. Once a drive is over it stays so until the next one.
    A program that drives a robot which another one armed joins that drive (:meth:`join`).
    """

    def __init__(self, connection: Connection, texts: TextLog, status: Callable[[], RobotStatus]) -> None:
        self.begun = False
        self._connection, self._texts, self._status = connection, texts, status
        self._accepted = self._joined = False
        self._over: StoppedError | None = None
        self._reset()
        self._asking = False
        self._mark = 0
        connection.add_listener(self._hear)

    def _reset(self) -> None:
        """Forget what the robot said of an earlier drive."""
        self._armed: bool | None = None
        self._seen_armed = self._seen_disarmed = self._held = False
        self._state: str | None = None
        self._over = None
        self._since_s = self._connection.clock()

    def _hear(self, message: Message) -> None:
        beat, status, text = decode(Heartbeat, message), decode(Status, message), decode(StatusText, message)
        if self.begun and not self._accepted and _accepts_arming(message):
            self._accepted = True
            self._reset()
            self._mark = self._texts.mark()
        elif beat is not None:
            self._armed = beat.armed
            self._seen_disarmed = self._seen_disarmed or (self._seen_armed and not beat.armed)
            self._seen_armed = self._seen_armed or beat.armed
        elif status is not None:
            self._state = status.state
        elif text is not None and self._is_watching:
            self._held = self._held or self._tells_of_end(text.text)

    def _tells_of_end(self, text: str) -> bool:
        """Return whether a text ends this drive. Those of the hub keep their order, and so are never too late."""
        late = self._connection.clock() - self._since_s <= (JOIN_S if self._joined else LATE_S)
        return notices.ends_drive(text) or (text.startswith((HELD_BY, TAKEN_OVER_BY)) and not late)

    def begin(self) -> None:
        """Take note that this program asks the robot to arm."""
        self.begun, self._accepted, self._joined = True, False, False
        self._mark = self._texts.mark()

    def join(self) -> None:
        """Take note that this program drives a robot that another one armed; nothing changes if it was armed here."""
        if not self.begun and not self._joined:
            self._reset()
            self._joined = self._armed = self._seen_armed = True
            self._mark = self._texts.mark()

    def go_on(self) -> None:
        """Take note that this program began a new drive of the robot that it had armed: it may have been held."""
        if self.begun and self._accepted and self._armed:
            self._reset()
            self._armed = self._seen_armed = True
            self._mark = self._texts.mark()

    def end(self) -> None:
        """Take note that this program disarms or stops the robot."""
        self.begun = self._joined = False
        self._over = None

    @property
    def armed_here(self) -> bool:
        """Whether the robot is armed by this program, as far as is known: nobody else has disarmed and armed it."""
        return self.begun and not (self._seen_disarmed and self._armed)

    def check(self) -> None:
        """Raise StoppedError if the drive that was begun or joined here is over; nothing happens if there is none.

        Until its heartbeat says that it is armed, a robot that is disarmed counts as one that is about to arm.
        """
        if not self._is_watching or self._asking:
            return
        self._over = self._over or self._ending()
        if self._over is not None:
            raise StoppedError(str(self._over), hint=self._over.hint)

    @property
    def is_over(self) -> bool:
        """Whether the drive that was begun or joined here is over, by what is known now; :meth:`check` raises why."""
        return self._is_watching and (self._over is not None or self._is_stopped() or self._is_held())

    @property
    def _is_watching(self) -> bool:
        return self._joined or (self.begun and self._accepted)

    def _is_stopped(self) -> bool:
        return self._state in ("failsafe", "estop") or self._seen_disarmed

    def _is_held(self) -> bool:
        return self._held or any(_ENDED in text.text for text in self._texts.since(self._mark))

    def _ending(self) -> StoppedError | None:
        """Return why the drive is over; None while it is not."""
        if self._is_stopped():
            self._await_reason()
            who = self._who()
            if who or self._state == "disarmed":
                return self._stopped_by_another(who)
            return self._stopped_itself() if self._has_stopped_state() else _stopped_without_reason()
        return self.held() if self._is_held() else None

    def held(self) -> StoppedError:
        """Return the error of a drive that another station or program ended while the robot stays armed."""
        who = self._who()
        by = f" ({who})" if who else ""
        return StoppedError(
            f"another station or program held the robot or took the command{by}", hint="arm again to go on"
        )

    def _who(self) -> str:
        """Return the text that says who ended the drive, "" if none does.

        One of the hub names a program, and so goes before one of the robot. Of each the last one counts.
        """
        texts = [text.text for text in self._texts.since(self._mark)]
        by_hub = [text for text in texts if notices.names_program(text)]
        by_robot = [text for text in texts if text.startswith((*STOPPED_BY, TAKEN_OVER_BY))]
        return next(iter([*by_hub[-1:], *by_robot[-1:]]), "")

    def _await_reason(self) -> None:
        self._asking = True  # what is repeated meanwhile may check, too
        try:
            if not self._has_stopped_state():
                self._connection.wait(lambda _: self._has_stopped_state(), STATE_S)
            self._connection.pump_quietly(REASON_S)
        finally:
            self._asking = False

    def _has_stopped_state(self) -> bool:
        return self._state not in (None, "armed")

    def _faults(self) -> str:
        safety = self._status().safety
        return ", ".join(safety.fault_history or safety.faults) if safety is not None else ""

    def _stopped_itself(self) -> StoppedError:
        hint = "`omni monitor` shows the faults; disarming clears the failsafe"
        why = self._faults() or "no fault named"
        return StoppedError(f"the robot stopped by itself ({self._state}): {why}", hint=hint)

    def _stopped_by_another(self, who: str) -> StoppedError:
        ends = {"estop": "an emergency stop is on", "failsafe": f"it is in failsafe ({self._faults()})"}
        return StoppedError(
            f"another station or program stopped the robot ({who or 'it is not said which'}): "
            f"{ends.get(self._state or '', 'it was disarmed')}",
            hint="nothing arms it again by itself",
        )


def _stopped_without_reason() -> StoppedError:
    hint = "`omni monitor` shows its state; nothing arms it again by itself"
    return StoppedError(f"the robot is not armed any more and sent no safety state within {STATE_S:g} s", hint=hint)


def _accepts_arming(message: Message) -> bool:
    return (
        message.get_type() == "COMMAND_ACK"
        and message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        and message.result == mavlink.MAV_RESULT_ACCEPTED
    )
