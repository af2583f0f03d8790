# SPDX-License-Identifier: MIT
"""A burst that another program began is not taken for the one that was asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from omniwheel.burst import Burst
from omniwheel.burst_request import BurstRequest
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.errors import OtherBurstError
from tests.host.conftest import FakeRobot

ASKED = (0.5, ("pose", "supply"), 2, ())
START_S = 100.0


def burst(samples: int = 250, start_s: float = START_S, number: int = 3) -> Burst:
    """Return what the robot records for ASKED."""
    return Burst(
        time_s=np.asarray(2e-3 * np.arange(samples), dtype=np.float64),
        signals={"pose": np.zeros((samples, 3)), "supply": np.zeros(samples)},
        units={"pose": ("m", "m", "rad"), "supply": ("V",)},
        wheels=(),
        start_s=start_s,
        period_s=2e-3,
        number=number,
        config_sequence=(1, 1),
        complete=True,
    )


class Asker:
    """A request on a line on which the robot's clock is that of the host, and another program may be answered."""

    def __init__(self, fake: FakeRobot) -> None:
        self.fake = fake
        self.connection = Connection(fake, clock=fake.clock)
        self.connection.target_system, self.connection.target_component = 7, 1
        self.request = BurstRequest(self.connection, lambda ack: ack.result_param2 == 99)

    def hear(self, robot_s: float) -> None:
        """Let the robot say what time it is."""
        self.fake.send(mavlink.MAVLink_local_position_ned_message(round(1e3 * robot_s), *[0.0] * 6))
        self.connection.pump(0.05)

    def ask(self, *, wait: bool = False) -> None:
        with self.request.asking(*ASKED, wait):
            pass

    def answer_another(self) -> None:
        command = mavlink.MAV_CMD_OMNI_BURST
        self.fake.send(mavlink.MAVLink_command_ack_message(command, mavlink.MAV_RESULT_ACCEPTED, 0, 99))
        self.connection.pump(0.05)


@pytest.fixture
def asker(fake: FakeRobot) -> Iterator[Asker]:
    asker = Asker(fake)
    asker.hear(START_S - 0.2)
    yield asker
    asker.connection.close()


def test_the_burst_that_was_asked_for_is_taken_and_again(asker: Asker) -> None:
    asker.ask()
    asker.request.check(burst())
    asker.request.check(burst())
    asker.ask()
    asker.request.check(burst(number=4))


DIFFERENT: dict[str, Callable[[Burst], Burst]] = {
    "signals": lambda b: replace(b, signals={"pose": b["pose"]}),
    "more signals": lambda b: replace(b, signals={**b.signals, "duty": np.zeros((len(b.time_s), 3))}, wheels=(0, 1, 2)),
    "spacing": lambda b: replace(b, period_s=1e-3),
    "length": lambda _: burst(500),
    "ended early": lambda _: replace(burst(100), complete=False),
    "before": lambda _: burst(start_s=START_S - 1.0),
    "after": lambda _: burst(start_s=START_S + 5.0),
}


@pytest.mark.parametrize("what", DIFFERENT)
def test_any_other_is_refused(asker: Asker, what: str) -> None:
    asker.ask()
    with pytest.raises(OtherBurstError):
        asker.request.check(DIFFERENT[what](burst()))


def test_one_of_other_wheels_is_refused(asker: Asker) -> None:
    with asker.request.asking(0.5, ("duty",), 1, (0, 2), False):
        pass
    mine = replace(burst(500), signals={"duty": np.zeros((500, 2))}, wheels=(0, 2), period_s=1e-3)
    asker.request.check(mine)
    with pytest.raises(OtherBurstError):
        asker.request.check(replace(mine, wheels=(0, 1)))


def test_a_number_that_was_begun_elsewhere_is_refused(asker: Asker) -> None:
    asker.ask()
    asker.request.check(burst())
    asker.ask()
    with pytest.raises(OtherBurstError):
        asker.request.check(burst(number=5))


def test_the_answer_to_another_program_is_enough(asker: Asker) -> None:
    asker.ask()
    asker.answer_another()
    with pytest.raises(OtherBurstError):
        asker.request.check(burst())


def test_one_that_waits_begins_with_the_excitation(asker: Asker) -> None:
    asker.ask(wait=True)
    asker.hear(START_S + 3.0)
    with asker.request.beginning():
        asker.hear(START_S + 3.1)
    asker.request.check(burst(start_s=START_S + 3.05))
    with pytest.raises(OtherBurstError):
        asker.request.check(burst(start_s=START_S + 1.0))


def test_one_that_was_ended_here_may_be_short(asker: Asker) -> None:
    asker.ask()
    with asker.request.asking(0.0, (), 1, (), False):
        pass
    asker.request.check(replace(burst(100), complete=False))


def test_who_asked_for_nothing_gets_whatever_there_is(asker: Asker) -> None:
    asker.request.check(burst(start_s=3.0))


def test_the_robots_stamps_wrap(asker: Asker) -> None:
    asker.hear(2**32 * 1e-3 - 0.1)
    asker.ask()
    asker.request.check(burst(start_s=2**32 * 1e-3 + 0.1))
