# SPDX-License-Identifier: MIT
"""The examples of the pages about other simulators run as they stand, with pymavlink and without this package."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.native import ROOT

PAGE = ROOT / "docs" / "guides" / "external-worlds.md"
EXAMPLES = ROOT / "examples" / "external_world"
BLOCKED = "import sys\nsys.modules.update(dict.fromkeys(('omniwheel', 'hil_sim', 'omni_schema', 'numpy')))\n"
"""Importing one of these is an ImportError."""


def shell_of(page: str, words: str) -> str:
    """Return the page's shell block that has these words."""
    return next(str(block) for block in re.findall(r"```sh\n(.*?)```", page, re.DOTALL) if words in block)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def type_in(block: str, folder: Path) -> str:
    """Type a block of a page into a shell in this folder, at a port that is free; return what it prints."""
    place = Path(sys.executable).parent
    block = "\n".join(line for line in block.splitlines() if not line.startswith("pip install"))
    with subprocess.Popen(
        ["bash", "-e", "-c", block.replace("5760", str(free_port()))], cwd=folder,
        env={**os.environ, "PATH": f"{place}:{os.environ['PATH']}"}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    ) as shell:  # fmt: skip
        try:
            said, trouble = shell.communicate(timeout=900)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGKILL)
    assert shell.returncode == 0, said + trouble
    return said


def promised(page: str) -> str:
    """Return what the page says that its example ends with."""
    return str(re.findall(r"```text\n(path driven in .*?)\n```", page)[0])


@pytest.mark.full
def test_the_example_is_typed_as_it_stands_and_drives_its_circle(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    (tmp_path / "circle.py").write_text(
        BLOCKED + EXAMPLES.joinpath("circle.py").read_text(encoding="utf-8"), encoding="utf-8"
    )
    assert type_in(shell_of(page, "python circle.py"), tmp_path).splitlines()[-1] == promised(page)


def test_without_a_firmware_the_example_says_so(tmp_path: Path) -> None:
    code = EXAMPLES.joinpath("circle.py").read_text(encoding="utf-8").replace("range(100)", "range(2)")
    (tmp_path / "circle.py").write_text(code, encoding="utf-8")
    (tmp_path / "robot.params").write_text("SYS_ID=1\n", encoding="utf-8")
    xml = str(ROOT / "shared" / "link" / "omni.xml")
    words = [sys.executable, "circle.py", "127.0.0.1", str(free_port()), xml, "robot.params"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "start the firmware first" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.full
def test_the_example_in_c_is_typed_as_it_stands_and_drives_its_circle(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    shutil.copy(EXAMPLES / "circle.c", tmp_path)
    build = shell_of(page, "cc -std").replace("cc -std", "cc -Wall -Wextra -Werror -std")
    type_in(build, tmp_path)
    run = shell_of(page, "python circle.py")
    run = re.sub(r"python circle.py (\S+ \S+) omni.xml", r"./circle \1", run)
    assert type_in(run, tmp_path).splitlines()[-1] == promised(page)


@pytest.mark.full
def test_the_class_of_the_page_is_a_world(tmp_path: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    world, use = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[:2]
    (tmp_path / "my_simulator.py").write_text(world, encoding="utf-8")
    type_in(shell_of(page, "omni run demo --world"), tmp_path)
    folder = next((tmp_path / "runs").iterdir())
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["world"]["external"] == "my_simulator:MyWorld"
    assert summary["duration_s"] == pytest.approx(20.0, abs=0.2)
    assert 0.0 < summary["rmse"]["position_m"] < 2e-3
    (tmp_path / "use.py").write_text(use, encoding="utf-8")
    done = subprocess.run([sys.executable, "use.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("5101 ")


def test_omni_xml_compiles_alone(tmp_path: Path) -> None:
    xml = ROOT / "shared" / "link" / "omni.xml"
    command = [sys.executable, "-m", "pymavlink.tools.mavgen", "--lang", "C", "--wire-protocol", "2.0", "--output"]
    done = subprocess.run([*command, str(tmp_path), str(xml)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (tmp_path / "alone.c").write_text('#include "mavlink.h"\nint main(void) { return 0; }\n', encoding="utf-8")
    built = ["cc", "-std=c99", "-isystem", str(tmp_path / "omni"), str(tmp_path / "alone.c"), "-o", str(tmp_path / "a")]
    subprocess.run(built, check=True)
