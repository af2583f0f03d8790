# SPDX-License-Identifier: MIT
"""The robot of `omni sitl` in simulated time, for commands that run in this process: nothing waits for a clock."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import omniwheel.robot
from hil_sim.lockstep import PATIENCE_S, SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel import FirmwareProcess, Robot

URL = "simulated"
_NAMES = ("omni.cli.common.link_url", "omni.cli.stop.link_url")


class _LastingLink(SteppedLink):
    """A link that the next connection finds as the last one left it, in the same world."""

    def close(self) -> None:
        """Stay open; :func:`robot` closes it."""


@contextmanager
def robot(scenario: str = "sitl", end_s: float = PATIENCE_S) -> Iterator[str]:
    """Whoever connects, to whatever link, finds this robot in its world.

    After ``end_s`` of simulated time comes a Ctrl-C.
    """
    real = omniwheel.robot.connect
    world = load_scenario(scenario)
    with FirmwareProcess(parameters=world.parameter_values(), links=["tcp:127.0.0.1:0"], lockstep=True) as firmware:
        link = _LastingLink(firmware.open_link(), new_world(world))
        link.end_s = end_s

        def connect(_url: object, *, clock: object = None, **options: Any) -> Robot:
            return real(link, clock=link.clock_s, **options)

        try:
            with patched({"omniwheel.robot.connect": connect} | {name: _named for name in _NAMES if there(name)}):
                yield URL
        finally:
            SteppedLink.close(link)


def _named(link: str | None) -> str:
    return link or URL


@contextmanager
def patched(replacements: dict[str, Any]) -> Iterator[None]:
    """Replace these names during the block."""
    with ExitStack() as stack:
        for name, value in replacements.items():
            stack.enter_context(patch(name, value))
        yield


def there(name: str) -> bool:
    """Return whether a module has this name."""
    module, _, attribute = name.rpartition(".")
    return hasattr(__import__(module, fromlist=[attribute]), attribute)


def connect(url: str) -> Robot:
    """Return a connection of the test's own, within :func:`robot`."""
    return omniwheel.robot.connect(url)
