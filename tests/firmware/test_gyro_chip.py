# SPDX-License-Identifier: MIT
"""The driver of the gyro's chip against its model: the start, the readings, and each thing that goes wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tests.firmware.gyro_model import (
    BMI270,
    CHIPS,
    GOOD_TICKS,
    ICM42688,
    NOISE_RAD_S,
    RETRY_TICKS,
    Cause,
    Chip,
    Gyro,
)

ALL = 7


@pytest.fixture(params=CHIPS, ids=lambda chip: chip.name)
def gyro(request: pytest.FixtureRequest) -> Iterator[Gyro]:
    made = Gyro(request.param)
    yield made
    made.close()


@pytest.fixture
def bmi() -> Iterator[Gyro]:
    made = Gyro(BMI270)
    yield made
    made.close()


@pytest.mark.full
def test_it_gives_readings_soon_and_in_all_ticks_but_the_looks(gyro: Gyro) -> None:
    gyro.start()
    assert gyro.valid[-1] == ALL
    assert not gyro.valid[: gyro.chip.quiet_ticks].any()
    gyro.run(1000, (0.1, -0.2, 0.5))
    assert set(gyro.valid) == {0, ALL}
    assert np.count_nonzero(gyro.valid == 0) == pytest.approx(20, abs=3), "the settings are read back every 50 readings"
    assert gyro.rates[5:].mean(axis=0) == pytest.approx([0.1, -0.2, 0.5], abs=4 * NOISE_RAD_S / np.sqrt(1000))
    assert gyro.cause() is Cause.NONE
    assert (gyro.call("starts"), gyro.call("recoveries")) == (1, 0)


@pytest.mark.full
def test_the_registers_are_those_that_the_driver_promises(gyro: Gyro) -> None:
    gyro.start()
    settings = gyro.chip.settings
    assert {place: gyro.call("register", *place) for place in settings} == settings
    assert gyro.call("ignored_writes") == 0, "something was written when nothing may be"


def test_a_start_that_was_broken_off_in_another_bank_is_begun_anew() -> None:
    gyro = Gyro(ICM42688)
    gyro.call("set_register", 0, 0x76, 1)
    assert gyro.start().valid[-1] == ALL
    gyro.close()


@pytest.mark.parametrize("share", [-0.997, -0.03, 0.0, 0.07, 0.997])
def test_a_reading_is_the_rate_to_a_step(gyro: Gyro, share: float) -> None:
    rate = share * np.radians(gyro.chip.range_dps)
    gyro.start((0.02, -0.015, rate))
    gyro.run(400, (0.02, -0.015, rate))
    assert gyro.rates[:, 2].mean() == pytest.approx(rate, abs=gyro.chip.step_rad_s / 2)


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
    assert gyro.start().valid[-1] == ALL


def test_a_chip_that_is_not_there_is_asked_five_times_a_second(gyro: Gyro) -> None:
    gyro.faults.absent = True
    gyro.run(2000)
    assert gyro.cause() is Cause.ABSENT
    assert not gyro.valid.any()
    assert gyro.call("starts") == pytest.approx(10, abs=1)
    assert gyro.call("recoveries") == 0, "the bus is free: nobody answers"
    gyro.faults.absent = False
    gyro.restart()
    assert gyro.valid[-1] == ALL
    assert gyro.cause() is Cause.NONE


def test_another_chip_is_told_from_it(gyro: Gyro) -> None:
    gyro.faults.other_id = 0x12
    gyro.run(2000)
    assert (gyro.cause(), gyro.call("seen")) == (Cause.WRONG_ID, 0x12)
    assert not gyro.valid.any()
    assert gyro.call("register", 0, gyro.chip.power_register) == 0, "another chip's registers are not written to"
    assert gyro.call("starts") == pytest.approx(10, abs=1)
    assert gyro.call("wanted") == gyro.chip.identity


def test_a_chip_that_resets_itself_is_noticed_at_once_and_set_up_again(gyro: Gyro) -> None:
    gyro.start().run(33, (0.0, 0.0, 0.5))
    gyro.call("power_cycle")
    gyro.run(12, (0.0, 0.0, 0.5))
    assert gyro.cause() is Cause.LOST
    assert not gyro.valid[1:].any(), "what it reads without its settings is no reading"
    gyro.restart()
    assert gyro.cause() is Cause.NONE
    assert gyro.valid[-1] == ALL
    settings = gyro.chip.settings
    assert {place: gyro.call("register", *place) for place in settings} == settings


@pytest.mark.parametrize(
    ("chip", "reg", "value"),
    [pytest.param(chip, *change, id=f"{chip.name} {change[0]:#x}") for chip in CHIPS for change in chip.changes],
)
def test_a_setting_that_changes_is_noticed_within_a_round_of_looks(chip: Chip, reg: int, value: int) -> None:
    """A range that is halved doubles every reading: nothing but the look at the settings shows it."""
    gyro = Gyro(chip)
    gyro.start().run(7)
    gyro.call("set_register", 0, reg, value)
    gyro.run(55 * chip.looks)
    assert gyro.cause() is Cause.LOST
    gyro.restart()
    assert gyro.cause() is Cause.NONE
    assert gyro.call("register", 0, reg) != value
    gyro.close()


def test_a_chip_that_answers_and_does_not_measure_is_silent(gyro: Gyro) -> None:
    gyro.faults.silent = True
    gyro.run(1000)
    assert gyro.cause() is Cause.SILENT
    assert not gyro.valid.any()
    assert gyro.call("starts") == pytest.approx(1000 / (RETRY_TICKS + gyro.chip.start_ticks), abs=2)
    gyro.faults.silent = False
    gyro.restart().restart()
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


def test_readings_that_stand_still_are_no_readings(gyro: Gyro) -> None:
    gyro.start().run(50)
    gyro.faults.stuck = True
    gyro.run(125)
    assert gyro.cause() is Cause.STUCK
    assert not gyro.valid[-10:].any()
    gyro.faults.stuck = False
    gyro.restart()
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


@pytest.mark.parametrize("rate", [40.0, -40.0])
def test_a_rate_beyond_the_range_is_said_and_handed_on(gyro: Gyro, rate: float) -> None:
    """The core leaves it out by GYRO_MAX, 34 rad/s."""
    gyro.start()
    gyro.run(60, (0.02, -0.015, rate))
    assert gyro.cause() is Cause.SATURATED
    assert np.sign(rate) * gyro.rates[-1, 2] > 34.0
    assert np.count_nonzero(gyro.valid == 0) <= 4
    gyro.run(GOOD_TICKS)
    assert gyro.cause() is Cause.NONE


def test_another_axis_may_be_saturated(gyro: Gyro) -> None:
    gyro.start()
    gyro.run(60, (40.0, 0.0, 1.0))
    assert gyro.cause() is Cause.NONE


def test_a_reading_that_jumps_is_left_out_and_one_that_stays_is_believed(gyro: Gyro) -> None:
    gyro.start().run(3)
    gyro.run(13, lambda tick: (0.0, 0.0, 9.0 if tick == 2 or tick >= 7 else 0.5))  # seen two ticks later
    told = gyro.rates[gyro.valid == ALL, 2]
    assert np.count_nonzero(told > 8.0) == 3, "the lone one at 2 is left out, and the first of those from 7 on"
    assert gyro.cause() is Cause.NONE


def test_wires_that_lose_bits_are_noticed_and_nothing_far_off_gets_through(gyro: Gyro) -> None:
    gyro.start().run(200)
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
    gyro.start().run(20)
    gyro.call("hold", 1)
    gyro.run(60)
    assert gyro.cause() is Cause.BUS
    assert not gyro.valid[5:].any()
    before = gyro.call("batches")
    gyro.run(2000)
    assert gyro.call("batches") - before == pytest.approx(10, abs=2)
    gyro.call("hold", 0)
    gyro.restart()
    assert (gyro.cause(), gyro.valid[-1]) == (Cause.NONE, ALL)


def test_a_chip_that_stops_answering_for_a_moment_is_not_set_up_anew(gyro: Gyro) -> None:
    gyro.start().run(20)
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
    gyro.start((0.0, 0.0, 1.0)).run(5, (0.0, 0.0, 1.0))
    gyro.run(1, (0.0, 0.0, 2.0), step_us=3_000_000)
    gyro.run(4, (0.0, 0.0, 2.0))
    assert gyro.valid[0] == 0
    assert gyro.rates[gyro.valid == ALL, 2] == pytest.approx(2.0, abs=0.01)


# ---------------------------------------------------------------- a chip with a configuration file


def test_the_file_arrives_whole_in_pieces_that_leave_the_bus_within_a_tick(bmi: Gyro) -> None:
    bmi.start()
    assert bmi.call("uploaded") == 8192
    # 9 clocks a byte, and three for START, repeated START and STOP, at 400 kHz.
    assert (9 * bmi.call("longest_batch") + 3) / 400e3 < 1e-3
    assert bmi.call("starts") == 1


def test_a_chip_that_does_not_take_its_file_says_so(bmi: Gyro) -> None:
    bmi.faults.refuses = True
    bmi.run(1000)
    assert (bmi.cause(), bmi.call("seen") & 0xF) == (Cause.CONFIGURATION, 2)
    assert not bmi.valid.any()
    bmi.faults.refuses = False
    bmi.restart().restart()
    assert (bmi.cause(), bmi.valid[-1]) == (Cause.NONE, ALL)


@pytest.mark.parametrize("ticks", [20, 150, 262])
def test_an_upload_that_breaks_off_begins_anew(bmi: Gyro, ticks: int) -> None:
    bmi.run(ticks)
    bmi.call("power_cycle")
    bmi.run(1000)
    assert bmi.call("uploaded") == 8192
    assert bmi.valid[-1] == ALL
    assert bmi.call("starts") == 2


def test_the_file_may_come_in_the_middle_of_a_held_line(bmi: Gyro) -> None:
    bmi.run(100)
    bmi.call("hold", 1)
    bmi.run(100)
    assert bmi.cause() is Cause.BUS
    bmi.call("hold", 0)
    bmi.restart()
    assert (bmi.cause(), bmi.valid[-1]) == (Cause.NONE, ALL)
