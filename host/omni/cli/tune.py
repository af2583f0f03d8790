# SPDX-License-Identifier: MIT
"""``omni tune``: change gains on a live robot and see at once what it does."""

from __future__ import annotations

import enum
import math
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from omni.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    WhyOption,
    console,
    examples,
    note,
    open_robot,
    parse_assignments,
    print_json,
    record_history,
    redrawn_path,
    signals_interrupt,
)
from omni.cli.options import (
    ASSIGNMENTS,
    DEFAULT_OUT,
    KEEP,
    PLOT,
    Axis,
    AxisOption,
    LiftedOption,
    OutOption,
    RoomOption,
    rounds_option,
    takes,
)
from omniwheel.errors import OutputFileError
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omni.cli.tune_outcome import TriedSets, TuneOutcome
    from omniwheel.experiments.repeated import Series
    from omniwheel.robot import Robot

EXAMPLES = examples(
    "omni tune --link tcp:127.0.0.1:5760 --set ISMC_LAM_XY=15",
    "omni tune --set WS_P=1 -e wheel-chirp -e wheel-step --rounds 3",
    "omni tune --set ISMC_LAM_XY=3 --experiment position-step --rounds 5 --revert",
    "omni tune --experiment trajectory --set CTL_MODE=pid --revert --json",
    "omni tune --set WS_P=2 --candidate 'WS_P=6 WS_I=150' --rounds 5",
    "omni tune --set ISMC_LAM_XY=15 --keep --store",
)
NAME = "tune"
LARGEST_STEP = 3.0


class Kind(str, enum.Enum):
    """Which experiment."""

    STEP = "step"
    TRAJECTORY = "trajectory"
    WHEEL_STEP = "wheel-step"
    WHEEL_CHIRP = "wheel-chirp"
    POSITION_STEP = "position-step"
    POSITION_SWEEP = "position-sweep"
    DISTURBANCE = "disturbance"


@dataclass(frozen=True)
class _Wanted:
    """What the robot is to do before and after."""

    kinds: Annotated[
        list[Kind] | None,
        typer.Option(
            "--experiment",
            "-e",
            help="Experiment to run; repeatable. Default: what shows the changed parameters.",
            show_default=False,
        ),
    ] = None
    axis: AxisOption = Axis.X
    size: Annotated[
        float | None,
        typer.Option(
            "--size",
            metavar="SIZE",
            help="Amplitude of the step, m or rad \\[0.1]; for other experiments as their --amplitude.",
            show_default=False,
        ),
    ] = None
    duration_s: Annotated[
        float | None,
        typer.Option(
            "--duration",
            "-d",
            min=0.05,
            metavar="S",
            help="Duration of a step \\[3] or of the signal, time limit of a trajectory \\[600].",
            show_default=False,
        ),
    ] = None
    wheel: Annotated[
        int | None,
        typer.Option(
            "--only-wheel", min=0, max=4, metavar="N", help="Wheel number of a wheel experiment, from 1; 0: all wheels."
        ),
    ] = None
    lifted: LiftedOption = False
    room_m: RoomOption = 1.0


@takes(_Wanted)
def tune(
    link: LinkOption = None,
    assignments: Annotated[list[str] | None, ASSIGNMENTS] = None,
    candidates: Annotated[
        list[str] | None,
        typer.Option("--candidate", metavar="'NAME=VALUE ...'", help="Another candidate besides --set; repeatable."),
    ] = None,
    rounds: Annotated[int, rounds_option(1)] = 1,
    keep: Annotated[bool | None, KEEP] = None,
    store: Annotated[bool, typer.Option("--store", help="With --keep: store the values in the robot's flash.")] = False,
    why: WhyOption = "",
    out: OutOption = DEFAULT_OUT,
    plot: Annotated[Path | None, PLOT] = None,
    timeout_s: TimeoutOption = DEFAULT_TIMEOUT_S,
    json_wanted: JsonOption = False,
    *,
    wanted: _Wanted,
) -> None:
    """Drive an experiment with the present gains and with others, compare, and keep the new ones or go back.

    The default experiment is the one that shows what the changed parameters do: a step of the wheels' speed for WS_*,
    a step of the pose without limits for the gains of a pose controller, and otherwise a step of the pose within the
    robot's limits. All sets get the same signal. With several rounds the sets take turns, and each
    difference is given with an interval, or is inside the noise. Without --keep or --revert you are asked; where nobody
    can answer, the robot goes back.

    The robot moves: a step goes there and back, and needs that much room. Whatever goes wrong, the old values come
    back and the robot is disarmed. A folder in runs keeps telemetry, figures and pictures.
    """
    wanted_sets = _wanted_sets(assignments, candidates, keep)
    if out.suffix.lower() == ".png":
        raise typer.BadParameter(f"--out is a folder: write --plot {out} for a picture")
    target = None if plot is None else redrawn_path(plot, "the picture")
    run = _Run(wanted_sets, _series(wanted, wanted_sets, json_wanted), rounds, keep, store, json_wanted)
    trouble: OutputFileError | None = None
    try:
        run.drive(link, timeout_s, why, out, target)
    except OutputFileError as error:
        if run.outcome is None:
            raise
        trouble = error
    told = run.told(None if trouble is not None else target)
    if trouble is not None:  # minutes of driving are told before that
        trouble.found = told
        raise trouble
    if json_wanted:
        print_json(told)


class _Run:
    """All tries on one robot: what is driven, written, shown and kept."""

    def __init__(
        self,
        wanted: list[dict[str, float | str]],
        series: Series,
        rounds: int,
        keep: bool | None,
        store: bool,
        quiet: bool,
    ) -> None:
        self._wanted, self._series, self._rounds = wanted, series, rounds
        self._keep, self._store, self._quiet = keep, store, quiet
        self.outcome: TuneOutcome | None = None
        self._folder = Path()

    def drive(self, link: str | None, timeout_s: float, why: str, out: Path, plot: Path | None) -> None:
        """Drive everything, and keep or go back. An OutputFileError comes last, when all else is done."""
        from omni.cli.tune_outcome import TriedSets
        from omniwheel.drive_log import DriveLog

        with ExitStack() as stack:
            stack.enter_context(signals_interrupt())
            log = stack.enter_context(DriveLog(out, NAME, self._asked()))
            robot = stack.enter_context(open_robot(link, timeout_s=timeout_s, recorder=log.write))
            sets = TriedSets(robot, self._wanted)  # what is refused here leaves no folder
            recorder = record_history(robot, why)
            stack.callback(log.leaving)
            log.connected(robot)
            self._folder = log.folder
            trouble = self._try_all(robot, sets, plot)
            if self.outcome is not None and self.outcome.kept is not None:
                recorder.measured(self.outcome.pairs(self.outcome.kept))
                if self._store:
                    robot.store()
            if not self._quiet:
                kept = self.outcome.kept if self.outcome is not None else None
                console.print("old values restored" if kept is None else f"kept: {sets.names[kept]}", markup=False)
            if trouble is not None:
                raise trouble

    def _try_all(self, robot: Robot, sets: TriedSets, plot: Path | None) -> OutputFileError | None:
        """Try all sets, decide, and leave the robot with what is kept; return why a file could not be written."""
        from omni.cli.tune_outcome import TuneOutcome
        from omniwheel.trial import Trial
        from omniwheel.tuning_rounds import run_rounds

        kept: int | None = None
        with Trial(robot) as trial:
            try:
                self._series.prepare(robot, sets.values, trial.set_many)
                say = partial(_say, sets.names, self._rounds, self._quiet)
                tries = run_rounds(robot, sets.values, self._rounds, self._series.run, say, trial.set_many)
                self.outcome = TuneOutcome(sets, self._series, tries)
                trouble = _unwritten(self.outcome, self._folder, plot)
                if not self._quiet:
                    self.outcome.show()
                    for path in self.outcome.pictures:
                        console.print(f"[bold]{escape(str(path))}[/]", soft_wrap=True)
                kept = self.outcome.kept = _chosen(self._keep, len(self._wanted), self._quiet)
            finally:
                trial.set_many(sets.values[kept or 0])
        return trouble

    def _asked(self) -> str:
        tried = " or ".join(" ".join(f"{name}={value}" for name, value in entry.items()) for entry in self._wanted)
        return f"{NAME} {', '.join(experiment.name for experiment in self._series.experiments)}: {tried}"

    def told(self, plot: Path | None) -> dict[str, Any]:
        """Return everything as plain data, with folder and pictures that could be written."""
        assert self.outcome is not None
        pictures = [str(path) for path in self.outcome.pictures]
        document = {**self.outcome.document(), "folder": str(self._folder), "pictures": pictures}
        return {**document, "picture": str(plot or pictures[0])} if pictures else document


def _unwritten(outcome: TuneOutcome, folder: Path, plot: Path | None) -> OutputFileError | None:
    """Write pictures and numbers; return why that failed. All rounds are told, and their best kept, before that."""
    try:
        outcome.write(folder, plot)
    except OutputFileError as error:
        return error
    return None


def _wanted_sets(
    assignments: list[str] | None, candidates: list[str] | None, keep: bool | None
) -> list[dict[str, float | str]]:
    """Return the sets to try beside the present values."""
    from omniwheel.tuning_rounds import MAX_SETS

    words = [assignments or [], *(text.split() for text in candidates or [])]
    sets = [parse_assignments(entry) for entry in words if entry]
    if not sets:
        raise typer.BadParameter("at least one --set NAME=VALUE is missing")
    if len(sets) >= MAX_SETS:
        raise typer.BadParameter(f"{len(sets)} candidates; at most {MAX_SETS - 1} can be compared")
    if keep and len(sets) > 1:
        raise typer.BadParameter(
            "--keep needs a single candidate: compare several with --revert, then repeat with the best one"
        )
    return sets


def _series(wanted: _Wanted, sets: list[dict[str, float | str]], quiet: bool) -> Series:
    """Return what the robot is to do with each set."""
    from omniwheel.experiments.repeated import Loop, Repeated, Series, Signal, Step, Trajectory, experiments_for
    from omniwheel.robots import parameter_table

    names = [name for values in sets for name in values]
    shown = [Kind(name) for name in experiments_for(names, parameter_table())]
    kinds = list(dict.fromkeys(wanted.kinds or shown or [Kind.STEP]))
    if len(kinds) > 1 and (wanted.size is not None or wanted.duration_s is not None):
        raise typer.BadParameter("--size and --duration belong to one experiment: give them with a single -e")
    if Kind.STEP in kinds and wanted.size is not None and not 0.0 < abs(wanted.size) <= LARGEST_STEP:
        raise typer.BadParameter(f"--size {wanted.size:g}; must be from -{LARGEST_STEP:g} to {LARGEST_STEP:g}, not 0")
    size, duration_s = (math.nan if value is None else value for value in (wanted.size, wanted.duration_s))
    signal = Signal(size, duration_s, wanted.axis.value, wanted.wheel, wanted.lifted)
    tell = partial(note, quiet=quiet)
    made: list[Repeated] = [
        Step(signal)
        if kind is Kind.STEP
        else Trajectory(signal)
        if kind is Kind.TRAJECTORY
        else Loop(kind.value, signal, wanted.room_m, tell)
        for kind in kinds
    ]
    return Series(made)


def _say(names: list[str], rounds: int, quiet: bool, number: int, index: int) -> None:
    which = "the present values" if index == 0 else "the new values" if len(names) == 2 else names[index]
    note(f"{f'round {number + 1} of {rounds}, ' if rounds > 1 else ''}with {which} …", quiet=quiet)


def _chosen(keep: bool | None, count: int, json_wanted: bool) -> int | None:
    """Return which set is kept, None to go back; prompts if there is a terminal."""
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
