# SPDX-License-Identifier: MIT
"""Host tools for Omniwheel robots: connect, tune, simulate, record and plot.

>>> import omniwheel
>>> with omniwheel.connect("tcp:127.0.0.1:5760") as robot:   # doctest: +SKIP
...     robot.parameters["ISMC_LAM_XY"] = 15.0
...     robot.arm()
...     robot.drive_velocity(0.1, 0.0, 0.0, duration_s=2.0)

:func:`connect` and :class:`Robot` are the API; :mod:`omniwheel.errors` draws the exception tree.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from omniwheel.errors import OmniError
    from omniwheel.firmware_process import FirmwareProcess
    from omniwheel.frames import Pose, Twist
    from omniwheel.robot import Robot, connect

__all__ = ["FirmwareProcess", "OmniError", "Pose", "Robot", "Twist", "__version__", "connect"]

_HOMES = {
    "FirmwareProcess": "omniwheel.firmware_process",
    "OmniError": "omniwheel.errors",
    "Pose": "omniwheel.frames",
    "Robot": "omniwheel.robot",
    "Twist": "omniwheel.frames",
    "connect": "omniwheel.robot",
}
"""Where the names of this package are. They are imported when they are first used: most programs use a few."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # here, not above: it takes long to import

        return version("omniwheel")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'omniwheel' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
