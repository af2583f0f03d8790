# SPDX-License-Identifier: MIT
"""Which tests make test-changed takes for a changed file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import changed


def chosen(*paths: str) -> list[str]:
    return changed.tests_for(paths, "HEAD")


def has(tests: list[str], file: str) -> bool:
    return any(file == test or file.startswith(f"{test}/") for test in tests)


@pytest.mark.full
def test_a_python_module_brings_the_tests_that_import_it_at_any_distance() -> None:
    tests = chosen("emulated_teensy/i2c_wave.py")  # tests/image reaches it through hil_sim.pins
    assert any(test.startswith("tests/image") for test in tests)
    assert not has(tests, "tests/core/test_pid.py")


@pytest.mark.full
def test_a_conftest_brings_its_folder_and_a_test_itself() -> None:
    assert has(chosen("tests/hub/conftest.py"), "tests/hub/test_routing.py")
    assert has(chosen("tests/core/test_pid.py"), "tests/core/test_pid.py")


def test_a_page_brings_the_tests_of_pages_and_those_that_name_it() -> None:
    tests = chosen("docs/start/screen.md")
    assert has(tests, "tests/docs/test_front_page.py")
    assert has(tests, "tests/e2e/test_demo.py")


def test_a_function_of_the_core_brings_what_reaches_it(monkeypatch: pytest.MonkeyPatch) -> None:
    reached = [("tests/core/a.py::one", 0.1, frozenset({"omni_wrap"})), ("tests/core/a.py::two", 0.1, frozenset({"x"}))]
    monkeypatch.setattr("tests.changed.Reach.tests", lambda self: iter(reached if self._area.name == "core" else []))
    monkeypatch.setattr(changed, "changed_functions", lambda path, since: {"omni_wrap"})
    assert "tests/core/a.py::one" in chosen("shared/core/src/math/angle.c")
    assert "tests/core/a.py::two" not in chosen("shared/core/src/math/angle.c")


@pytest.mark.parametrize(("line", "names"), [(2, {"first"}), (6, {"second"}), (4, set())])
def test_lines_of_a_change_are_those_of_functions_or_of_the_file(
    line: int, names: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.c").write_text(
        "int first(int a) {\n    return a;\n}\nint global = 3;\nstatic int second(void) {\n  return 1;\n}\n"
    )
    monkeypatch.setattr(changed, "ROOT", tmp_path)
    monkeypatch.setattr(changed, "git", lambda *_: f"@@ -{line} +{line} @@")
    assert changed.changed_functions("a.c", "HEAD") == names
