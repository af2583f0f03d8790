# SPDX-License-Identifier: MIT
"""Puts the budgets' figures into docs/checks/performance.md, between its markers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

CLOCK_MHZ = 600
TICK_US = 1000
I2C_START_STOP_BITS = 2
I2C_CLOCKS_kHz = (100, 400, 1000)
CASES = {
    "every_filter": "three wheels, every filter on, fix at 50 Hz, 20 ms old",
    "every_filter_burst": "the same while a burst of every signal is recorded",
    "every_filter_no_fix": "the same without fixes",
    "every_filter_late_fix": "the same with fixes 250 ms old (replays the whole history)",
    "four_wheels": "four wheels, every filter on",
    "four_wheels_late_fix": "the same with fixes 250 ms old",
    "gyro": "three wheels and a gyro, every filter on, fix at 50 Hz, 20 ms old",
    "gyro_late_fix": "the same with fixes 250 ms old",
    "gyro_four_wheels": "four wheels and a gyro, fix at 50 Hz, 20 ms old",
    "flow": "three wheels and a sensor of motion over the floor, read with each fix, 20 ms old",
    "flow_gyro_late_fix": "three wheels, this sensor and a gyro, with fixes 250 ms old",
    "super_twisting": "three wheels, super-twisting ISMC",
    "p": "feedback-linearised P",
    "pd": "feedback-linearised PD",
    "pid": "feedback-linearised PID",
    "original": "the robot's original law",
    "torque": "direct torque",
    "report_path": "ISMC on the report's path (eq. 81)",
    "pose_setpoint": "ISMC, pose set-points",
    "velocity": "velocity set-points, no position controller",
    "filters_off": "ISMC, differenced counts, dead reckoning",
}
SIZES = {
    "size.core_code": "core: code and constants (flash; ITCM on a Teensy)",
    "size.core_data": "core: writable data",
    "size.omni_robot_t": "`omni_robot_t`: state of the core",
    "size.omni_robot_config_t": "`omni_robot_config_t`: a parameter set, derived",
    "size.omni_trajectory_t": "`omni_trajectory_t`: a planned path",
    "size.ControlLoop": "`ControlLoop`: all of the tick's memory, with parameter sets, paths, reports, requests",
    "stack.tick_painted": "stack below `ControlLoop::tick`, painted and looked at after all cases",
    "stack.core_bound": "stack of `omni_robot_tick`, bound from the call graph",
    "stack.tick_bound": "stack of `ControlLoop::tick`, bound from the call graph",
}
UPDATES = {
    "six single-channel writes": [5] * 6,
    "three pair bursts (ours)": [9] * 3,
    "one burst over channels 2 to 14": [53],
    "ALL_LED off": [2],
}
"""Bytes after the address byte of each transaction of an update of six channels."""
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])")
"""A figure, and no part of a name or of a version."""


def instruction_rows(figures: Mapping[str, int]) -> list[str]:
    """Return the table of instructions per tick."""
    rows = [
        "| case | core, mean | core, max | whole tick, mean | max | share of the tick |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for case in dict.fromkeys(name.removesuffix(".core_mean") for name in figures if name.endswith(".core_mean")):
        words = CASES.get(case, f"controller `{case}`")
        core, core_max, tick, tick_max = (
            figures[f"{case}.{name}"] for name in ("core_mean", "core_max", "tick_mean", "tick_max")
        )
        share = 100.0 * tick / (CLOCK_MHZ * TICK_US)
        rows.append(f"| {words} | {core} | {core_max} | {tick} | {tick_max} | {share:.2f} % |")
    return rows


def size_rows(figures: Mapping[str, int]) -> list[str]:
    """Return the table of memory."""
    return ["| what | bytes |", "|---|---:|", *(f"| {words} | {figures[name]} |" for name, words in SIZES.items())]


def bus_us(payloads: list[int], clock_kHz: int) -> float:
    """Return the time of an update on the wire [us]: nine bits a byte, START and STOP (or repeated START) one each."""
    bits = sum(9 * (1 + payload) + I2C_START_STOP_BITS for payload in payloads)
    return bits * 1000.0 / clock_kHz


def bus_rows() -> list[str]:
    """Return the table of bus times."""
    heads = " | ".join(f"{clock} kHz" for clock in I2C_CLOCKS_kHz)
    rows = [f"| update of six channels, µs | {heads} |", "|---|" + "---:|" * len(I2C_CLOCKS_kHz)]
    for words, payloads in UPDATES.items():
        times = " | ".join(f"{bus_us(payloads, clock):.0f}" for clock in I2C_CLOCKS_kHz)
        rows.append(f"| {words} | {times} |")
    return rows


NOISE = 0.02
"""A figure that has moved by less is left as it is written: code moves when other code is added."""


def unmoved(written: float, measured: float) -> bool:
    """Return whether a figure need not be written again."""
    return abs(measured - written) <= max(NOISE * abs(written), 1.0)


def is_current(text: str, name: str, lines: Sequence[str]) -> bool:
    """Return whether the page has these lines between its markers, with figures that may have moved a little."""
    written = text.split(f"<!-- {name} -->", 1)[-1].split(f"<!-- /{name} -->", 1)[0].strip("\n")
    measured = "\n".join(lines)
    return _NUMBER.sub("0", written) == _NUMBER.sub("0", measured) and all(
        unmoved(float(before), float(after))
        for before, after in zip(_NUMBER.findall(written), _NUMBER.findall(measured), strict=True)
    )


def replace_block(text: str, name: str, lines: Sequence[str]) -> str:
    """Return the page with what is between ``<!-- NAME -->`` and ``<!-- /NAME -->`` replaced.

    Raises ValueError if one of the markers is missing or stands twice.
    """
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(end) < text.index(begin):
        raise ValueError(f"the page needs the markers {begin} and {end}, once each")
    before, rest = text.split(begin, 1)
    return "\n".join([f"{before}{begin}", *lines, end]) + rest.split(end, 1)[1]


def write_page(page: Path, figures: Mapping[str, int]) -> None:
    """Replace what is between the markers ``<!-- NAME -->`` and ``<!-- /NAME -->``."""
    text = page.read_text()
    for name, rows in {
        "instructions": instruction_rows(figures),
        "memory": size_rows(figures),
        "bus": bus_rows(),
    }.items():
        text = replace_block(text, name, rows)
    page.write_text(text)
