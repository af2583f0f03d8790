# SPDX-License-Identifier: MIT
"""Tests that passed on the bare machine are left out for the same commit, and for no other."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests import passed

NAMES = ["tests/a.py::test_b", 'tests/a.py::test_b["line\nbreak" ü]']


def git(folder: Path, *words: str) -> None:
    identity = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    subprocess.run(["git", "-C", str(folder), *identity, *words], check=True, capture_output=True, timeout=60.0)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    folder = tmp_path / "tree"
    folder.mkdir()
    git(folder, "init", "-q")
    (folder / "file").write_text("1")
    git(folder, "add", "file")
    git(folder, "commit", "-q", "-m", "One")
    return folder


def test_names_come_back_for_their_commit_alone(tree: Path, tmp_path: Path) -> None:
    revision = passed.commit(tree)
    passed.write(tmp_path / "list", revision, NAMES)
    assert passed.read(tmp_path / "list", revision) == set(NAMES)
    (tree / "untracked").write_text("1")
    assert passed.commit(tree) == revision
    git(tree, "commit", "-q", "--allow-empty", "-m", "Two")
    assert passed.read(tmp_path / "list", passed.commit(tree)) == set()


def test_a_changed_tree_has_passed_nothing(tree: Path, tmp_path: Path) -> None:
    (tree / "file").write_text("2")
    passed.write(tmp_path / "list", passed.commit(tree), NAMES)
    assert passed.read(tmp_path / "list", passed.commit(tree)) == set()


@pytest.mark.parametrize("content", ["", None])
def test_no_list_is_an_empty_one(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "list").write_text(content)
    assert passed.read(tmp_path / "list", "abc") == set()
