# SPDX-License-Identifier: MIT
"""What ``omni montecarlo``, ``sweep`` and ``optimize`` share: options, the pool, progress, what Ctrl-C says."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from hil_sim.scenario import MAX_DURATION_S, Scenario
from hil_sim.studies.pools import LocalPool, Pool
from omniwheel.cli.common import INTERRUPTED, console, error_console, signals_interrupt
from omniwheel.cli.run_output import DEFAULT_OUT, scenario_of

MAX_WORKERS = 1024
_WIDEST = 300
WorkersOption = Annotated[
    int | None,
    typer.Option(
        "--workers", min=1, max=MAX_WORKERS, help="Threads that work. \\[default: every processor]", show_default=False
    ),
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="URL",
        help="Let the workers of this Dask scheduler do it: tcp://host:8786.",
        show_default=False,
    ),
]
BatchOption = Annotated[int, typer.Option("--batch", help="Runs that are done, kept and repeated together: 8, 16, ...")]
DurationOption = Annotated[
    float | None,
    typer.Option(
        "--duration",
        "-d",
        min=0.1,
        max=MAX_DURATION_S,
        metavar="S",
        help="End every run at this time.",
        show_default=False,
    ),
]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Forget the runs that the folder holds and start over.")]
StudyOutOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="The study's folder. \\[default: runs/SCENARIO-COMMAND]", show_default=False
    ),
]


def study_scenario(
    name: str, plant: str | None, preset: str | None, settings: Sequence[str] | None, duration_s: float | None
) -> Scenario:
    """Return the scenario that the options describe."""
    return scenario_of(name, plant=plant, preset=preset, settings=settings).with_duration(duration_s)


def study_folder(out: Path | None, scenario: Scenario, command: str) -> Path:
    """Return the folder to work in."""
    return out if out is not None else DEFAULT_OUT / f"{scenario.name}-{command}"


@contextmanager
def study_pool(workers: int | None, cluster: str | None) -> Iterator[Pool]:
    """Give the pool that the options describe. To be opened before the study: ``--fresh`` forgets nothing in vain."""
    if workers is not None and cluster is not None:
        raise typer.BadParameter("--workers is for this computer; a cluster has its own")
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
        kept = f"; {self.kept} were there already" if self.kept else ""
        if new == 0:
            return f"all {self.kept} runs were there already"
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
        "run the same command again to go on",
        soft_wrap=True,
    )
    raise typer.Exit(INTERRUPTED)


def print_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table, numbers to the right; one that is wider than the terminal keeps its digits."""
    table = Table(
        title=escape(title), title_style="bold", title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1)
    )
    for number, heading in enumerate(headings):
        table.add_column(escape(heading), justify="right" if number else "left", no_wrap=True)
    for row in rows:
        table.add_row(*(escape(str(cell)) for cell in row))
    wide = Console(file=console.file, width=_WIDEST, highlight=False)
    wide.width = max(console.width, wide.measure(table).maximum)
    wide.print(table)


def print_end(progress: StudyProgress, folder: str) -> None:
    """Print how fast it went and where everything is."""
    console.print(progress.speed_line(), markup=False)
    console.print(f"\n[bold]{folder}[/]", soft_wrap=True)
