# SPDX-License-Identifier: MIT
"""The map from the report to the code must lead somewhere."""

import re
from pathlib import Path

import pytest

from omniwheel._core import lib

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "report" / "report-map.md").read_text(encoding="utf-8")
LAST_EQUATION = 88
POSE_FILTER = {r"F P\w* F\^T": 62, r"S = H P": 64, r"S\^-1": 65, r"Joseph": 67}
"""What a comment of the pose filter shows, and the report's equation for it."""


def mapped_equations() -> set[int]:
    found: set[int] = set()
    for line in TEXT.splitlines():
        match = re.match(r"\| ([\d, –]+) \|", line)
        for part in match.group(1).split(",") if match else ():
            first, _, last = part.strip().partition("–")
            found.update(range(int(first), int(last or first) + 1))
    return found


def test_every_equation_has_its_line() -> None:
    assert mapped_equations() == set(range(1, LAST_EQUATION + 1))


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`((?:shared|hil_sim|host|omni_reproduce)/[^`]+)`", TEXT))))
def test_every_file_is_there(name: str) -> None:
    assert (ROOT / name).is_file()


@pytest.mark.parametrize("name", sorted(set(re.findall(r"\]\(([^)#]+)\)", TEXT))))
def test_every_page_is_there(name: str) -> None:
    assert (ROOT / "docs" / "report" / name).is_file()


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`((?:omni|hil)_[a-z0-9_]+)`", TEXT))))
def test_every_function_is_there(name: str) -> None:
    if not name.startswith(("omni_reproduce", "hil_sim")):
        assert callable(getattr(lib, name))


@pytest.mark.parametrize(("formula", "equation"), POSE_FILTER.items())
def test_the_pose_filter_cites_the_equation_that_it_shows(formula: str, equation: int) -> None:
    sources = [*(ROOT / "shared/core").rglob("pose_ekf*.[ch]")]
    lines = [line for source in sources for line in source.read_text(encoding="utf-8").splitlines()]
    cited = [re.split(r"\beq\.", line)[1] for line in lines if re.search(formula, line) and "eq." in line]
    assert cited
    assert all(str(equation) in re.findall(r"\d+", text.split("]")[0].split(":")[0]) for text in cited), cited
