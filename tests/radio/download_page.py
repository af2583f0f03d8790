# SPDX-License-Identifier: MIT
"""The table of docs/guides/radio.md: how long all parameters take over a radio, in simulated time.

usage: python -m tests.radio.download_page [--write]

Every figure is measured: our client without and with a key and MAVProxy's parameter module, without and with loss, for
each of SEEDS. Without ``--write``: exit code 1 if the page has another table.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from MAVProxy.modules.mavproxy_param import ParamState

from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.presets import read_preset
from omniwheel.radio_model import RadioSettings
from omniwheel.robot import Robot, connect
from omniwheel.robots import parameter_table
from omniwheel.signing import EPOCH_S, UNITS_PER_S, Signer
from tests.parity.budget_page import replace_block
from tests.radio.memory_robot import RADIO, USB, MemoryLink, MemoryRobot
from tests.radio.simulated_radio import RadioLink
from tests.radio.station import KEY, START, usb

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "radio.md"
BLOCK = "radio-download"
BAUDS = (9600, 115200)
SEEDS = (1, 2, 3)
LOSS, LATENCY_S = 0.2, 0.2
LONGEST_S = 300.0
_SETTLE_TICKS = 3000
_HEARTBEAT_S = 20.0


def bad_radio(baud: int) -> RadioSettings:
    """Return a radio that loses a fifth of the packets and takes 200 ms, each way."""
    return RadioSettings(baud=baud, loss=LOSS, latency_s=LATENCY_S)


@contextmanager
def robot_with(baud: int, signed: bool = False) -> Iterator[MemoryRobot]:
    """A robot with a profile loaded over USB, and perhaps a key."""
    with MemoryRobot() as robot:
        link = MemoryLink(robot, USB)
        with connect(link, clock=link.clock_s) as there:
            there.parameters.set_many(read_preset(f"radio_{baud}", parameter_table()).parameters)
        if signed:
            usb(robot).give_key(KEY)
        robot.run(_SETTLE_TICKS)
        assert robot.baud == baud
        robot.read(RADIO)
        yield robot


@contextmanager
def station(robot: MemoryRobot, link: RadioLink, signed: bool = False) -> Iterator[Robot]:
    """Our own host program behind the radio."""
    signer = Signer(KEY, clock=lambda: EPOCH_S + START / UNITS_PER_S + link.clock_s(), link_id=3) if signed else None
    connection = Connection(link, clock=link.clock_s, signer=signer)
    connection.target_system, connection.target_component = 1, 1
    assert connection.wait(lambda m: m.get_type() == "HEARTBEAT", _HEARTBEAT_S) is not None
    yield Robot(connection, table=parameter_table())


class MavProxySide:
    """What MAVProxy's parameter module wants of a connection, in simulated time."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._last_s = connection.clock()
        connection.add_listener(self._note)

    def _note(self, message: Any) -> None:
        if message.get_type() == "PARAM_VALUE":
            self._last_s = self._connection.clock()

    def time_since(self, _name: str) -> float:
        """Return how long ago the last value came [s]."""
        return self._connection.clock() - self._last_s

    def param_fetch_all(self) -> None:
        """Ask for all."""
        self._connection.send(mavlink.MAVLink_param_request_list_message(1, 1))

    def param_fetch_one(self, index: int) -> None:
        """Ask for one."""
        self._connection.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", index))


def ours_s(radio: RadioSettings, seed: int, signed: bool) -> float:
    """Return what our client needs for all parameters [s]."""
    with robot_with(radio.baud, signed) as robot:
        link = RadioLink(robot, radio, seed=seed)
        with station(robot, link, signed) as there:
            start_s = link.clock_s()
            assert len(there.parameters.download()) == len(parameter_table())
            return link.clock_s() - start_s


def mavproxy_s(radio: RadioSettings, seed: int) -> float:
    """Return what MAVProxy's parameter module itself, unchanged, needs on the simulated clock [s]."""
    with robot_with(radio.baud) as robot:
        link = RadioLink(robot, radio, seed=seed)
        with patch.object(time, "time", lambda: 1e9 + link.clock_s()), station(robot, link) as there:
            console = SimpleNamespace(settings=SimpleNamespace(param_ftp=False))
            state = ParamState({}, None, "Rover", "parameters", console, 1)
            side = MavProxySide(there.connection)
            there.connection.add_listener(lambda message: state.handle_mavlink_packet(side, message))
            start_s, count = link.clock_s(), len(parameter_table())
            while len(state.mav_param_set) < count and link.clock_s() < start_s + LONGEST_S:
                state.fetch_check(side)
                there.pump(0.05)
            assert len(state.mav_param_set) == count
            return link.clock_s() - start_s


ROWS: tuple[tuple[str, Callable[[int, int], float]], ...] = (
    ("`omni`, no loss", lambda baud, seed: ours_s(RadioSettings(baud=baud), seed, signed=False)),
    ("`omni`, no loss, signed", lambda baud, seed: ours_s(RadioSettings(baud=baud), seed, signed=True)),
    ("`omni`, with loss", lambda baud, seed: ours_s(bad_radio(baud), seed, signed=False)),
    ("`omni`, with loss, signed", lambda baud, seed: ours_s(bad_radio(baud), seed, signed=True)),
    ("MAVProxy's parameter module, with loss", lambda baud, seed: mavproxy_s(bad_radio(baud), seed)),
)


def in_words(times_s: Sequence[float]) -> str:
    """Return the shortest and the longest of some times."""
    least, most = round(min(times_s)), round(max(times_s))
    return f"{least} s" if least == most else f"{least}–{most} s"


def block() -> list[str]:
    """Measure everything and return the lines between the page's marks."""
    lines = [
        f"{len(parameter_table())} parameters, radio seeds {SEEDS[0]} to {SEEDS[-1]}:",
        "",
        "| All parameters | " + " | ".join(f"{baud} baud" for baud in BAUDS) + " |",
        "|---|" + "---|" * len(BAUDS),
    ]
    for label, measure in ROWS:
        cells = [in_words([measure(baud, seed) for seed in SEEDS]) for baud in BAUDS]
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Compare the page with what is measured, or write it."""
    parser = argparse.ArgumentParser(prog="python -m tests.radio.download_page", description=__doc__)
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    write = parser.parse_args().write
    text = PAGE.read_text(encoding="utf-8")
    lines = block()
    sys.stdout.write("\n".join(lines) + "\n")
    measured = replace_block(text, BLOCK, lines)
    if write:
        PAGE.write_text(measured, encoding="utf-8")
    elif measured != text:
        sys.exit(f"{PAGE.name} has another table: python -m tests.radio.download_page --write, and look at it")


if __name__ == "__main__":
    main()
