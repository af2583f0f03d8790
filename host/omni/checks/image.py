# SPDX-License-Identifier: MIT
"""``python -m omni.checks image``: run a firmware image on the emulated chip and look at what it does."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from image_check.check import CI, NIGHTLY, SHORT
from omni.cli import completion
from omni.cli.common import JsonOption, console, examples, print_json, redrawn_path
from omni.cli.image_check import print_outcome
from omni.cli.options import ListOption, OwnSeedOption, page_option
from omniwheel import files
from omniwheel.errors import OmniError

EXAMPLES = examples(
    "python -m omni.checks image .pio/build/three_wheel/firmware.elf",
    "python -m omni.checks image firmware.elf --robot my_robot.toml --depth short",
    "python -m omni.checks image firmware.elf --only stop-commands --only path",
    "python -m omni.checks image --list",
)


class Depth(str, Enum):
    """How much is checked."""

    short = SHORT
    ci = CI
    nightly = NIGHTLY


def check_image(
    image: Annotated[
        Path | None,
        typer.Argument(metavar="FIRMWARE.ELF", help="The image: firmware.elf of `make firmware`.", show_default=False),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            "-r",
            metavar="NAME|FILE",
            help="Robot file that the image was built for.",
            autocompletion=completion.robots,
        ),
    ] = "three_wheel",
    depth: Annotated[
        Depth, typer.Option("--depth", help="How many checks run. short: those before an upload; nightly: all.")
    ] = Depth.ci,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="CHECK", help="Run only this check; --list names them. Repeatable."),
    ] = None,
    seed: OwnSeedOption = 1,
    workers: Annotated[int, typer.Option("--workers", min=1, help="Checks to run in parallel.")] = 2,
    page_file: Annotated[Path | None, page_option("FILE.md")] = None,
    list_wanted: ListOption = False,
    json_wanted: JsonOption = False,
) -> None:
    """Run a firmware image on an emulated Teensy 4.0 with the robot at its pins, and check what it does.

    Exit code 1 if a check fails. This is a model of the chip; its page says what it leaves out.
    """
    from image_check.run import PAGE_BEGINS, all_checks, outcome_page, run_checks

    if list_wanted:
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(no_wrap=True)
        for check in all_checks():
            table.add_row(check.name, escape(f"{check.what} ({', '.join(check.depths)})"))
        console.print(table)
        return
    if image is None:
        raise typer.BadParameter(
            "the image is missing: give an .elf or .hex file; `make firmware` links .pio/build/three_wheel/firmware.elf"
        )
    if page_file is not None:
        redrawn_path(page_file, "--out", PAGE_BEGINS.encode())
    try:
        outcomes = run_checks(
            image, robot, depth=depth.value, seed=seed, only=only or (), workers=workers, done=print_outcome
        )
    except OmniError:  # it brings its hint, whether or not it is a ValueError as well
        raise
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    failed = [outcome for outcome in outcomes if not outcome.passed]
    page = partial(outcome_page, image, robot, depth.value, seed, outcomes)
    if json_wanted:
        _write(page_file, page)
        print_json({"image": str(image), "robot": robot, "seed": seed, "checks": [o.as_dict() for o in outcomes]})
    else:
        verdict = f"checks: {len(outcomes) - len(failed)} passed, {len(failed)} failed"
        console.print(f"{verdict}, on a model of the chip: no silicon was tested (seed {seed})")
        console.print(f"{sum(outcome.cpu_s for outcome in outcomes):.1f} s of processor time")
        _write(page_file, page)  # last: on a full disk, too, the checks have been told
    if failed:
        raise typer.Exit(1)


def _write(path: Path | None, page: Callable[[], str]) -> None:
    if path is not None:
        files.write_text(path, page())
