# SPDX-License-Identifier: MIT
"""What ``omni montecarlo``, ``sweep`` and ``optimize`` share: options, the pool, progress, what Ctrl-C says."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from omni.cli.common import INTERRUPTED, JsonOption, console, error_console, signals_interrupt
from omni.cli.options import DEFAULT_OUT
from omni.cli.run_output import DurationOption, PlantOption, PresetOption, SeedOption, SetOption, scenario_of

if TYPE_CHECKING:
    from hil_sim.scenario import Scenario
    from hil_sim.studies.pools import Pool

MAX_WORKERS = 1024
WorkersOption = Annotated[
    int | None,
    typer.Option(
        "--workers", min=1, max=MAX_WORKERS, help="Worker threads. \\[default: all processors]", show_default=False
    ),
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="URL",
        help="Run on the workers of this Dask scheduler: tcp://host:8786.",
        show_default=False,
    ),
]
RunsOption = Annotated[
    int, typer.Option("--runs", help="Number of runs per point or trial; run i has the same seed everywhere.")
]
BatchOption = Annotated[int, typer.Option("--batch", help="Runs per batch, the unit of work and storage: 8, 16, ...")]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Delete the folder's runs and start over.")]
StudyOutOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="The study's folder. \\[default: runs/SCENARIO-COMMAND]", show_default=False
    ),
]


@dataclass(frozen=True)
class StudyOptions:
    """The options that all studies have, for ``takes``: how much to run, of what, where, by whom."""

    runs: RunsOption
    batch: BatchOption
    seed: SeedOption = None
    workers: WorkersOption = None
    cluster: ClusterOption = None
    settings: SetOption = None
    duration: DurationOption = None
    plant: PlantOption = None
    preset: PresetOption = None
    out: StudyOutOption = None
    fresh: FreshOption = False
    json_wanted: JsonOption = False

    def scenario(self, name: str) -> Scenario:
        """Return the scenario that the options make of the one called so."""
        changed = scenario_of(name, plant=self.plant, preset=self.preset, settings=self.settings)
        return changed.with_duration(self.duration)

    def first_seed(self, scenario: Scenario) -> int:
        """Return the seed of the first run."""
        return scenario.seed if self.seed is None else self.seed


def study_folder(out: Path | None, scenario: Scenario, command: str) -> Path:
    """Return the folder to work in."""
    return out if out is not None else DEFAULT_OUT / f"{scenario.name}-{command}"


@contextmanager
def study_pool(workers: int | None, cluster: str | None) -> Iterator[Pool]:
    """Give the pool that the options describe. To be opened before the study: ``--fresh`` forgets nothing in vain."""
    from hil_sim.studies.pools import LocalPool

    if workers is not None and cluster is not None:
        raise typer.BadParameter("--workers and --cluster exclude each other")
    pool: Pool = LocalPool(workers)
    if cluster is not None:
        from hil_sim.studies.cluster import DaskPool  # here, not above: Dask takes a second to import

        pool = DaskPool(cluster)
    try:
        yield pool
    finally:
        pool.close()


class StudyProgress:
    """The progress bar of a study: runs, how much faster than real time, time left."""

    def __init__(self, progress: Progress, title: str, total: int) -> None:
        self._progress = progress
        self._start_s = time.monotonic()
        self.simulated_s = 0.0
        self.done = 0
        self.kept = 0
        self._task = progress.add_task(escape(title), total=total, speed="")

    @property
    def wall_s(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._start_s

    def __call__(self, runs: int, simulated_s: float, *, kept: bool) -> None:
        """Take note of runs that are done, or were ``kept`` from an earlier session."""
        self.done += runs
        self.kept += runs if kept else 0
        self.simulated_s += simulated_s
        speed = f"{self.simulated_s / max(self.wall_s, 1e-9):.0f} × real time" if self.simulated_s > 0.0 else ""
        self._progress.update(self._task, advance=runs, speed=speed)

    def title(self, text: str) -> None:
        """Say what is being done."""
        self._progress.update(self._task, description=escape(text))

    def speed_line(self) -> str:
        """Say what was done how fast."""
        new = self.done - self.kept
        kept = f"; {self.kept} were already kept" if self.kept else ""
        if new == 0:
            return f"all {self.kept} runs were already kept"
        factor = self.simulated_s / max(self.wall_s, 1e-9)
        return f"{new} runs, {self.simulated_s:.0f} s simulated in {self.wall_s:.1f} s: {factor:.0f} × real time{kept}"


@contextmanager
def study_progress(title: str, total: int, folder: Path, quiet: bool) -> Iterator[StudyProgress]:
    """Show how far a study is, on standard error. Ctrl-C and SIGTERM end it with exit code 130, saying how to go on."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.completed:.0f}/{task.total:.0f} runs"),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(compact=True),
    )
    with Progress(*columns, console=error_console, transient=True, disable=quiet) as progress:
        shown = StudyProgress(progress, title, total)
        try:
            with signals_interrupt():
                yield shown
            return
        except KeyboardInterrupt:
            progress.stop()
    error_console.print(
        f"[yellow]interrupted[/]: {shown.done} of {total} runs are kept in {escape(str(folder))}; "
        "repeat the command to continue",
        soft_wrap=True,
    )
    raise typer.Exit(INTERRUPTED)


def print_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[Any]], keys: int = 1) -> None:
    """Print a table, numbers to the right; columns that do not fit beside each other go into further tables below.

    The first ``keys`` columns say what a row is about: they stand in each table, as far as half the width holds them.
    """
    widths = [max(len(str(cell)) for cell in column) + 1 for column in zip(headings, *rows, strict=True)]
    for number, part in enumerate(_fitting(widths, console.width - 2, keys)):
        table = Table(
            title=None if number else escape(title),
            title_style="bold",
            title_justify="left",
            box=box.SIMPLE_HEAD,
            padding=(0, 0, 0, 1),
        )
        for column in part:
            table.add_column(escape(headings[column]), justify="right" if column else "left", no_wrap=True)
        for row in rows:
            table.add_row(*(escape(str(row[column])) for column in part))
        console.print(table)


def _fitting(widths: Sequence[int], room: int, keys: int) -> list[list[int]]:
    """Return the columns of each table: the keys stand in all of them, and what fits beside them."""
    while keys > 1 and 2 * sum(widths[:keys]) > room:
        keys -= 1
    parts: list[list[int]] = [list(range(keys))]
    for column in range(keys, len(widths)):
        if len(parts[-1]) > keys and sum(widths[shown] for shown in parts[-1]) + widths[column] > room:
            parts.append(list(range(keys)))
        parts[-1].append(column)
    return parts


def print_end(progress: StudyProgress, folder: str) -> None:
    """Print how fast it went and where everything is."""
    console.print(progress.speed_line(), markup=False)
    console.print(f"\n[bold]{escape(str(folder))}[/]", soft_wrap=True)
