# SPDX-License-Identifier: MIT
"""The operators find the changes they promise, in C and in C++, and mutants are known by their text."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutation.operators import OPERATORS, Mutant, chosen, find_mutants
from tests.mutation.reach import reached

CHOICE = "#define omni_select(condition, a, b) ((condition) ? (a) : (b))\n"
C = """
#include "types.h"
static const float share = 0.5f;
int further(int a, int b);
float limited(float value, float limit, int steps) {
    const float low = -limit;
    if (steps >= 3 && value != low) {
        steps = further(steps, 7);
    }
    return omni_select(value > limit, limit, share * value);
}
"""
CPP = """
namespace omni {
struct Counter {
    void count(bool up) {
        if (!up) {
            return;
        }
        ++total_;
    }
    int total_ = 0;
};
}  // namespace omni
"""


def mutants_of(folder: Path, name: str, text: str) -> list[Mutant]:
    source = folder / "src" / name
    source.parent.mkdir(exist_ok=True)
    (folder / "include").mkdir(exist_ok=True)
    (folder / "include" / "types.h").write_text(CHOICE, encoding="utf-8")
    source.write_text(text, encoding="utf-8")
    standard = "-std=c99" if name.endswith(".c") else "-std=c++17"
    return find_mutants(folder, [source], source.parent, [standard, f"-I{folder / 'include'}"])


def changes(mutants: list[Mutant], text: str) -> set[tuple[str, str, str]]:
    return {(m.operator, text[m.start : m.end], m.new) for m in mutants}


def test_every_operator_finds_its_change_in_c(tmp_path: Path) -> None:
    mutants = mutants_of(tmp_path, "limited.c", C)
    assert {mutant.operator for mutant in mutants} == set(OPERATORS)
    assert changes(mutants, C) >= {
        ("comparison", ">=", ">"),
        ("comparison", ">", "<="),
        ("arithmetic", "*", "/"),
        ("constant", "0.5f", "0.0f"),
        ("off by one", "3", "4"),
        ("negated condition", "value > limit", "!(value > limit)"),
        ("removed statement", "steps = further(steps, 7)", "(void)0"),
        ("swapped arguments", "steps, 7", "7, steps"),
        ("early return", "", " if (1) { return 0; }"),
        ("logical connector", "&&", "||"),
        ("logical connector", "steps >= 3 && value != low", "value != low"),
        ("sign", "-", " "),
    }


def test_methods_have_the_names_of_their_classes(tmp_path: Path) -> None:
    mutants = mutants_of(tmp_path, "counter.cpp", CPP)
    assert changes(mutants, CPP) >= {
        ("negated condition", "!", " "),
        ("removed statement", "return", "(void)0"),
        ("arithmetic", "++", "--"),
    }
    assert {(mutant.function, mutant.symbol) for mutant in mutants} == {("Counter::count", "_ZN4omni7Counter5countEb")}


def test_a_mutant_keeps_its_key_when_lines_move(tmp_path: Path) -> None:
    before = {mutant.key: mutant for mutant in mutants_of(tmp_path, "limited.c", C)}
    assert len(before) == len(mutants_of(tmp_path, "limited.c", C))
    after = {mutant.key: mutant for mutant in mutants_of(tmp_path, "limited.c", f"/* More. */\n{C}")}
    assert before.keys() == after.keys()
    assert all(after[key].start > mutant.start for key, mutant in before.items())
    assert [m.key for m in chosen(list(before.values()), 5, 1)] == [m.key for m in chosen(list(after.values()), 5, 1)]


def test_lines_that_read_the_same_are_told_apart(tmp_path: Path) -> None:
    twice = "void f(int *a) {\n    *a = 1;\n    *a = 1;\n}\n"
    mutants = mutants_of(tmp_path, "twice.c", twice)
    assert len({mutant.key for mutant in mutants}) == len(mutants)


def test_a_source_that_does_not_compile_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"bad\.c"):
        mutants_of(tmp_path, "bad.c", "int f(void) { return x; }\n")


def test_a_mutant_knows_its_functions_text_and_nothing_of_the_neighbours(tmp_path: Path) -> None:
    def texts(source: str) -> set[str]:
        return {mutant.text for mutant in mutants_of(tmp_path, "limited.c", source) if mutant.function == "limited"}

    before = texts(C)
    assert len(before) == 1
    assert texts(f"/* More. */{C}int another(int a) {{ return a + 1; }}\n") == before
    assert texts(C.replace("if (steps >= 3 &&", "if (steps >= 3\n        &&")) == before
    assert texts(C.replace("further(steps, 7)", "further(steps, 8)")) != before


def test_a_function_of_a_template_is_known_by_what_its_names_look_like(tmp_path: Path) -> None:
    text = "namespace omni {\ntemplate <class T> struct Box {\n    T twice(T a) { return a + a; }\n};\n}\n"
    (mutant,) = [mutant for mutant in mutants_of(tmp_path, "box.cpp", text) if mutant.operator == "arithmetic"]
    assert reached(mutant.symbol, frozenset({"_ZN4omni3BoxIiE5twiceEi", "main"}))
    assert not reached(mutant.symbol, frozenset({"_ZN4omni3BoxIiE6thriceEi", "_ZN4omni4Cage5twiceEi"}))
    assert reached("main", frozenset({"main"}))
    assert not reached("main", frozenset({"_Z6domainv"}))
