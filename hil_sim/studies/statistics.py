# SPDX-License-Identifier: MIT
"""Old place of ``hil_sim.studies.study_summary``, for one more release."""

from omniwheel.moved import moved

_NAMES = (
    *("QUANTILES", "counted", "fault_counts", "not_run", "ranking"),
    *("spread", "student_quantile", "summarise", "wilson"),
)

__getattr__ = moved(__name__, dict.fromkeys(_NAMES, "hil_sim.studies.study_summary"))
