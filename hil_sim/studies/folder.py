# SPDX-License-Identifier: MIT
"""A study's folder: what the study is (study.json), its finished batches, and what was made of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from hil_sim.studies.errors import StudyFolderError
from hil_sim.studies.store import BatchStore
from omniwheel import files

DEFINITION_FILE = "study.json"
DIGEST_FILE = "study.sha256"
"""Tells whose a damaged DEFINITION_FILE was."""
BATCHES_FILE = "batches.bin"
_SHOWN = 5


@dataclass(frozen=True)
class Definition:
    """Everything that decides a study's numbers, as plain data: two studies with the same one have the same runs.

    ``kind`` is the command. How many runs are wanted is left out: a study can be made longer.
    """

    kind: str
    content: Mapping[str, Any]

    def document(self) -> dict[str, Any]:
        """Return the definition as it stands in study.json."""
        return json.loads(json.dumps({"kind": self.kind, **self.content}, allow_nan=False))  # type: ignore[no-any-return]


def differences(old: Any, new: Any, key: str = "") -> list[str]:
    """Return where two documents differ, one line each."""
    if isinstance(old, dict) and isinstance(new, dict):
        names = [*old, *(name for name in new if name not in old)]
        return [
            line
            for name in names
            for line in differences(old.get(name), new.get(name), f"{key}.{name}" if key else name)
        ]
    return [] if old == new else [f"{key} was {_short(old)}, is {_short(new)}"]


def _short(value: Any) -> str:
    text = "not given" if value is None else str(value) if isinstance(value, dict) else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


class StudyFolder:
    """An open study: :attr:`path`, :attr:`store`."""

    def __init__(self, path: Path, definition: Definition, row: np.dtype[Any], batch_runs: int, *, fresh: bool) -> None:
        """Open or make the folder of a study, or take it up again; ``fresh`` forgets its runs. StudyFolderError."""
        self.path = path
        wanted = definition.document()
        try:
            _refuse_strange_folder(path)
            path.mkdir(parents=True, exist_ok=True)
            if not fresh:
                _refuse_other_study(path, wanted)
            self.store = BatchStore(path / BATCHES_FILE, row, batch_runs, fresh=fresh)
        except OSError as error:
            hint = "choose another folder with --out"
            raise StudyFolderError(f"cannot work in {path}: {error.strerror or error}", hint=hint) from error
        try:
            files.write_text(path / DIGEST_FILE, _digest(wanted) + "\n")
            files.write_text(path / DEFINITION_FILE, json.dumps(wanted, indent=1) + "\n")
        except BaseException:
            self.store.close()
            raise
        self.kept = len(self.store)

    def __enter__(self) -> StudyFolder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.store.close()


def _digest(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def _digest_in(path: Path) -> str:
    file = path / DIGEST_FILE
    return file.read_text(encoding="utf-8", errors="replace").strip() if file.exists() else ""


def _refuse_strange_folder(path: Path) -> None:
    """Refuse a folder with foreign files."""
    known = any((path / name).exists() for name in (DEFINITION_FILE, BATCHES_FILE))
    if not known and path.is_dir() and any(path.iterdir()):
        hint = "choose another folder with --out; a missing folder is created"
        raise StudyFolderError(f"{path} has files, but no study", hint=hint)


def _refuse_other_study(path: Path, wanted: dict[str, Any]) -> None:
    file = path / DEFINITION_FILE
    digest = _digest_in(path)
    if not file.exists() and not digest:
        return
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        lines = differences(found, wanted)
    except (OSError, ValueError, RecursionError) as error:
        if digest == _digest(wanted):
            return  # it is written anew
        hint = (
            "the finished batches are kept, but only with their definition. Start the command with another "
            f"--out, copy its {DEFINITION_FILE} to {path}, and repeat the original command"
        )
        raise StudyFolderError(f"{file} is damaged: {error}", hint=hint) from error
    if lines:
        more = f" and {len(lines) - _SHOWN} more" if len(lines) > _SHOWN else ""
        raise StudyFolderError(
            f"{path} has another study: {'; '.join(lines[:_SHOWN])}{more}",
            hint="start over with --fresh (its runs are lost), or choose another folder with --out",
        )
