# SPDX-License-Identifier: MIT
"""Figures of runs as a page shows them: an error in the pose only with what it was measured by."""

from __future__ import annotations

from dataclasses import replace

from omni.studio.recording import ASKED, POSE_MODES
from omniwheel.drive_log.listing import RunEntry, cell, compare, headline

_OF_POSE = ("position_rmse_m", "heading_rmse_rad", "largest_error_m")
_MARKS = ("RMSE", "largest error")
_MEASURED_BY = {"drive": "robot's own estimate", "simulated": "true pose"}
"""What the pose in the errors is, by kind of run. The true one is further from the path: the estimate has errors."""
_WITHOUT_POSES = frozenset({"velocity", "duty", "keys", "wheel-step", "wheel-chirp", "identify"})
"""What is asked for without poses to follow: the reference is where the robot is, so an error means nothing."""


def follows_poses(entry: RunEntry) -> bool:
    """Return whether errors in the pose mean something in this run."""
    if entry.asked.startswith(ASKED):
        return any(f", {mode}" in entry.asked for mode in POSE_MODES)
    return entry.asked.partition(" ")[0] not in _WITHOUT_POSES


def figures(entry: RunEntry) -> str:
    """Return the figures that a list of runs shows, in words."""
    by = _MEASURED_BY.get(entry.kind, "")
    facts = headline(_meaningful(entry))
    return ", ".join(f"{fact} ({by})" if by and _is_of_pose(fact) else fact for fact in facts)


def comparison_rows(one: RunEntry, other: RunEntry) -> list[list[str]]:
    """Return rows of a heading and both runs' figures. Errors say what they were measured by."""
    rows = []
    for title, *values in compare(_meaningful(one), _meaningful(other)):
        cells = [cell(value) for value in values]
        if _is_of_pose(title):
            cells = [
                text if value is None else f"{text} ({_MEASURED_BY.get(run.kind, '')})"
                for text, value, run in zip(cells, values, (one, other), strict=True)
            ]
        rows.append([title, *cells])
    return rows


def _is_of_pose(title: str) -> bool:
    return any(mark in title for mark in _MARKS)


def _meaningful(entry: RunEntry) -> RunEntry:
    if follows_poses(entry):
        return entry
    return replace(entry, numbers={**entry.numbers, **dict.fromkeys(_OF_POSE)})
