# SPDX-License-Identifier: MIT
"""Files have fewer than 500 lines, functions at most 80: what is longer is two things. C has lines of at most 120."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILE_LINES, FUNCTION_LINES, WIDTH = 500, 80, 120
C_SUFFIXES = (".c", ".cpp", ".h", ".hpp")


def sources(*suffixes: str) -> list[Path]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    return [ROOT / name for name in listed if name.endswith(suffixes) and (ROOT / name).is_file()]


def python_functions(text: str) -> Iterator[tuple[str, int]]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node.name, (node.end_lineno or node.lineno) - node.lineno + 1


def c_functions(text: str) -> Iterator[tuple[str, int]]:
    """Yield what begins with ``name(...) {`` at the margin and ends with a brace there, as clang-format leaves it."""
    begun: tuple[str, int] | None = None
    for number, line in enumerate(text.splitlines()):
        if line.startswith("}") and begun is not None:
            yield begun[0], number - begun[1] + 1
            begun = None
        head = re.match(r"(?!namespace|extern|struct|class|enum|union|typedef)[\w:].*?(\w+)\(", line)
        if head and not line.rstrip().endswith(";"):
            begun = head[1], number


def test_files_are_short() -> None:
    long = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines())
        for path in sources(".py", *C_SUFFIXES)
    }
    assert {name: lines for name, lines in long.items() if lines >= FILE_LINES} == {}


def test_lines_of_c_are_short() -> None:
    wide = {
        f"{path.relative_to(ROOT)}:{number}": line
        for path in sources(*C_SUFFIXES)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > WIDTH
    }
    assert wide == {}


@pytest.mark.full
def test_functions_are_short() -> None:
    found = {}
    for suffixes, functions in (((".py",), python_functions), (C_SUFFIXES, c_functions)):
        for path in sources(*suffixes):
            for name, lines in functions(path.read_text(encoding="utf-8")):
                found[f"{path.relative_to(ROOT)}: {name}"] = lines
    assert len(found) > 5000
    assert {name: lines for name, lines in found.items() if lines > FUNCTION_LINES} == {}


def test_a_long_function_is_found() -> None:
    body = "    ++x;\n" * 90
    assert dict(c_functions(f"static int many(int x) {{\n{body}}}\nint one(void) {{\n}}\n")) == {"many": 92, "one": 2}
    assert dict(c_functions(f"void Robot::far(int a,\n                int b) {{\n{body}}}\n")) == {"far": 93}
