# SPDX-License-Identifier: MIT
"""What a build was made from: `omni` warns when a source is newer, and the list of inputs is complete."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.build_inputs import build_inputs
from omniwheel.build_record import BuildRecord, load_record
from tests.native import ROOT

BEGAN_S = 1_700_000_000.0


@pytest.fixture
def record(tmp_path: Path) -> BuildRecord:
    """Return the record of a build of a small tree with a controller outside it, all of it older than the build."""
    tree, controller = tmp_path / "tree", tmp_path / "my law"
    names = ("CMakeLists.txt", "pyproject.toml", "shared/params.toml", "shared/core/src/a.c", "firmware/app/a.cpp")
    more = ("shared/generate/generate.py", "host/omniwheel/robot.py", "hil_sim/scenarios/demo.toml")
    for path in (*(tree / name for name in (*names, *more)), *(controller / n for n in ("law.c", "parameters.toml"))):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        os.utime(path, (BEGAN_S - 1.0, BEGAN_S - 1.0))
    return BuildRecord(str(tree), BEGAN_S, "law", str(controller))


def touch(path: Path) -> None:
    os.utime(path, (BEGAN_S + 1.0, BEGAN_S + 1.0))


@pytest.mark.parametrize(
    "name",
    [
        "pyproject.toml",
        "shared/params.toml",
        "shared/core/src/a.c",
        "firmware/app/a.cpp",
        "shared/generate/generate.py",
    ],
)
def test_a_source_that_is_newer_than_the_build_is_found(record: BuildRecord, name: str) -> None:
    assert record.newer_inputs() == []
    touch(Path(record.source) / name)
    assert record.newer_inputs() == [name]


@pytest.mark.parametrize("name", ["host/omniwheel/robot.py", "hil_sim/scenarios/demo.toml"])
def test_what_is_used_where_it_lies_needs_no_build(record: BuildRecord, name: str) -> None:
    touch(Path(record.source) / name)
    assert record.newer_inputs() == []


@pytest.mark.parametrize("name", ["law.c", "parameters.toml"])
def test_the_folder_of_a_controller_counts_and_the_remedy_names_it(record: BuildRecord, name: str) -> None:
    path = Path(record.controller_folder) / name
    touch(path)
    assert record.newer_inputs() == [str(path)]
    assert record.controller_folder in record.remedy
    assert replace(record, controller="").newer_inputs() == []


def test_a_wheel_has_no_sources_to_compare(record: BuildRecord) -> None:
    touch(Path(record.source) / "shared/params.toml")
    assert replace(record, source="").newer_inputs() == []


def test_omni_warns_once_and_works_all_the_same(record: BuildRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omni.cli.group.load_record", lambda: record)
    quiet = CliRunner().invoke(app, ["robots", "--json"])
    assert (quiet.exit_code, quiet.stderr) == (0, "")
    touch(Path(record.source) / "shared/params.toml")
    warned = CliRunner().invoke(app, ["robots", "--json"], env={"COLUMNS": "400"})
    assert (warned.exit_code, warned.stdout) == (0, quiet.stdout)
    assert "shared/params.toml" in warned.stderr
    assert warned.stderr.count("make setup") == 1


def test_the_version_names_a_controller_outside_the_tree(record: BuildRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omniwheel.build_record.load_record", lambda: record)
    assert f"controller law from {record.controller_folder}" in CliRunner().invoke(app, ["--version"]).stdout
    monkeypatch.setattr("omniwheel.build_record.load_record", lambda: None)
    assert "controller" not in CliRunner().invoke(app, ["--version"]).stdout


def test_every_file_of_the_tree_that_the_build_read_is_an_input() -> None:
    """Ninja says what it read, headers included, so that no kind of source can be forgotten."""
    record = load_record()
    assert record is not None
    (build,) = [path.parent for path in (ROOT / "build").glob("cp*/build.ninja")]
    ninja = str(Path(sys.executable).with_name("ninja"))
    named = subprocess.run([ninja, "-C", str(build), "-t", "inputs", "all"], capture_output=True, text=True, check=True)
    headers = subprocess.run([ninja, "-C", str(build), "-t", "deps"], capture_output=True, text=True, check=True)
    paths = {Path(os.path.abspath(build / line.strip())) for line in f"{named.stdout}\n{headers.stdout}".splitlines()}
    read = {path.relative_to(ROOT).as_posix() for path in paths if path.is_file() and path.is_relative_to(ROOT)}
    read = {name for name in read if not name.startswith(("build/", ".venv"))}
    assert "shared/core/include/omni/robot.h" in read
    assert read <= set(build_inputs(str(ROOT)))
