# SPDX-License-Identifier: MIT
"""What ``omni tune`` tried and found: the sets of values, tables, verdicts, files and pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from omni.cli.common import console
from omniwheel import files
from omniwheel.number_text import finite

if TYPE_CHECKING:
    from omniwheel.experiments.repeated import Series, Try
    from omniwheel.robot import Robot
    from omniwheel.tuning_verdict import Verdict

NUMBERS_FILE, PICTURE = "tune.json", "tune.png"


class TriedSets:
    """The sets that are tried: the present values first, then the candidates; each has all that any changes."""

    def __init__(self, robot: Robot, wanted: list[dict[str, float | str]]) -> None:
        checked = [{name: robot.parameters.check(name, value) for name, value in entry.items()} for entry in wanted]
        old = {name: robot.parameters[name] for entry in checked for name in entry}
        self.changes = checked
        self.values = [old, *({**old, **entry} for entry in checked)]
        alone = len(wanted) == 1
        self.names = ["before" if alone else "present"]
        self.names += ["after"] if alone else [_assigned(entry) for entry in checked]
        self.title = ", ".join(f"{name} {old[name]:g} → {value:g}" for name, value in checked[0].items())
        if not alone:
            self.title = f"present: {_assigned(old)}"


class TuneOutcome:
    """What came of all tries, and which set was kept (None: the old one)."""

    def __init__(self, sets: TriedSets, series: Series, tries: Sequence[Sequence[Try]]) -> None:
        from omniwheel.tuning_verdict import judge_figures

        self._sets, self._series, self._tries = sets, series, tries
        self._figures = [[entry.figures for entry in one] for one in tries]
        self.rounds = len(tries[0])
        before, *candidates = self._figures
        self._verdicts = [judge_figures(before, entry, series.kinds, len(candidates)) for entry in candidates]
        self.kept: int | None = None
        self.pictures: list[Path] = []

    def pairs(self, candidate: int) -> dict[str, tuple[float, float]]:
        """Return {figure: (before, after)} of a candidate, means over the rounds."""
        return {verdict.kind.key: (verdict.before, verdict.after) for verdict in self._verdicts[candidate - 1]}

    def write(self, folder: Path, plot: Path | None) -> None:
        """Write the pictures, one per experiment (``plot``: the first one there, too), and the numbers."""
        for name in [experiment.name for experiment in self._series.experiments]:
            several = len(self._series.experiments) > 1
            self._draw(name, folder / (f"tune-{name}.png" if several else PICTURE))
        if plot is not None:
            self._draw(self._series.experiments[0].name, plot)
        files.write_json(folder / NUMBERS_FILE, finite(self.document()))

    def _draw(self, name: str, path: Path) -> None:
        from omniwheel.experiments import Outcome
        from omniwheel.experiments.comparison_plot import draw_outcomes
        from omniwheel.tuning_plot import draw_tuning

        seen = {
            title: [entry.seen[name] for entry in one] for title, one in zip(self._sets.names, self._tries, strict=True)
        }
        first = next(iter(seen.values()))[0]
        draw: Any = draw_outcomes if isinstance(first, Outcome) else draw_tuning
        draw(seen, self._sets.title, path)
        self.pictures.append(path)

    def show(self) -> None:
        """Print table and verdicts."""
        console.print(self._table())
        for name, verdicts in zip(self._sets.names[1:], self._verdicts, strict=True) if self.rounds > 1 else ():
            console.print(f"[bold]{escape(name)}[/]")
            for verdict in verdicts:
                console.print(f"  [{_style(verdict)}]{escape(verdict.sentence())}[/]")

    def _table(self) -> Table:
        table = Table(title=escape(self._sets.title), title_style="bold", title_justify="left")
        for heading in ("", *self._sets.names):
            table.add_column(escape(heading), justify="right" if heading else "left")
        for kind in self._series.kinds:
            means = [_mean([entry.get(kind.key, math.nan) for entry in tries]) for tries in self._figures]
            if any(math.isfinite(mean) for mean in means):
                unit = f" [{kind.unit}]" if kind.unit else ""
                table.add_row(escape(kind.name + unit), *map(kind.shown, means))
        return table

    def document(self) -> dict[str, Any]:
        """Return everything as plain data; "new", "before" and "after" are those of the first candidate."""
        means = [
            {
                kind.key: _mean([entry[kind.key] for entry in tries if kind.key in entry])
                for kind in self._series.kinds
                if any(kind.key in entry for entry in tries)
            }
            for tries in self._figures
        ]
        candidates = [
            {"new": new, "after": after, "verdicts": [_verdict_document(verdict) for verdict in verdicts]}
            for new, after, verdicts in zip(self._sets.changes, means[1:], self._verdicts, strict=True)
        ]
        names = [experiment.name for experiment in self._series.experiments]
        first = {"new": self._sets.changes[0], "before": means[0], "after": means[1]}
        told = {"experiment": ",".join(names), "old": self._sets.values[0], "kept": self.kept is not None}
        return {**told, **first, "rounds": self.rounds, "candidates": candidates}


def _style(verdict: Verdict) -> str:
    return {"better": "green", "worse": "yellow", "": "dim"}.get(verdict.word, "bold")


def _assigned(values: Mapping[str, float]) -> str:
    return " ".join(f"{name}={value:g}" for name, value in values.items())


def _mean(values: list[float]) -> float:
    """Return the mean of those that exist, NaN without any."""
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan


def _verdict_document(verdict: Verdict) -> dict[str, Any]:
    return {
        "figure": verdict.kind.key,
        "difference": verdict.difference,
        "half_width": verdict.half_width,
        "rounds": verdict.rounds,
        "shows": verdict.shows,
        "text": verdict.sentence(),
    }
