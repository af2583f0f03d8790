# SPDX-License-Identifier: MIT
"""The folder that a run leaves: how it is made, what the files of a simulated run are called, and how they are read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from omniwheel import files
from omniwheel.errors import OutputFileError
from omniwheel.npz_file import read_npz

SUMMARY_FILE = "summary.json"
RECORD_FILE = "record.npz"
DRIVE_TLOG = "telemetry.tlog"
"""The telemetry log in the folder of a robot's drive."""
DRIVE_PARAMETERS = "parameters.toml"
"""What its parameters were when it began."""


def new_run_folder(root: Path, name: str) -> Path:
    """Create and return a folder ``name`` below ``root``, or name-2, name-3...: an existing one is never touched.

    Raises OutputFileError.
    """
    for number in range(1, 100_000):
        folder = root / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise files.write_error(folder, error) from error
        return folder
    raise OutputFileError(f"{root} has no free name for another run {name}", hint="delete some: omni runs")


def load_run(folder: Path) -> tuple[dict[str, Any], NDArray[Any]]:
    """Return summary and stored samples of a run folder. Raises FileNotFoundError or ValueError that names the file."""
    path = folder / SUMMARY_FILE
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {error}") from error
    samples = read_npz(folder / RECORD_FILE).get("samples")
    if not isinstance(summary, dict) or not isinstance(summary.get("parameters"), dict):
        raise ValueError(f"{path} is not a summary of a run: it has no parameters")  # noqa: TRY004
    if samples is None or samples.dtype.names is None or samples.ndim != 1 or not len(samples):
        raise ValueError(f"{folder / RECORD_FILE} is not a record of a run")
    return summary, samples
