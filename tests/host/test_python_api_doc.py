# SPDX-License-Identifier: MIT
"""The programs of docs/guides/python-api.md, run as they stand against `omni sitl`."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from omniwheel.robot import connect
from tests.hub.parts import omni

DOCUMENT = Path(__file__).parents[2] / "docs" / "guides" / "python-api.md"
DOCUMENTED_URL = "tcp:127.0.0.1:5760"
BLOCKS = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.full
@pytest.mark.parametrize("block", range(len(BLOCKS)))
def test_the_documented_program_works(block: int, tmp_path: Path) -> None:
    with omni("sitl", "--port", "0", "--json") as (_, ready):
        url = ready["links"][0]
        # In simulated time, so that it does not matter how busy the computer is.
        program = BLOCKS[block].replace(DOCUMENTED_URL, url).replace("omniwheel.simulate", "omniwheel.sync.simulate")
        environment = {**os.environ, "MAVLINK20": "1", "MPLBACKEND": "agg"}
        result = subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            env=environment,
            cwd=tmp_path,
        )
        assert result.returncode == 0, result.stderr
        assert result.stdout
        if DOCUMENTED_URL not in BLOCKS[block]:
            assert (tmp_path / "square.csv").is_file()
            return
        with connect(url) as robot:
            assert robot.parameters["ISMC_LAM_XY"] == 15.0
            assert not robot.status.armed


def test_three_programs_use_this_package_and_one_plain_pymavlink() -> None:
    assert ["omniwheel" in block for block in BLOCKS] == [True, True, True, False]
