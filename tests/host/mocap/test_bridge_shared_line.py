# SPDX-License-Identifier: MIT
"""``omni mocap bridge`` where two real robots share a line: a fix has no target, so it moves none but the only one."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.host.shared_line import SharedLine, shared_line
from tests.waiting import LONGEST_S

FIRST, SECOND = 7, 9
POSE = (0.006, 0.004, 0.0)
"""Near enough to the start: a robot that stands there does not believe a fix far away."""


@pytest.fixture(scope="module")
def line() -> Iterator[SharedLine]:
    with shared_line((FIRST, SECOND)) as found:
        yield found


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A robot that stands at POSE for two seconds."""
    x, y, theta = POSE
    rows = [f"{0.1 * n:.1f},{0.1 * n:.1f},{n},{x},{y},{theta}" for n in range(20)]
    path = tmp_path / "still.csv"
    path.write_text("\n".join(["taken_s,arrived_s,frame,x_m,y_m,theta_rad", *rows]) + "\n")
    return path


def bridge(line: SharedLine, recording: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = ["mocap", "bridge", "--source", f"recorded:{recording}", "--link", line.url, "--json", *words]
    return subprocess.run(
        [sys.executable, "-m", "omni", *command], capture_output=True, text=True, check=False, timeout=LONGEST_S
    )


@pytest.mark.full
@pytest.mark.parametrize("kind", ["compact", "vicon"])
@pytest.mark.parametrize("chosen", [None, FIRST, SECOND])
def test_a_bridge_beside_another_robot_moves_neither_and_names_both(
    line: SharedLine, recording: Path, chosen: int | None, kind: str
) -> None:
    line.connected = {FIRST, SECOND}
    before = {system: line.pose_of(system) for system in line.observers}
    words = ["--as", kind] + ([] if chosen is None else ["--system", str(chosen)])
    refused = bridge(line, recording, *words)
    assert refused.returncode not in (0, -9), refused.stdout
    error = json.loads(refused.stdout)["error"]
    assert error["type"] == "SeveralRobotsError"
    assert str(FIRST) in error["message"]
    assert str(SECOND) in error["message"]
    assert {system: line.pose_of(system) for system in line.observers} == before


@pytest.mark.full
@pytest.mark.parametrize("chosen", [FIRST, SECOND])
def test_a_bridge_moves_the_robot_that_it_is_alone_with(line: SharedLine, recording: Path, chosen: int) -> None:
    other = FIRST + SECOND - chosen
    line.connected = {chosen}
    before = line.pose_of(other)
    done = bridge(line, recording, "--system", str(chosen))
    assert done.returncode == 0, done.stderr
    x, y, _ = line.pose_of(chosen)
    assert x > 0.5 * POSE[0]
    assert y > 0.5 * POSE[1]
    assert line.pose_of(other) == before
    line.connected = {other}
    missed = bridge(line, recording, "--system", str(chosen), "--timeout", "2")
    assert missed.returncode not in (0, -9)
    assert line.pose_of(other) == before
