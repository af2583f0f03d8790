# SPDX-License-Identifier: MIT
"""An experiment over a radio of 9600 baud that loses packets: the same numbers, only later; and a stop of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest

import omniwheel.robot
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel import FirmwareProcess, Robot
from omniwheel.dialect import mavlink
from omniwheel.errors import OmniError
from omniwheel.experiments import WheelPlan, wheel_step
from omniwheel.radio_model import RadioSettings
from tests.host.experiments.test_wheel import step
from tests.radio.simulated_radio import RadioLink

SLOW = {"LINK1_BUDGET": 480.0, "SR1_STATE": 1.0, "SR1_WHEELS": 0.0, "SR1_STATUS": 0.5}
"""What the profile of such a radio says of its link."""
SETTINGS = RadioSettings(baud=9600, loss=0.05, latency_s=0.05)


@dataclass
class _Behind:
    """A robot in simulated time as :class:`RadioLink` wants it."""

    link: SteppedLink

    @property
    def ticks(self) -> int:
        return self.link.ticks

    def run(self, ticks: int) -> None:
        self.link.run(ticks)
        self.link.forget_samples()

    def write(self, _: int, data: bytes) -> None:
        if data:
            self.link.write(data)

    def read(self, _: int) -> bytes:
        return self.link._take()


@contextmanager
def behind_a_radio(seed: int = 1) -> Iterator[tuple[Robot, RadioLink]]:
    """A robot on a stand whose only link is the radio."""
    scenario = load_scenario("stand")
    parameters = {**scenario.parameter_values(), **SLOW}
    with FirmwareProcess(parameters=parameters, links=["tcp:127.0.0.1:0"], lockstep=True) as firmware:
        behind = _Behind(SteppedLink(firmware.open_link(), new_world(scenario)))
        radio = RadioLink(behind, SETTINGS, seed=seed)  # type: ignore[arg-type]
        with omniwheel.robot.connect(radio, clock=radio.clock_s, timeout_s=20.0) as robot:
            yield robot, radio


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 2, 5])
def test_a_step_over_a_bad_radio_shows_the_same_as_over_a_cable(seed: int) -> None:
    """With ten setpoints a second the radio was full: of six seeds, four did not get through."""
    with behind_a_radio(seed) as (robot, radio):
        outcome = step(robot, wheel=1, duration_s=0.2, on_stand=True)
        assert radio.radio.down.packets_lost > 0
        assert radio.radio.up.packets_lost > 0
        assert not robot.status.armed
    assert outcome["rise_s"].measured == pytest.approx(outcome["rise_s"].model, abs=2e-3)


@pytest.mark.full
def test_a_radio_that_dies_leaves_a_robot_at_rest() -> None:
    with behind_a_radio() as (robot, radio):
        plan = WheelPlan(wheel=1, duration_s=8.0, on_stand=True)

        def lose(message: Any) -> None:
            if message.get_type() == "COMMAND_ACK" and message.command == mavlink.MAV_CMD_OMNI_EXCITE:
                radio.write = lambda data: None  # type: ignore[method-assign]

        remove = robot.connection.add_listener(lose)
        with pytest.raises(OmniError):
            wheel_step(robot, plan, 1.0, lambda _: None)
        remove()
        robot.pump(5.0)
        assert robot.status.state == "failsafe"
