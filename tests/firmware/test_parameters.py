# SPDX-License-Identifier: MIT
"""The parameter protocol and what survives a power cut."""

from __future__ import annotations

import math
from itertools import permutations
from pathlib import Path

import pytest

from omni_schema import load_parameters
from omniwheel.paths import params_path
from tests.firmware.client import Client, lockstep_robot, mav, storage_arguments

STORAGE = mav.MAV_CMD_PREFLIGHT_STORAGE
LOAD, SAVE, RESET = 0, 1, 2


def test_the_list_has_every_parameter_once_with_its_index(robot: Client) -> None:
    table = load_parameters(params_path())
    robot.mav.param_request_list_send(1, 1)
    names = {}
    for _ in table.parameters:
        message = robot.wait("PARAM_VALUE")
        assert message.param_count == len(table.parameters)
        assert message.param_type == mav.MAV_PARAM_TYPE_REAL32
        names[message.param_index] = message.param_id
    assert names == {p.index: p.name for p in table.parameters}


def test_reading_by_index_and_by_name_agree(robot: Client) -> None:
    by_name = robot.get("ISMC_LAM_XY")
    robot.mav.param_request_read_send(1, 1, b"", 0)
    assert robot.wait("PARAM_VALUE", param_index=0).param_id == "SYS_ID"
    assert by_name == load_parameters(params_path()).defaults()["ISMC_LAM_XY"]


def test_a_gain_set_over_the_link_takes_effect_in_the_next_tick(robot: Client) -> None:
    before = robot.tick().actuators.config_sequence
    assert robot.set("ISMC_LAM_XY", 7.5) == 7.5
    assert robot.tick().actuators.config_sequence == before + 1
    assert robot.set("ISMC_LAM_XY", 8.5) == 8.5
    assert robot.set("ISMC_K_XY", 0.5) == 0.5
    assert robot.tick().actuators.config_sequence == before + 3


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("ISMC_LAM_XY", math.nan, "not a number"),
        ("ISMC_LAM_XY", math.inf, "not a number"),
        ("ISMC_LAM_XY", -1.0, "0..200"),
        ("ISMC_LAM_XY", 201.0, "0..200"),
        ("TRJ_PETALS", 2.5, "whole numbers"),
        ("W1_ENC_DIR", 0.0, "does not fit the others"),
        ("W1_IN1_CH", 8.0, "refused"),  # the channel of the same wheel's IN2
    ],
)
def test_a_refused_value_is_answered_with_the_old_one(robot: Client, name: str, value: float, why: str) -> None:
    before = robot.get(name)
    sequence = robot.tick().actuators.config_sequence
    assert robot.set(name, value) == before
    assert any(name in text and why in text for text in robot.texts())
    assert robot.get(name) == before
    assert robot.tick().actuators.config_sequence == sequence


def test_no_two_bridge_inputs_share_a_channel(robot: Client) -> None:
    names = [f"W{wheel}_IN{place}_CH" for place in (1, 2) for wheel in (1, 2, 3)]
    channels = [robot.get(name) for name in names]
    for one, other in permutations(range(len(names)), 2):
        assert robot.set(names[other], channels[one]) == channels[other]


def test_another_type_than_real32_is_refused(robot: Client) -> None:
    before = robot.get("TRJ_PETALS")
    assert robot.set("TRJ_PETALS", 5.0, mav.MAV_PARAM_TYPE_INT32) == before
    assert any("REAL32" in text for text in robot.texts())


def test_an_unknown_name_changes_nothing_and_is_said(robot: Client) -> None:
    robot.mav.param_set_send(1, 1, b"NO_SUCH_THING", 1.0, mav.MAV_PARAM_TYPE_REAL32)
    assert "NO_SUCH_THING" in robot.wait("STATUSTEXT").text


def test_geometry_is_locked_while_armed_and_gains_are_not(robot: Client) -> None:
    robot.armed()
    radius = robot.get("WHEEL_RADIUS")
    assert robot.set("WHEEL_RADIUS", 0.06) == radius
    assert any("disarm first" in text for text in robot.texts())
    assert robot.set("ISMC_LAM_XY", 7.0) == 7.0


MODEL = ("MOT_J", "MOT_B", "MOT_K", "MOT_R", "MOT_L", "BAT_V_NOM", "MASS", "INERTIA", "LIM_A")
"""The model that feeds forward, and the ramp that brakes."""


@pytest.mark.parametrize("name", MODEL)
def test_the_model_and_the_ramp_stay_as_they_are_until_the_robot_is_disarmed(robot: Client, name: str) -> None:
    before = robot.armed().get(name)
    robot.texts()
    assert robot.set(name, 0.5 * before) == before
    assert any(name in text and "disarm first" in text for text in robot.texts())
    robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    robot.ticks(5)
    assert robot.set(name, 0.5 * before) == pytest.approx(0.5 * before)


def test_storing_while_armed_is_refused(robot: Client) -> None:
    assert robot.armed().command(STORAGE, SAVE) == mav.MAV_RESULT_DENIED


def test_the_system_id_changes_with_its_parameter(robot: Client) -> None:
    robot.mav.param_set_send(1, 1, b"SYS_ID", 7.0, mav.MAV_PARAM_TYPE_REAL32)
    assert robot.wait("PARAM_VALUE", param_id="SYS_ID").get_srcSystem() == 7


def test_a_ground_stations_number_is_refused_and_the_robot_goes_on_hearing(robot: Client) -> None:
    robot.armed()
    robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    robot.ticks(5)
    assert robot.set("SYS_ID", 255) == 1
    assert any("255: ground station" in text for text in robot.texts())
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, 1) == mav.MAV_RESULT_ACCEPTED


def test_stored_parameters_come_back_and_reset_forgets_them_in_use_only(tmp_path: Path) -> None:
    storage = storage_arguments(tmp_path / "eeprom")
    with lockstep_robot(*storage) as robot:
        default = robot.get("ISMC_LAM_XY")
        robot.set("ISMC_LAM_XY", 7.5)
        assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
        robot.set("ISMC_LAM_XY", 9.5)
    with lockstep_robot(*storage) as robot:
        assert robot.get("ISMC_LAM_XY") == 7.5
        assert robot.command(STORAGE, RESET) == mav.MAV_RESULT_ACCEPTED
        assert robot.get("ISMC_LAM_XY") == default
        assert robot.command(STORAGE, LOAD) == mav.MAV_RESULT_ACCEPTED
        assert robot.get("ISMC_LAM_XY") == 7.5


@pytest.mark.pc_only
@pytest.mark.parametrize("stored", [5, None], ids=["another stored", "nothing stored"])
@pytest.mark.parametrize("action", [LOAD, RESET])
def test_a_robot_keeps_its_system_id_when_all_values_are_replaced(
    tmp_path: Path, action: int, stored: int | None
) -> None:
    """Another robot on the line may have the number that it would go back to."""
    storage = storage_arguments(tmp_path / "eeprom")
    with lockstep_robot(*storage) as robot:
        own = robot.get("ISMC_LAM_XY")
        if stored is not None:
            rename(robot, stored)
            assert storage_command(robot, SAVE, stored) == mav.MAV_RESULT_ACCEPTED
        rename(robot, 7)
        robot.mav.param_set_send(7, 1, b"ISMC_LAM_XY", 7.5, mav.MAV_PARAM_TYPE_REAL32)
        assert storage_command(robot, action, 7) == mav.MAV_RESULT_ACCEPTED
        robot.mav.param_request_read_send(7, 1, b"ISMC_LAM_XY", -1)
        answer = robot.wait_for(lambda m: m.get_type() == "PARAM_VALUE" and m.param_value == own, "not replaced")
        assert answer.get_srcSystem() == 7
        assert storage_command(robot, SAVE, 7) == mav.MAV_RESULT_ACCEPTED
    with lockstep_robot(*storage) as robot:
        robot.mav.param_request_read_send(0, 0, b"SYS_ID", -1)
        assert robot.wait("PARAM_VALUE", param_id="SYS_ID").param_value == 7


def rename(robot: Client, system: int) -> None:
    robot.mav.param_set_send(0, 0, b"SYS_ID", system, mav.MAV_PARAM_TYPE_REAL32)
    assert robot.wait("PARAM_VALUE", param_id="SYS_ID").get_srcSystem() == system


def storage_command(robot: Client, action: int, system: int) -> int:
    robot.mav.command_long_send(system, 1, STORAGE, 0, action, *[0.0] * 6)
    return int(robot.wait("COMMAND_ACK", command=STORAGE).result)


@pytest.mark.pc_only
def test_a_power_cut_at_any_byte_of_a_save_leaves_the_set_before(tmp_path: Path) -> None:
    """The file is replaced by one that was written beside it: a cut leaves a part of that and the old file."""
    path = tmp_path / "eeprom"
    storage = storage_arguments(path)
    images = []
    with lockstep_robot(*storage) as robot:
        for gain in (5.0, 6.0):
            before = path.stat().st_ino if path.exists() else 0
            robot.set("ISMC_LAM_XY", gain)
            assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
            assert path.stat().st_ino != before, "written in place"
            images.append(path.read_bytes())
    old, new = images
    changed = [place for place, (a, b) in enumerate(zip(old, new, strict=True)) if a != b]
    for cut in (0, changed[0], changed[0] + 1, changed[-1], changed[-1] + 1, len(new)):
        path.write_bytes(old)
        (tmp_path / "eeprom.part").write_bytes(new[:cut])
        with lockstep_robot(*storage) as robot:
            assert robot.get("ISMC_LAM_XY") == 5.0, f"cut at byte {cut}"
            robot.set("ISMC_LAM_XY", 6.0)
            assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
        assert path.read_bytes() == new


def test_nonsense_in_the_memory_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "eeprom"
    path.write_bytes(bytes(range(256)) * 8)
    with lockstep_robot(*storage_arguments(path)) as robot:
        assert robot.get("ISMC_LAM_XY") == load_parameters(params_path()).defaults()["ISMC_LAM_XY"]
