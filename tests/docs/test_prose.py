# SPDX-License-Identifier: MIT
"""The warnings of prose: what a sentence is, what a word is, what is a habit, and that none is an error."""

from __future__ import annotations

import pytest

from tests.docs import prose

LONG = " ".join(["word"] * (prose.MOST_WORDS + 1)) + "."


def test_what_is_no_prose_is_left_out() -> None:
    text = f"# {LONG}\n\n```\n{LONG}\n```\n\n<!-- {LONG} -->\n\nOne. `Two` is one word (2 m). Three!\n\n- four\n"
    assert list(prose.sentences(text)) == ["One.", "`code` is one word (2 m).", "Three!", "four"]


def test_symbols_numbers_and_names_in_code_are_no_words() -> None:
    assert prose.words("The gain K = q / (q + (sd_rad T)^2) of `code`, 2.5 m/s, is *small* (well-known).") == 6


def test_a_long_sentence_is_a_warning_and_no_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    short = LONG.replace("word ", "", 1)
    monkeypatch.setattr(prose, "pages", lambda: {"a.md": f"{short}\n\n- {LONG}\n", "b.md": short})
    prose.main()
    assert capsys.readouterr().out == f"warning: a.md: {prose.MOST_WORDS + 1} words: {LONG}\n"


@pytest.mark.parametrize(
    ("sentence", "found"),
    [
        ("A set-point is old.", "set-point"),
        ("Nobody answers.", "Nobody"),
        ("A setpoint is old.", None),
        ("A shallow deadband.", None),
    ],
)
def test_a_paraphrase_of_a_term_is_a_habit(sentence: str, found: str | None) -> None:
    habit = prose.habit(sentence)
    assert (habit and habit[0]) == found


def test_a_name_in_code_is_no_habit() -> None:
    (sentence,) = prose.sentences("The robot says `set-point refused`.")
    assert prose.habit(sentence) is None


def test_a_habit_is_a_warning_and_no_error(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(prose, "pages", lambda: {"a.md": "Send a set-point."})
    prose.main()
    assert capsys.readouterr().out == "warning: a.md: 'set-point', plainer: setpoint: Send a set-point.\n"
