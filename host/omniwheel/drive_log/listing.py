# SPDX-License-Identifier: MIT
"""The runs in a folder: drives of a robot and simulated runs, side by side."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omniwheel import parameter_file
from omniwheel.drive_log.folder import BEFORE_FILE, DRIVE_FILE
from omniwheel.errors import LogError, ParameterFileError
from omniwheel.logs.run_folder import SUMMARY_FILE
from omniwheel.robots import parameter_table
from omniwheel.telemetry_picture import jumps_in_words

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
UNITS = (
    ("duration_s", "duration [s]", 1.0),
    ("way_m", "way [m]", 1.0),
    ("position_rmse_m", "position RMSE [mm]", 1e3),
    ("heading_rmse_rad", "heading RMSE [mrad]", 1e3),
    ("largest_error_m", "largest error [mm]", 1e3),
    ("top_speed_m_s", "top speed [m/s]", 1.0),
    ("top_wheel_rad_s", "top wheel speed [rad/s]", 1.0),
    ("full_duty_share", "time at full duty [%]", 100.0),
    ("pose_jumps", "jumps of the pose estimate", 1.0),
)
"""Numbers of a run: key, heading with unit, factor to that unit."""
_HEADLINE = ("duration_s", "position_rmse_m", "heading_rmse_rad", "top_speed_m_s")


@dataclass(frozen=True)
class RunEntry:
    """One run: ``kind`` is "drive" or "simulated"; numbers by the keys of UNITS, None where not known.

    ``robot`` is the link of a real one, the name of a simulated one, "" if it is not known. ``controller``: by name.
    """

    folder: Path
    kind: str
    asked: str
    began: str
    end: str
    numbers: Mapping[str, float | None]
    parameters: Mapping[str, float]
    robot: str = ""
    controller: str = ""

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.folder.name


def list_runs(root: Path, text: str = "") -> list[RunEntry]:
    """Return the runs below a folder, oldest first, whose name or request contains ``text``."""
    folders = sorted(
        (path for path in root.glob("*") if path.is_dir()), key=lambda path: (path.stat().st_mtime, path.name)
    )
    entries = [entry for folder in folders if (entry := _entry(folder)) is not None]
    return [entry for entry in entries if text.lower() in f"{entry.name} {entry.asked}".lower()]


def find_run(root: Path, name: str) -> RunEntry:
    """Return a run by its name below ``root``, or by its path. Raises LogError."""
    for folder in (root / name, Path(name)):
        entry = _entry(folder) if folder.is_dir() else None
        if entry is not None:
            return entry
    raise LogError(f"unknown run {name} in {root}", hint="`omni runs` lists them; --folder names another folder")


def compare(one: RunEntry, other: RunEntry) -> list[tuple[str, float | None, float | None]]:
    """Return rows of heading and both runs' numbers, in the headings' units."""
    return [(title, _scaled(one, key, factor), _scaled(other, key, factor)) for key, title, factor in UNITS]


def cell(value: float | None) -> str:
    """Return a number of :func:`compare` as text."""
    return "–" if value is None else f"{value:.3g}"


def different_parameters(one: RunEntry, other: RunEntry) -> dict[str, tuple[float, float]]:
    """Return the parameters that both runs know and that differ."""
    common = [name for name in one.parameters if name in other.parameters]
    return {n: (one.parameters[n], other.parameters[n]) for n in common if one.parameters[n] != other.parameters[n]}


def headline(entry: RunEntry) -> list[str]:
    """Return the figures that a list of runs shows, in words."""
    known = [(title, _scaled(entry, key, factor)) for key, title, factor in UNITS if key in _HEADLINE]
    return [*(_fact(title, value) for title, value in known if value is not None), *jumps_in_words(entry.numbers)]


def _fact(title: str, value: float) -> str:
    """Return a number with its name and unit, from a heading like "duration [s]"."""
    name, _, unit = title.removesuffix("]").partition(" [")
    return f"{name} {value:.3g} {unit}".rstrip()


def rename_run(entry: RunEntry, name: str) -> Path:
    """Give a run's folder another name; raises LogError if it cannot have it."""
    if not _NAME.fullmatch(name) or not name.strip("."):
        raise LogError(f"{name!r} is not a valid run name", hint="letters, digits, _ . and -, no more than 100")
    target = entry.folder.with_name(name)
    if target.exists():
        raise LogError(f"the folder already has a run {name}", hint="choose another name")
    return entry.folder.rename(target)


def delete_run(entry: RunEntry) -> None:
    """Delete a run's folder with all that is in it."""
    shutil.rmtree(entry.folder)


def _scaled(entry: RunEntry, key: str, factor: float) -> float | None:
    value = entry.numbers.get(key)
    return None if value is None else value * factor


def _entry(folder: Path) -> RunEntry | None:
    try:
        if (folder / DRIVE_FILE).is_file():
            return _drive(folder, json.loads((folder / DRIVE_FILE).read_text(encoding="utf-8")))
        if (folder / SUMMARY_FILE).is_file():
            return _simulated(folder, json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return RunEntry(folder, "damaged", "", "", "cannot be read", {}, {})
    return None


def _drive(folder: Path, document: Mapping[str, Any]) -> RunEntry:
    numbers = {key: document["numbers"].get(key) for key, _, _ in UNITS}
    asked, began, end = (str(document[key]) for key in ("asked", "began", "end"))
    link = str(document.get("link", ""))
    return RunEntry(
        folder, "drive", asked, began, end, numbers, _parameters(folder), link, str(document.get("controller", ""))
    )


def _parameters(folder: Path) -> Mapping[str, float]:
    """Return what a drive began with; nothing if its file is gone, damaged or of a version with other parameters."""
    try:
        return parameter_file.read(folder / BEFORE_FILE, parameter_table())
    except ParameterFileError:
        return {}


def _simulated(folder: Path, summary: Mapping[str, Any]) -> RunEntry:
    rmse, effort = summary["rmse"], summary["effort"]
    numbers: dict[str, float | None] = {
        "duration_s": summary["duration_s"],
        "position_rmse_m": rmse["position_m"],
        "heading_rmse_rad": rmse["theta_rad"],
        "top_wheel_rad_s": effort["peak_wheel_rad_s"],
    }
    end = "done" if summary["completed"] else ", ".join(summary["faults"]) or "not driven to its end"
    asked = f"{summary['scenario']}, seed {summary['seed']}"
    robot, controller = (str(summary.get(key, "")) for key in ("robot", "controller"))
    return RunEntry(folder, "simulated", asked, "", end, numbers, summary["parameters"], robot, controller)
