# SPDX-License-Identifier: MIT
"""Every exception of this package, in one tree.

::

    OmniError
    ├── LinkError                     the connection itself
    │   ├── LinkUrlError              the link URL cannot be understood            (bad input)
    │   ├── LinkOpenError             port or address cannot be opened
    │   ├── LinkLostError             the other end went away
    │   ├── LinkTimeoutError          no answer in time
    │   ├── SeveralRobotsError        more than one robot is on the line; says which (bad input)
    │   ├── OutsideLoopError          the robot is no longer in host-in-the-loop
    │   └── SigningKeyError           a signing key is missing, malformed, exposed or another one  (bad input)
    ├── ParameterError
    │   ├── UnknownParameterError     no such name; says which one is close        (bad input, a KeyError)
    │   ├── ParameterRangeError       the value is not allowed; says what is       (bad input, a ValueError)
    │   ├── ParameterFileError        a parameter file cannot be read              (bad input)
    │   ├── ParameterRefusedError     the robot kept its old value; says why
    │   └── OtherRobotError           a parameter file is of a robot with other hardware; lists what differs
    ├── SetpointError                 a set-point or argument that is no number    (bad input, a ValueError)
    │   └── LimitError                one that this robot cannot follow; has limit, asked, possible
    ├── CommandRefusedError           the robot answered a command with a refusal; says why
    │   └── ArmingRefusedError
    ├── FirmwareError                 the firmware as a program of this computer, its own or an emulated one
    │   ├── FirmwareNotFoundError     it, or the emulator, is not installed
    │   ├── FirmwareStartError        it ended or did not get ready
    │   ├── FirmwareEndedError        it ended while it was used; says its last words
    │   └── FirmwareImageError        an image for the Teensy that is none, or is refused by the chip  (bad input)
    ├── FlashError                    the Teensy's firmware could not be built, uploaded or found running
    │   └── HexFileError              a .hex file that is damaged, or no program for a Teensy 4.0   (bad input)
    ├── MocapError                    a stream of poses from motion capture
    │   ├── MocapSourceError          its name or file cannot be understood        (bad input)
    │   ├── MocapLibraryError         the library that reads it is not installed
    │   ├── MocapLostError            it cannot be reached, or went away
    │   ├── MocapLatencyError         its latency cannot be told; says what to do
    │   └── CameraError               pictures that cannot tell what was asked for; says what is missing
    ├── DriveError                    a drive that did not happen, or not to its end
    │   ├── StoppedError              ended by the robot itself, another station or program, or another thread
    │   └── NotArrivedError           the robot was not at its goal in time; has goal and pose
    ├── HostControlStopError          the host's control loop stopped the robot by itself
    ├── CoreError                     the control core refuses a parameter set     (bad input)
    ├── RobotFileError                a robot file is missing or malformed         (bad input)
    │   └── DataSheetError            a data sheet whose numbers are missing or contradict
    ├── HistoryError                  a history of parameters, or an entry that it does not have (bad input)
    ├── LogError                      a log, its column mapping or calibration      (bad input, a ValueError)
    │   └── OtherBurstError           the robot's burst is not the one that was asked for
    ├── DatasetError                  measured data that is no valid dataset           (bad input, a ValueError)
    ├── IdentificationError           the data cannot show what was asked for; says what is missing
    ├── AutotuneError                 a robot could not be tuned; it has its old parameters
    ├── OutputFileError               a file cannot be written: the disk is full or broken; the old one is still there
    │   └── OutputPathError           ... because of its folder, name or permissions  (bad input)
    ├── MissingPackageError           a command needs an optional package that is not installed
    └── VersionMismatchError          robot and host speak different versions

``str(error)`` is one line that says what happened; ``error.hint`` says what to do about it, or is "".
The command line ends with ``error.exit_code``: 2 for bad input, 1 otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from omniwheel.frames import Pose


class OmniError(Exception):
    """Base of everything this package raises on purpose."""

    exit_code: ClassVar[int] = 1

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return self.message


class LinkError(OmniError):
    """The connection to the robot."""


class LinkUrlError(LinkError, ValueError):
    """A link URL that cannot be understood."""

    exit_code = 2


class LinkOpenError(LinkError):
    """A port or address that cannot be opened."""


class LinkLostError(LinkError):
    """The other end closed the connection or the port disappeared."""


class LinkTimeoutError(LinkError, TimeoutError):
    """No answer in time."""


class SeveralRobotsError(LinkError, ValueError):
    """Several robots are on one line, and none was chosen or ``message`` would reach all of them.

    ``systems`` are their system ids. ``message`` is the name of a MAVLink message without a target system.
    """

    exit_code = 2

    def __init__(self, url: str, systems: Sequence[int], message: str = "") -> None:
        names = " and ".join(map(str, systems))
        choose = f"choose one with --system {systems[0]}; in Python connect(..., system_id={systems[0]})"
        hint = "give each robot a line of its own: this message has no target system" if message else choose
        sent = f", and {message} would reach all of them" if message else ""
        super().__init__(f"several robots are on {url}: system ids {names}{sent}", hint=hint)
        self.systems = tuple(systems)


class DriveError(OmniError):
    """A drive that did not happen, or not to its end."""


class StoppedError(DriveError):
    """A drive was ended by the robot itself, by another station or program, or by another thread of this one.

    ``reason`` is the message.
    """

    @property
    def reason(self) -> str:
        """Why."""
        return self.message


class NotArrivedError(DriveError):
    """The robot was not at its goal in time; it holds where it is.

    ``goal`` and ``pose`` are world poses: where it should be, and where it was at the end of the time.
    """

    def __init__(self, message: str, goal: Pose, pose: Pose, *, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.goal = goal
        self.pose = pose


class OutsideLoopError(LinkError):
    """The robot is no longer in host-in-the-loop."""


class SigningKeyError(LinkError, ValueError):
    """A signing key that is missing, malformed, readable by others, or not the robot's."""

    exit_code = 2


class ParameterError(OmniError):
    """Something about a parameter."""


class UnknownParameterError(ParameterError, KeyError):
    """There is no parameter of this name."""

    exit_code = 2


class ParameterRangeError(ParameterError, ValueError):
    """A value outside what params.toml allows; nothing was sent."""

    exit_code = 2


class ParameterFileError(ParameterError, ValueError):
    """A parameter file that cannot be read or written."""

    exit_code = 2


class ParameterRefusedError(ParameterError):
    """The robot did not take a value: ``wanted`` was asked for, ``kept`` is in force, ``reasons`` are its own words."""

    def __init__(self, name: str, wanted: float, kept: float, reasons: Sequence[str]) -> None:
        why = "; ".join(reasons) or "it gave no reason"
        super().__init__(f"the robot refused {name} = {wanted:.7g} and keeps {kept:.7g}: {why}")
        self.name = name
        self.wanted = wanted
        self.kept = kept
        self.reasons = tuple(reasons)


class OtherRobotError(ParameterError):
    """A parameter file is of a robot with other wheels, geometry or wiring; nothing was set."""


class SetpointError(OmniError, ValueError):
    """A set-point or argument that is not a finite number; nothing was sent."""

    exit_code = 2


class LimitError(SetpointError):
    """A setpoint that this robot cannot follow; nothing was sent.

    ``limit`` is the parameter's name, or what else limits it. ``asked`` was asked for, ``possible`` is what this robot
    can do, both in the unit of the message; NaN where there is no such number.
    """

    def __init__(
        self, message: str, *, hint: str = "", limit: str = "", asked: float = math.nan, possible: float = math.nan
    ) -> None:
        super().__init__(message, hint=hint)
        self.limit = limit
        self.asked = asked
        self.possible = possible


class CommandRefusedError(OmniError):
    """The robot answered a command with something else than ACCEPTED.

    ``result`` is the name of the MAV_RESULT without prefix ("DENIED"), ``reasons`` the robot's status texts.
    """

    what = "the robot refused"

    def __init__(self, command: str, result: str, reasons: Sequence[str] = (), *, hint: str = "") -> None:
        why = "; ".join(reasons) or "it gave no reason"
        super().__init__(f"{self.what} {command} ({result.lower().replace('_', ' ')}): {why}", hint=hint)
        self.command = command
        self.result = result
        self.reasons = tuple(reasons)


class ArmingRefusedError(CommandRefusedError):
    """The robot did not arm."""


class FirmwareError(OmniError):
    """The firmware as a program of this computer."""


class FirmwareNotFoundError(FirmwareError):
    """The firmware program, or the emulator for it, is not part of this installation."""


class FirmwareStartError(FirmwareError):
    """The PC firmware program ended before it was ready, or did not get ready."""


class FirmwareEndedError(FirmwareError):
    """The firmware ended while it was used. ``code`` is its exit code, ``messages`` the last that it said."""

    def __init__(self, code: int, messages: str) -> None:
        said = [line for line in messages.splitlines() if not line.startswith("{")]
        why = f": {said[0]}" if said else " and said nothing"
        super().__init__(f"the firmware ended with exit code {code}{why}", hint="\n".join(said[1:]))
        self.code = code
        self.messages = messages


class FirmwareImageError(FirmwareError):
    """A file that is no firmware image for the Teensy 4.0, or one that the emulated chip will not run."""

    exit_code = 2


class FlashError(OmniError):
    """The Teensy's firmware could not be built, uploaded or found running afterwards."""


class HexFileError(FlashError, ValueError):
    """A .hex file that is missing, damaged or no program for a Teensy 4.0; nothing was uploaded."""

    exit_code = 2


class MocapError(OmniError):
    """A stream of poses from motion capture."""


class MocapSourceError(MocapError, ValueError):
    """A stream's name, object or file that cannot be understood."""

    exit_code = 2


class MocapLibraryError(MocapError):
    """The library that reads the stream is not installed."""


class MocapLostError(MocapError):
    """The stream cannot be reached, or went away."""


class CameraError(MocapError):
    """Pictures of a camera that cannot tell what was asked for; nothing was written."""


class MocapLatencyError(MocapError):
    """Poses and turning from which their latency cannot be told."""


class HostControlStopError(OmniError):
    """The control loop on the host stopped the robot by itself; says why."""


class CoreError(OmniError, ValueError):
    """The control core refuses a parameter set; the message names the parameter."""

    exit_code = 2


class RobotFileError(OmniError, ValueError):
    """A robot file that is missing, malformed or out of range."""

    exit_code = 2


class DataSheetError(RobotFileError):
    """A motor's data-sheet numbers are missing, unreadable, or contradict each other."""


class LogError(OmniError, ValueError):
    """A log, a column mapping or a calibration that is missing, malformed or does not hold what is asked of it."""

    exit_code = 2


class OtherBurstError(LogError):
    """The burst that the robot holds is not the one that was asked for: another program has begun one."""

    exit_code = 1


class HistoryError(OmniError, ValueError):
    """A history of parameters that cannot be read, or an entry that it does not have."""

    exit_code = 2


class DatasetError(OmniError, ValueError):
    """Measured data that is no valid dataset: wrong shape, not finite, time that does not rise."""

    exit_code = 2


class AutotuneError(OmniError):
    """A robot could not be tuned; it has its old parameters."""


class IdentificationError(OmniError):
    """The data cannot show what was asked for: too short, not excited, saturated."""


class OutputFileError(OmniError):
    """A file cannot be written, because the disk is full or broken. What stood there before is untouched.

    ``found`` is what a command had found by then: its JSON holds it beside the error.
    """

    found: Mapping[str, Any] = MappingProxyType({})


class OutputPathError(OutputFileError, ValueError):
    """A file cannot be written because of its folder, its name or its permissions."""

    exit_code = 2


class MissingPackageError(OmniError):
    """A command needs an optional package that is not installed."""


class VersionMismatchError(OmniError):
    """The robot's firmware and this package do not fit together."""
