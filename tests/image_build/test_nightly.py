# SPDX-License-Identifier: MIT
"""`make nightly` goes on where it was interrupted, and says what it does not know."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def nightly(folder: Path, *steps: str) -> subprocess.CompletedProcess[str]:
    """Run it in a repository whose only step is ``soak``."""
    return subprocess.run([str(folder / ".ci" / "nightly"), *steps], capture_output=True, text=True, check=False)


def repository(folder: Path, program: str) -> Path:
    """Return a repository in which Python is this shell program."""
    script = (ROOT / ".ci" / "nightly").read_text(encoding="utf-8")
    for path, text in ((".ci/nightly", script), (".venv/bin/python", f"#!/bin/sh\n{program}\n")):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
        (folder / path).chmod(0o755)
    (folder / ".gitignore").write_text("build\n*.count\n", encoding="utf-8")
    git = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "one"]):
        subprocess.run([*git, *words], check=True)
    return folder


def test_a_step_that_passed_is_not_done_again(tmp_path: Path) -> None:
    folder = repository(tmp_path, "echo x >>runs.count")
    for said in ("soak passed in", "soak has passed"):
        done = nightly(folder, "soak")
        assert done.returncode == 0, done.stderr
        assert said in done.stdout
    assert (folder / "runs.count").read_text() == "x\n"


def test_a_step_that_failed_is_done_again_and_shows_its_end(tmp_path: Path) -> None:
    folder = repository(tmp_path, "echo the motor smokes; exit 3")
    for _ in range(2):
        done = nightly(folder, "soak")
        assert done.returncode == 1
        assert "the motor smokes" in done.stderr


def test_an_unknown_step_is_refused_with_those_there_are(tmp_path: Path) -> None:
    done = nightly(repository(tmp_path, "true"), "sleep")
    assert done.returncode == 2
    assert "image-three-wheel" in done.stderr
