# SPDX-License-Identifier: MIT
"""make ready, on a small repository with a planted formatting error, a stale table, a failing test, a missing tool."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests import changed, needs
from tests.ci.ready import CHECKS, WRITERS, Report, Task, ready

ROOT = Path(__file__).resolve().parents[2]


def git(*words: str) -> None:
    subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], check=True, capture_output=True)


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(changed, "ROOT", tmp_path)
    monkeypatch.setitem(needs.NEEDS, "kit", needs.Need("kits", "sudo apt install kit", ("no-such-program",)))
    git("init", "-q")
    (tmp_path / ".gitignore").write_text("/build/\n__pycache__\n")
    (tmp_path / "table.md").write_text("1\n")
    (tmp_path / "code.py").write_text("a = 1\n")
    (tmp_path / "test_code.py").write_text("from code_ import a\n\ndef test_a() -> None:\n    assert a == 2\n")
    git("add", ".")
    git("commit", "-qm", "x")
    (tmp_path / "code.py").write_text("a  =  3\n")
    return tmp_path


@pytest.mark.full
def test_all_that_can_be_mended_is_and_the_rest_is_named(clone: Path) -> None:
    (clone / "code_.py").write_text("a = 3\n")
    writers = (
        Task("broken", "exit 3"),
        Task("format", "sed -i 's/  */ /g' code.py", ("code",)),
        Task("table", "sed -n 's/a = //p' code.py > table.md"),
        Task("other", "touch other.md", ("firmware/",)),
        Task("proof", "true", needs=("kit",)),
    )
    pytest_words = f"{shlex.quote(sys.executable)} -m pytest -q -p no:cacheprovider test_code.py"
    report = ready("HEAD", writers, (Task("tests", pytest_words), Task("lint", "true", slots=1)))
    assert report == Report(["broken", "tests"], ["code.py", "table.md"], {"proof": "sudo apt install kit"})
    assert (clone / "table.md").read_text() == "3\n"
    assert "assert 3 == 2" in (clone / "build/ready/tests.log").read_text()
    (clone / "code_.py").write_text("a = 2\n")
    assert ready("HEAD", writers[1:], (Task("tests", pytest_words),)) == Report(
        [], [], {"proof": "sudo apt install kit"}
    )
    assert report.lines()[0] != Report().lines()[0]
    assert "not checked: proof: sudo apt install kit" in report.lines()


def test_tasks_are_targets_and_modules_that_exist_and_need_what_is_known() -> None:
    targets = re.findall(
        r"^([\w$(){}/.-]+):", (ROOT / "Makefile").read_text().replace("$(VENV)", ".venv"), re.MULTILINE
    )
    for task in (*WRITERS, *CHECKS):
        assert set(task.needs) <= set(needs.NEEDS)
        words = shlex.split(task.command)
        if words[0] == "make":
            assert {word for word in words[1:] if "=" not in word} <= set(targets), task
        else:
            assert (ROOT / f"{words[2].replace('.', '/')}.py").is_file(), task
        for path in filter(None, task.paths):
            assert (ROOT / path).exists(), task
