# SPDX-License-Identifier: MIT
"""The generated C tables say the same as the files, down to the last bit of a float."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from c_tables import float_literal
from git_version import NO_GIT, git_state, version_header
from omni_schema import as_float32, load_parameters, load_robot
from omniwheel import _core

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT / "shared"
TABLE = load_parameters(SHARED / "params.toml")
GENERATOR = SHARED / "generate" / "generate.py"
C = _core.lib


def text(pointer: object) -> str:
    return str(_core.ffi.string(pointer).decode())


def test_the_compiled_table_is_the_file() -> None:
    assert len(TABLE) == C.OMNI_PARAM_COUNT
    assert TABLE.schema_version == C.OMNI_PARAM_SCHEMA_VERSION
    assert TABLE.crc == C.omni_param_schema_crc
    for parameter in TABLE.parameters:
        row = C.omni_param_table[parameter.index]
        assert getattr(C, f"OMNI_PARAM_{parameter.name}") == parameter.index
        assert (text(row.name), text(row.unit)) == (parameter.name, parameter.unit)
        assert (row.minimum, row.maximum, row.initial) == (parameter.minimum, parameter.maximum, parameter.default)
        assert bool(row.locked_while_armed) == parameter.disarmed_only
        assert row.storage_key == parameter.storage_key
        assert (row.kind == C.OMNI_PARAM_REAL) == (parameter.kind == "real")
        for label, number in parameter.values.items():
            assert getattr(C, f"OMNI_{parameter.name}_{label.upper()}") == number


def test_the_compiled_presets_are_the_robot_files() -> None:
    robots = [load_robot(path, TABLE) for path in sorted((SHARED / "robots").glob("*.toml"))]
    robots_in_c = {
        text(C.omni_builtin_robots[i].name): C.omni_builtin_robots[i] for i in range(C.omni_builtin_robot_count)
    }
    assert set(robots_in_c) == {robot.name for robot in robots}
    for robot in robots:
        assert list(robots_in_c[robot.name].values) == list(robot.parameter_values().values())


@given(st.floats(-(2.0**120), 2.0**120, width=32))  # the schema reader refuses what a float cannot hold
def test_float_literals_keep_every_bit(value: float) -> None:
    literal = float_literal(value)
    assert literal.endswith("f")
    assert as_float32(float(literal[:-1])) == value


def run_generator(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(GENERATOR), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def test_a_users_robot_file_becomes_a_preset(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text((SHARED / "robots" / "three_wheel.toml").read_text().replace('"three_wheel"', '"mine"'))
    done = run_generator("--out", tmp_path / "out", "--part", "tables", "--robot", mine)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert '.name = "mine"' in (tmp_path / "out" / "src" / "robots_gen.c").read_text()


def test_a_broken_robot_file_stops_the_build_with_its_reason(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('[robot]\nname = "mine"\n[geometry]\nwheels = 7\n')
    done = run_generator("--out", tmp_path / "out", "--part", "tables", "--robot", mine)
    assert done.returncode == 1
    assert "mine.toml: geometry.wheels: is 7.0; allowed is a whole number from 3 to 4" in done.stderr
    assert not (tmp_path / "out").exists()


def test_two_robots_of_one_name_are_refused(tmp_path: Path) -> None:
    three = SHARED / "robots" / "three_wheel.toml"
    again = tmp_path / "again.toml"
    shutil.copyfile(three, again)
    done = run_generator("--out", tmp_path / "out", "--part", "tables", "--robot", three, "--robot", again)
    assert done.returncode == 1
    assert "robot.name" in done.stderr


def test_an_unknown_part_is_refused(tmp_path: Path) -> None:
    done = run_generator("--out", tmp_path, "--part", "table")
    assert done.returncode == 2
    assert "did you mean tables?" in done.stderr


def test_without_git_the_version_is_still_written(tmp_path: Path) -> None:
    assert git_state(tmp_path) == (NO_GIT, False)
    header = version_header("1.2.3", NO_GIT, False)
    assert "#define OMNI_VERSION_MINOR 2" in header
    assert "#define OMNI_GIT_DIRTY 0" in header


@pytest.mark.parametrize("version", ["", "1.2", "one.two.three"])
def test_a_version_needs_three_numbers(version: str) -> None:
    with pytest.raises(ValueError, match=r"major\.minor\.patch"):
        version_header(version, NO_GIT, False)
