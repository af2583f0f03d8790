# SPDX-License-Identifier: MIT
"""The commands that run the flashed image, typed as a user types them, on the emulated Teensy and on QEMU's board."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

import omniwheel
from omniwheel.firmware_process import first_ready_line
from tests.waiting import wait_until

OMNI = (sys.executable, "-m", "omni")
OF_THE_RUN = ("realtime_factor", "firmware_version", "wall_s", "folder")
"""What differs between two runs that drove the same."""


def run(folder: Path, *options: str) -> dict[str, Any]:
    """Return the JSON of a second of ``omni run demo``, without what differs from run to run."""
    words = [*OMNI, "run", "demo", "--duration", "1", "--json", "--out", str(folder), *options]
    done = subprocess.run(words, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert (Path(said["folder"]) / "telemetry.tlog").stat().st_size > 5_000
    return {name: value for name, value in said.items() if name not in OF_THE_RUN}


def test_run_gives_the_same_figures_on_the_image(image: Path, tmp_path: Path) -> None:
    assert run(tmp_path / "image", "--image", str(image)) == run(tmp_path / "pc")


@pytest.mark.needs("qemu")
def test_run_gives_the_same_figures_on_the_emulated_cortex_m7(tmp_path: Path) -> None:
    assert run(tmp_path / "qemu", "--board", "cortex-m7") == run(tmp_path / "pc")


def test_sitl_runs_the_image_as_a_robot_that_a_program_drives(image: Path, tmp_path: Path) -> None:
    words = [*OMNI, "sitl", "--image", str(image), "--link", "usb=tcp:127.0.0.1:0", "--json", "--end-with-stdin"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=tmp_path) as process:
        try:
            links = first_ready_line(process)
            assert links is not None
            with omniwheel.connect(links[0]) as robot:
                robot.arm()
                robot.velocity(0.1, 0.0, 0.0)
                wait_until(lambda: robot.pose.x > 0.02, "the robot moves")
                robot.stop()
                robot.disarm()
                assert abs(robot.pose.y) < 0.01
            assert process.stdin is not None
            process.stdin.close()
            assert process.wait(timeout=10.0) == 0
        finally:
            process.kill()
