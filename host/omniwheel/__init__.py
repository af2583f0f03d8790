# SPDX-License-Identifier: MIT
"""Host tools for Omniwheel robots: connect, tune, simulate, record and plot.

>>> import omniwheel
>>> with omniwheel.connect("tcp:127.0.0.1:5760") as robot:   # doctest: +SKIP
...     robot.parameters["ISMC_LAM_XY"] = 15.0
...     robot.arm()
...     robot.drive_velocity(0.1, 0.0, 0.0, duration_s=2.0)

:func:`connect` and :class:`Robot` are the API; :mod:`omniwheel.errors` draws the exception tree.
"""

from importlib.metadata import version

from omniwheel.errors import OmniError
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.frames import Pose, Twist
from omniwheel.robot import Robot, connect

__version__ = version("omniwheel")

__all__ = ["FirmwareProcess", "OmniError", "Pose", "Robot", "Twist", "__version__", "connect"]
