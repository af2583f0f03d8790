# SPDX-License-Identifier: MIT
"""The examples of the pages about other simulators run as they stand, with pymavlink and without this package."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from omniwheel import FirmwareProcess
from omniwheel.parameter_file import format_value
from tests.native import ROOT

PAGE = ROOT / "docs" / "guides" / "external-worlds.md"
C_PAGE = PAGE.with_name("external-worlds-c.md")
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


def firmware_of(page: str, folder: Path) -> tuple[FirmwareProcess, Path]:
    """Return the firmware with the page's circle, and the file of its parameters."""
    firmware = FirmwareProcess("three_wheel", parameters=circle_of(page), lockstep=True)
    lines = [f"{name}={format_value(None, value)}" for name, value in firmware.values.items()]
    (folder / "robot.params").write_text("\n".join(lines), encoding="utf-8")
    return firmware, folder / "robot.params"


def check_circle(command: list[str], folder: Path) -> None:
    """Run an example and read what it says of its path."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    said = re.search(r"path driven in ([\d.]+) s, position RMSE ([\d.]+) mm", done.stdout)
    assert said is not None, done.stdout
    assert 7.0 < float(said[1]) < 60.0
    assert 0.0 < float(said[2]) < 3.0


def test_the_example_drives_its_circle(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    (tmp_path / "circle.py").write_text(BLOCKED + code_of(page), encoding="utf-8")
    firmware, parameters = firmware_of(page, tmp_path)
    with firmware:
        host, port = firmware.urls[0].removeprefix("tcp:").split(":")
        xml = ROOT / "shared" / "link" / "omni.xml"
        check_circle([sys.executable, "circle.py", host, port, str(xml), parameters.name], tmp_path)


def test_the_example_in_c_is_built_as_its_page_says_and_drives_its_circle(tmp_path: Path) -> None:
    page = C_PAGE.read_text(encoding="utf-8")
    program = re.search(r"```c\n(.*?)```", page, re.DOTALL)
    build = re.search(r"```sh\npip install pymavlink\n(.*?)```", page, re.DOTALL)
    assert program is not None
    assert build is not None
    (tmp_path / "circle.c").write_text(program[1], encoding="utf-8")
    shutil.copy(ROOT / "shared" / "link" / "omni.xml", tmp_path)
    commands = build[1].replace("cc -std", "cc -Wall -Wextra -Werror -std")
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-ec", commands], cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    firmware, parameters = firmware_of(page, tmp_path)
    with firmware:
        host, port = firmware.urls[0].removeprefix("tcp:").split(":")
        check_circle(["./circle", host, port, parameters.name], tmp_path)


def test_omni_xml_compiles_alone(tmp_path: Path) -> None:
    xml = ROOT / "shared" / "link" / "omni.xml"
    command = [sys.executable, "-m", "pymavlink.tools.mavgen", "--lang", "C", "--wire-protocol", "2.0", "--output"]
    done = subprocess.run([*command, str(tmp_path), str(xml)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (tmp_path / "alone.c").write_text('#include "mavlink.h"\nint main(void) { return 0; }\n', encoding="utf-8")
    built = ["cc", "-std=c99", "-isystem", str(tmp_path / "omni"), str(tmp_path / "alone.c"), "-o", str(tmp_path / "a")]
    subprocess.run(built, check=True)
