# SPDX-License-Identifier: MIT
"""Every drive leaves a folder: telemetry, parameters, what happened, numbers and a picture; and how those are read."""

from omniwheel.drive_log.folder import DriveLog
from omniwheel.drive_log.listing import RunEntry, compare, delete_run, find_run, list_runs, rename_run
from omniwheel.link import is_slow
from omniwheel.telemetry_picture import draw_telemetry
from omniwheel.telemetry_record import TelemetryRecord, read_record

__all__ = [
    "DriveLog",
    "RunEntry",
    "TelemetryRecord",
    "compare",
    "delete_run",
    "draw_telemetry",
    "find_run",
    "is_slow",
    "list_runs",
    "read_record",
    "rename_run",
]
