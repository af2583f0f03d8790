# SPDX-License-Identifier: MIT
"""``omni tune``: change gains on a live robot and see at once what it does."""

from __future__ import annotations

import enum
import math
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omniwheel.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    WhyOption,
    console,
    examples,
    keep_history,
    note,
    open_robot,
    parse_assignments,
    print_json,
    signals_interrupt,
    writable_path,
)
from omniwheel.cli.old_options import with_old_key
from omniwheel.cli.options import ASSIGNMENTS, KEEP, PLOT, Axis, AxisOption, rounds_option
from omniwheel.errors import OutputFileError
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omniwheel.robot import Robot
    from omniwheel.tuning import Figures, Trace
    from omniwheel.tuning_verdict import Verdict

EXAMPLES = examples(
    "omni tune --link tcp:127.0.0.1:5760 --set ISMC_LAM_XY=15",
    "omni tune --set WS_P=6 --set WS_I=150 --axis theta --size 0.5",
    "omni tune --experiment trajectory --set CTL_MODE=pid --revert --json",
    "omni tune --set WS_P=2 --candidate 'WS_P=6 WS_I=150' --rounds 5",
    "omni tune --set ISMC_LAM_XY=15 --keep --store",
)


class Kind(str, enum.Enum):
    """Which experiment."""

    STEP = "step"
    TRAJECTORY = "trajectory"


def tune(
    link: LinkOption = None,
    assignments: Annotated[list[str] | None, ASSIGNMENTS] = None,
    candidates: Annotated[
        list[str] | None,
        typer.Option(
            "--candidate", metavar="'NAME=VALUE ...'", help="Another set to try beside that of --set; repeatable."
        ),
    ] = None,
    rounds: Annotated[int, rounds_option(1)] = 1,
    experiment: Annotated[
        Kind, typer.Option("--experiment", "-e", help="What the robot does before and after.")
    ] = Kind.STEP,
    axis: AxisOption = Axis.X,
    size: Annotated[float, typer.Option("--size", min=-3.0, max=3.0, help="Size of the step \\[m or rad].")] = 0.1,
    duration_s: Annotated[
        float | None,
        typer.Option(
            "--duration",
            "-d",
            min=0.2,
            metavar="S",
            help="Time to watch a step \\[3], or allowed for a trajectory \\[600].",
        ),
    ] = None,
    keep: Annotated[bool | None, KEEP] = None,
    store: Annotated[bool, typer.Option("--store", help="With --keep: keep them over a restart too.")] = False,
    why: WhyOption = "",
    out: Annotated[Path, PLOT] = Path("tune.png"),
    timeout_s: TimeoutOption = DEFAULT_TIMEOUT_S,
    json_wanted: JsonOption = False,
) -> None:
    """Drive an experiment with the present gains and with others, compare, and keep the new ones or go back.

    Shown are rise time, overshoot, settling time and RMSE. With several rounds the sets take turns, and each difference
    is given with an interval, or is inside the noise. Without --keep or --revert you are asked; where nobody can
    answer, the robot goes back.

    The robot moves: a step goes there and back, and needs that much room. Whatever goes wrong, the old values come
    back and the robot is disarmed.
    """
    wanted = _wanted(assignments, candidates, keep)
    if size == 0.0:
        raise typer.BadParameter("--size must not be 0")
    from omniwheel.trial import Trial
    from omniwheel.tuning_rounds import run_rounds

    target, plan = writable_path(out, "the picture"), _Plan(experiment, axis, size, duration_s)
    kept: int | None = None
    unwritten: OutputFileError | None = None
    with signals_interrupt(), open_robot(link, timeout_s=timeout_s) as robot:
        recorder = keep_history(robot, why)
        with Trial(robot) as trial:
            sets = _Sets(robot, wanted)
            try:
                say = partial(_say, sets.names, rounds, json_wanted)
                tries = run_rounds(robot, sets.values, rounds, plan.run, say, trial.set_many)
                outcome = _Outcome(sets, [[figures for _, figures in entry] for entry in tries])
                traces = {name: [trace for trace, _ in entry] for name, entry in zip(sets.names, tries, strict=True)}
                unwritten = _unwritten(traces, sets.title, target)
                if not json_wanted:
                    outcome.show()
                    console.print(f"\n[bold]{target}[/]" if unwritten is None else "")
                kept = _chosen(keep, len(wanted), json_wanted)
            finally:
                trial.set_many(sets.values[kept or 0])
        if kept is not None:
            recorder.measured(outcome.pairs(kept))
            if store:
                robot.store()
    if not json_wanted:
        console.print("old values restored" if kept is None else f"kept: {sets.names[kept]}")
    told = {"experiment": experiment.value, "old": sets.values[0], "kept": kept is not None}
    if unwritten is not None:
        unwritten.found = {**told, **outcome.document()}
        raise unwritten
    if json_wanted:
        print_json(with_old_key({**told, "picture": str(target), **outcome.document()}, "picture"))


def _unwritten(traces: Mapping[str, Sequence[Trace]], title: str, target: Path) -> OutputFileError | None:
    """Draw the picture; return why it could not be written. All rounds are told, and their best kept, before that."""
    from omniwheel.tuning_plot import draw_tuning

    try:
        draw_tuning(traces, title, target)
    except OutputFileError as error:
        return error
    return None


def _wanted(
    assignments: list[str] | None, candidates: list[str] | None, keep: bool | None
) -> list[dict[str, float | str]]:
    """Return the sets to try beside the present values."""
    from omniwheel.tuning_rounds import MAX_SETS

    words = [assignments or [], *(text.split() for text in candidates or [])]
    sets = [parse_assignments(entry) for entry in words if entry]
    if not sets:
        raise typer.BadParameter("give at least one --set NAME=VALUE")
    if len(sets) >= MAX_SETS:
        raise typer.BadParameter(f"{len(sets)} candidates; at most {MAX_SETS - 1} are tried at once")
    if keep and len(sets) > 1:
        raise typer.BadParameter("--keep needs to know which: try several with --revert, then give the one alone")
    return sets


class _Sets:
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


def _assigned(values: Mapping[str, float]) -> str:
    return " ".join(f"{name}={value:g}" for name, value in values.items())


def _say(names: list[str], rounds: int, quiet: bool, number: int, index: int) -> None:
    which = "the present values" if index == 0 else "the new values" if len(names) == 2 else names[index]
    note(f"{f'round {number + 1} of {rounds}, ' if rounds > 1 else ''}with {which} …", quiet=quiet)


class _Outcome:
    """What came of all tries: ``figures`` per set and round, and the verdicts of each candidate."""

    def __init__(self, sets: _Sets, figures: list[list[Figures]]) -> None:
        from omniwheel.tuning_verdict import judge

        self._sets, self._figures = sets, figures
        self._rounds = len(figures[0])
        self._verdicts = [judge(figures[0], entry, len(figures) - 1) for entry in figures[1:]]

    def pairs(self, candidate: int) -> dict[str, tuple[float, float]]:
        """Return {figure: (before, after)} of a candidate, means over the rounds."""
        return {verdict.kind.key: (verdict.before, verdict.after) for verdict in self._verdicts[candidate - 1]}

    def show(self) -> None:
        console.print(self._table())
        for name, verdicts in zip(self._sets.names[1:], self._verdicts, strict=True) if self._rounds > 1 else ():
            console.print(f"[bold]{escape(name)}[/]")
            for verdict in verdicts:
                style = "dim" if not verdict.shows else "green" if verdict.difference < 0.0 else "yellow"
                console.print(f"  [{style}]{verdict.sentence()}[/]")

    def _table(self) -> Table:
        from omniwheel.tuning_verdict import KINDS

        table = Table(title=escape(self._sets.title), title_style="bold", title_justify="left")
        for heading in ("", *self._sets.names):
            table.add_column(escape(heading), justify="right" if heading else "left")
        for kind in KINDS:
            means = [_mean([entry.as_dict()[kind.key] for entry in tries]) for tries in self._figures]
            if any(math.isfinite(mean) for mean in means):
                cells = (f"{mean * kind.factor:.{kind.digits}f}" if math.isfinite(mean) else "–" for mean in means)
                table.add_row(escape(f"{kind.name} [{kind.unit}]"), *cells)
        return table

    def document(self) -> dict[str, Any]:
        """Return everything as plain data; "new", "before" and "after" are those of the first candidate."""
        from omniwheel.tuning_verdict import KINDS

        means = [
            {kind.key: _mean([entry.as_dict()[kind.key] for entry in tries]) for kind in KINDS}
            for tries in self._figures
        ]
        candidates = [
            {"new": new, "after": after, "verdicts": [_verdict_document(verdict) for verdict in verdicts]}
            for new, after, verdicts in zip(self._sets.changes, means[1:], self._verdicts, strict=True)
        ]
        first = {"new": self._sets.changes[0], "before": means[0], "after": means[1]}
        return {**first, "rounds": self._rounds, "candidates": candidates}


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


def _chosen(keep: bool | None, count: int, json_wanted: bool) -> int | None:
    """Return which set is kept, None to go back; asks where somebody can answer."""
    if keep is not None:
        return 1 if keep else None
    if json_wanted or not sys.stdin.isatty():
        return None
    if count == 1:
        return 1 if typer.confirm("Keep the new values?", default=False) else None
    number = -1
    while not 0 <= number <= count:
        number = typer.prompt(f"Keep which candidate, 1 to {count}? 0: none", type=int, default=0)
    return number or None


class _Plan:
    """The experiment that is run twice."""

    def __init__(self, kind: Kind, axis: Axis, size: float, duration_s: float | None) -> None:
        self.kind, self.axis, self.size = kind, axis, size
        self.duration_s = duration_s if duration_s is not None else 3.0 if kind is Kind.STEP else 600.0

    def run(self, robot: Robot) -> tuple[Trace, Figures]:
        from omniwheel.tuning import Experiment

        if self.kind is Kind.STEP:
            return Experiment(robot).step(self.axis.value, self.size, self.duration_s)
        return Experiment(robot).trajectory(self.duration_s)
