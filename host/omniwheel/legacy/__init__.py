# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.host_control``, for one more release."""

from omniwheel.moved import moved

_HERE = "omniwheel.host_control"

__getattr__ = moved(
    __name__,
    {
        **dict.fromkeys(("Goal", "PwmRadio", "format_line", "parse_line"), _HERE),
        "LegacyController": f"{_HERE}:HostController",
        "LegacyLoop": f"{_HERE}:HostControlLoop",
        "LegacyRun": f"{_HERE}:HostControlRun",
        "LegacySettings": f"{_HERE}:HostControlSettings",
    },
)
