# SPDX-License-Identifier: MIT
"""The options of every command that talks to a robot, and those of every drive: listed once, see ``options.takes``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from omni.cli.common import JsonOption, LinkOption, TimeoutOption, open_robot
from omni.cli.options import DEFAULT_OUT, OutOption
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omniwheel.connection import Recorder
    from omniwheel.robot import Robot

LogOption = Annotated[
    bool, typer.Option("--log/--no-log", help="Keep telemetry, parameters and a plot of the drive in this folder.")
]


@dataclass(frozen=True)
class RobotOptions:
    """Which robot, how patiently, and how the answer is printed."""

    link: LinkOption = None
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S
    as_json: JsonOption = False

    def open(self, recorder: Recorder | None = None) -> Robot:
        """Connect to the robot."""
        return open_robot(self.link, timeout_s=self.timeout, recorder=recorder)


@dataclass(frozen=True)
class DriveOptions(RobotOptions):
    """The same, and what is kept of the drive."""

    out: OutOption = DEFAULT_OUT
    log: LogOption = True
