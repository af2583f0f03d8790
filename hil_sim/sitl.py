# SPDX-License-Identifier: MIT
"""The firmware, as a process or emulated, in a simulated world in real time, for any MAVLink program to connect to."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import omniwheel.robot
from hil_sim.external import ExternalWorld, outside_world
from hil_sim.live_world import LiveWorld
from hil_sim.lockstep import LockstepLink
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario
from hil_sim.world import World
from omniwheel.dialect import Message
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from omniwheel.errors import CommandRefusedError, LinkTimeoutError, OutsideLoopError
from omniwheel.firmware_child import FirmwareChild
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.link import open_link
from omniwheel.presets import read_preset
from omniwheel.radio_model import RadioBridge, RadioSettings
from omniwheel.robot import Robot
from omniwheel.robots import parameter_table
from omniwheel.telemetry import Heartbeat, decode

WORLD_LINK = "tcp:127.0.0.1:0"
SLICE_TICKS = 50
"""How often the world can be asked to end."""
RADIO_SLICE_TICKS = 5
"""How often the radio's bytes go on."""
RADIO_LINK = 2
"""Number of the firmware's link that is the radio."""
POLL_S = 0.1


@dataclass(frozen=True)
class SimulatedRadio:
    """A radio in front of the robot's second link, and where the ground station's side listens."""

    settings: RadioSettings
    host: str = "127.0.0.1"
    port: int = 0
    seed: int = 1

    def parameters(self) -> dict[str, float]:
        """Return the telemetry profile that goes with the baud rate."""
        return read_preset(f"radio_{self.settings.baud}", parameter_table()).parameters


class _Loop:
    """Runs the ticks, and takes a robot that has left host-in-the-loop back into it.

    It leaves when a stop comes while the world is late, because a stop is never delayed. Then the world stands still
    until the robot is in the loop again, which is after the emergency stop's release. A robot whose storage says that
    it was stopped is not in the loop at first.
    """

    def __init__(self, robot: Robot, link: LockstepLink) -> None:
        """Enter host-in-the-loop. Raises CommandRefusedError if it is refused for another reason than a stop."""
        self._robot, self._link = robot, link
        self._outside = False
        try:
            robot.enter_hil()
        except CommandRefusedError:
            if robot.status.state != "estop":
                raise
            self._outside = True

    @property
    def outside(self) -> bool:
        """Whether the robot is out of the loop, and no tick runs."""
        return self._outside

    def run(self, ticks: int) -> None:
        """Run ticks, or try to enter again. Raises LinkError if the firmware ended or does not answer any more."""
        if self._outside:
            self._outside = not self._entered()
            return
        try:
            self._link.run(ticks, self._link.drop_received)
        except OutsideLoopError:
            self._outside = True

    def _entered(self) -> bool:
        """Try once per heartbeat; what else runs the world's thread goes on meanwhile."""
        if self._robot.connection.wait(_reports_external_world, POLL_S) is None:
            return False
        with suppress(CommandRefusedError, LinkTimeoutError):
            self._robot.enter_hil()
            return True
        return False


def _reports_external_world(message: Message) -> bool:
    beat = decode(Heartbeat, message)
    return beat is not None and not beat.hil


@dataclass(frozen=True)
class Sitl:
    """A running firmware process with its world. ``urls`` are the links for others; :meth:`advance` keeps it alive.

    ``live`` breaks and mends things meanwhile. ``run`` runs so many ticks, or fewer if the robot is outside.
    ``stopped``: its storage holds a latched stop; time stands still until its release.
    """

    urls: tuple[str, ...]
    firmware: FirmwareChild
    link: LockstepLink
    live: LiveWorld
    run: Callable[[int], None]
    world: World
    radio: RadioBridge | None = None
    stopped: bool = False

    def advance(self, ticks: int = SLICE_TICKS) -> None:
        """Go on by this many ticks, in real time. Raises LinkError if the firmware ended."""
        step = ticks if self.radio is None else RADIO_SLICE_TICKS
        for _ in range(0, ticks, step):
            self.run(step)
            if self.radio is not None:
                self.radio.pump(time.monotonic())
        self.link.drop_received()
        self.link.forget_samples()


@contextmanager
def start_sitl(
    scenario: Scenario,
    links: Sequence[str],
    *,
    storage: Path | None = None,
    realtime_factor: float = 1.0,
    radio: SimulatedRadio | None = None,
    emulated: bool = False,
    world: ExternalWorld | None = None,
) -> Iterator[Sitl]:
    """Start firmware with these links in the scenario's world; ``storage`` keeps parameters over restarts.

    ``world`` takes the place of the simulated one; at the end its motors coast. Raises ExternalWorldInputError.

    With ``radio``, of one link given, a second is behind it (not on the emulated processor). The world's own link is
    never a radio.
    """
    with ExitStack() as stack:
        if world is None:
            around = new_world(scenario)
        else:
            outside = outside_world(scenario, world)
            stack.callback(outside.release)
            around = outside
        if emulated:
            yield stack.enter_context(_start_emulated(scenario, links, storage, realtime_factor, around))
        else:
            yield stack.enter_context(_start_process(scenario, links, storage, realtime_factor, radio, around))


@contextmanager
def _start_emulated(
    scenario: Scenario, links: Sequence[str], storage: Path | None, realtime_factor: float, world: World
) -> Iterator[Sitl]:
    parameters = scenario.parameter_values()
    with EmulatedFirmware(links=[*links, DIRECT], lockstep=True, storage=storage, parameters=parameters) as firmware:
        base = firmware.open_link(len(links))
        try:
            link = LockstepLink(base, world, realtime_factor=realtime_factor)
            link.run(1)
            live = LiveWorld(scenario, link, world)
            run = partial(link.run, between=link.drop_received)
            yield Sitl(firmware.urls[:-1], firmware, link, live, run, world)
        finally:
            base.close()


@contextmanager
def _start_process(
    scenario: Scenario,
    links: Sequence[str],
    storage: Path | None,
    realtime_factor: float,
    radio: SimulatedRadio | None,
    world: World,
) -> Iterator[Sitl]:
    parameters = {**scenario.parameter_values(), **(radio.parameters() if radio is not None else {})}
    inner = [*links, *([WORLD_LINK] if radio is not None else [])]
    number = RADIO_LINK if radio is not None else 0
    with ExitStack() as stack:
        firmware = stack.enter_context(
            FirmwareProcess(links=[*inner, WORLD_LINK], storage=storage, parameters=parameters, radio=number)
        )
        urls = firmware.urls[:-1]
        bridge = None
        if radio is not None:
            behind = open_link(urls[RADIO_LINK - 1])
            address = (radio.host, radio.port)
            bridge = stack.enter_context(RadioBridge(behind, radio.settings, address, seed=radio.seed))
            urls = (urls[0], bridge.url)
        base = open_link(firmware.urls[-1])
        robot = stack.enter_context(omniwheel.robot.connect(base, heartbeat=False))
        link = LockstepLink(base, world, realtime_factor=realtime_factor)
        loop = _Loop(robot, link)
        stopped = loop.outside
        loop.run(1)
        yield Sitl(urls, firmware, link, LiveWorld(scenario, link, world), loop.run, world, bridge, stopped)
