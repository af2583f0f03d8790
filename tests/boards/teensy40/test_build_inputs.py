# SPDX-License-Identifier: MIT
"""The script that PlatformIO runs before it builds: what it reads, when it generates anew, whom it refuses."""

from __future__ import annotations

import shutil
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.boards.teensy40.platformio_module import FOLDER, load
from tests.native import ROOT

inputs = load("build_inputs")
WATCH = """
import runpy, sys
del sys.argv[0]
opened = set()
sys.addaudithook(lambda what, args: opened.add(str(args[0])) if what == "open" else None)
try:
    runpy.run_path(sys.argv[0], run_name="__main__")
finally:
    print(*opened, sep="\\n")
"""
"""Runs a script and prints what it opened."""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a copy of what a build generates code from."""
    skip = shutil.ignore_patterns("__pycache__")
    for name in ("link", "generate", "robots", "core"):
        shutil.copytree(ROOT / "shared" / name, tmp_path / "shared" / name, ignore=skip)
    for name in ("params.toml", "world.toml"):
        shutil.copy(ROOT / "shared" / name, tmp_path / "shared" / name)
    return tmp_path


@pytest.fixture
def robot(root: Path) -> Path:
    return root / "shared" / "robots" / "three_wheel.toml"


def test_a_folder_beside_the_dialect_is_no_file_to_read(root: Path, robot: Path) -> None:
    before = inputs.fingerprint(root, robot)
    (root / "shared" / "link" / "empty_folder" / "another").mkdir(parents=True)
    assert inputs.fingerprint(root, robot) == before


@pytest.mark.parametrize(
    "name",
    [
        "params.toml",
        "world.toml",
        "robots/three_wheel.toml",
        "link/omni.xml",
        "link/standard.toml",
        "link/include/omni_link/poll_backoff.h",
        "generate/generate.py",
        "generate/mavlink_dialect.py",
        "generate/omni_schema/robots.py",
    ],
)
def test_a_change_of_any_input_is_seen(root: Path, robot: Path, name: str) -> None:
    before = inputs.fingerprint(root, robot)
    path = root / "shared" / name
    path.write_bytes(path.read_bytes() + b"\n")
    assert inputs.fingerprint(root, robot) != before


def test_a_controller_outside_the_tree_is_read_and_a_change_of_it_is_seen(root: Path, robot: Path) -> None:
    folder = root / "my law"
    folder.mkdir()
    (folder / "law.c").touch()
    assert inputs.controller_folder(root, {}) is None
    assert inputs.controller_folder(root, {"OMNI_CONTROLLER": str(folder)}) == folder
    states = [inputs.fingerprint(root, robot), inputs.fingerprint(root, robot, folder)]
    for name in ("law.c", "parameters.toml"):
        (folder / name).write_text("changed", encoding="utf-8")
        states.append(inputs.fingerprint(root, robot, folder))
    assert len(set(states)) == len(states)


def test_another_robot_and_a_new_file_of_the_dialect_are_seen(root: Path, robot: Path) -> None:
    before = inputs.fingerprint(root, robot)
    assert inputs.fingerprint(root, root / "shared" / "robots" / "four_wheel.toml") != before
    (root / "shared" / "link" / "more.xml").touch()
    assert inputs.fingerprint(root, robot) != before


@pytest.mark.full
def test_every_file_that_the_generator_opens_is_an_input(root: Path, robot: Path, tmp_path: Path) -> None:
    """Python itself says what it opens, so that a schema added later cannot be forgotten."""
    shutil.copy(ROOT / "pyproject.toml", root)
    generator = root / "shared" / "generate" / "generate.py"
    arguments = [str(generator), "--out", str(tmp_path / "out"), "--robot", str(robot)]
    for part in ("tables", "wiring", "mavlink-c", "version"):
        arguments += ["--part", part]
    done = subprocess.run([sys.executable, "-B", "-c", WATCH, *arguments], capture_output=True, text=True, check=True)
    shared = root / "shared"
    opened = {path for path in map(Path, done.stdout.splitlines()) if path.is_file() and shared in path.parents}
    assert {robot, root / "shared" / "params.toml", root / "shared" / "link" / "omni.xml"} <= opened
    assert opened <= set(inputs.generator_inputs(root, robot))


def test_the_robot_file_is_the_environments(root: Path, robot: Path) -> None:
    option = "shared/robots/three_wheel.toml"
    assert inputs.robot_file(root, option, {}) == robot
    assert inputs.robot_file(root, "OMNI_ROBOT", {"OMNI_ROBOT": str(robot)}) == robot
    assert inputs.robot_file(root, "OMNI_ROBOT", {"OMNI_ROBOT": option}) == robot
    with pytest.raises(inputs.InputError, match="which robot"):
        inputs.robot_file(root, "OMNI_ROBOT", {})
    with pytest.raises(inputs.InputError, match=r"none\.toml does not exist"):
        inputs.robot_file(root, "none.toml", {})


def test_the_project_file_reads_nothing_of_the_environment() -> None:
    """PlatformIO throws every robot's build away when the file, with what it reads of the environment, has changed."""
    assert "${sysenv" not in "".join(
        line for line in (ROOT / "platformio.ini").read_text().splitlines() if not line.startswith(";")
    )


def test_another_robot_than_was_asked_for_is_refused(root: Path) -> None:
    """OMNI_ROBOT, left in a shell, once made `make firmware ROBOT=four_wheel` build for that file."""
    with pytest.raises(inputs.InputError, match="-e robot"):
        inputs.robot_file(root, "shared/robots/four_wheel.toml", {"OMNI_ROBOT": "mine.toml"})


@pytest.mark.parametrize("environ", [{}, {"OMNI_WERROR": "0"}, {"OMNI_WERROR": ""}])
def test_warnings_are_errors_in_ci_only(environ: dict[str, str]) -> None:
    assert not inputs.warnings_are_errors(environ)
    assert inputs.warnings_are_errors({"OMNI_WERROR": "1"})


class FakeScons:
    """As much of SCons' environment as prepare.py uses, for a project in ``root``."""

    def __init__(self, root: Path, custom_robot: str) -> None:
        self.root = root
        self.custom_robot = custom_robot
        self.appended: dict[str, list[str]] = {}
        self.built: list[str] = []
        self.middlewares: list[tuple[Any, str]] = []

    def subst(self, text: str) -> str:
        values = {"$PROJECT_DIR": self.root, "$BUILD_DIR": self.root / "build", "$PYTHONEXE": sys.executable}
        return str(values[text])

    def GetProjectOption(self, _: str, __: str) -> str:
        return self.custom_robot

    def PioPlatform(self) -> SimpleNamespace:
        return SimpleNamespace(get_package_dir=lambda name: f"/packages/{name}")

    def Append(self, **values: list[str]) -> None:
        for name, more in values.items():
            self.appended.setdefault(name, []).extend(more)

    def AddBuildMiddleware(self, callback: Any, pattern: str) -> None:
        self.middlewares.append((callback, pattern))

    def BuildSources(self, _: str, folder: str) -> None:
        self.built.append(folder)

    def Exit(self, code: int) -> None:
        raise SystemExit(code)


def run_prepare(root: Path, custom_robot: str, monkeypatch: pytest.MonkeyPatch) -> FakeScons:
    """Run prepare.py as PlatformIO does."""
    scons = FakeScons(root, custom_robot)
    monkeypatch.setitem(sys.modules, "SCons", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "SCons.Script", SimpleNamespace(DefaultEnvironment=lambda: scons))
    monkeypatch.syspath_prepend(str(FOLDER))
    code = compile((FOLDER / "prepare.py").read_text(), str(FOLDER / "prepare.py"), "exec")
    exec(code, {"__name__": "prepare"})
    return scons


@pytest.fixture
def project(root: Path) -> Path:
    shutil.copy(ROOT / "pyproject.toml", root)
    return root


@pytest.mark.full
def test_the_script_itself_generates_once_and_again_after_a_change(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OMNI_ROBOT", raising=False)
    monkeypatch.delenv("OMNI_WERROR", raising=False)
    robot = "shared/robots/three_wheel.toml"
    scons = run_prepare(project, robot, monkeypatch)
    generated = project / "build" / "generated"
    assert scons.built == [str(generated / "src")]
    (number,) = scons.appended["SRC_BUILD_FLAGS"]
    assert number.startswith("-DOMNI_DIALECT=")
    header = generated / "include" / "omni" / "wiring_gen.h"
    header.unlink()
    assert run_prepare(project, robot, monkeypatch).appended["SRC_BUILD_FLAGS"] == [number]
    assert not header.exists()
    dialect = project / "shared" / "link" / "omni.xml"
    dialect.write_bytes(dialect.read_bytes().replace(b"<enum name=", b"<!-- changed --><enum name=", 1) + b"\n")
    run_prepare(project, robot, monkeypatch)
    assert header.exists()


@pytest.mark.full
def test_the_sources_that_are_to_be_small_are_there_and_get_their_option_last(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OMNI_ROBOT", raising=False)
    scons = run_prepare(project, "shared/robots/three_wheel.toml", monkeypatch)
    assert scons.middlewares
    for compile_small, pattern in scons.middlewares:
        assert [file for file in (ROOT / "shared").rglob("*.c") if fnmatch(str(file), pattern)], pattern
        made = type("Env", (dict,), {"Object": lambda self, node, CCFLAGS: (node, CCFLAGS)})(CCFLAGS=["-g", "-O3"])
        assert compile_small(made, "file.c") == ("file.c", ["-g", "-O3", "-O2"])


@pytest.mark.full
def test_the_script_ends_the_build_on_a_wrong_robot_file_and_is_strict_when_asked(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("OMNI_ROBOT", raising=False)
    monkeypatch.setenv("OMNI_WERROR", "1")
    scons = run_prepare(project, "shared/robots/four_wheel.toml", monkeypatch)
    assert scons.appended["SRC_BUILD_FLAGS"][1:] == ["-Werror"]
    with pytest.raises(SystemExit):
        run_prepare(project, "shared/robots/none.toml", monkeypatch)
    assert "none.toml does not exist" in capsys.readouterr().err


def test_another_message_changes_the_flags_so_what_packs_messages_is_compiled_anew(tmp_path: Path) -> None:
    """SCons does not look into system headers: the table of checksums in an object was that of the message before."""
    (tmp_path / "omni").mkdir()
    header = tmp_path / "omni" / "mavlink_msg_omni_flow.h"
    header.write_text("#define CRC 1\n")
    before = inputs.dialect_number(tmp_path)
    assert before == inputs.dialect_number(tmp_path)
    header.write_text("#define CRC 2\n")
    assert inputs.dialect_number(tmp_path) != before
