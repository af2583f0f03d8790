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

from collections.abc import Mapping
from contextlib import suppress
from types import TracebackType

from omniwheel.dialect import mavlink
from omniwheel.errors import CommandRefusedError, OmniError
from omniwheel.parameters import ParameterValue
from omniwheel.robot import Robot

_KEEP, _BEGIN, _BACK, _ASK = 0.0, 1.0, 2.0, 3.0


class Trial:
    """A trial from entering to leaving the ``with`` block; the robot must not be armed at its beginning.

    Entering raises CommandRefusedError if a program on another link tries parameters.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._known = True

    def __enter__(self) -> Trial:
        self._begin()
        return self

    def set_many(self, values: Mapping[str, ParameterValue]) -> None:
        """Set several parameters, all or none, as ``robot.parameters.set_many`` does.

        While a program computes or waits for a key it sends no heartbeats, and the robot takes everything back. So this
        asks first whether the trial goes on. If not, a new one begins, and all values are sent.
        """
        if not self._goes_on():
            self._robot.parameters.forget()
            self._begin()
        self._robot.parameters.set_many(values)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._send(_KEEP, "to keep the parameters on trial")
            return
        with suppress(OmniError):  # the robot does it by itself, and the first error is the one to tell
            self._send(_BACK, "to take back the parameters on trial")
            self._robot.parameters.forget()

    def _begin(self) -> None:
        try:
            self._send(_BEGIN, "to try parameters")
        except CommandRefusedError as error:
            if error.result != "DENIED" or not self._goes_on():
                raise
            # A program before this one on the same link was killed a moment ago.
            self._send(_BACK, "to take back the parameters on trial")
            self._robot.parameters.forget()
            self._send(_BEGIN, "to try parameters")

    def _goes_on(self) -> bool:
        try:
            self._send(_ASK, "whether a trial goes on")
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
