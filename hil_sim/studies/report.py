# SPDX-License-Identifier: MIT
"""Old place of ``hil_sim.studies.tables``, for one more release."""

from omniwheel.moved import moved

_HERE = "hil_sim.studies.tables"
_SAME = (
    "SPREAD_HEADINGS",
    "NO_FIGURES",
    "spread_rows",
    "completion_line",
    "fault_lines",
    "markdown_table",
)

__getattr__ = moved(
    __name__,
    {
        **dict.fromkeys(_SAME, _HERE),
        "REPORT_FILE": f"{_HERE}:PAGE_FILE",
        "write_montecarlo_report": f"{_HERE}:write_montecarlo_page",
    },
)
