# SPDX-License-Identifier: MIT
"""The firmware, as a process or emulated, in a simulated world in real time, for any MAVLink program to connect to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import omniwheel
from hil_sim.lockstep import LockstepLink
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from omniwheel.firmware_child import FirmwareChild
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.link import open_link

WORLD_LINK = "tcp:127.0.0.1:0"
SLICE_TICKS = 50
"""How often the world can be asked to end."""


@dataclass(frozen=True)
class Sitl:
    """A running firmware process with its world. ``urls`` are the links for others; :meth:`advance` keeps it alive."""

    urls: tuple[str, ...]
    firmware: FirmwareChild
    link: LockstepLink

    def advance(self, ticks: int = SLICE_TICKS) -> None:
        """Go on by this many ticks, in real time. Raises LinkError if the firmware ended."""
        self.link.run(ticks, self.link.drop_received)
        self.link.drop_received()
        self.link.forget_samples()


@contextmanager
def start_sitl(
    scenario: Scenario,
    links: Sequence[str],
    *,
    storage: Path | None = None,
    realtime_factor: float = 1.0,
    emulated: bool = False,
) -> Iterator[Sitl]:
    """Start firmware with these links in the scenario's world; ``storage`` keeps parameters over restarts."""
    start = _start_emulated if emulated else _start_process
    with start(scenario, links, storage, realtime_factor) as running:
        yield running


@contextmanager
def _start_emulated(
    scenario: Scenario, links: Sequence[str], storage: Path | None, realtime_factor: float
) -> Iterator[Sitl]:
    parameters = scenario.parameter_values()
    with EmulatedFirmware(links=[*links, DIRECT], lockstep=True, storage=storage, parameters=parameters) as firmware:
        base = firmware.open_link(len(links))
        try:
            link = LockstepLink(base, new_world(scenario), realtime_factor=realtime_factor)
            link.run(1)
            yield Sitl(firmware.urls[:-1], firmware, link)
        finally:
            base.close()


@contextmanager
def _start_process(
    scenario: Scenario, links: Sequence[str], storage: Path | None, realtime_factor: float
) -> Iterator[Sitl]:
    parameters = scenario.parameter_values()
    with FirmwareProcess(links=[*links, WORLD_LINK], storage=storage, parameters=parameters) as firmware:
        base = open_link(firmware.urls[-1])
        with omniwheel.connect(base, heartbeat=False) as robot:
            robot.enter_hil()
            link = LockstepLink(base, new_world(scenario), realtime_factor=realtime_factor)
            link.run(1)
            yield Sitl(firmware.urls[:-1], firmware, link)
