# SPDX-License-Identifier: MIT
"""``omni flash``: build the Teensy's firmware, upload it and say what runs now."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from rich.markup import escape

from omniwheel.cli.common import JsonOption, console, examples, note, print_json
from omniwheel.flashing import require_board, run_pio, wait_for_firmware

EXAMPLES = examples(
    "omni flash                         # the three-wheel robot's firmware onto the one Teensy",
    "omni flash --robot four_wheel",
    "omni flash --robot my_robot.toml --port /dev/ttyACM1",
    "omni flash --build-only",
)


def flash(
    robot: Annotated[
        str, typer.Option("--robot", "-r", metavar="NAME|FILE", help="Whose wiring and values are built in.")
    ] = "three_wheel",
    port: Annotated[
        str | None, typer.Option("--port", "-p", metavar="PORT", help="The board's port. Default: the one Teensy.")
    ] = None,
    blank: Annotated[
        bool, typer.Option("--blank", help="The board has no serial port yet: press its button when asked.")
    ] = False,
    build_only: Annotated[bool, typer.Option("--build-only", help="Do not upload.")] = False,
    json_wanted: JsonOption = False,
) -> None:
    """Build the firmware for a Teensy 4.0 with PlatformIO, upload it, wait for the board and ask it what it runs.

    Works from a source checkout. The firmware switches the motors off when the upload begins.
    """
    if not build_only and not blank:
        require_board(port)
    built = run_pio(robot, upload=not build_only, port=port)
    if build_only:
        if json_wanted:
            print_json({"built": built})
        else:
            console.print(f"built for {escape(robot)}")
        return
    note("uploaded; waiting for the board")
    flashed = wait_for_firmware(port, built)
    if json_wanted:
        print_json({"port": flashed.port, "version": asdict(flashed.version)})
    else:
        console.print(f"{escape(flashed.port)} runs firmware {escape(str(flashed.version))} for {escape(robot)}")
