# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.host_control.pwm_line``, for one more release."""

from omniwheel.moved import moved

_NAMES = (
    *("FULL_PWM", "MOTORS", "END", "MAX_LINE_BYTES", "DEFAULT_BAUD", "USABLE_SHARE", "BACKLOG_BYTES", "KEEPALIVE_S"),
    *("STOP_LINES", "STOP", "PwmLine", "PwmRadio", "format_line", "parse_line"),
)

__getattr__ = moved(__name__, dict.fromkeys(_NAMES, "omniwheel.host_control.pwm_line"))
