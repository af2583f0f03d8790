# SPDX-License-Identifier: MIT
"""The changes of one robot's parameters, in a file on this computer.

One line of JSON for each thing that happened, only ever appended. Each has the key "session". One session is one
command, or one connection of a program. The other keys say what happened:

- "time", "who", "command", "why": the session begins;
- "set", {name: [before, after]}: the robot has confirmed these changes;
- "stored": the robot keeps its parameters over a restart;
- "figures", {name: [before, after]}: what an experiment saw.

Lines of several programs may alternate. Undoing needs nothing from the robot: it may have been switched off meanwhile.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omniwheel.errors import HistoryError, OutputPathError
from omniwheel.files import home, write_error

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Change = tuple[float, float]
"""Value before and after."""
_LARGEST = sys.float_info.max
_NO_FOLDER = "no folder for the history: this user has no home directory"
_SET_ONE = "set OMNI_STATE_DIR to a folder, or HOME"


@dataclass
class Entry:
    """What one command changed; ``number`` counts from 1. ``changes``: what was left in the end, values as sent.

    ``figures``: what an experiment measured before and after, by the names of `omni tune --json`.
    """

    number: int
    time: str
    who: str
    command: str
    why: str
    changes: dict[str, Change] = field(default_factory=dict)
    stored: bool = False
    figures: dict[str, Change] = field(default_factory=dict)

    def take(self, name: str, before: float, after: float) -> None:
        """Note a change; one that goes back to where it began leaves nothing."""
        first = self.changes[name][0] if name in self.changes else before
        self.changes[name] = (first, after)
        if first == after:
            del self.changes[name]


def history_file(serial_number: int, url: str) -> Path | None:
    """Return where a robot's history is kept: by its serial number; a robot without one is known by its link.

    ``OMNI_STATE_DIR`` chooses another folder, else it is the user's (``XDG_STATE_HOME``). None: the user has no folder.
    """
    own, state, user = os.environ.get("OMNI_STATE_DIR"), os.environ.get("XDG_STATE_HOME"), home()
    if own:
        folder = Path(own)
    elif state:
        folder = Path(state, "omniwheel")
    elif user is not None:
        folder = user / ".local" / "state" / "omniwheel"
    else:
        return None
    name = f"robot-{serial_number}" if serial_number else "link-" + re.sub(r"[^A-Za-z0-9.]+", "-", url).strip("-")
    return folder / "history" / f"{name}.jsonl"


class RobotHistory:
    """The history of one robot. Without a ``path`` it can neither be read nor written."""

    def __init__(self, path: Path | None) -> None:
        self.path = path

    def entries(self) -> list[Entry]:
        """Return what changed something, oldest first. Raises HistoryError for a file that cannot be read.

        A last line that a crash of the computer cut short is left out.
        """
        sessions: dict[str, Entry] = {}
        for line in self._lines():
            if "time" in line:
                time, who, command, why = (str(line.get(key, "")) for key in ("time", "who", "command", "why"))
                sessions[str(line["session"])] = Entry(0, time, who, command, why)
                continue
            entry = sessions.get(str(line["session"]))
            if entry is not None:
                _take(entry, line)
        changed = [entry for entry in sessions.values() if entry.changes]
        for number, entry in enumerate(changed, 1):
            entry.number = number
        return changed

    def before(self, number: int) -> dict[str, float]:
        """Return the values that the parameters changed since had before entry ``number``.

        Raises HistoryError if there is no such entry.
        """
        entries = self.entries()
        if not 1 <= number <= len(entries):
            known = f"its entries are 1 to {len(entries)}" if entries else "the history is empty"
            raise HistoryError(
                f"the history has no entry {number}: {known}", hint="omni params undo --history lists them"
            )
        values: dict[str, float] = {}
        for entry in entries[number - 1 :]:
            for name, (before, _) in entry.changes.items():
                values.setdefault(name, before)
        return values

    def append(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Append lines, whole or not at all, and bring them to the disk. Raises OutputFileError."""
        if self.path is None:
            raise OutputPathError(_NO_FOLDER, hint=_SET_ONE)
        text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
            try:
                _lock(file)
                _write_whole(file, ("" if _ends_with_line(file) else "\n") + text)
            finally:
                os.close(file)
        except OSError as error:
            raise write_error(self.path, error) from error

    def _lines(self) -> list[dict[str, Any]]:
        if self.path is None:
            raise HistoryError(_NO_FOLDER, hint=_SET_ONE)
        try:
            text = self.path.read_text(encoding="utf-8", errors="replace")
        except FileNotFoundError:
            return []
        except OSError as error:
            raise HistoryError(f"cannot read {self.path}: {error.strerror or error}") from error
        found = []
        for line in text.split("\n"):  # a reason may hold what else ends a line
            try:
                content = json.loads(line)
            except (ValueError, RecursionError):
                continue  # cut short by a crash, or the empty line after such a one
            if isinstance(content, dict) and "session" in content:
                found.append(content)
        return found


def _take(entry: Entry, line: Mapping[str, Any]) -> None:
    for name, (before, after) in _pairs(line.get("set")).items():
        entry.take(name, before, after)
    entry.figures.update(_pairs(line.get("figures")))
    entry.stored = entry.stored or line.get("stored") is True


def _pairs(found: object) -> dict[str, Change]:
    """Return {name: (before, after)} of what a line holds, without what is no pair of numbers."""
    pairs = found.items() if isinstance(found, dict) else ()
    return {
        str(name): (float(pair[0]), float(pair[1]))
        for name, pair in pairs
        if isinstance(pair, list) and len(pair) == 2 and all(map(_is_number, pair))
    }


def _is_number(value: object) -> bool:
    return isinstance(value, float) or (isinstance(value, int) and abs(value) <= _LARGEST)


def _ends_with_line(file: int) -> bool:
    size = os.fstat(file).st_size
    return size == 0 or os.pread(file, 1, size - 1) == b"\n"


def _lock(file: int) -> None:
    """Keep other programs from appending meanwhile: what a full disk makes us cut off would be theirs, too."""
    if fcntl is not None:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)


def _write_whole(file: int, text: str) -> None:
    """Write all or leave the file as it was: a full disk must not end another program's lines.

    What the user typed may be no text in UTF-8; such bytes become question marks.
    """
    size, data = os.fstat(file).st_size, text.encode("utf-8", errors="replace")
    try:
        done = os.write(file, data)
        while done < len(data):
            done += os.write(file, data[done:])
        os.fsync(file)
    except OSError:
        os.ftruncate(file, size)
        raise
