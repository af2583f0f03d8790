# SPDX-License-Identifier: MIT
"""The radio profiles measured: a minute of what the firmware really sends, and the download on a bad radio."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from omniwheel.radio_model import RadioSettings
from omniwheel.robot import connect
from omniwheel.robots import parameter_table
from tests.radio import download_page
from tests.radio.download_page import bad_radio, robot_with, station
from tests.radio.memory_robot import USB, MemoryLink, MemoryRobot
from tests.radio.simulated_radio import RadioLink

PROFILES = [9600, 57600, 115200]
BYTES_S = {baud: baud / 10 for baud in PROFILES}
LONGEST_FRAME = 100
BENCH_PAGE = Path(__file__).resolve().parents[2] / "docs" / "checks" / "performance.md"


@pytest.mark.full
@pytest.mark.parametrize("signed", [False, True], ids=["unsigned", "signed"])
@pytest.mark.parametrize("baud", PROFILES)
def test_a_minute_of_a_profile_stays_below_60_percent_of_the_line(baud: int, signed: bool) -> None:
    with robot_with(baud, signed) as robot:
        link = RadioLink(robot, RadioSettings(baud=baud))
        with station(robot, link, signed) as there:
            heard: Counter[str] = Counter()
            lengths: list[int] = []

            def count(message: Any) -> None:
                heard[message.get_type()] += 1
                lengths.append(len(message.get_msgbuf()))

            there.connection.add_listener(count)
            start_s, start = link.clock_s(), link.radio.down.bytes_in
            assert there.parameters.download()
            loaded_s, meanwhile = link.clock_s(), heard["OMNI_TRACKING"]
            there.pump(60.0 - (loaded_s - start_s))
            after_s = link.clock_s() - loaded_s
            bytes_s = (link.radio.down.bytes_in - start) / (link.clock_s() - start_s)
        assert bytes_s < 0.6 * BYTES_S[baud]
        assert max(lengths) <= LONGEST_FRAME
        assert link.radio.down.bytes_overflowed == 0
        assert heard["HEARTBEAT"] >= 58
        assert heard["PARAM_VALUE"] >= len(parameter_table())
        assert heard["SYS_STATUS"] >= 11
        assert heard["OMNI_STATUS"] >= 7
        assert heard["LOCAL_POSITION_NED"] >= 50
        assert heard["OMNI_TRACKING"] - meanwhile >= 0.95 * after_s, "once a second, and more often on a faster line"
        assert meanwhile >= 0.25 * (loaded_s - start_s), "parameters do not keep everything else away"


def test_the_default_rates_cannot_flood_a_slow_line() -> None:
    """Without any profile: the baud rate alone holds telemetry to half of the line, and heartbeats are in time."""
    with MemoryRobot() as robot:
        link = RadioLink(robot, RadioSettings(baud=9600))
        ages = []
        with station(robot, link) as there:
            there.pump(1.5)
            start_s, start = link.clock_s(), link.radio.down.bytes_in
            while link.clock_s() < start_s + 30.0:
                there.pump(0.1)
                ages.append(there.status.heartbeat_age_s)
            bytes_s = (link.radio.down.bytes_in - start) / (link.clock_s() - start_s)
        assert bytes_s < 0.6 * 960
        assert max(ages) < 1.5


def test_no_message_stays_away_where_rates_do_not_fit() -> None:
    """Five messages at 20 Hz are four times the budget of 9600 baud."""
    fast = ["LOCAL_POSITION_NED", "ATTITUDE", "POSITION_TARGET_LOCAL_NED", "OMNI_TRACKING", "OMNI_HEALTH"]
    with MemoryRobot() as robot:
        link = RadioLink(robot, RadioSettings(baud=9600))
        heard: Counter[str] = Counter()
        with station(robot, link) as there:
            for name in fast:
                there.set_message_interval(name, 20.0)
            there.pump(5.0)
            there.connection.add_listener(lambda message: heard.update([message.get_type()]))
            there.pump(30.0)
        assert heard["HEARTBEAT"] >= 29
        assert min(heard[name] for name in ("SYS_STATUS", "OMNI_STATUS", "BATTERY_STATUS")) >= 5
        assert min(heard[name] for name in fast) >= 25, heard


@pytest.mark.full
@pytest.mark.parametrize("baud", [9600, 115200])
@pytest.mark.parametrize("signed", [False, True], ids=["unsigned", "signed"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_our_download_completes_on_a_bad_radio(baud: int, signed: bool, seed: int) -> None:
    """A fifth of the packets lost, 200 ms each way. Requests are not repeated needlessly."""
    with robot_with(baud, signed) as robot:
        link = RadioLink(robot, bad_radio(baud), seed=seed)
        with station(robot, link, signed) as there:
            counts: Counter[int] = Counter()
            there.connection.add_listener(
                lambda m: counts.update([m.param_index]) if m.get_type() == "PARAM_VALUE" else None
            )
            start_s = link.clock_s()
            values = there.parameters.download()
            took_s = link.clock_s() - start_s
        assert len(values) == len(parameter_table())
        assert took_s < (90.0 if baud == 9600 else 60.0)
        assert link.radio.down.packets_lost > 0.1 * link.radio.down.packets_sent
        assert sum(counts.values()) < 1.5 * len(values)


@pytest.mark.parametrize("baud", [9600, 115200])
@pytest.mark.parametrize("seed", [1, 2])
def test_gains_are_set_and_confirmed_on_a_bad_radio(baud: int, seed: int) -> None:
    with robot_with(baud) as robot:
        link = RadioLink(robot, bad_radio(baud), seed=seed)
        with station(robot, link) as there:
            for gain in range(5, 15):
                there.parameters["ISMC_LAM_XY"] = float(gain)
                assert there.parameters.read("ISMC_LAM_XY") == gain
        check = MemoryLink(robot, USB)
        with connect(check, clock=check.clock_s) as beside:
            assert beside.parameters.read("ISMC_LAM_XY") == 14.0


@pytest.mark.parametrize("baud", [9600, 115200])
def test_mavproxys_own_download_completes_on_a_bad_radio(baud: int) -> None:
    """Its parameter module itself, unchanged, on the simulated clock."""
    assert download_page.mavproxy_s(bad_radio(baud), 4) < 120.0


def test_the_pages_tables_are_of_about_as_many_parameters_as_there_are() -> None:
    """If not: ``python -m tests.radio.download_page --write``; ``make bench ARGS="--only download --write"``."""
    text = download_page.PAGE.read_text(encoding="utf-8")
    shown = text.split(f"<!-- {download_page.BLOCK} -->")[1].split(f"<!-- /{download_page.BLOCK} -->")[0]
    bench = BENCH_PAGE.read_text(encoding="utf-8")
    for page, pattern in ((shown, r"^(\d+) parameters,"), (bench, r"\*(\d+) parameters, ")):
        found = re.search(pattern, page, re.MULTILINE)
        assert found is not None
        assert int(found[1]) == pytest.approx(len(parameter_table()), rel=0.05)
    labels = [line.split(" | ")[0].removeprefix("| ") for line in shown.splitlines() if line.startswith("| ")]
    assert labels == ["All parameters", *(label for label, _ in download_page.ROWS)]


@pytest.mark.full
def test_the_pages_table_has_todays_times() -> None:
    """Times at the fast profile; those at 9600 baud take longer to measure.

    With another number of parameters other packets are lost, so times with loss are held to a quarter.
    """
    text = download_page.PAGE.read_text(encoding="utf-8")
    for label, measure in download_page.ROWS:
        today = [measure(115200, seed) for seed in download_page.SEEDS]
        row = next(line for line in text.splitlines() if line.startswith(f"| {label} |"))
        written = [float(number) for number in re.findall(r"\d+", row.split(" | ")[-1])]
        slack = 0.25 if "with loss" in label else 0.05
        middle = (min(written) + max(written)) / 2
        assert (min(today) + max(today)) / 2 == pytest.approx(middle, rel=slack, abs=1.0), label
