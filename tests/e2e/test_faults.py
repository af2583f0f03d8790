# SPDX-License-Identifier: MIT
"""Each stop fault against the real firmware: how soon the motors stop, that they stay stopped, what the robot says.

What the faults do otherwise, and in process, is in tests/hil_sim/test_runs.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.hil import run_hil
from hil_sim.runs import Run, faults_seen
from hil_sim.scenario import load_scenario

ARMED, FAILSAFE = 2, 3

STOPPING = {
    "fault_encoder_stuck": ("stall", 1.0),
    "fault_encoder_reversed": ("stall", 0.5),
    "fault_encoder_invalid": ("encoder", 0.01),
    "fault_i2c_nack": ("driver", 0.05),
    "fault_i2c_stuck": ("driver", 0.2),
    "fault_link_silence": ("link loss", 4.0),
    "fault_battery_sag": ("battery", 0.2),
    "fault_motor_dead": ("stall", 1.0),
}
"""Scenario -> the fault that must be named, and the longest time [s] it may take."""


def check_stop(run: Run, fault: str, latency_s: float) -> None:
    """The robot was armed when the fault came, stopped within the time, named it and stayed stopped."""
    record = run.record
    start = run.scenario.faults[0].start_s
    before = record[record["time_s"] < start]
    assert before["state"][-1] == ARMED
    stopped = np.flatnonzero((record["time_s"] >= start) & (record["state"] != ARMED))
    assert len(stopped), "the motors went on"
    assert record["time_s"][stopped[0]] - start <= latency_s
    after = record[stopped[0] :]
    assert after["state"][0] == FAILSAFE
    assert ARMED not in after["state"], "nothing but disarming and arming again may lead out"
    assert fault in faults_seen(run)[0]


@pytest.mark.full
@pytest.mark.parametrize("name", sorted(STOPPING))
def test_the_firmware_stops_the_motors_and_says_why(name: str) -> None:
    fault, latency_s = STOPPING[name]
    run = run_hil(load_scenario(name))
    check_stop(run, fault, latency_s)
    assert any("failsafe" in text and fault.replace(" ", "_") in text.replace(" ", "_") for text in run.messages), (
        run.messages
    )
