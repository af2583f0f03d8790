# SPDX-License-Identifier: MIT
"""A controller outside the tree becomes one more row: what the generator writes, and what it refuses."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from generate import main
from omni_schema import ParameterTable, load_parameters
from tests.native import ROOT

EXAMPLE = ROOT / "examples" / "controllers" / "lqr"
TREE = ROOT / "shared" / "params.toml"


def generate(out: Path, controller: Path | None = None) -> int:
    own = ["--controller", str(controller)] if controller else []
    return main(["--out", str(out), "--part", "tables", "--part", "schema", *own])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a copy of the example that a test may spoil, in a path that is hard to quote."""
    return Path(shutil.copytree(EXAMPLE, tmp_path / "my contröllers" / "lqr"))


def merged(out: Path, folder: Path) -> ParameterTable:
    assert generate(out, folder) == 0
    return load_parameters(out / "params.toml")


def test_what_the_tree_has_keeps_its_numbers_and_its_places(folder: Path, tmp_path: Path) -> None:
    tree, table = load_parameters(TREE), merged(tmp_path / "out", folder)
    own = [parameter.name for parameter in table.parameters[len(tree) :]]
    assert own == ["LQR_E_XY", "LQR_E_TH", "LQR_Z_XY", "LQR_Z_TH", "LQR_V_XY", "LQR_V_TH"]
    before, mode = tree["CTL_MODE"], table["CTL_MODE"]
    assert mode.values == {**before.values, "lqr": max(before.values.values()) + 1}
    assert (mode.default, mode.maximum) == (before.default, before.maximum + 1)
    assert [p for p in table.parameters[: len(tree)] if p.name != "CTL_MODE"] == [
        p for p in tree.parameters if p.name != "CTL_MODE"
    ]
    assert table.crc != tree.crc


def test_without_a_controller_the_tree_is_as_before(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert "lqr" in merged(out, folder)["CTL_MODE"].values
    assert generate(out) == 0
    assert (out / "params.toml").read_bytes() == TREE.read_bytes()
    written = [
        out / "src" / "controller_gen.c",
        *(out / "include" / "omni" / f"{n}_gen.h" for n in ("params", "modules")),
    ]
    assert not any("lqr" in path.read_text(encoding="utf-8").lower() for path in written)


def test_the_core_compiles_with_it_and_points_at_the_users_own_file(folder: Path, tmp_path: Path) -> None:
    merged(tmp_path / "out", folder)
    source = folder / "lqr.c"
    source.write_text(source.read_text(encoding="utf-8").replace("omni_pose_error(", "no_such("), encoding="utf-8")
    folders = [ROOT / "shared/core/include", ROOT / "shared/core/src", tmp_path / "out" / "include"]
    command = ["gcc", "-std=c99", "-fsyntax-only", "-Werror", *(f"-I{path}" for path in folders)]
    done = subprocess.run(
        [*command, str(tmp_path / "out" / "src" / "controller_gen.c")], capture_output=True, text=True, check=False
    )
    assert f"{source}:" in done.stderr
    assert "no_such" in done.stderr


ROW = '{ kind = "real", unit = "", min = 0.0, max = 1.0, default = 0.5, doc = "One" }'


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("parameters.toml", f"FL_I_MAX = {ROW}", "FL_I_MAX: is a parameter of params.toml already"),
        ("parameters.toml", f"A_NAME_THAT_IS_TOO_LONG = {ROW}", "at most 16"),
        ("parameters.toml", "LQR_K = 3", "LQR_K: is 3"),
        ("parameters.toml", "LQR_K = ", "is not valid TOML"),
        ("parameters.toml", f'"LQR{{n}}" = {ROW}', "per_wheel"),
        ("other.c", "", "exactly one .c file is needed, found: lqr.c, other.c"),
        ("lqr.c", "int x;", "defines no omni_configure_lqr"),
        ("lqr.c", "void omni_configure_lqr(void);", "defines no omni_controller_row_lqr"),
    ],
)
def test_a_folder_that_is_wrong_is_refused_with_its_file(
    folder: Path, tmp_path: Path, name: str, text: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / name).write_text(text, encoding="utf-8")
    assert generate(tmp_path / "out", folder) == 1
    error = capsys.readouterr().err
    assert said in error
    assert str(folder) in error


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("torque", "a controller torque is in params.toml already"),
        ("fl", "a controller fl is in params.toml already"),
        ("robot", "omni/robot.h"),
        ("count", "rename the file"),
        ("My-Law", "rename the file"),
    ],
)
def test_a_name_that_is_taken_or_none_is_refused(
    folder: Path, tmp_path: Path, name: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder / "lqr.c").read_text(encoding="utf-8").replace("omni/lqr.h", "").replace("lqr", name)
    (folder / f"{name}.c").write_text(text, encoding="utf-8")
    (folder / "lqr.c").unlink()
    assert generate(tmp_path / "out", folder) == 1
    assert said in capsys.readouterr().err


def test_no_folder_and_a_folder_without_a_source_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    for name, said in (("nowhere", "no such folder"), ("empty", "found: none")):
        assert generate(tmp_path / "out", tmp_path / name) == 1
        assert said in capsys.readouterr().err
