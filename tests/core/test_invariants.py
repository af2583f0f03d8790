# SPDX-License-Identifier: MIT
"""Invariants of the core: checked where OMNI_ASSERTS is defined, and nothing at all elsewhere."""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.native import ROOT, WARNINGS, _compiler, core_archive, generated_dir, kept_library

# A safety state that there is none of: no input can bring it about.
PROGRAM = """
#include "omni/omni.h"
#include <stdlib.h>
static omni_robot_t robot;
static omni_robot_config_t config;
int main(int count, char **words) {
    omni_inputs_t inputs = {0};
    omni_outputs_t outputs;
    int32_t bad;
    if (omni_robot_config(&config, omni_builtin_robots[0].values, &bad) != OMNI_OK) {
        return 2;
    }
    omni_robot_init(&robot, &config);
    robot.supervisor.state = (omni_safety_state_t)atoi(words[count - 1]);
    inputs.time_us = 1000;
    inputs.events = OMNI_EVENT_DISARM;
    omni_robot_tick(&robot, &inputs, &outputs);
    return outputs.drive ? 3 : 0;
}
"""


def test_the_core_that_the_tests_drive_checks_them() -> None:
    words = """
from tests.core.test_robot import Bench, lib
bench = Bench()
bench.tick()
bench.robot.supervisor.state = 77
bench.tick(lib.OMNI_EVENT_DISARM)
"""
    done = subprocess.run([sys.executable, "-c", words], cwd=ROOT, capture_output=True, text=True, check=False)
    trapped = done.returncode in (-signal.SIGILL, -signal.SIGTRAP, -signal.SIGABRT)
    assert trapped or "DEADLYSIGNAL" in done.stderr, done.stderr  # the sanitizers say it in their own way


def built(folder: Path, core: Path) -> Path:
    """Build the program in a folder with this core."""
    source = folder / "program.c"
    source.write_text(PROGRAM)
    program = folder / "program"
    folders = [f"-I{path / 'include'}" for path in (ROOT / "shared" / "core", generated_dir())]
    words = [*_compiler("CC", "cc"), "-std=c99", *WARNINGS, *folders, str(source), str(core), "-o", str(program)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{shlex.join(done.args)}\n{done.stderr}"
    return program


def exit_code(program: Path, state: int) -> int:
    return subprocess.run([str(program), str(state)], check=False).returncode


@pytest.mark.full
@pytest.mark.own_build
def test_what_no_input_can_bring_about_ends_the_program_if_it_is_asked_to(tmp_path: Path) -> None:
    program = built(tmp_path, core_archive())
    assert exit_code(program, 77) in (-signal.SIGILL, -signal.SIGTRAP, -signal.SIGABRT)
    assert exit_code(program, 1) == 0


@pytest.mark.full
@pytest.mark.own_build
def test_it_is_not_looked_for_otherwise(tmp_path: Path) -> None:
    sources = [*sorted((ROOT / "shared" / "core" / "src").glob("*/*.c")), *(generated_dir() / "src").glob("*.c")]
    core = kept_library("core_without_asserts", sources, flags=["-fno-math-errno"], static=True)
    assert exit_code(built(tmp_path, core), 77) == 0
