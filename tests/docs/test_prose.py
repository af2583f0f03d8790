# SPDX-License-Identifier: MIT
"""The check of the prose: what a sentence is, what is too long, and that its list can only shrink."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from omni_schema.toml_file import read_toml
from tests.docs import prose

LONG = " ".join(["word"] * 25) + "."
SHORT = " ".join(["word"] * 24) + "."


def test_the_pages_pass() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.docs.prose"], cwd=prose.ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_what_is_no_prose_is_left_out() -> None:
    text = f"# {LONG}\n\n```\n{LONG}\n```\n\n<!-- {LONG} -->\n\nOne. `Two` is one word (2 m). Three!\n\n- four\n"
    assert list(prose.sentences(text)) == ["One.", "`code` is one word (2 m).", "Three!", "four"]


@pytest.mark.parametrize("page", [f"{LONG} Next.", f"- {LONG}", f"| a |\n|---|\n| {LONG} |"])
def test_a_long_sentence_is_found_wherever_it_stands(page: str) -> None:
    assert prose.long_sentences(page) == [LONG]
    assert prose.long_sentences(page.replace(LONG, SHORT)) == []


def test_a_list_of_names_counts_as_one_word() -> None:
    names = ", ".join(["`a_name`"] * 30)
    assert prose.long_sentences(f"These are meant: {names}.") == []
    assert prose.long_sentences(f"{names}, {LONG}") != []


def test_more_than_listed_is_wrong_and_so_is_less() -> None:
    assert prose.judge("a.md", LONG, 1) == []
    assert "1 sentences" in prose.judge("a.md", LONG, 0)[0]
    assert "--write lowers" in prose.judge("a.md", SHORT, 1)[0]


def test_inside_words_are_wrong() -> None:
    assert prose.judge("a.md", "That is simply so.", 0) == ["a.md: 'simply': leave it out"]
    assert prose.judge("a.md", "`simply` is a name.", 0) == []


def test_writing_never_raises_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prose, "BASELINE", tmp_path / "prose.toml")
    prose.write_baseline({"a.md": 3, "b.md": 1, "c.md": 0}, {"a.md": 2, "b.md": 2, "c.md": 1})
    assert read_toml(tmp_path / "prose.toml")["long_sentences"] == {"a.md": 2, "b.md": 1}
