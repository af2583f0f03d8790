# SPDX-License-Identifier: MIT
"""Imports go one way: no circle of files, and the contracts of pyproject.toml notice an import that goes up."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import grimp
import networkx as nx
import pytest

from omniwheel import telemetry_gen
from tests.native import ROOT

PACKAGES = (
    *("omni_schema", "omniwheel", "omni", "emulated_teensy"),
    *("hil_sim", "image_check", "omni_reproduce", "bench"),
)
FOLDERS = {"omniwheel": "host", "omni": "host", "omni_schema": "shared/generate"}
"""Where a package lies, if not at the top."""


def imports(*packages: str) -> nx.DiGraph[str]:
    """Return which file imports which, those inside of functions too."""
    graph = grimp.build_graph(*packages, include_external_packages=True, cache_dir=None)
    found: nx.DiGraph[str] = nx.DiGraph()
    for importer in graph.modules:
        found.add_edges_from((importer, imported) for imported in graph.find_modules_directly_imported_by(importer))
    return found


def circles(graph: nx.DiGraph[str]) -> list[list[str]]:
    return [sorted(circle) for circle in nx.strongly_connected_components(graph) if len(circle) > 1]


@pytest.mark.full
def test_no_files_import_each_other() -> None:
    graph = imports(*PACKAGES)
    # What `_core` belongs to is its package for grimp, which sees no compiled modules.
    own = [edge for edge in graph.edges if edge[1] == "omniwheel" and edge[0].startswith("omniwheel.")]
    graph.remove_edges_from(own)
    graph.remove_edge("omniwheel.simulation", "hil_sim.simulated_robot")  # the library's one door to it, opened late
    assert graph.number_of_edges() > 1000
    assert circles(graph) == []


def test_a_circle_of_two_files_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "round_about"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "one.py").write_text("from round_about import two\n")
    (package / "two.py").write_text("def f():\n    from round_about.one import x\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert circles(imports("round_about")) == [["round_about.one", "round_about.two"]]


def test_what_is_installed_needs_no_tests() -> None:
    users = {importer for importer, imported in imports(*PACKAGES).edges if imported == "tests"}
    assert {user.split(".")[0] for user in users} == {"bench"}


PLANTED = {
    "the API from the simulation": ("host/omniwheel/status.py", "hil_sim.world", "The library needs neither"),
    "the simulation from the commands": ("hil_sim/runs.py", "omni.cli.common", "Front ends and benchmarks"),
    "a module from one above it": ("host/omniwheel/link.py", "omniwheel.robot", "The library's modules"),
    "a circle": ("omni_reproduce/loops.py", "omni_reproduce.table1", "No circles"),
}


def checked(folder: Path) -> subprocess.CompletedProcess[str]:
    """Check the contracts of a copy. Without `site`, so that the packages that are installed are not found first."""
    paths = [sysconfig.get_path("purelib"), *(str(folder / name) for name in ("host", "shared/generate", "."))]
    call = "from importlinter.cli import lint_imports_command; lint_imports_command(['--no-cache'])"
    words = [sys.executable, "-S", "-c", call]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "300"}
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=120)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages' Python files and their contracts, as they are."""
    folder = tmp_path_factory.mktemp("copy")
    for package in PACKAGES:
        place = Path(FOLDERS.get(package, "")) / package
        for source in (ROOT / place).rglob("*.py"):
            target = folder / source.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
    shutil.copy(telemetry_gen.__file__, folder / "host" / "omniwheel")  # the build's, beside the installed extension
    shutil.copy(ROOT / "pyproject.toml", folder)
    done = checked(folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.full
@pytest.mark.parametrize("name", PLANTED)
def test_an_import_in_the_wrong_direction_breaks_its_contract(copy: Path, name: str) -> None:
    file, imported, contract = PLANTED[name]
    original = (copy / file).read_text(encoding="utf-8")
    (copy / file).write_text(f"{original}\nimport {imported}\n", encoding="utf-8")
    done = checked(copy)
    (copy / file).write_text(original, encoding="utf-8")
    assert done.returncode == 1, done.stdout + done.stderr
    broken = [line for line in done.stdout.splitlines() if " BROKEN" in line]
    assert any(line.startswith(contract) for line in broken), done.stdout
