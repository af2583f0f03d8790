# SPDX-License-Identifier: MIT
"""Every named fault against the PC firmware and the emulated Cortex-M7.

What counts is the voltage on the simulated motors: when it goes, that it stays away, what the robot says, and the way
back. The same runs fill the table in docs/reference/safety.md.
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from bench.figures.fault_table import FAULTS, table, with_part
from hil_sim.fault_bench import FaultResult, Firmware, run_case
from hil_sim.fault_cases import CASES, CIRCLE, EMERGENCY_STOP, FAULT_S, FaultCase
from omniwheel import FirmwareProcess
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from tests.arm import need_emulator

FIRMWARES: dict[str, Firmware] = {"pc": FirmwareProcess, "cortex-m7": partial(EmulatedFirmware, links=[DIRECT])}
ON_EACH = ["pc", pytest.param("cortex-m7", marks=pytest.mark.nightly)]
"""Before a merge the image that is flashed does the same: its checks `faults-at-the-pins` and `faults-in-the-loop`."""
DRIVING = 0.05
ESTOP = 4
DOCUMENT = Path(__file__).parents[2] / "docs" / "reference" / "safety.md"


@cache
def result_of(name: str, firmware: str) -> FaultResult:
    if firmware == "cortex-m7":
        need_emulator()
    return run_case(next(case for case in CASES if case.name == name), FIRMWARES[firmware])


def check_stop(result: FaultResult) -> None:
    """The motors lost their voltage in time and for good; the robot named the fault."""
    case = result.case
    if case.stops == EMERGENCY_STOP:
        during = result.record[result.record["time_s"] > FAULT_S + case.bound_s(result.values)]
        assert during["state"][0] == ESTOP
        assert result.faults == ()
    else:
        assert f"failsafe: {case.stops}" in result.texts
        assert case.stops in result.faults
    if case.coasts:
        assert result.latency_s is not None, "a motor kept its voltage"
        assert result.latency_s <= case.bound_s(result.values) + 1e-9
    else:
        assert result.latency_s is None, "without the pin nothing could have stopped it"


def check_drives_on(result: FaultResult) -> None:
    """It took no notice worth a stop, and did not leave its path."""
    case = result.case
    assert result.stayed_armed
    assert result.faults == ()
    if case.drive == CIRCLE:
        assert result.error_m <= case.error_m


@pytest.mark.parametrize("firmware", ON_EACH)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_fault_is_met_as_promised(case: FaultCase, firmware: str) -> None:
    result = result_of(case.name, firmware)
    before = result.record[result.record["time_s"] < FAULT_S - 0.0005]
    assert np.abs(before["duty"][-1]).max() > DRIVING, "it must drive when the fault comes"
    if case.stops is None:
        check_drives_on(result)
    else:
        check_stop(result)
    if case.warns is not None:
        assert case.warns in result.warnings
    if case.says is not None:
        assert any(case.says in text for text in result.texts), result.texts
    assert result.moved_after > DRIVING, "it must drive again afterwards"


@pytest.mark.nightly
def test_both_processors_take_the_same_time() -> None:
    pairs = {case.name: tuple(result_of(case.name, firmware).latency_s for firmware in FIRMWARES) for case in CASES}
    assert {name: pair for name, pair in pairs.items() if pair[0] != pair[1]} == {}


def test_the_table_in_the_documentation_is_what_was_measured() -> None:
    """After a change, ``python -m bench.figures.fault_table --write`` brings it up to date."""
    measured, document = table(result_of(case.name, "pc") for case in CASES), DOCUMENT.read_text()
    assert with_part(document, FAULTS, measured) == document
