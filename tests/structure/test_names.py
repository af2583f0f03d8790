# SPDX-License-Identifier: MIT
"""A function that only its file knows has a name that a search finds: two words at least, and no other file's."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
AREAS = {"shared/core/src": 200, "firmware/app": 60}
"""Where names are looked at, and how many there are at least."""

_STATIC = re.compile(r"^static\b[^;={}()]*?\b(\w+)\((?!\()", re.MULTILINE)
_UNNAMED = re.compile(r"^namespace \{\n(.*?)^\} // namespace$", re.MULTILINE | re.DOTALL)
_FUNCTION = re.compile(r"^(?!static\b)[A-Za-z_][^;={}()]*?\b(\w+)\([^;{}]*\)[^;{}()]*\{", re.MULTILINE)


def functions(source: str) -> Iterator[str]:
    """Yield the names of a source's own functions: static ones, and those in a namespace without a name."""
    yield from _STATIC.findall(source)
    for inside in _UNNAMED.findall(source):
        yield from _FUNCTION.findall(inside)


def own_functions(area: str) -> dict[str, set[str]]:
    """Return the names of an area, each with the files that have a function of that name."""
    found: dict[str, set[str]] = {}
    for path in sorted((ROOT / area).rglob("*")):
        if path.suffix in (".c", ".cpp", ".h"):
            for name in functions(path.read_text(encoding="utf-8")):
                found.setdefault(name, set()).add(path.relative_to(ROOT).as_posix())
    return found


@pytest.mark.parametrize("area", AREAS)
def test_a_search_for_a_function_finds_this_function(area: str) -> None:
    names = own_functions(area)
    assert len(names) > AREAS[area]
    assert {name: sorted(files) for name, files in names.items() if len(files) > 1} == {}
    assert {name: sorted(files) for name, files in names.items() if "_" not in name} == {}


def test_functions_are_found_in_c_and_in_cpp() -> None:
    source = """
static void one_c(int a);
static inline const struct s *two_c(int a,
                                    int b) {
}
static const int table[] = {1};
void known_elsewhere(void) {
}
namespace {
constexpr int size = 3;
std::array<float, 3> three_cpp(const T &a) {
    if (a) {
    }
}
class Thing {
    void method() {}
};
COLD bool four_cpp(int a,
                   int b) {
}
} // namespace
void Thing::method() {
}
"""
    assert list(functions(source)) == ["one_c", "two_c", "three_cpp", "four_cpp"]
