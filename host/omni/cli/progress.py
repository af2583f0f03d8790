# SPDX-License-Identifier: MIT
"""A bar with the time left, for drives that take a while; nothing where no person watches."""

from __future__ import annotations

import math
from types import TracebackType

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from omni.cli.common import error_console

SHORT_S = 2.0


class Waiting:
    """Shows how much of a time has passed, on standard error and only on a terminal; drives below SHORT_S need none."""

    def __init__(self, what: str, total_s: float, *, quiet: bool = False) -> None:
        self._total_s = total_s
        known = math.isfinite(total_s)
        self._bar = Progress(
            TextColumn(what),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
            console=error_console,
            transient=True,
            disable=quiet or total_s < SHORT_S or not error_console.is_terminal,
        )
        self._task = self._bar.add_task(what, total=total_s if known else None, left="")

    def at(self, passed_s: float, total_s: float | None = None) -> None:
        """Show that so many seconds have passed; ``total_s`` where it has become known."""
        self._total_s = self._total_s if total_s is None else total_s
        left = f"{max(0.0, self._total_s - passed_s):.0f} s left" if math.isfinite(self._total_s) else ""
        total = self._total_s if math.isfinite(self._total_s) else None
        self._bar.update(self._task, completed=passed_s, total=total, left=left)

    def __enter__(self) -> Waiting:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._bar.stop()
