# SPDX-License-Identifier: MIT
"""``omni reproduce``: the report's tables and figures, made anew and put beside the published ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from omni.cli import completion
from omni.cli.common import FAILED, JsonOption, console, error_console, examples, print_json
from omni.cli.options import DEFAULT_OUT, ListOption, OutOption
from omni.cli.run_output import RunFolderError
from omniwheel import __version__
from omniwheel.number_text import finite

if TYPE_CHECKING:
    from omni_reproduce import study
    from omni_reproduce.registry import Experiment

EXAMPLES = examples(
    "omni reproduce --quick", "omni reproduce", "omni reproduce table2 fig13", "omni reproduce table7 --seeds 5000"
)
MAX_SEEDS = 100_000


def reproduce(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[TABLE|FIGURE|EXPERIMENT]... [FOLDER]",
            help="Experiments to run, see --list. Default: all. FOLDER: the measured logs of an experiment on logs.",
            autocompletion=completion.experiments,
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer seeds: about a minute for all.")] = False,
    seeds: Annotated[
        int | None, typer.Option("--seeds", min=2, max=MAX_SEEDS, help="Number of seeds of every random experiment.")
    ] = None,
    listed: ListOption = False,
    out: OutOption = DEFAULT_OUT,
    json_wanted: JsonOption = False,
) -> None:
    """Run the report's experiments on the control core and put the results beside the published ones.

    Prints a table per experiment: published figure, ours (mean and standard deviation over the seeds), theoretical
    limit, and what explains a difference. Writes the figures and a page, reproduction.html, to put beside the report.
    """
    from hil_sim.processes import worker_pool
    from omni_reproduce import page, study
    from omni_reproduce.experiment import Context
    from omni_reproduce.registry import select

    names, data = _names_and_folder(names or [])
    chosen = select(names)
    if data is not None and not any(entry.logs for entry in chosen if names):
        raise typer.BadParameter(f"no experiment before the folder {data} reads logs; see omni reproduce --list")
    if listed:
        _print_list(chosen)
        return
    folder = _new_folder(out)
    with worker_pool() as pool, _progress(chosen, quiet=json_wanted) as show:
        outcomes = study.run_all(chosen, Context(folder, quick=quick, seeds=seeds, pool=pool, data=data), show)
    about = {"omniwheel": __version__, "quick": quick, "seeds": seeds, "folder": str(folder)}
    everything = finite(page.data(outcomes, about))
    if not json_wanted:
        for outcome in outcomes:
            _print(outcome)
    page.write(folder, outcomes, _facts(quick, seeds), everything)
    if json_wanted:
        print_json(everything)
    else:
        console.print(f"\n[bold]{folder / page.HTML_FILE}[/]", soft_wrap=True)
    if any(outcome.error for outcome in outcomes):
        raise typer.Exit(FAILED)


def _names_and_folder(arguments: list[str]) -> tuple[list[str], Path | None]:
    """Return the names and the folder of measured logs, which comes last if at all."""
    from omni_reproduce.registry import targets

    if not arguments or arguments[-1] in targets() or not Path(arguments[-1]).is_dir():
        return arguments, None
    return arguments[:-1], Path(arguments[-1])


def _new_folder(out: Path) -> Path:
    for number in range(1, 100_000):
        folder = out / ("reproduce" if number == 1 else f"reproduce-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            hint = "choose another folder with --out"
            raise RunFolderError(f"cannot make a folder in {out}: {error.strerror or error}", hint=hint) from error
        return folder
    raise RunFolderError(f"{out} has no free folder name left; delete old results")


@contextmanager
def _progress(chosen: Sequence[Experiment], quiet: bool) -> Iterator[study.Progress]:
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=36), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=error_console, transient=True, disable=quiet) as progress:
        task = progress.add_task("", total=len(chosen))

        def show(number: int, share: float) -> None:
            progress.update(task, description=chosen[number].name, completed=number + share)

        yield show


def _facts(quick: bool, seeds: int | None) -> str:
    how = "with --quick" if quick else "in full"
    number = f", {seeds} seeds each" if seeds is not None else ""
    return (
        f"Made by `omni reproduce` of omniwheel {__version__}, {how}{number}. Every number is computed by the run that "
        "printed it; published figures are quoted beside it. *Limit* is the theoretical bound of the quantity where "
        "there is one."
    )


def _print_list(chosen: Sequence[Experiment]) -> None:
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("experiment", "makes", "what it is"):
        table.add_column(heading)
    for entry in chosen:
        table.add_row(entry.name, ", ".join(entry.targets), entry.title)
    console.print(table)


def _print(outcome: study.Outcome) -> None:
    from omni_reproduce import page
    from omni_reproduce.numbers import NOTHING

    rows = outcome.result.rows
    marks, texts = page.footnotes(rows)
    entries = [page.cells(row, mark) for row, mark in zip(rows, marks, strict=True)]
    shown = [
        column
        for column in range(3, len(page.HEADINGS))
        if any(entry[column] not in ("", NOTHING) for entry in entries)
    ]
    title = f"{outcome.experiment.name}: {outcome.experiment.title} ({outcome.seconds:.1f} s)"
    console.print(f"\n[bold]{escape(title)}[/]", soft_wrap=True)
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("")
    for column in shown:
        table.add_column(page.HEADINGS[column], justify="right")
    setting = None
    for row, entry in zip(rows, entries, strict=True):
        if row.setting != setting:
            setting = row.setting
            table.add_row(f"[bold]{escape(setting)}[/]")
        unit = f" [{row.unit}]" if row.unit not in ("", "1") else ""
        table.add_row(escape(f"  {row.quantity}{unit}"), *(escape(entry[column]) for column in shown))
    if rows:
        console.print(table)
    for number, text in enumerate(texts, start=1):
        console.print(f"[{number}] {text}", markup=False)
    if outcome.error:
        console.print(f"[red]not run: {escape(outcome.error)}[/]; {escape(outcome.hint)}")
