# SPDX-License-Identifier: MIT
"""The step that shows our sources to newer compilers: it finds them all, and what a compiler says ends it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests import kept
from tests.image_build import front_ends
from tests.image_build.front_ends import DatabaseError, FrontEnd, Source, complaints, own_sources

FILES = [f"{folder}/a{suffix}" for folder in front_ends.MUST_APPEAR for suffix in (".c", ".cpp")]


def database(folder: Path, files: list[str]) -> Path:
    path = folder / "compile_commands.json"
    command = '/tools/arm-none-eabi-gcc -o out/{0}.o -c -DNAME=\\"x\\" -O3 {0}'
    path.write_text(json.dumps([{"file": file, "command": command.format(file), "directory": "."} for file in files]))
    return path


def host_compiler() -> FrontEnd:
    return FrontEnd("cc", lambda source: source.path.suffix == ".c", lambda source: ["cc", *source.flags])


def test_all_sources_but_the_frameworks_are_taken_with_their_flags(tmp_path: Path) -> None:
    framework = "core/packages/framework-arduinoteensy/cores/teensy4/main.cpp"
    sources = own_sources(database(tmp_path, [*FILES, framework]))
    assert [str(source.path) for source in sources] == FILES
    assert sources[0].compiler == "/tools/arm-none-eabi-gcc"
    assert sources[0].flags == ("-c", '-DNAME="x"', "-O3", FILES[0])


@pytest.mark.parametrize("missing", front_ends.MUST_APPEAR)
def test_a_database_without_a_part_of_the_image_is_refused(tmp_path: Path, missing: str) -> None:
    path = database(tmp_path, [file for file in FILES if not file.startswith(missing)])
    with pytest.raises(DatabaseError, match=missing):
        own_sources(path)


def test_a_warning_and_an_error_are_complaints_and_clean_code_is_none(tmp_path: Path) -> None:
    texts = {
        "clean.c": "int main(void) { return 0; }\n",
        "warned.c": "int main(void) { int never_used; return 0; }\n",
        "refused.c": "int main(void) { return }\n",
    }
    sources = []
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        sources.append(Source(tmp_path / name, "cc", ("-c", str(tmp_path / name))))
    clean, warned, refused = complaints(host_compiler(), sources, tmp_path / "objects")
    assert clean == ""
    assert "warned.c" in warned
    assert "never_used" in warned
    assert "refused.c" in refused


def test_only_what_the_front_end_takes_and_what_has_not_passed_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources = [Source(front_ends.ROOT / name, "cc", ("-c",)) for name in ("a.c", "b.c", "c.cpp")]
    compiled: list[str] = []

    def complaints_of(_: FrontEnd, wanted: list[Source], __: Path) -> list[str]:
        compiled.extend(source.path.name for source in wanted)
        return [""] * len(wanted)

    monkeypatch.setattr(front_ends, "complaints", complaints_of)
    monkeypatch.setattr(kept, "has_passed", lambda name, _: name == "cc: b.c")
    assert front_ends.check(host_compiler(), sources, "cc==1") == []
    assert compiled == ["a.c"]


def test_any_complaint_ends_the_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(front_ends, "installed", lambda *_: tmp_path)
    monkeypatch.setattr(front_ends, "newer_gcc", lambda _: host_compiler())
    monkeypatch.setattr(front_ends, "newer_clang", lambda _: host_compiler())
    monkeypatch.setattr(front_ends, "check", lambda *_: [])
    arguments = [str(database(tmp_path, FILES))]
    assert front_ends.main(arguments) == 0
    answers = iter([["firmware/app/a.c: refused"], []])
    monkeypatch.setattr(front_ends, "check", lambda *_: next(answers))
    assert front_ends.main(arguments) == 1
