# SPDX-License-Identifier: MIT
"""Drive, tune, simulate, record and plot Omniwheel robots.

>>> import omniwheel
>>> with omniwheel.simulate("fast_three_wheel") as robot:   # doctest: +SKIP
...     robot.arm()
...     robot.drive_to(0.5, 0.0, speed=0.5)
...     robot.drive(0.0, 0.2, 0.0, duration=2.0)
...     print(robot.pose, robot.battery_V, robot.state)
...     robot.run.save("drive.csv")

More of the same robot:

>>> robot.drive_to(0.0, 0.3, frame="body")                       # doctest: +SKIP
>>> print(robot.follow([(0, 0), (1, 0.5), (2, 0)], speed=0.4))   # a smooth path through points
>>> for k in range(60):                                          # a loop of one's own
...     robot.velocity(0.2, 0.0, 0.3)
...     robot.sleep(0.05)
>>> robot.stop()                                                 # brake and hold; disarm() powers off, estop() latches
>>> robot.parameters["LIM_V"], robot.parameters.info("LIM_V").maximum
>>> with robot.parameters.changed(LIM_V=0.3):                    # set back at the end of the block
...     robot.drive_to(0.0, 0.0)
>>> robot.on(omniwheel.telemetry.Battery, lambda battery: print(battery.voltage_V))
>>> robot.estop()                                                # the motion under way raises StoppedError
>>> robot.estop_clear()
>>> run = omniwheel.load("drive.csv")
>>> run.plot()

:func:`connect` gives a :class:`Robot`, :func:`simulate` a simulated one, :func:`load` a recorded :class:`Run`. Metres,
seconds, radians; poses in the world's frame. A thread serves the link: the program may sleep and compute. Simulated
faster than real time, ``simulate(speed="max")``, time passes in ``robot.sleep`` and motions, not in ``time.sleep``.
:mod:`omniwheel.sync` is the same without a thread, :mod:`omniwheel.aio` with ``await``. Everything that goes wrong on
purpose is an :class:`OmniError`; :mod:`omniwheel.errors` draws the tree.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import omniwheel.aio as aio
    from omniwheel import errors, sync, telemetry
    from omniwheel.background import connect, simulate
    from omniwheel.driven import Driven, DrivenPath
    from omniwheel.errors import DriveError, LimitError, LinkError, NotArrivedError, OmniError, StoppedError
    from omniwheel.firmware_process import FirmwareProcess
    from omniwheel.frames import Pose, Twist
    from omniwheel.robot import Robot
    from omniwheel.run import Run, load
    from omniwheel.simulation import SimulatedRobot

__all__ = [
    "DriveError",
    "Driven",
    "DrivenPath",
    "FirmwareProcess",
    "LimitError",
    "LinkError",
    "NotArrivedError",
    "OmniError",
    "Pose",
    "Robot",
    "Run",
    "SimulatedRobot",
    "StoppedError",
    "Twist",
    "__version__",
    "aio",
    "connect",
    "errors",
    "load",
    "simulate",
    "sync",
    "telemetry",
]

_HOMES = {
    "DriveError": "omniwheel.errors",
    "Driven": "omniwheel.driven",
    "DrivenPath": "omniwheel.driven",
    "FirmwareProcess": "omniwheel.firmware_process",
    "LimitError": "omniwheel.errors",
    "LinkError": "omniwheel.errors",
    "NotArrivedError": "omniwheel.errors",
    "OmniError": "omniwheel.errors",
    "Pose": "omniwheel.frames",
    "Robot": "omniwheel.robot",
    "Run": "omniwheel.run",
    "SimulatedRobot": "omniwheel.simulation",
    "StoppedError": "omniwheel.errors",
    "Twist": "omniwheel.frames",
    "connect": "omniwheel.background",
    "load": "omniwheel.run",
    "simulate": "omniwheel.background",
}
"""Where the names of this package are. They are imported when they are first used: most programs use a few."""
_MODULES = ("aio", "errors", "sync", "telemetry")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # here, not above: it takes long to import

        return version("omniwheel")
    if name in _MODULES:
        return import_module(f"omniwheel.{name}")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'omniwheel' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
