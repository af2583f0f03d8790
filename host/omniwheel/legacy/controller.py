# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.host_control.controller``, for one more release."""

from omniwheel.moved import moved

_HERE = "omniwheel.host_control.controller"
_SAME = ("PERIOD_S", "PREDICTIONS", "Command", "pwm_of", "share_of")

__getattr__ = moved(
    __name__,
    {
        **dict.fromkeys(_SAME, _HERE),
        "LegacyController": f"{_HERE}:HostController",
        "LegacySettings": f"{_HERE}:HostControlSettings",
        "legacy_values": f"{_HERE}:host_control_values",
    },
)
