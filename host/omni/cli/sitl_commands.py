# SPDX-License-Identifier: MIT
"""``omni sitl --commands``: lines that change the simulated world while it runs."""

from __future__ import annotations

from collections.abc import Iterator
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, BinaryIO

from rich.markup import escape

from omni.cli.common import console, error_console, print_json
from omniwheel.errors import OmniError

if TYPE_CHECKING:
    from hil_sim.live_world import LiveWorld

LONGEST_LINE = 4096
"""[bytes]"""


def lines_of(stream: BinaryIO) -> Iterator[bytes]:
    """Yield the lines of a stream until it ends; of one that is too long its beginning, LONGEST_LINE bytes."""
    while line := stream.readline(LONGEST_LINE):
        yield line
        while len(line) == LONGEST_LINE and not line.endswith(b"\n"):
            line = stream.readline(LONGEST_LINE)


class Commands:
    """Takes lines from any thread (:meth:`take`); the thread that runs the world obeys them (:meth:`serve`).

    Whatever changes in the world is said on standard output, a refusal on standard error.
    """

    def __init__(self, world: LiveWorld, json_wanted: bool) -> None:
        self._world, self._json_wanted = world, json_wanted
        self._lines: SimpleQueue[bytes] = SimpleQueue()
        self._said: dict[str, Any] | None = None

    def take(self, line: bytes) -> None:
        """Keep a line until the world is between two steps."""
        self._lines.put(line)

    def serve(self) -> None:
        """Obey what has come, and say what is on and how fast it runs, where that has changed."""
        while True:
            try:
                line = self._lines.get_nowait()
            except Empty:
                break
            if line.strip() or len(line) == LONGEST_LINE:
                self._apply_line(line.decode(errors="replace"))
        state = self._world.state()
        if state != self._said:
            self._said = state
            self._say(state)

    def _apply_line(self, line: str) -> None:
        try:
            self._world.apply_command(line)
        except OmniError as error:
            error_console.print(f"[bold red]error:[/] {escape(str(error))}", soft_wrap=True)

    def _say(self, state: dict[str, Any]) -> None:
        if self._json_wanted:
            print_json({"now": state}, one_line=True)
            return
        on = [str(one["fault"]) + (f" of wheel {one['wheel']}" if one["wheel"] else "") for one in state["on"]]
        console.print(f"active faults: {', '.join(on) or 'none'}; {state['speed']:g} times real time")
