# SPDX-License-Identifier: MIT
"""What the commands share: consoles, options, exit codes, JSON output, connecting.

Importing this costs little, so that ``omni --help`` is quick: what connects is imported when it connects.
"""

from __future__ import annotations

import json
import shlex
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omni.cli import completion
from omniwheel.default_system import default_system
from omniwheel.errors import CommandRefusedError, LinkUrlError, OmniError, VersionMismatchError
from omniwheel.number_text import finite, parse_number

if TYPE_CHECKING:
    from rich.console import Console

    from omniwheel.connection import Recorder
    from omniwheel.dialect import Message
    from omniwheel.history import ChangeRecorder
    from omniwheel.robot import Robot

    console: Console
    error_console: Console

BAD_INPUT = 2
FAILED = 1
INTERRUPTED = 130
JSON_WANTED = "omniwheel.json"
_WHERE_ROBOTS_ARE = (
    "give --link URL or set OMNI_LINK, e.g. --link tcp:127.0.0.1:5760. Without a robot: `omni sitl` simulates one"
)
_HEAD_BYTES = 64
_PICTURES: Mapping[str, tuple[bytes, ...]] = {
    ".png": (b"\x89PNG",),
    ".pdf": (b"%PDF",),
    ".svg": (b"<?xml", b"<svg"),
}
"""How pictures begin, by the ending of their names."""
WARNING_SEVERITY = 4
"""MAVLink's severities: this one and lower numbers are shown as warnings."""


@cache
def _console(*, stderr: bool) -> Console:
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, emoji=False)


def __getattr__(name: str) -> Any:
    """Make ``console`` and ``error_console`` on first use: completion needs none, and importing rich is slow."""
    if name not in ("console", "error_console"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _console(stderr=name == "error_console")


def _note_json(ctx: typer.Context, wanted: bool) -> bool:
    ctx.meta[JSON_WANTED] = wanted
    return wanted


LinkOption = Annotated[
    str | None,
    typer.Option(
        "--link",
        "-l",
        envvar="OMNI_LINK",
        metavar="URL",
        help="Where the robot is: /dev/ttyACM0\\[,baud], COM3\\[,baud], tcp:host:port, udp:host:port. Default: the one "
        "Teensy that is connected. If the radio has a key, add --signing-key FILE. If several robots share it, add "
        "--system N.",
        show_default=False,
        autocompletion=completion.ports,
    ),
]
TimeoutOption = Annotated[float, typer.Option("--timeout", min=0.1, metavar="S", help="Timeout for each reply.")]
WhyOption = Annotated[
    str,
    typer.Option(
        "--why",
        metavar="TEXT",
        help="Comment on the change, shown by `omni params undo --history`.",
        show_default=False,
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", callback=_note_json, help="Print one JSON object on standard output and nothing else.")
]


def examples(*lines: str) -> str:
    """Return the epilog that shows ``lines`` as examples under a command's help."""
    from rich.markup import escape

    return "[bold]Examples[/]\n\n" + "\n\n".join(f"  [cyan]{escape(line)}[/]" for line in lines)


def print_json(value: Any, *, one_line: bool = False) -> None:
    """Print one JSON object; numbers that JSON has no form for become null.

    ``one_line`` is for commands that go on running: a program reads a line and knows that it has all of it.
    """
    typer.echo(json.dumps(finite(value), indent=None if one_line else 2, default=str, allow_nan=False))


def note(text: str, *, quiet: bool = False) -> None:
    """Print a line for the user on standard error, so that it never mixes with results."""
    if not quiet:
        _console(stderr=True).print(text)


def link_url(link: str | None) -> str:
    """Return the link to use; without one, the only port that looks like a Teensy."""
    if link:
        return link
    from omniwheel.ports import only_teensy

    try:
        return only_teensy()
    except LinkUrlError as error:
        raise LinkUrlError(str(error), hint=_WHERE_ROBOTS_ARE) from error


def open_robot(
    link: str | None, *, timeout_s: float | None = None, recorder: Recorder | None = None, texts: bool = True
) -> Robot:
    """Connect to the robot that the options name; warn if its parameters are another version's.

    With ``texts``, every status text of the robot appears on standard error as it comes. Changes of parameters go into
    the robot's history, unless the caller makes a recorder of its own (:func:`record_history`).
    """
    from omniwheel.limits import DEFAULT_TIMEOUT_S
    from omniwheel.robot import connect

    timeout_s = DEFAULT_TIMEOUT_S if timeout_s is None else timeout_s
    robot = connect(link_url(link), timeout_s=timeout_s, recorder=recorder, system_id=default_system())
    note_if_shared(robot)
    _note_later_sharing(robot)
    if texts:
        robot.connection.add_listener(_show_text)
    try:
        robot.require_same_parameters()
    except (VersionMismatchError, CommandRefusedError) as error:
        _warn(str(error))
    except BaseException:
        robot.close()
        raise
    record_history(robot)
    return robot


def record_history(robot: Robot, why: str = "") -> ChangeRecorder:
    """Write every change of the robot's parameters into its history from now on, with ``why``."""
    from omniwheel.history import ChangeRecorder, history_of

    def warn(error: OmniError) -> None:
        _warn(f"the change is not in the history: {error}")

    return ChangeRecorder(robot, history_of(robot), shlex.join(["omni", *sys.argv[1:]]), why, warn)


def note_if_shared(robot: Robot) -> None:
    """Say that the robot's port is shared with other programs, if it is."""
    notice = getattr(robot.connection.link, "notice", "")
    if notice:
        from rich.markup import escape

        _console(stderr=True).print(f"[dim]{escape(notice)}[/]", soft_wrap=True)


def _note_later_sharing(robot: Robot) -> None:
    """Say when another robot is heard on the line, unless one was chosen."""

    def say(number: int) -> None:
        mine = robot.connection.target_system
        _warn(
            f"another robot, system id {number}, is on this link; this command is sent to {mine} (choose with --system)"
        )

    if default_system() is None:
        robot.connection.on_other_robot = say


def _warn(text: str) -> None:
    from rich.markup import escape

    note(f"[yellow]warning:[/] {escape(text)}")


def _show_text(message: Message) -> None:
    from rich.markup import escape

    from omniwheel.telemetry import StatusText, decode

    text = decode(StatusText, message)
    if text is not None:
        style = "yellow" if text.severity <= WARNING_SEVERITY else "dim"
        note(f"[{style}]robot: {escape(text.text)}[/]")


@contextmanager
def signals_interrupt() -> Iterator[None]:
    """SIGTERM, and SIGHUP where there is one, end the block as Ctrl-C does: the robot is stopped on the way out."""
    with ExitStack() as stack:
        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None:
                stack.callback(signal.signal, number, signal.signal(number, _interrupt))
        yield


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def writable_path(path: Path, what: str) -> Path:
    """Return ``path`` if a file can be made there; a usage error otherwise."""
    if path.is_dir() or not path.parent.is_dir():
        raise typer.BadParameter(f"{path}: {what} needs the name of a file in a folder that exists")
    return path


def new_path(path: Path, what: str, *, force: bool) -> Path:
    """Return ``path`` if a file can be made there and no file is lost; a usage error otherwise.

    What is no regular file, as /dev/stdout, is written into. With ``force`` a file is replaced.
    """
    if path.is_file() and not force:
        raise typer.BadParameter(f"{path} exists already; choose another name or give --force")
    return writable_path(path, what)


def redrawn_path(path: Path, what: str, *beginnings: bytes) -> Path:
    """Do the same for what is made anew again and again: only a file of the same kind is replaced.

    ``beginnings`` are those of such a file; none: a picture's, as the name's ending says.
    """
    known = beginnings or _PICTURES.get(path.suffix.lower(), ())
    if path.is_file() and (head := _head_of(path)) and not head.startswith(known):
        raise typer.BadParameter(f"{path} exists already and is another kind of file; choose another name")
    return writable_path(path, what)


def _head_of(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except OSError:
        return b""  # writing it says what is wrong


def parse_assignments(words: list[str]) -> dict[str, float | str]:
    """Read NAME=VALUE words; a value is a number or the name of an enum's value."""
    values: dict[str, float | str] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name or not text.strip():
            raise typer.BadParameter(f"{word!r} is not NAME=VALUE: write the name, = and the value without spaces")
        values[name.strip().upper()] = _number_or_word(text.strip())
    return values


def _number_or_word(text: str) -> float | str:
    try:
        return parse_number(text)
    except ValueError:
        return text.lower()
