# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.bringup.results_page``, for one more release."""

from omniwheel.moved import moved

_HERE = "omniwheel.bringup.results_page"

__getattr__ = moved(__name__, {"write_report": f"{_HERE}:write_results", "as_markdown": _HERE, "as_dict": _HERE})
