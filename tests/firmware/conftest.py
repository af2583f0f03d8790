# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from tests.arm import need_emulated_firmware
from tests.firmware.client import BOARDS, Client, lockstep_robot, on_board

ON_ALL_BOARDS = (
    "test_clock_wraps",
    "test_commands",
    "test_damaged_storage",
    "test_driver",
    "test_estop",
    "test_i2c_scan",
    "test_link",
    "test_motor_pins",
    "test_not_finite",
    "test_parameters",
    "test_refusals",
    "test_stations",
    "test_stop_path",
    "test_trial",
)
"""The modules whose tests must hold for the firmware on any processor; ``pc_only`` tests are about the process."""
NIGHTLY_ELSEWHERE = ("test_stations", "test_trial")
"""Those that wait for silences, which take long where every instruction is emulated: only the PC's run each time."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    module = metafunc.module.__name__.rpartition(".")[2]
    everywhere = module in ON_ALL_BOARDS
    alone = metafunc.definition.get_closest_marker("pc_only") is not None or "OMNI_SANITIZED" in os.environ
    marks = [pytest.mark.nightly if module in NIGHTLY_ELSEWHERE else pytest.mark.full]
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
