# SPDX-License-Identifier: MIT
"""Parameters on trial: the robot itself goes back to its old ones if the program that tries others is gone.

    with Trial(robot) as trial:
        trial.set_many({"ISMC_LAM_XY": 20.0})
        ...                                    # an error or Ctrl-C in here: the old values
    # reached the end: what is in use stays

The robot takes the old values back when the connection is closed, or when its heartbeats have been missing for
SAFE_LINK_TO. So they are back after the cable came out or the program was killed. Firmware that does not know trials
is told to go back by this program alone, which needs the link.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from types import TracebackType

from omniwheel.dialect import TRIAL_ASK, TRIAL_BACK, TRIAL_BEGIN, TRIAL_KEEP, mavlink
from omniwheel.errors import CommandRefusedError, OmniError
from omniwheel.parameters import ParameterValue
from omniwheel.robot import Robot


class Trial:
    """A trial from entering to leaving the ``with`` block; the robot must not be armed at its beginning.

    Entering raises CommandRefusedError if another station tries parameters. Programs with the same ids on one link are
    one station to the robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._known = True
        self._before: dict[str, float] = {}
        self._tried: dict[str, float] = {}

    def __enter__(self) -> Trial:
        self._begin()
        return self

    def set_many(self, values: Mapping[str, ParameterValue]) -> None:
        """Set several parameters, all or none, as ``robot.parameters.set_many`` does.

        While a program computes or waits for a key it sends no heartbeats, and the robot takes everything back. So this
        asks first whether the trial goes on. If not, a new one begins, and all values are sent.
        """
        parameters = self._robot.parameters
        if not self._goes_on():
            self._read_again(values)
            self._begin()
        self._before = {**{name: parameters[name] for name in values}, **self._before}
        parameters.set_many(values)
        self._tried |= {name: parameters[name] for name in values}

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._send(TRIAL_KEEP, "to keep the parameters on trial")
            return
        with suppress(OmniError):  # the robot does it by itself, and the first error is the one to tell
            with suppress(CommandRefusedError):  # it has done so already
                self._send(TRIAL_BACK, "to restore the parameters before the trial")
            known = self._robot.parameters.known
            self._read_again(name for name, value in self._before.items() if known.get(name) != value)

    def _read_again(self, names: Iterable[str]) -> None:
        """Ask the robot: what is known here is of before it took something back. That goes into its history, too."""
        parameters = self._robot.parameters
        for name in names:
            parameters.read(name)
        taken_back = {name: (value, parameters[name]) for name, value in self._tried.items()}
        self._tried.clear()
        parameters.report_changes({name: pair for name, pair in taken_back.items() if pair[0] != pair[1]})

    def _begin(self) -> None:
        try:
            self._send(TRIAL_BEGIN, "to try parameters")
        except CommandRefusedError as error:
            if error.result != "DENIED" or not self._goes_on():
                raise
            # A program before this one, with the same ids on the same link, was killed a moment ago.
            self._send(TRIAL_BACK, "to restore the parameters before the trial")
            self._read_again(self._robot.parameters.known)
            self._send(TRIAL_BEGIN, "to try parameters")

    def _goes_on(self) -> bool:
        try:
            self._send(TRIAL_ASK, "whether a trial is active")
        except CommandRefusedError:
            return False
        return True

    def _send(self, action: float, what: str) -> None:
        if not self._known:
            return
        try:
            self._robot.commands.send(mavlink.MAV_CMD_OMNI_TRIAL, action, what=what)
        except CommandRefusedError as error:
            if error.result != "UNSUPPORTED":
                raise
            self._known = False
