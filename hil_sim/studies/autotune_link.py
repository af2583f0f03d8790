# SPDX-License-Identifier: MIT
"""Over which link, and on which processor, drawn robots are tuned: this PC and a cable, a slow radio, a Cortex-M7."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import omniwheel.robot
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario
from hil_sim.studies.errors import StudyInputError
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.link import FileLink
from omniwheel.presets import read_preset
from omniwheel.radio_model import Radio, RadioSettings
from omniwheel.robot import Robot
from omniwheel.robots import parameter_table

BAUDS = (9600, 57600, 115200)
"""Speeds that have a telemetry profile."""
TCP = "tcp:127.0.0.1:0"
RADIO_TICKS = 2
"""How far the world goes on between two looks at the radio."""
RADIO_TIMEOUT_S = 20.0
"""How long an answer may take over a radio, in simulated time."""


@dataclass(frozen=True)
class Way:
    """How a robot is reached: over a ``radio``, or a cable if that is None. ``emulated``: on an emulated Cortex-M7."""

    radio: RadioSettings | None = None
    emulated: bool = False

    def __post_init__(self) -> None:
        """Refuse what there is not. Raises StudyInputError."""
        if self.emulated and self.radio is not None:
            raise StudyInputError(
                "the emulated processor has no radio", hint="--radio and --emulated exclude each other"
            )
        if self.radio is not None and self.radio.baud not in BAUDS:
            known = ", ".join(map(str, BAUDS))
            raise StudyInputError(f"--radio {self.radio.baud}: must be one of {known} baud")

    @property
    def suffix(self) -> str:
        """What tells its folder from the others'."""
        return "-emulated" if self.emulated else "" if self.radio is None else f"-radio-{self.radio.baud}"


CABLE = Way()


class RadioLink:
    """A ground station's end of a radio; reading makes the world and the robot behind it go on, tick by tick."""

    def __init__(self, world: SteppedLink, base: FileLink, settings: RadioSettings, seed: int) -> None:
        self.url = f"/dev/radio,{settings.baud}"
        self.radio = Radio(settings, seed)
        self._world, self._base = world, base

    def clock_s(self) -> float:
        """Return the simulated time."""
        return self._world.clock_s()

    def read(self, timeout_s: float) -> bytes:
        """Return what has come; if there is nothing, wait up to ``timeout_s`` for it."""
        end_s = self.clock_s() + timeout_s
        while not (data := self.radio.down.take(self.clock_s())) and self.clock_s() < end_s:
            self._go_on()
        return data

    def _go_on(self) -> None:
        self._world.run(RADIO_TICKS, self._world.drop_received)
        self._world.drop_received()
        self._world.forget_samples()
        now_s = self.clock_s()
        # First what the ticks sent: the answer to what is written now may come at once, or after the next tick.
        self.radio.down.put(self._base.read(0.0), now_s)
        if data := self.radio.up.take(now_s):
            self._base.write(data)

    def write(self, data: bytes) -> None:
        """Send towards the robot."""
        self.radio.up.put(data, self.clock_s())

    def close(self) -> None:
        """Close the robot's port."""
        self._base.close()


def radio_parameters(baud: int) -> dict[str, float]:
    """Return the telemetry profile of a radio, for link 1. Raises OmniError if there is none of this speed."""
    given: Mapping[str, float] = read_preset(f"radio_{baud}", parameter_table()).parameters
    first = {name.replace("LINK2_BUDGET", "LINK1_BUDGET").replace("SR2_", "SR1_"): given[name] for name in given}
    return {**first, "LINK2_BAUD": float(baud)}


@contextmanager
def reached_robot(scenario: Scenario, way: Way) -> Iterator[tuple[Robot, SteppedLink]]:
    """Start the firmware in the scenario's world and connect; the world advances while a caller waits."""
    parameters = scenario.parameter_values()
    if way.emulated:
        with EmulatedFirmware(parameters=parameters, links=[DIRECT], lockstep=True) as firmware:
            link = _endless(firmware.open_link(), scenario)
            with omniwheel.robot.connect(link, clock=link.clock_s) as robot:
                yield robot, link
    elif way.radio is None:
        with FirmwareProcess(parameters=parameters, links=[TCP], lockstep=True) as firmware:
            link = _endless(firmware.open_link(), scenario)
            with omniwheel.robot.connect(link, clock=link.clock_s) as robot:
                yield robot, link
    else:
        parameters |= radio_parameters(way.radio.baud)
        # The radio is the first link: its bytes are out before the answer that ends a tick.
        with FirmwareProcess(parameters=parameters, links=[TCP, TCP], lockstep=True, radio=1) as firmware:
            behind = firmware.open_link(0)
            link = _endless(firmware.open_link(1), scenario)
            radio = RadioLink(link, behind, way.radio, scenario.seed)
            with omniwheel.robot.connect(radio, clock=radio.clock_s, timeout_s=RADIO_TIMEOUT_S) as robot:
                yield robot, link


def _endless(base: FileLink, scenario: Scenario) -> SteppedLink:
    link = SteppedLink(base, new_world(scenario))
    link.end_s = math.inf
    return link
