# SPDX-License-Identifier: MIT
"""``omni radio``: the signing key of a robot's radio."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from omni.cli.common import JsonOption, LinkOption, TimeoutOption, console, examples, open_robot, print_json
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omniwheel.robot import Robot
    from omniwheel.telemetry import SigningStatus

app = typer.Typer(help="Protect the robot's radio with a key.", no_args_is_help=True)
key_app = typer.Typer(
    help="The key that protects the radio. Without a key, any transmitter in range can command the robot. The key is "
    "set over USB.",
    no_args_is_help=True,
)
app.add_typer(key_app, name="key")

FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="Key file: secret, readable by its owner only.")]
_STATES = {
    "off": "no key: the radio accepts unsigned messages",
    "on": "key {0}",
    "damaged": "the stored key is damaged: the radio rejects all messages until a key is set or removed",
}


@key_app.command("new", epilog=examples("omni radio key new ~/robot.key"))
def new(file: FileArgument, as_json: JsonOption = False) -> None:
    """Make a random key and write it to a new file."""
    from omniwheel import signing

    key = signing.new_key_file(file)
    if as_json:
        print_json({"file": str(file), "fingerprint": signing.fingerprint(key)})
    else:
        shown = escape(str(file))
        console.print(f"key {signing.fingerprint(key)} in {shown}; next: omni radio key set {shown} --link USB-PORT")


@key_app.command("set", epilog=examples("omni radio key set ~/robot.key --link /dev/ttyACM0"))
def set_key(
    file: FileArgument, link: LinkOption = None, timeout: TimeoutOption = DEFAULT_TIMEOUT_S, as_json: JsonOption = False
) -> None:
    """Store this key in the robot, over USB and while it is disarmed. Its radio then accepts only signed messages."""
    from omniwheel import signing

    key = signing.read_key_file(file)
    with open_robot(link, timeout_s=timeout) as robot:
        robot.setup_signing(key)
        _print(robot, as_json)


@key_app.command("remove", epilog=examples("omni radio key remove --link /dev/ttyACM0"))
def remove(link: LinkOption = None, timeout: TimeoutOption = DEFAULT_TIMEOUT_S, as_json: JsonOption = False) -> None:
    """Remove the robot's key, over USB and while it is disarmed. Its radio then accepts unsigned messages."""
    with open_robot(link, timeout_s=timeout) as robot:
        robot.setup_signing(None)
        _print(robot, as_json)


@key_app.command("show", epilog=examples("omni radio key show", "omni radio key show --file ~/robot.key"))
def show(
    file: Annotated[
        Path | None, typer.Option("--file", metavar="FILE", help="A key file instead of the robot's.")
    ] = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Show the fingerprint of the robot's key and its count of rejected messages, or a key file's fingerprint."""
    from omniwheel import signing

    if file is not None:
        mark = signing.fingerprint(signing.read_key_file(file))
        if as_json:
            print_json({"file": str(file), "fingerprint": mark})
        else:
            console.print(f"key {mark}")
        return
    with open_robot(link, timeout_s=timeout) as robot:
        _print(robot, as_json)


def _print(robot: Robot, as_json: bool) -> None:
    status: SigningStatus = robot.signing_status()
    if as_json:
        print_json(asdict(status))
        return
    console.print(_STATES[status.state].format(status.fingerprint))
    console.print(
        f"rejected since boot: {status.refused_unsigned} unsigned, {status.refused_wrong} wrongly signed, "
        f"{status.refused_replayed} replayed, {status.refused_keys} key changes, {status.refused_lines} setpoint lines"
    )
