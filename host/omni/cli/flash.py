# SPDX-License-Identifier: MIT
"""``omni flash``: build the Teensy's firmware, or take a released file, upload it and say what runs now."""

from __future__ import annotations

import shlex
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from omni.cli import completion
from omni.cli.common import JsonOption, console, examples, note, print_json
from omni.cli.image_check import check_image
from omniwheel.errors import FlashError, HexFileError
from omniwheel.files import write_bytes
from omniwheel.flashing.hex_file import HexImage, read_hex
from omniwheel.flashing.source import build

if TYPE_CHECKING:
    from omniwheel.flashing.boards import Board
    from omniwheel.flashing.running import Flashed

EXAMPLES = examples(
    "omni flash                         # the three-wheel robot's firmware onto the one Teensy",
    "omni flash --robot four_wheel",
    "omni flash --robot my_robot.toml --port /dev/ttyACM1",
    "omni flash omniwheel-0.1.0-three_wheel.hex    # a released file, without building",
    "omni flash --dry-run               # everything but the upload",
)
DEFAULT_ROBOT = "three_wheel"
SKIP_HINT = "--skip-check uploads it unchecked"


@dataclass(frozen=True)
class Program:
    """What is to be uploaded: the checked file, words for it, and the git hash built in ("" if not known)."""

    image: HexImage
    what: str
    git_hash: str


def flash(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE.hex]", help="Upload this file instead of building.")
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            "-r",
            metavar="NAME|FILE",
            help="Robot file whose wiring and parameters are built in. \\[three_wheel]",
            autocompletion=completion.robots,
        ),
    ] = None,
    port: Annotated[
        str | None, typer.Option("--port", "-p", metavar="PORT", help="The board's port. Default: the one Teensy.")
    ] = None,
    blank: Annotated[
        bool,
        typer.Option(
            "--blank", help="For a board without a serial port, or after an interrupted upload: press its button."
        ),
    ] = False,
    build_only: Annotated[bool, typer.Option("--build-only", help="Build and check, do not upload.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Do everything but the upload; needs no board.")] = False,
    skip_check: Annotated[
        bool, typer.Option("--skip-check", help="Upload without checking the image on the emulated Teensy first.")
    ] = False,
    new_wiring: Annotated[
        bool, typer.Option("--new-wiring", help="Upload even if the board's present firmware has another wiring.")
    ] = False,
    sha256: Annotated[str, typer.Option(metavar="DIGEST", help="Upload FILE.hex only if this is its SHA-256.")] = "",
    json_wanted: JsonOption = False,
) -> None:
    """Build the firmware for a Teensy 4.0 with PlatformIO, upload it, wait for the board and ask it what it runs.

    Builds in a source checkout; a FILE.hex is uploaded from anywhere. The firmware switches the motors off when the
    upload begins.
    """
    from omniwheel.flashing.boards import choose_board
    from omniwheel.flashing.loader import require_loader
    from omniwheel.flashing.wiring import require_same_wiring

    if file is not None and (robot or build_only):
        raise typer.BadParameter("--robot and --build-only apply only to building; a FILE.hex is uploaded unchanged")
    if file is None and sha256:
        raise typer.BadParameter("--sha256 needs a FILE.hex")
    uploads = not build_only and not dry_run
    released = _from_file(file, sha256) if file is not None else None  # before the board: a wrong name needs none
    board = choose_board(port, blank=blank) if uploads else None
    loader = require_loader() if uploads and released else None  # a first build brings PlatformIO's
    program = released or _built(robot or DEFAULT_ROBOT, check=not skip_check)
    if board is None:
        said = _dry_run(program, port, blank, new_wiring=new_wiring) if dry_run else {"built": program.git_hash}
        _say(json_wanted, said, f"built {program.what}" if build_only else "")
        return
    if not new_wiring:
        require_same_wiring(program.image, board)
    flashed = _upload(program, board, loader or require_loader())
    words = f"{flashed.port} runs firmware {flashed.version}, uploaded from {program.what}"
    _say(json_wanted, {"port": flashed.port, "version": asdict(flashed.version)}, words)


def _say(json_wanted: bool, value: dict[str, Any], words: str) -> None:
    if json_wanted:
        print_json(value)
    elif words:
        console.print(escape(words), soft_wrap=True)


def _from_file(file: Path, sha256: str) -> Program:
    image = read_hex(file)
    if sha256 and image.sha256 != sha256.lower():
        raise HexFileError(f"{file} has the SHA-256 {image.sha256}, not {sha256}", hint="download the file again")
    return Program(image, str(file), "")


def _built(robot: str, *, check: bool) -> Program:
    from image_check.check import SHORT

    made = build(robot)
    image = read_hex(made.hex)
    if check:
        check_image(made.elf, robot, depth=SHORT, without=SKIP_HINT)
    return Program(image, f"{made.hex} for {robot}", made.git_hash)


def _dry_run(program: Program, port: str | None, blank: bool, *, new_wiring: bool) -> dict[str, Any]:
    """Say what an upload would do now; a board or a loader that is missing is a sentence, no error."""
    from omniwheel.flashing.boards import choose_board
    from omniwheel.flashing.loader import HOW_TO_GET_IT, PROGRAM, find_loader, loader_command
    from omniwheel.flashing.wiring import require_same_wiring

    loader = find_loader()
    command = loader_command(loader or PROGRAM, program.image.path)
    try:
        chosen = choose_board(port, blank=blank)
        if not new_wiring:
            require_same_wiring(program.image, chosen)
        board, problem = str(chosen), None
    except FlashError as error:
        board, problem = None, f"{error}; {error.hint}" if error.hint else str(error)
    note(escape(f"{program.what}: {program.image.size} bytes, SHA-256 {program.image.sha256}"))
    note(escape(f"would run: {shlex.join(command)}"))
    if loader is None:
        note(f"{PROGRAM} is not installed here; {HOW_TO_GET_IT}")
    note(escape(f"for {board}" if board else f"an upload would be refused: {problem}"))
    note("dry run: nothing was uploaded")
    return {
        "file": str(program.image.path),
        "size": program.image.size,
        "sha256": program.image.sha256,
        "built": program.git_hash,
        "command": command,
        "loader": loader,
        "board": board,
        "problem": problem,
        "uploaded": False,
    }


def _upload(program: Program, board: Board, loader: str) -> Flashed:
    from omniwheel.flashing.loader import CUT_SHORT, enter_bootloader, run_loader
    from omniwheel.flashing.running import wait_for_firmware

    began_s = time.monotonic()
    left = enter_bootloader(board)
    if not left or board.port is None:
        note("if the board does not wait in its bootloader yet: press its button")
    try:
        with TemporaryDirectory(prefix="omniwheel-flash-") as folder:
            # What was checked is uploaded, whatever becomes of the file meanwhile.
            checked = Path(folder) / program.image.path.name
            write_bytes(checked, program.image.content)
            run_loader(loader, checked)
    except KeyboardInterrupt:
        note(f"the upload was interrupted: {CUT_SHORT}")
        raise
    note("uploaded; waiting for the board to restart")
    return wait_for_firmware(board, program.git_hash, began_s=began_s, left=left)
