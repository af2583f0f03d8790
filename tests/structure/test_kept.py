# SPDX-License-Identifier: MIT
"""A check is left out if it has passed for the same content, and only then."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests import kept
from tests.kept import IGNORE, VARIABLE, WRITE, drop, has_passed, note_passed, source_digest
from tests.structure import c_lint


@pytest.fixture(autouse=True)
def usual_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)


def test_what_passed_is_left_out_for_these_inputs_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "kept.txt"
    note_passed([("proof: a", "1" * 20)], file)
    assert not file.exists()  # nothing is written unasked
    monkeypatch.setenv(VARIABLE, WRITE)
    note_passed([("proof: a", "1" * 20), ("proof: b", "2" * 20)], file)
    assert has_passed("proof: a", "1" * 20, file)
    assert not has_passed("proof: a", "2" * 20, file)
    assert not has_passed("proof: ab", "1" * 20, file)
    note_passed([("proof: a", "3" * 20)], file)
    assert not has_passed("proof: a", "1" * 20, file)
    assert has_passed("proof: b", "2" * 20, file)
    drop("proof: ", ["proof: a"], file)
    assert file.read_text() == "3" * 20 + " proof: a\n"
    monkeypatch.setenv(VARIABLE, IGNORE)
    assert not has_passed("proof: a", "3" * 20, file)
    monkeypatch.setenv(VARIABLE, "wrote")
    with pytest.raises(ValueError, match="wrote"):
        has_passed("proof: a", "3" * 20, file)


def tree(folder: Path) -> Path:
    """Return a source that includes a header of another folder, and through it one beside that."""
    files = {
        "src/a.c": '#include <outer.h>\n#include <stdio.h>\n#include "version_gen.h"\n',
        "include/outer.h": '#  include "inner.h"\n',
        "include/inner.h": "extern int inner;\n",
        "include/other.h": "extern int other;\n",
        "include/version_gen.h": "#define COMMIT 1\n",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "src" / "a.c"


def digest_of(source: Path, *more: str, flags: tuple[str, ...] = ("-O2",)) -> str:
    kept._read.cache_clear()
    folder = source.parents[1]
    command = ["/bin/cc", *flags, f"-I{folder}/include", "-o", f"{folder}/a.o", "-c", str(source)]
    return source_digest(source, command, folder, *more)


def test_a_source_is_known_by_all_that_it_includes_and_its_flags_and_not_by_its_place(tmp_path: Path) -> None:
    source = tree(tmp_path / "one")
    before = digest_of(source, "version 1")
    assert digest_of(tree(tmp_path / "two"), "version 1") == before
    assert digest_of(source, "version 2") != before
    assert digest_of(source, "version 1", flags=("-O3",)) != before
    for name, matters in (("a.c", True), ("inner.h", True), ("other.h", False), ("version_gen.h", False)):
        path = next((tmp_path / "one").rglob(name))
        text = path.read_text()
        path.write_text(f"{text}// more\n")
        assert (digest_of(source, "version 1") != before) == matters, name
        path.write_text(text)
    (tmp_path / "one" / "src" / "outer.h").write_text("")  # hides the other one
    assert digest_of(source, "version 1") != before


def test_a_file_that_has_passed_is_not_shown_to_clang_tidy_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build, sources = tmp_path / "build", [tmp_path / f"{name}.c" for name in "abcdef"]
    build.mkdir()
    for source in sources:
        source.write_text(f"int {source.stem};\n")
    rows = [{"file": str(path), "directory": str(tmp_path), "command": f"cc -c {path}"} for path in sources]
    (build / "compile_commands.json").write_text(json.dumps(rows))
    (tmp_path / ".clang-tidy").write_text("Checks: one\n")
    tool = tmp_path / "bin" / "clang-tidy"
    tool.parent.mkdir()
    tool.write_text(
        f'#!/bin/sh\n[ "$1" = --version ] && exit\nshift 3\necho "$@" >>{tmp_path}/log\n! grep -l wrong "$@"\n'
    )
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tool.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(c_lint, "ROOT", tmp_path)
    file = tmp_path / "kept.txt"
    for function in (kept.has_passed, kept.note_passed, kept.drop):
        monkeypatch.setattr(function, "__defaults__", (file,))
    monkeypatch.setenv(VARIABLE, WRITE)

    def run() -> tuple[bool, set[str]]:
        kept._read.cache_clear()
        (tmp_path / "log").write_text("")
        good = c_lint.clang_tidy(build, ())
        return good, {path.name for path in sources if str(path) in (tmp_path / "log").read_text()}

    assert run() == (True, {"a.c", "b.c", "c.c", "d.c", "e.c", "f.c"})
    assert run() == (True, set())
    sources[0].write_text("int wrong;\n")
    assert run() == (False, {"a.c"})
    assert run() == (False, {"a.c"})  # a complaint is not kept
    sources[0].write_text("int a;\n")
    assert run() == (True, set())
    (tmp_path / ".clang-tidy").write_text("Checks: two\n")
    assert len(run()[1]) == 6


def test_a_command_is_run_until_it_has_passed_for_these_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, WRITE)
    for function in (kept.has_passed, kept.note_passed):
        monkeypatch.setattr(function, "__defaults__", (tmp_path / "kept.txt",))
    folder, runs = tmp_path / "folder", tmp_path / "runs"
    folder.mkdir()
    command = ["sh", "-c", f"echo x >>{runs}; ! grep -rq wrong {folder}"]

    def run(content: str, tool: str = "git") -> tuple[int, int]:
        (folder / "file").write_text(content)
        runs.write_text("")
        return kept.main(["name", "--of", str(folder), "--tool", tool, "--", *command]), len(runs.read_text().split())

    assert run("wrong") == (1, 1)
    assert run("wrong") == (1, 1)
    assert run("right") == (0, 1)
    assert run("right") == (0, 0)
    assert run("right", tool="no-such-tool") == (0, 1)  # what it has not seen cannot be kept
    (folder / "file").rename(folder / "other")
    assert run("right") == (0, 1)


def test_branches_that_both_keep_something_merge(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        who = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", "-C", str(tmp_path), *who, *words], check=True, capture_output=True)

    def write(row: str, branch: str) -> None:
        git("checkout", "-q", "-b", branch, "start")
        (tmp_path / "tests" / "kept.txt").write_text(f"{row} one\n2 two\n")
        git("commit", "-q", "-a", "-m", row)

    (tmp_path / "tests").mkdir()
    (tmp_path / ".gitattributes").write_bytes((kept.ROOT / ".gitattributes").read_bytes())
    (tmp_path / "tests" / "kept.txt").write_text("1 one\n2 two\n")
    git("init", "-q", "-b", "start")
    git("add", ".")
    git("commit", "-q", "-m", "start")
    write("3", "left")
    write("4", "right")
    git("merge", "-q", "left")
    assert set((tmp_path / "tests" / "kept.txt").read_text().splitlines()) == {"3 one", "4 one", "2 two"}
