# SPDX-License-Identifier: MIT
"""The driver of the gyro's chip against its model: the start, the readings, and each thing that goes wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tests.firmware.gyro_model import NOISE_RAD_S, START_TICKS, STEP_RAD_S, Cause, Gyro

ALL = 7
RETRY_TICKS = 200
GOOD_TICKS = 110
"""After these a trouble that has gone is no longer shown: 100 good readings, and looks at the settings between."""


@pytest.fixture
def gyro() -> Iterator[Gyro]:
    made = Gyro()
    yield made
    made.close()


def test_it_gives_readings_within_80_ms_in_all_ticks_but_the_looks(gyro: Gyro) -> None:
    gyro.run(START_TICKS)
    assert gyro.valid[-1] == ALL
    assert not gyro.valid[:60].any(), "the gyro takes 30 ms to start and must stay on for 45 ms"
    gyro.run(1000, (0.1, -0.2, 0.5))
    assert set(gyro.valid) == {0, ALL}
    assert np.count_nonzero(gyro.valid == 0) == 20, "the settings are read back every 50 readings"
    assert gyro.rates[5:].mean(axis=0) == pytest.approx([0.1, -0.2, 0.5], abs=4 * NOISE_RAD_S / np.sqrt(1000))
    assert gyro.cause() is Cause.NONE
    assert (gyro.call("starts"), gyro.call("recoveries")) == (1, 0)


def test_the_registers_are_those_that_the_driver_promises(gyro: Gyro) -> None:
    gyro.run(START_TICKS)
    bank_0 = {0x4D: 0x51, 0x4E: 0x0C, 0x4F: 0x06, 0x50: 0x06, 0x51: 0x12, 0x52: 0x10, 0x76: 0}
    assert {reg: gyro.call("register", 0, reg) for reg in bank_0} == bank_0
    bank_1 = {0x0B: 0xA0, 0x0C: 11, 0x0D: 122, 0x0E: 0x80}
    assert {reg: gyro.call("register", 1, reg) for reg in bank_1} == bank_1
    assert gyro.call("ignored_writes") == 0, "something was written when nothing may be"


def test_a_start_that_was_broken_off_in_another_bank_is_begun_anew(gyro: Gyro) -> None:
    gyro.call("set_register", 0, 0x76, 1)
    assert gyro.run(START_TICKS).valid[-1] == ALL


@pytest.mark.parametrize("rate", [-34.8, -1.0, -STEP_RAD_S, 0.0, STEP_RAD_S, 2.5, 34.8])
def test_a_reading_is_the_rate_to_a_step(gyro: Gyro, rate: float) -> None:
    gyro.run(START_TICKS, (0.0, 0.0, rate))
    gyro.run(400, (0.0, 0.0, rate))
    assert gyro.rates[:, 2].mean() == pytest.approx(rate, abs=STEP_RAD_S / 2)


def test_without_an_axis_nothing_is_on_the_bus(gyro: Gyro) -> None:
    gyro.use_axis(0)
    gyro.run(500)
    assert (gyro.call("batches"), gyro.call("starts")) == (0, 0)
    assert not gyro.valid.any()
    assert gyro.cause() is Cause.NONE


def test_an_axis_that_is_taken_away_ends_the_traffic_and_the_trouble(gyro: Gyro) -> None:
    gyro.faults.absent = True
    gyro.run(10)
    assert gyro.cause() is Cause.ABSENT
    gyro.use_axis(0)
    gyro.run(2)
    before = gyro.call("batches")
    gyro.run(500)
    assert gyro.call("batches") == before
    assert gyro.cause() is Cause.NONE
    gyro.faults.absent = False
    gyro.use_axis(-1)
    assert gyro.run(START_TICKS).valid[-1] == ALL


def test_a_chip_that_is_not_there_is_asked_five_times_a_second(gyro: Gyro) -> None:
    gyro.faults.absent = True
    gyro.run(2000)
    assert gyro.cause() is Cause.ABSENT
    assert not gyro.valid.any()
    assert gyro.call("starts") == pytest.approx(10, abs=1)
    assert gyro.call("recoveries") == 0, "the bus is free: nobody answers"
    gyro.faults.absent = False
    gyro.run(RETRY_TICKS + START_TICKS + GOOD_TICKS)
    assert gyro.valid[-1] == ALL
    assert gyro.cause() is Cause.NONE


def test_another_chip_is_told_from_it(gyro: Gyro) -> None:
    gyro.faults.other_id = 0x12
    gyro.run(2000)
    assert (gyro.cause(), gyro.call("seen")) == (Cause.WRONG_ID, 0x12)
    assert not gyro.valid.any()
    assert gyro.call("register", 0, 0x4E) == 0, "another chip's registers are not written to"
    assert gyro.call("starts") == pytest.approx(10, abs=1)


def test_a_chip_that_resets_itself_is_noticed_at_once_and_set_up_again(gyro: Gyro) -> None:
    gyro.run(START_TICKS + 33)
    gyro.call("power_cycle")
    gyro.run(6)
    assert gyro.cause() is Cause.LOST
    assert not gyro.valid[1:].any(), "what it reads without its settings is no reading"
    gyro.run(RETRY_TICKS + START_TICKS + GOOD_TICKS)
    assert gyro.cause() is Cause.NONE
    assert gyro.valid[-1] == ALL
    assert gyro.call("register", 1, 0x0C) == 11


@pytest.mark.parametrize(("reg", "value"), [(0x4F, 0x26), (0x51, 0x16), (0x52, 0x11), (0x4D, 0x91)])
def test_a_setting_that_changes_is_noticed_within_a_twentieth_of_a_second(gyro: Gyro, reg: int, value: int) -> None:
    """A range that is halved doubles every reading: nothing but the look at the settings shows it."""
    gyro.run(START_TICKS + 7)
    gyro.call("set_register", 0, reg, value)
    gyro.run(55)
    assert gyro.cause() is Cause.LOST
    gyro.run(RETRY_TICKS + START_TICKS + GOOD_TICKS)
    assert gyro.cause() is Cause.NONE
    assert gyro.call("register", 0, reg) != value


def test_a_chip_that_answers_and_does_not_measure_is_silent(gyro: Gyro) -> None:
    gyro.faults.silent = True
    gyro.run(1000)
    assert gyro.cause() is Cause.SILENT
    assert not gyro.valid.any()
    assert gyro.call("starts") == pytest.approx(1000 / (RETRY_TICKS + START_TICKS), abs=2)
    gyro.faults.silent = False
    gyro.run(2 * (RETRY_TICKS + START_TICKS) + GOOD_TICKS)
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


def test_readings_that_stand_still_are_no_readings(gyro: Gyro) -> None:
    gyro.run(START_TICKS + 50)
    gyro.faults.stuck = True
    gyro.run(120)
    assert gyro.cause() is Cause.STUCK
    assert not gyro.valid[-10:].any()
    gyro.faults.stuck = False
    gyro.run(RETRY_TICKS + START_TICKS + GOOD_TICKS)
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


@pytest.mark.parametrize("rate", [40.0, -40.0])
def test_a_rate_beyond_the_range_is_said_and_handed_on(gyro: Gyro, rate: float) -> None:
    """The core leaves it out by GYRO_MAX, 34 rad/s."""
    gyro.run(START_TICKS)
    gyro.run(60, (0.0, 0.0, rate))
    assert gyro.cause() is Cause.SATURATED
    assert np.sign(rate) * gyro.rates[-1, 2] > 34.0
    assert np.count_nonzero(gyro.valid == 0) <= 4
    gyro.run(GOOD_TICKS)
    assert gyro.cause() is Cause.NONE


def test_another_axis_may_be_saturated(gyro: Gyro) -> None:
    gyro.run(START_TICKS)
    gyro.run(60, (40.0, 0.0, 1.0))
    assert gyro.cause() is Cause.NONE


def test_a_reading_that_jumps_is_left_out_and_one_that_stays_is_believed(gyro: Gyro) -> None:
    gyro.run(START_TICKS + 3)
    gyro.run(13, lambda tick: (0.0, 0.0, 9.0 if tick == 2 or tick >= 7 else 0.5))  # seen two ticks later
    told = gyro.rates[gyro.valid == ALL, 2]
    assert np.count_nonzero(told > 8.0) == 3, "the lone one at 2 is left out, and the first of those from 7 on"
    assert gyro.cause() is Cause.NONE


def test_wires_that_lose_bits_are_noticed_and_nothing_far_off_gets_through(gyro: Gyro) -> None:
    gyro.run(START_TICKS + 200)
    gyro.faults.seed, gyro.faults.bit_errors = 3, 2e-4
    gyro.run(5000)
    assert gyro.cause() is Cause.NONE, "one byte in 5000"
    assert np.abs(gyro.rates[:, 2]).max() < 2.3, "bits 12 to 15 are 4.3 rad/s and more"
    gyro.faults.bit_errors = 0.05
    gyro.run(1000)
    assert gyro.cause() in (Cause.NOISY, Cause.LOST, Cause.WRONG_ID)
    gyro.run(3000)
    assert np.count_nonzero(gyro.valid) < 1000
    gyro.faults.bit_errors = 0.0
    gyro.run(2500)
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


def test_a_bus_that_is_held_low_is_freed_at_a_bounded_rate(gyro: Gyro) -> None:
    gyro.run(START_TICKS + 20)
    gyro.call("hold", 1)
    gyro.run(60)
    assert gyro.cause() is Cause.BUS
    assert not gyro.valid[5:].any()
    before = gyro.call("batches")
    gyro.run(2000)
    assert gyro.call("batches") - before == pytest.approx(10, abs=2)
    gyro.call("hold", 0)
    gyro.run(RETRY_TICKS + START_TICKS + GOOD_TICKS)
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


def test_a_chip_that_stops_answering_for_a_moment_is_not_set_up_anew(gyro: Gyro) -> None:
    gyro.run(START_TICKS + 20)
    gyro.faults.absent = True
    gyro.run(8)
    gyro.faults.absent = False
    gyro.run(20)
    assert gyro.cause() is Cause.NONE
    assert gyro.valid[-1] == ALL
    assert gyro.call("starts") == 1
    gyro.faults.absent = True
    gyro.run(20)
    assert gyro.cause() is Cause.ABSENT


def test_a_reading_from_before_a_pause_is_dropped(gyro: Gyro) -> None:
    """With the host in the loop nobody asks the driver."""
    gyro.run(START_TICKS + 5, (0.0, 0.0, 1.0))
    gyro.run(1, (0.0, 0.0, 2.0), step_us=3_000_000)
    gyro.run(4, (0.0, 0.0, 2.0))
    assert gyro.valid[0] == 0
    assert gyro.rates[gyro.valid == ALL, 2] == pytest.approx(2.0, abs=0.01)
