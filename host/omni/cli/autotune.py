# SPDX-License-Identifier: MIT
"""``omni autotune``: measure a robot, choose its gains from that, try them, and keep them or go back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omni.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    WhyOption,
    console,
    examples,
    note,
    open_robot,
    print_json,
    record_history,
    signals_interrupt,
)
from omni.cli.log_options import RobotOption
from omni.cli.options import DEFAULT_OUT, KEEP, NameOption, OutOption, OwnSeedOption, RoomOption, rounds_option
from omni.cli.params_output import StoreOption
from omniwheel.autotune.prefer import Prefer
from omniwheel.errors import OutputFileError
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omniwheel.autotune.procedure import Outcome

EXAMPLES = examples(
    "omni autotune --link tcp:127.0.0.1:5760",
    "omni autotune --room 0.8 --store",
    "omni autotune --rounds 10 --revert --json",
    "omni autotune --prefer margin",
    "omni autotune --name mine --robot three_wheel   # and write a robot file",
)


def autotune(
    link: LinkOption = None,
    room_m: RoomOption = 1.0,
    legs: Annotated[int, typer.Option("--legs", min=4, max=31, help="Straight segments of each test drive.")] = 10,
    rounds: Annotated[int, rounds_option(2)] = 4,
    seed: OwnSeedOption = 1,
    prefer: Annotated[
        Prefer,
        typer.Option(
            "--prefer",
            help="What decides if the old values have too little margin: how the robot drives (tracking), or the "
            "margins, even if it drives worse (margin).",
        ),
    ] = Prefer.TRACKING,
    keep: Annotated[bool, KEEP] = True,
    store: StoreOption = False,
    name: NameOption = "",
    robot_file: RobotOption = "three_wheel",
    why: WhyOption = "",
    out: OutOption = DEFAULT_OUT,
    timeout_s: TimeoutOption = DEFAULT_TIMEOUT_S,
    json_wanted: JsonOption = False,
) -> None:
    """Measure the robot's motors and inertia, choose gains from that, drive with old and new in turns, keep the better.

    The robot drives by itself, for a few minutes, in a square around where it stands: first slowly, then at 70 % of
    its limits. It turns on the spot, too. Leave it room, and stand by to stop it. No gain is raised until something
    swings: all follow from the model that was measured. Whatever goes wrong, the robot is disarmed and has its old
    values again.

    Without --revert the new values are kept if they drive better and a sweep shows their margins. With --name a copy
    of the robot file --robot gets them then, too.
    """
    from omniwheel.autotune.page import AFTER, write_page  # here, not above: SciPy and matplotlib take a second
    from omniwheel.autotune.procedure import Settings
    from omniwheel.autotune.procedure import autotune as run
    from omniwheel.autotune.robot_file import write_robot_file
    from omniwheel.logs.run_folder import new_run_folder
    from omniwheel.robots import find_robot_file, free_robot_path

    settings = Settings(room_m, legs, rounds, seed, prefer)
    if name:
        free_robot_path(name, Path())
        find_robot_file(robot_file)
    with signals_interrupt(), open_robot(link, timeout_s=timeout_s) as robot:
        recorder = record_history(robot, why)
        outcome = run(robot, settings, keep, lambda text: note(text, quiet=json_wanted))
        recorder.measured({v.kind.key: (v.before, v.after) for v in outcome.verdicts})
        if outcome.kept and store:
            robot.store()
        try:
            folder = new_run_folder(out, "autotune")
            page = write_page(outcome, settings.required, robot.table, folder)
        except OutputFileError as error:  # minutes of driving are told before that
            error.found = _document(outcome)
            _show(outcome, quiet=json_wanted)
            raise
    written = write_robot_file(outcome, name, robot_file, Path()) if name and outcome.kept else None
    if json_wanted:
        print_json({**_document(outcome), "folder": str(folder), "robot_file": str(written) if written else None})
        return
    _show(outcome)
    for line in _left_undone(outcome, name, after=folder / AFTER, store=store):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if written is not None:
        note(f"{written} written")
    console.print(f"\n[bold]{page}[/] says why", soft_wrap=True)


def _show(outcome: Outcome, *, quiet: bool = False) -> None:
    if quiet:
        return
    for name, value in outcome.new.items():
        console.print(f"{name} {outcome.old[name]:.4g} → {value:.4g}", markup=False, highlight=False)
    for verdict in outcome.verdicts:
        console.print(verdict.sentence(), markup=False, highlight=False)
    end = "kept" if outcome.kept else "old values restored"
    console.print(f"{end}: {outcome.choice.why}", markup=False, highlight=False)


def _left_undone(outcome: Outcome, name: str, *, after: Path, store: bool) -> list[str]:
    """Return what was asked for and not done because the old values are back, and how to have the new ones."""
    if outcome.kept:
        return []
    asked = [f"{name}.toml was not written"] if name else []
    asked += ["nothing was stored on the robot"] if store else []
    lines = [f"{' and '.join(asked)}: the old values are restored"] if asked else []
    if outcome.choice.lacking:
        lines.append("to prefer margins over tracking: omni autotune --prefer margin")
    return [*lines, f"to take the new values: omni params load {after}"]


def _document(outcome: Outcome) -> dict[str, Any]:
    return {
        "old": outcome.old,
        "new": outcome.new,
        "kept": outcome.kept,
        "why": outcome.choice.why,
        "lacking": outcome.choice.lacking,
        "explained": outcome.design.fit.fit,
        "verdicts": [
            {
                "figure": v.kind.key,
                "before": v.before,
                "after": v.after,
                "half_width": v.half_width,
                "text": v.sentence(),
            }
            for v in outcome.verdicts
        ],
    }
