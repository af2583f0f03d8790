# SPDX-License-Identifier: MIT
"""The register models of the gyros' chips, without a driver: what their data sheets say."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from omni_schema import load_parameters
from tests.firmware.gyro_model import BMI270, CHIPS, Gyro
from tests.native import ROOT

HERE = (0.5, -0.5, 1.0)
ELSEWHERE = (-9.0, 9.0, -30.0)
ST = [chip for chip in CHIPS if chip.data == 0x22]
CTRL2_G, CTRL3_C, STATUS_REG, WHO_AM_I = 0x11, 0x12, 0x1E, 0x0F
PWR_CONF, PWR_CTRL, INIT_CTRL, INIT_ADDR, INIT_DATA, INTERNAL_STATUS, CMD = 0x7C, 0x7D, 0x59, 0x5B, 0x5E, 0x21, 0x7E
PIECE = 64


@pytest.fixture(params=ST, ids=lambda chip: chip.name)
def st(request: pytest.FixtureRequest) -> Iterator[Gyro]:
    made = Gyro(request.param, axis=0)
    made.sense(*HERE)
    yield made
    made.close()


@pytest.fixture
def bmi() -> Iterator[Gyro]:
    made = Gyro(BMI270, axis=0)
    made.sense(*HERE)
    yield made
    made.close()


def axes(data: list[int]) -> list[int]:
    return [int.from_bytes(bytes(data[at : at + 2]), "little", signed=True) for at in (0, 2, 4)]


def wait(gyro: Gyro, milliseconds: int, rates: tuple[float, float, float] = HERE) -> None:
    for _ in range(milliseconds // 2):
        gyro.sense(*rates)


def upload(gyro: Gyro, pieces: int = 8192 // PIECE) -> None:
    assert gyro.write(CMD, 0xB6)
    wait(gyro, 4)
    assert gyro.write(PWR_CONF, 0)
    wait(gyro, 2)
    assert gyro.write(INIT_CTRL, 0)
    for number in range(pieces):
        word = number * PIECE // 2
        assert gyro.write(INIT_ADDR, word & 0xF, word >> 4)
        assert gyro.write(INIT_DATA, *([number & 0xFF] * PIECE))
    assert gyro.write(INIT_CTRL, 1)


def test_models_and_table_name_the_same_chips_in_the_same_order() -> None:
    table = load_parameters(ROOT / "shared" / "params.toml").gyro_chips
    assert [(chip.name, chip.number) for chip in CHIPS] == [(chip.name, chip.number) for chip in table.values()]


def test_st_says_who_it_is_and_steps_by_70_mdps(st: Gyro) -> None:
    assert st.read(WHO_AM_I) == [st.chip.identity]
    assert st.write(CTRL2_G, 0x8C)
    assert st.read(STATUS_REG)[0] & 0x02 == 0
    wait(st, 68)
    assert st.read(STATUS_REG)[0] & 0x02 == 0, "70 ms"
    wait(st, 6)
    assert st.read(STATUS_REG)[0] & 0x02 != 0
    assert axes(st.read(st.chip.data, 6)) == [round(rate / st.chip.step_rad_s) for rate in HERE]
    assert st.read(STATUS_REG)[0] & 0x02 == 0, "read"


@pytest.mark.parametrize("before", [1, 3, 5])
def test_st_keeps_the_bytes_of_an_axis_together_only_with_block_update(st: Gyro, before: int) -> None:
    st.write(CTRL2_G, 0x8C)
    wait(st, 80)
    old = [round(rate / st.chip.step_rad_s) for rate in HERE]
    new = [round(rate / st.chip.step_rad_s) for rate in ELSEWHERE]
    mixed = axes(list(st.read_across(before, ELSEWHERE)))
    assert mixed[before // 2] not in (old[before // 2], new[before // 2])
    st.write(CTRL3_C, 0x44)
    wait(st, 4)
    whole = axes(list(st.read_across(before, ELSEWHERE)))
    assert all(value in pair for value, pair in zip(whole, zip(old, new, strict=True), strict=True))


def test_st_reads_one_register_again_and_again_without_if_inc(st: Gyro) -> None:
    st.write(CTRL3_C, 0x00)
    assert st.read(WHO_AM_I, 3) == [st.chip.identity] * 3


def test_st_forgets_its_settings_in_a_reset(st: Gyro) -> None:
    st.write(CTRL2_G, 0x8C)
    st.write(CTRL3_C, 0x05)
    assert st.read(CTRL2_G) == [], "it resets itself"
    wait(st, 2)
    assert st.read(CTRL2_G, 2) == [0x00, 0x04]


def test_bosch_does_not_measure_without_its_file(bmi: Gyro) -> None:
    assert bmi.read(0x00) == [0x24]
    bmi.write(PWR_CONF, 0)
    wait(bmi, 2)
    bmi.write(PWR_CTRL, 0x02)
    wait(bmi, 200)
    assert bmi.read(INTERNAL_STATUS) == [0]
    assert bmi.read(0x03)[0] & 0x40 == 0
    assert axes(bmi.read(0x12, 6)) == [0, 0, 0]


def test_bosch_takes_a_whole_file_in_20_ms_and_then_measures(bmi: Gyro) -> None:
    upload(bmi)
    assert bmi.read(INTERNAL_STATUS) == [0]
    wait(bmi, 22)
    assert bmi.read(INTERNAL_STATUS) == [1]
    bmi.write(0x42, 0xDD, 0x00)
    bmi.write(PWR_CTRL, 0x02)
    wait(bmi, 44)
    assert bmi.read(0x03)[0] & 0x40 == 0, "45 ms"
    wait(bmi, 4)
    assert bmi.read(0x03)[0] & 0x40 != 0
    assert axes(bmi.read(0x12, 6)) == [round(rate / BMI270.step_rad_s) for rate in HERE]
    across = axes(list(bmi.read_across(3, ELSEWHERE)))
    assert across == [round(rate / BMI270.step_rad_s) for rate in HERE], "six bytes belong together"


def test_bosch_notices_a_piece_that_is_missing(bmi: Gyro) -> None:
    upload(bmi, 8192 // PIECE - 1)
    wait(bmi, 22)
    assert bmi.read(INTERNAL_STATUS) == [2]


def test_bosch_loses_writes_while_it_saves_power(bmi: Gyro) -> None:
    bmi.write(0x42, 0xDD)
    assert bmi.read(0x42) == [0xA9]
    bmi.write(PWR_CONF, 0)
    bmi.write(0x42, 0xDD)
    assert bmi.read(0x42) == [0xA9], "450 us"
    wait(bmi, 2)
    bmi.write(0x42, 0xDD)
    assert bmi.read(0x42) == [0xDD]
