# SPDX-License-Identifier: MIT
"""docs/how-to-add/board.md, followed word by word, gives a board that drives over its own link and lets a stop win."""

from __future__ import annotations

import subprocess

from tests.recipes.drive import ESTOP_AT_5_S, drive, scenario
from tests.recipes.recipe import Scratch


def check(copy: Scratch) -> None:
    """Drive with the board's program in the simulated world, over the pseudo-terminal that it names."""
    program = copy.build("omni_firmware_terminal") / "firmware" / "omni-firmware-terminal"
    with subprocess.Popen([program], stdout=subprocess.PIPE, text=True) as board:
        try:
            assert board.stdout is not None
            link = board.stdout.readline().strip()
            run = drive(copy, scenario(), firmware=True, link=link)
            assert run["faults"] == []
            assert run["farthest_m"] > 0.2
            assert run["rmse_m"] < 0.005
            stopped = drive(copy, scenario(more=ESTOP_AT_5_S), firmware=True, link=link)
            assert 0.1 < stopped["farthest_m"] < run["farthest_m"]
            assert stopped["last_m"] == 0.0
        finally:
            board.kill()
