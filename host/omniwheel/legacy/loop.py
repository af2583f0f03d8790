# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.host_control.loop``, for one more release."""

from omniwheel.moved import moved

_HERE = "omniwheel.host_control.loop"
_SAME = ("SETTLE_S", "SAMPLE_COLUMNS", "STANDING", "Goal")

__getattr__ = moved(
    __name__,
    {
        **dict.fromkeys(_SAME, _HERE),
        "LegacyLoop": f"{_HERE}:HostControlLoop",
        "LegacyRun": f"{_HERE}:HostControlRun",
    },
)
