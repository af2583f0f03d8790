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

EXAMPLES = examples(
    "omni radio",
    "omni radio --new-key ~/robot.key",
    "omni radio --set-key ~/robot.key --link /dev/ttyACM0",
    "omni radio --remove-key --link /dev/ttyACM0",
    "omni radio --show-key ~/robot.key",
)
_STATES = {
    "off": "no key: the radio accepts unsigned messages",
    "on": "key {0}",
    "damaged": "the stored key is damaged: the radio rejects all messages until a key is set or removed",
}


def radio(
    new_key: Annotated[
        Path | None,
        typer.Option(
            "--new-key",
            metavar="FILE",
            help="Make a random key and write it to this new file: secret, readable by its owner only.",
        ),
    ] = None,
    set_key: Annotated[
        Path | None,
        typer.Option(
            "--set-key",
            metavar="FILE",
            help="Store this key in the robot. Its radio then accepts only signed messages.",
        ),
    ] = None,
    remove_key: Annotated[
        bool,
        typer.Option("--remove-key", help="Remove the robot's key. Its radio then accepts unsigned messages."),
    ] = False,
    show_key: Annotated[
        Path | None, typer.Option("--show-key", metavar="FILE", help="Show the fingerprint of this key file.")
    ] = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Show the fingerprint of the robot's key and its count of rejected messages, or change the key.

    Without a key, any transmitter in range can command the robot. The key is set and removed over USB, while the
    robot is disarmed.
    """
    from omniwheel import signing

    if sum((new_key is not None, set_key is not None, remove_key, show_key is not None)) > 1:
        raise typer.BadParameter("--new-key, --set-key, --remove-key and --show-key exclude each other: give one")
    if new_key is not None:
        mark, shown = signing.fingerprint(signing.new_key_file(new_key)), escape(str(new_key))
        _print_file(
            new_key, mark, f"key {mark} in {shown}; next: omni radio --set-key {shown} --link USB-PORT", as_json
        )
        return
    if show_key is not None:
        mark = signing.fingerprint(signing.read_key_file(show_key))
        _print_file(show_key, mark, f"key {mark}", as_json)
        return
    key = None if set_key is None else signing.read_key_file(set_key)
    with open_robot(link, timeout_s=timeout) as robot:
        if key is not None or remove_key:
            robot.setup_signing(key)
        _print(robot, as_json)


def _print_file(file: Path, mark: str, sentence: str, as_json: bool) -> None:
    if as_json:
        print_json({"file": str(file), "fingerprint": mark})
    else:
        console.print(sentence)


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
