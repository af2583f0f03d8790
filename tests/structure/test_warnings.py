# SPDX-License-Identifier: MIT
"""A compiler with a warning that ours do not have builds the project; in CI it is an error."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CMAKE = Path(sys.executable).parent / "cmake"
PROJECT = """cmake_minimum_required(VERSION 3.20)
project(warns LANGUAGES C)
include("{root}/cmake/flags.cmake")
add_library(warns OBJECT warns.c)
target_link_libraries(warns PRIVATE omni_flags omni_warnings)
"""


@pytest.mark.parametrize(("setting", "builds"), [(None, True), ("", True), ("0", True), ("1", False)])
def test_a_warning_is_an_error_only_where_it_is_asked_for(tmp_path: Path, setting: str | None, builds: bool) -> None:
    (tmp_path / "CMakeLists.txt").write_text(PROJECT.format(root=ROOT), encoding="utf-8")
    (tmp_path / "warns.c").write_text("int unused(int value) { return 0; }\n", encoding="utf-8")
    environment = {key: value for key, value in os.environ.items() if key != "OMNI_WERROR"}
    if setting is not None:
        environment["OMNI_WERROR"] = setting
    build = tmp_path / "build"
    subprocess.run([CMAKE, "-S", tmp_path, "-B", build], env=environment, check=True, capture_output=True)
    done = subprocess.run([CMAKE, "--build", build], env=environment, check=False, capture_output=True)
    assert (done.returncode == 0) == builds, done.stdout
    assert b"unused parameter" in done.stdout + done.stderr
