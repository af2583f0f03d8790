# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
from collections.abc import Iterator
from fnmatch import fnmatchcase

import pytest

from tests.arm import need_emulated_firmware
from tests.firmware.client import BOARDS, Client, lockstep_robot, on_board

ALL = "test_*"
ON_ALL_BOARDS: dict[str, tuple[str, ...]] = {
    "test_clock_wraps": (ALL,),
    "test_commands": (
        "test_a_numbered_command_gets_a_receipt_of_what_was_asked",
        "test_body_velocity_drives_the_wheels_in_our_frame",
        "test_manual_control_turns_right_with_the_stick",
        "test_duties_reach_the_bridges_while_they_are_fresh",
        "test_a_sample_holds_what_identification_needs",
        "test_a_vicon_fix_pulls_the_estimate_towards_it",
        "test_waypoints_have_no_gaps",
    ),
    "test_damaged_storage": (
        "test_an_undamaged_memory_gives_the_set_without_a_word",
        "test_a_load_of_a_damaged_set_fails_and_changes_nothing",
    ),
    "test_driver": (
        "test_moved_wires_are_driven_on_their_new_channels",
        "test_the_answer_says_duty_and_coast_of_each_wheel_as_its_bytes_do",
    ),
    "test_estop": ("test_it_outlives_the_program_and_its_release_does_too",),
    "test_i2c_scan": ("test_a_scan_finds_who_is_there",),
    "test_link": (ALL,),
    "test_motor_pins": ("test_duties_come_out_at_the_pins_and_nothing_at_the_bus",),
    "test_not_finite": (ALL,),
    "test_parameters": (ALL,),
    "test_refusals": ("test_the_list_of_missions_is_empty",),
    "test_stations": (),
    "test_stop_path": ("test_of_a_backlog_it_is_the_newest_that_are_used",),
    "test_trial": (),
}
"""The modules whose tests must hold for the firmware on any processor; ``pc_only`` tests are about the PC's build.

Of each, the tests that run on the emulated processor before a merge: those of numbers, layouts and bytes, which a
processor and its compiler can change. The others are about rules, which the PC's firmware follows or not as the
emulated one does; there they run nightly. tests/emulated/planted.py holds that nothing escapes by this.
"""


def runs_before_a_merge(module: str, test: str) -> bool:
    """Return whether a test of these modules runs on the emulated processor in each run of CI."""
    return any(fnmatchcase(test, pattern) for pattern in ON_ALL_BOARDS.get(module, ()))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    module = metafunc.module.__name__.rpartition(".")[2]
    everywhere = module in ON_ALL_BOARDS
    alone = metafunc.definition.get_closest_marker("pc_only") is not None or "OMNI_SANITIZED" in os.environ
    each_time = runs_before_a_merge(module, metafunc.definition.originalname)
    marks = [pytest.mark.full if each_time else pytest.mark.nightly]
    others = [pytest.param(name, marks=marks) for name in BOARDS[1:]] if everywhere and not alone else []
    metafunc.parametrize("board", [BOARDS[0], *others], indirect=True, scope="module")


@pytest.fixture(autouse=True, scope="module")
def board(request: pytest.FixtureRequest) -> Iterator[str]:
    """What the firmware runs on."""
    name = str(request.param)
    if name != BOARDS[0]:
        need_emulated_firmware()
    with on_board(name):
        yield name


@pytest.fixture
def robot(board: str) -> Iterator[Client]:
    """A fresh three-wheel robot in lockstep."""
    with lockstep_robot() as client:
        yield client
