# SPDX-License-Identifier: MIT
"""The core's README: its example compiles, its links lead somewhere, and it cites the report as the front page does."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.native import ROOT, WARNINGS, _compiler, generated_dir

PAGE = ROOT / "shared" / "core" / "README.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_the_example_compiles(tmp_path: Path) -> None:
    (code,) = re.findall(r"```c\n(.*?)```", TEXT, re.DOTALL)
    source = tmp_path / "example.c"
    declared = "bool start(void);\nvoid every_millisecond(const omni_inputs_t *inputs, omni_outputs_t *outputs);\n"
    include, rest = code.split("\n", 1)
    source.write_text(f"{include}\n{declared}{rest}", encoding="utf-8")
    folders = [f"-I{ROOT / 'shared' / 'core' / 'include'}", f"-I{generated_dir() / 'include'}"]
    words = [*_compiler("CC", "cc"), "-std=c99", "-fsyntax-only", *WARNINGS, *folders, str(source)]
    built = subprocess.run(words, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr


def test_every_link_leads_to_a_file() -> None:
    targets = re.findall(r"\]\(([^)#\s]+)\)", TEXT)
    assert targets
    assert [target for target in targets if not (PAGE.parent / target).is_file()] == []


@pytest.mark.parametrize("page", [ROOT / "README.md", PAGE], ids=["front page", "core"])
def test_the_report_is_cited_once(page: Path) -> None:
    text = " ".join(page.read_text(encoding="utf-8").replace("> ", "").split())
    for fact in (
        "Benjamin M. Dyer",
        "*Omni-wheel robot Dynamics, Kinematics, and Controllers*",
        "University of Guelph",
        "undated",
    ):
        assert text.count(fact) == 1


def test_equations_are_cited_by_their_number_in_the_report() -> None:
    headers = sorted((ROOT / "shared" / "core" / "include" / "omni").glob("*.h"))
    bare = [
        f"{header.name}: {line.strip()}"
        for header in headers
        for line in header.read_text(encoding="utf-8").splitlines()
        if re.search(r"(?<!report )(?<!report's )\beq\. [0-9]", line)
        and "text before" not in line
        and header.name != "robot.h"
    ]
    assert bare == []
