# SPDX-License-Identifier: MIT
"""The check of the prose: what a sentence is, what is too long, and that its list can only shrink."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from omni_schema.toml_file import read_toml
from tests.docs import prose
from tests.docs import prose_sources as sources
from tests.docs.prose_c import c_text

LONG = " ".join(["word"] * 25) + "."
SHORT = " ".join(["word"] * 24) + "."


@pytest.mark.nightly  # CI has it in `make lint`
def test_the_pages_pass() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.docs.prose"], cwd=sources.ROOT, capture_output=True, text=True, check=False
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
    assert prose.judge("a.md", [LONG], 1, "things") == []
    assert prose.judge("a.md", [LONG], 0, "things") == ["a.md: 1 things, 0 are allowed:", f"    {LONG}"]
    assert "--write lowers" in prose.judge("a.md", [], 1, "things")[0]


def test_inside_words_are_wrong() -> None:
    assert prose.wrong_words("That is simply so.", prose.INSIDE_WORDS) == ["'simply': leave it out"]
    assert prose.wrong_words("`simply` is a name.", prose.INSIDE_WORDS) == []


def test_the_glossary_says_which_words_are_not_used() -> None:
    variants = prose.glossary_variants(sources.pages()[prose.GLOSSARY])
    assert prose.wrong_words("Two Setpoints.", variants) == ["'Setpoints': the glossary's word is 'set-point'"]
    assert prose.wrong_words("A set-point, and SET_POINT.", variants) == []


@pytest.mark.parametrize("wide", [f"{'word ' * 30}", f"- {'word ' * 30}"])
def test_a_wide_line_is_found(wide: str) -> None:
    assert prose.wide_lines(f"Short.\n\n{wide}\n") == [wide]


@pytest.mark.parametrize("page", [f"# {LONG}", f"```\n{LONG}\n```", f"| a |\n|---|\n| {LONG} |", f"[x]({'y' * 130})"])
def test_what_cannot_be_broken_may_be_wide(page: str) -> None:
    assert prose.wide_lines(page) == []


def test_docstrings_and_help_texts_of_python_are_read() -> None:
    source = f'''"""Module."""
def shown(a=Option("--a", help="{LONG}")):
    """Shown.

    {LONG}
    """
def _hidden():
    """{LONG}"""
    # noqa: {LONG}
    x = 1  # {LONG}
    # {LONG[:49]}
    # {LONG[50:]}
Y = 2
"""{LONG}"""
'''
    text = sources.python_text(source)
    assert text.startswith("Module.")
    assert prose.long_sentences(text) == [LONG] * 6


def test_a_table_in_a_docstring_has_no_sentences() -> None:
    table = f'"""Module.\n\n====  ====\n{LONG}  b\n====  ====\n\n{LONG}\n"""\n'
    assert prose.long_sentences(sources.python_text(table)) == [LONG]


def test_comments_of_c_are_read_without_their_laws() -> None:
    source = f"""/**
 * @file a.h
 * First.
 *
 *   law = {LONG}
 *
 * {LONG}
 * @param a {SHORT}
 * @return {SHORT}
 */
int a; /**< {LONG} */
/// word
/// {SHORT}
int b; ///< {LONG}
/// Another one.
/* {LONG} */
const char *c = "// {LONG} /* {LONG} */"; // {LONG}
/*@ proof: {LONG} */
/*
 * The law is
 *   a = {LONG}
 */
"""
    text = c_text(f"/* SPDX-License-Identifier: MIT */\n{source}")
    assert prose.long_sentences(text) == [LONG] * 6
    assert "SPDX" not in text


def test_the_texts_of_a_table_are_read() -> None:
    table = {"a": {"doc": "One.", "unit": "m"}, "b": [{"description": "Two."}]}
    assert sources.table_text(table).split() == ["One.", "Two."]


def test_the_sources_are_found() -> None:
    names = set(sources.code())
    assert {"host/omniwheel/robot.py", "shared/core/include/omni/ismc.h", "shared/params.toml"} <= names
    assert {"shared/core/src/robot/robot.c", "firmware/boards/teensy40/i2c.cpp", "hil_sim/lanes/lanes.hpp"} <= names


def test_writing_never_raises_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prose, "BASELINE", tmp_path / "prose.toml")
    found = {"long_sentences": ("", {"a.md": [LONG] * 3, "b.md": [LONG], "c.md": []}), "new": ("", {"a.md": [LONG]})}
    prose.write_baseline(found, {"long_sentences": {"a.md": 2, "b.md": 2, "c.md": 1}})
    assert read_toml(tmp_path / "prose.toml") == {"long_sentences": {"a.md": 2, "b.md": 1}, "new": {"a.md": 1}}
