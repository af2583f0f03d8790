# SPDX-License-Identifier: MIT
"""What the studio's worker process does with runs: list and compare them, and read their logs for plots."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from omni.studio.bounds import SIGNAL_LIMITS
from omni.studio.recorded_log import RecordedLog
from omni.studio.run_figures import comparison_rows, figures
from omni.studio.samples import SAMPLES_WINDOW, packed
from omni.studio.signals import require_possible, signals_as_json
from omni.studio.simulated_log import LOG_SIGNALS, SimulatedLog
from omni.studio.spectra import spectrum
from omniwheel.drive_log.folder import BEFORE_FILE, DRIVE_FILE, TLOG_FILE
from omniwheel.drive_log.listing import RunEntry, different_parameters, find_run, list_runs
from omniwheel.errors import LogError
from omniwheel.logs.run_folder import RECORD_FILE, SUMMARY_FILE
from omniwheel.parameter_file import format_value
from omniwheel.robots import parameter_table

MOST_LISTED = 500
LONGEST_NAME = 255
_OPEN = 3
_HINT = "press Refresh: it may have been renamed or deleted"
_logs: OrderedDict[Path, tuple[tuple[int, int], RecordedLog | SimulatedLog]] = OrderedDict()


def listing(root: Path, text: str) -> dict[str, Any]:
    """Return the runs of a folder, newest first, of which no file lies elsewhere."""
    found = [entry for entry in reversed(list_runs(root, text)) if _is_inside(root, entry.folder)]
    return {
        "folder": str(root.resolve()),
        "runs": [_as_json(entry) for entry in found[:MOST_LISTED]],
        "more": max(len(found) - MOST_LISTED, 0),
    }


def comparison(root: Path, one: str, other: str) -> dict[str, Any]:
    """Return both runs' figures and the parameters that differ, as texts. Raises LogError."""
    first, second = (_entry(root, name) for name in (one, other))
    known = parameter_table()
    return {
        "numbers": comparison_rows(first, second),
        "parameters": [
            [name, *(format_value(known.get(name), value) for value in values)]
            for name, values in different_parameters(first, second).items()
        ],
    }


def run_log(root: Path, name: str) -> Path:
    """Return a run's telemetry log, or a simulated run's record, below ``root``, never outside. Raises LogError."""
    found = _log_in(run_folder(root, name))
    if found is None:
        raise LogError(f"the run {name} has neither a telemetry log nor a record", hint=_HINT)
    return found


def _log_in(folder: Path) -> Path | None:
    return next((path for path in (folder / TLOG_FILE, folder / RECORD_FILE) if path.is_file()), None)


def run_folder(root: Path, name: str) -> Path:
    """Return a run's folder below ``root``. Raises LogError for every other path and for links that lead outside."""
    folder = root / name
    if not 0 < len(name) <= LONGEST_NAME or "\0" in name or Path(name).name != name or not _is_inside(root, folder):
        raise LogError(f"unknown run {name!r} in {root}", hint=_HINT)
    return folder


def opened(path: Path) -> dict[str, Any]:
    """Return what a page has to know of a log. Raises LogError."""
    log = _log(path, fresh=True)
    return {
        "duration_s": log.end_s - log.start_s,
        "signals": signals_as_json(LOG_SIGNALS.values(), {signal.key for signal in log.signals()}),
        "limits": {name: value for name, value in log.parameters().items() if name in SIGNAL_LIMITS.values()},
        "marks": log.marks(),
        "path_s": log.path_s(),
        "lost_bytes": log.lost_bytes,
        "bad_frames": log.bad_frames,
    }


def window(path: Path, keys: Sequence[str], begin_s: float, end_s: float, width: int) -> bytes:
    """Return what plots of these signals show between two times, packed as live samples are.

    Of a signal that this log does not hold, nothing. Raises LogError, UnknownSignalError.
    """
    require_possible(keys, LOG_SIGNALS)
    log = _log(path)
    return packed(SAMPLES_WINDOW, 0.0, log.window(keys, begin_s, end_s, width), keys)


def spectra(path: Path, keys: Sequence[str], begin_s: float, end_s: float) -> list[dict[str, Any]]:
    """Return the spectra of signals between two times, of those that this log holds.

    Raises LogError, UnknownSignalError, TooFewSamplesError.
    """
    require_possible(keys, LOG_SIGNALS)
    return [spectrum(trace).as_json() for trace in _log(path).samples(keys, begin_s, end_s)]


def _log(path: Path, fresh: bool = False) -> RecordedLog | SimulatedLog:
    """Return an open log; if ``fresh``, read again if the file has changed."""
    try:
        about = path.stat()
    except OSError as error:
        raise LogError(f"{path.name}: {error.strerror}", hint=_HINT) from error
    now = (about.st_size, about.st_mtime_ns)
    seen, log = _logs.pop(path, (now, None))
    if log is not None and fresh and seen != now:
        log.close()
        log = None
    if log is None:
        seen, log = now, SimulatedLog(path) if path.name == RECORD_FILE else RecordedLog(path)
    _logs[path] = (seen, log)
    while len(_logs) > _OPEN:
        _logs.popitem(last=False)[1][1].close()
    return log


def _is_inside(root: Path, folder: Path) -> bool:
    whole = root.resolve()
    if folder.resolve().parent != whole:
        return False
    files = (folder / name for name in (DRIVE_FILE, SUMMARY_FILE, RECORD_FILE, BEFORE_FILE, TLOG_FILE))
    return all(file.resolve().parent.parent == whole for file in files)


def _entry(root: Path, name: str) -> RunEntry:
    run_folder(root, name)
    return find_run(root, name)


def _as_json(entry: RunEntry) -> dict[str, Any]:
    return {
        "name": entry.name,
        "kind": entry.kind,
        "when": entry.began or _changed(entry.folder),
        "robot": entry.robot,
        "asked": entry.asked,
        "end": entry.end,
        "figures": figures(entry),
        "has_log": _log_in(entry.folder) is not None,
    }


def _changed(folder: Path) -> str:
    return datetime.fromtimestamp(folder.stat().st_mtime, timezone.utc).isoformat(timespec="seconds")
