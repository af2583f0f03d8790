# SPDX-License-Identifier: MIT
"""The example of the page about other simulators runs as it stands, with pymavlink and without this package."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from omniwheel import FirmwareProcess
from omniwheel.parameter_file import format_value
from tests.native import ROOT

PAGE = ROOT / "docs" / "guides" / "external-worlds.md"
BLOCKED = "import sys\nsys.modules.update(dict.fromkeys(('omniwheel', 'hil_sim', 'omni_schema', 'numpy')))\n"
"""Whoever imports one of these gets an ImportError."""


def code_of(page: str) -> str:
    """Return the last Python block of the page."""
    return str(re.findall(r"```python\n(.*?)```", page, re.DOTALL)[-1])


def circle_of(page: str) -> dict[str, float]:
    """Return the parameters that the page adds to the robot's."""
    line = re.search(r"printf '([^']+)'", page)
    assert line is not None
    pairs = (word.split("=") for word in line[1].split("\\n") if word)
    return {name: float(value) for name, value in pairs}


def test_the_example_drives_its_circle(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    (tmp_path / "circle.py").write_text(BLOCKED + code_of(page), encoding="utf-8")
    with FirmwareProcess("three_wheel", parameters=circle_of(page), lockstep=True) as firmware:
        lines = [f"{name}={format_value(None, value)}" for name, value in firmware.values.items()]
        (tmp_path / "robot.params").write_text("\n".join(lines), encoding="utf-8")
        host, port = firmware.urls[0].removeprefix("tcp:").split(":")
        xml = ROOT / "shared" / "link" / "omni.xml"
        done = subprocess.run(
            [sys.executable, "circle.py", host, port, str(xml), "robot.params"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    said = re.search(r"path driven in ([\d.]+) s, position RMSE ([\d.]+) mm", done.stdout)
    assert said is not None, done.stdout
    assert 7.0 < float(said[1]) < 60.0
    assert float(said[2]) < 3.0
