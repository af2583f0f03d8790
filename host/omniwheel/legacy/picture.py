# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.host_control.picture``, for one more release."""

from omniwheel.moved import moved

_HERE = "omniwheel.host_control.picture"

__getattr__ = moved(
    __name__,
    {
        "draw_legacy_run": f"{_HERE}:draw_host_control_run",
    },
)
