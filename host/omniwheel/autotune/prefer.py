# SPDX-License-Identifier: MIT
"""What a user prefers where autotune has to weigh; for the command line, which loads nothing else of autotune."""

import enum


class Prefer(str, enum.Enum):
    """What decides where the old values drive as well as the new ones, but have less margin than is required."""

    TRACKING = "tracking"
    MARGIN = "margin"
