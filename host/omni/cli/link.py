# SPDX-License-Identifier: MIT
"""``omni link``: one port, many programs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from omni.cli.common import (
    JsonOption,
    LinkOption,
    console,
    error_console,
    examples,
    link_url,
    print_json,
    signals_interrupt,
)
from omniwheel.default_key import default_key
from omniwheel.default_system import default_system
from omniwheel.limits import HUB_LISTEN

if TYPE_CHECKING:
    from omni.hub.server import HubServer

EXAMPLES = examples(
    "omni link",
    "omni link --link /dev/ttyUSB0,9600",
    "omni link --link /dev/ttyACM0 --listen tcp:127.0.0.1:5790 --listen udp:127.0.0.1:14551",
)


def link(
    link: LinkOption = None,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            "--listen",
            metavar="URL",
            help="tcp:HOST:PORT, udp:HOST:PORT, or udpout:HOST:PORT, which sends first; repeatable. "
            f"\\[default: {' and '.join(HUB_LISTEN)}]",
        ),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget",
            min=20.0,
            metavar="BYTES/S",
            help="Maximum bytes/s to the robot. \\[default: half of a radio's rate]",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Share the robot's port among any number of programs, until Ctrl-C. One of them commands at a time.

    Only programs on this computer reach it, unless --listen says otherwise. Anybody who does can drive the robot.
    """
    from omni.hub.addresses import is_local, listen_address, radio_budget
    from omni.hub.log_writer import LogWriter
    from omni.hub.server import HAND_OVER_WITHIN_S, HubServer
    from omniwheel.signing import Signer

    addresses = list(listen or HUB_LISTEN)
    for text in addresses:
        if not is_local(listen_address(text)):
            error_console.print(
                f"[yellow]warning:[/] every program that can connect to {escape(text)} can drive the robot; set a "
                "signing key to prevent that"
            )
    key = default_key()
    signer = None if key is None else Signer(key)
    limit = None if budget is None else radio_budget(budget)
    url, log = link_url(link), LogWriter()
    try:
        hub = HubServer(url, addresses, budget=limit, signer=signer, system_id=default_system())
        with signals_interrupt(), hub as server:
            server.ask_owner(HAND_OVER_WITHIN_S)
            _announce(server, url, as_json)
            while True:
                server.serve()
                while server.hub.events:
                    log.write(server.hub.events.popleft())
    except KeyboardInterrupt:
        return
    finally:
        log.close()


def _announce(server: HubServer, url: str, as_json: bool) -> None:
    if as_json:
        print_json({"ready": True, "port": url, "listen": server.urls}, one_line=True)
    else:
        console.print(f"{escape(url)} is served at [bold]{'[/] and [bold]'.join(map(escape, server.urls))}[/]")
        console.print(f"Connect other omni commands with --link {escape(url)}. Ctrl-C ends it.")
