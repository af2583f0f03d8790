# SPDX-License-Identifier: MIT
"""What only the robot's processor shows is found by the tests that run on the emulated one before each merge."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.arm import need_emulated_firmware
from tests.emulated.planted import BUGS, Bug, build, passes
from tests.firmware.conftest import ALL, ON_ALL_BOARDS, runs_before_a_merge
from tests.native import ROOT


def place(bug: Bug) -> tuple[str, str]:
    """Return the module and the function of a bug's test."""
    path, _, test = bug.test.partition("::")
    return Path(path).stem, test


@pytest.mark.parametrize("bug", BUGS, ids=lambda bug: bug.what)
def test_what_finds_it_runs_before_a_merge(bug: Bug) -> None:
    module, test = place(bug)
    assert bug.test.startswith("tests/emulated/") or runs_before_a_merge(module, test)
    assert f"def {test}(" in (ROOT / bug.test.partition("::")[0]).read_text(encoding="utf-8")


def test_the_tests_chosen_for_the_emulated_processor_exist() -> None:
    for module, tests in ON_ALL_BOARDS.items():
        text = (ROOT / "tests" / "firmware" / f"{module}.py").read_text(encoding="utf-8")
        assert [test for test in tests if test != ALL and f"def {test}(" not in text] == [], module


@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("bug", BUGS, ids=lambda bug: bug.what)
def test_it_is_found_on_the_emulated_processor(bug: Bug, tmp_path: Path) -> None:
    need_emulated_firmware()
    assert not passes(bug, "emulated", build(bug, "emulated", tmp_path))


@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("bug", [bug for bug in BUGS if "/emulated/" not in bug.test], ids=lambda bug: bug.what)
def test_it_works_on_a_pc(bug: Bug, tmp_path: Path) -> None:
    """Else the PC's tests would find it, and it would say nothing about the other processor's."""
    assert passes(bug, "pc", build(bug, "pc", tmp_path))
