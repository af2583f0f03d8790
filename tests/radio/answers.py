# SPDX-License-Identifier: MIT
"""How long the answer to an emergency stop takes on a 9600-baud radio while a robot has much to say.

python -m tests.radio.answers
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from omniwheel.dialect import mavlink
from tests.radio.memory_robot import MemoryRobot
from tests.radio.station import ARM, KEY, Station, usb

FLOOD_TICKS = 8000
PERIOD_TICKS = 50
LONGEST_TICKS = 20_000
Flood = Callable[[MemoryRobot, Station, Station, int], None]


def bad_requests(station: Station) -> None:
    """Ask for what does not exist."""
    station.mav.param_request_read_send(1, 1, b"NO_SUCH_NAME", -1)


def quiet(_: MemoryRobot, __: Station, ___: Station, ____: int) -> None:
    """Nothing else."""


def on_usb(_: MemoryRobot, cable: Station, __: Station, ___: int) -> None:
    """20 bad requests a second on the other link."""
    bad_requests(cable)


def on_radio(_: MemoryRobot, __: Station, radio: Station, ___: int) -> None:
    """20 bad requests a second on the same link."""
    bad_requests(radio)


def arming(_: MemoryRobot, cable: Station, __: Station, number: int) -> None:
    """The other link arms and disarms."""
    cable.mav.command_long_send(1, 1, ARM, 0, 1 - number % 2, 0, 0, 0, 0, 0, 0)


def heartbeats(_: MemoryRobot, cable: Station, radio: Station, number: int) -> None:
    """The radio has asked for heartbeats at 100 Hz; they count as answers."""
    if number == 0:
        radio.mav.command_long_send(1, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 0, 10_000, 0, 0, 0, 0, 0)
    bad_requests(cable)


def listing(_: MemoryRobot, __: Station, radio: Station, number: int) -> None:
    """The parameter list, and each parameter once more."""
    if number == 0:
        radio.mav.param_request_list_send(1, 1)
    radio.mav.param_request_read_send(1, 1, b"", number % 100)


FLOODS: dict[str, Flood] = {
    "nothing else": quiet,
    "20 bad requests a second on USB": on_usb,
    "20 bad requests a second on the radio": on_radio,
    "arming and disarming over USB at 20 Hz": arming,
    "bad requests on USB and heartbeats at 100 Hz": heartbeats,
    "a parameter list and 20 parameters a second": listing,
}


@contextmanager
def flooded(flood: Flood, key: bytes | None) -> Iterator[tuple[MemoryRobot, Station, Station]]:
    """A robot that has been asked a lot for a while, with its station on USB and one on the radio."""
    with MemoryRobot() as robot:
        robot.run(100)
        cable = usb(robot)
        if key is not None:
            cable.give_key(key)
        robot.run(2000)
        radio = Station(robot, key=key)
        radio.run(0)
        for number in range(FLOOD_TICKS // PERIOD_TICKS):
            flood(robot, cable, radio, number)
            cable.run(PERIOD_TICKS)
            radio.run(0)
        yield robot, cable, radio


def ack_ticks(flood: Flood, key: bytes | None) -> int:
    """Return the ticks from an emergency stop on the radio to its answer there."""
    with flooded(flood, key) as (robot, cable, radio):
        radio.mav.command_long_send(1, 1, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1, 0, 0, 0, 0, 0, 0)
        for tick in range(1, LONGEST_TICKS):
            if tick % PERIOD_TICKS == 0:
                flood(robot, cable, radio, FLOOD_TICKS + tick)
            answers = [m for m in radio.run(1) if m.get_type() == "COMMAND_ACK"]
            if any(m.command == mavlink.MAV_CMD_OMNI_ESTOP for m in answers):
                return tick
    return LONGEST_TICKS


def main() -> None:
    """Print a table."""
    sys.stdout.write("| Meanwhile | Open [ms] | Signed [ms] |\n|---|---|---|\n")
    for name, flood in FLOODS.items():
        sys.stdout.write(f"| {name} | {ack_ticks(flood, None)} | {ack_ticks(flood, KEY)} |\n")


if __name__ == "__main__":
    main()
