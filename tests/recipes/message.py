# SPDX-License-Identifier: MIT
"""docs/how-to-add/message.md, followed word by word, gives a message that the robot fills and the host knows."""

from __future__ import annotations

import json
import re
import subprocess
import sys

from tests.native import generated_dir
from tests.recipes.drive import OWN_PACKAGES, run_program
from tests.recipes.recipe import Scratch

_MONITOR = (
    OWN_PACKAGES
    + """
from omniwheel import FirmwareProcess
from omni.cli import app
from typer.testing import CliRunner
with FirmwareProcess("three_wheel") as process:
    words = ["monitor", "--message", "OMNI_SLIP", "--json", "--link", process.urls[0]]
    print(json.dumps(json.loads(CliRunner().invoke(app, words).stdout)))
"""
)


def check(copy: Scratch) -> None:
    """The generator takes both files, the firmware compiles and sends it, and the host has the class."""
    out = copy.root / "build" / "message"
    program = [sys.executable, str(copy.root / "shared/generate/generate.py"), "--out", str(out)]
    parts = ["--part", "tables", "--part", "mavlink-c", "--part", "mavlink-python"]
    subprocess.run([*program, *parts], check=True, timeout=120)
    classes = (out / "python" / "telemetry_gen.py").read_text(encoding="utf-8")
    assert re.search(r"class Slip\(Telemetry\):.*residual_m_s: float", classes, re.DOTALL)
    assert "MAVLink_omni_slip_message" in (out / "dialects" / "omni.py").read_text(encoding="utf-8")
    folders = [copy.root / "firmware", copy.root / "shared/core/include", out / "include", generated_dir() / "include"]
    includes = [f"-I{folder}" for folder in folders] + ["-isystem", str(out / "mavlink")]
    source = str(copy.root / "firmware/app/services/reports.cpp")
    words = ["g++", "-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", *includes, source]
    subprocess.run(words, check=True, timeout=120)
    assert set(json.loads(run_program(copy, _MONITOR))["OMNI_SLIP"]) == {"time_boot_ms", "residual"}
