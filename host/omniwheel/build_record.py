# SPDX-License-Identifier: MIT
"""What the installed build was made from: source tree, controller outside the tree, and what is newer by now."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

from omniwheel.build_inputs import build_inputs
from omniwheel.paths import data_dir

FILE = "build.json"
_CONTROLLER_SUFFIXES = (".c", ".h", ".toml")


@dataclass(frozen=True)
class BuildRecord:
    """``source``: the tree of an editable install, "" for a wheel. ``began_s``: Unix time when the build began.

    ``controller``: name of the controller outside the tree, "" without one.
    """

    source: str
    began_s: float
    controller: str
    controller_folder: str

    def newer_inputs(self) -> list[str]:
        """Return the inputs that changed after the build began: paths from the tree, or whole ones."""
        if not self.source:
            return []
        inputs = {name: os.path.join(self.source, name) for name in build_inputs(self.source)}
        if self.controller:
            names = (entry.path for entry in _entries(self.controller_folder))
            inputs |= {path: path for path in names if path.endswith(_CONTROLLER_SUFFIXES)}
        return sorted(name for name, path in inputs.items() if _changed_s(path) > self.began_s)

    @property
    def remedy(self) -> str:
        """The command that builds anew, with the same controller."""
        return f"make setup CONTROLLER={self.controller_folder}" if self.controller else "make setup"


def _entries(folder: str) -> list[os.DirEntry[str]]:
    try:
        return list(os.scandir(folder))
    except OSError:  # the build has its own copy of the law
        return []


def _changed_s(path: str) -> float:
    try:
        return os.stat(path).st_mtime
    except OSError:  # deleted meanwhile
        return 0.0


def load_record(folder: Path | None = None) -> BuildRecord | None:
    """Return the record beside what the build made, None if there is none. ``folder``: elsewhere."""
    path = (folder or data_dir()) / FILE
    return BuildRecord(**json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None
