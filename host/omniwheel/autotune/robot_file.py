# SPDX-License-Identifier: MIT
"""Writes what autotune chose into a copy of a robot file: numbers are replaced, comments stay."""

from __future__ import annotations

from pathlib import Path

from omniwheel import files
from omniwheel.autotune.procedure import Outcome
from omniwheel.errors import OmniError
from omniwheel.robot_text import edited
from omniwheel.robots import new_robot_file, read_robot


def write_robot_file(outcome: Outcome, name: str, template: str, folder: Path) -> Path:
    """Write NAME.toml and return its path. Never overwrites. Raises RobotFileError, OutputFileError; no file then."""
    path = new_robot_file(name, template, folder)
    try:
        table = read_robot(path).table
        changes = {
            table[key].robot_key or f"parameters.{key}": (value, "autotune") for key, value in outcome.new.items()
        }
        files.write_text(path, edited(path.read_text(encoding="utf-8"), changes))
        read_robot(path)
    except OmniError:
        path.unlink()
        raise
    return path
