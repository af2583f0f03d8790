# SPDX-License-Identifier: MIT
"""Old place of ``omniwheel.identification.log_page``, for one more release."""

from omniwheel.moved import moved

_HERE = "omniwheel.identification.log_page"

__getattr__ = moved(
    __name__, {**dict.fromkeys(("KINDS", "study_data", "interval"), _HERE), "study_report": f"{_HERE}:study_page"}
)
