# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.log_sources``, for one more release."""

from omniwheel.moved import moved

_NAMES = ("KINDS", "open_log", "read_run", "read_tlog")

__getattr__ = moved(__name__, dict.fromkeys(_NAMES, "omniwheel.log_sources"))
