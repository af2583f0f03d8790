# SPDX-License-Identifier: MIT
"""What people read: pages; docstrings, comments and help texts of Python; comments of C and C++; texts of tables."""

from __future__ import annotations

import ast
import inspect
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from omni_schema.toml_file import read_toml
from tests.docs.prose_c import c_code

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ("docs/reference/generated/", "docs/report/results.md")
PYTHON = ("host/omniwheel", "hil_sim", "omni_reproduce", "bench", "shared/generate")
TABLES = ("shared/params.toml", "shared/world.toml")

_TABLE = re.compile(r"^=+  =+$.*?^=+  =+$", re.MULTILINE | re.DOTALL)
"""A table in a docstring: its cells are no sentences."""
_FOR_TOOLS = re.compile(r"# (?:SPDX|noqa|type:|fmt:|ruff:|pragma)")
_HELP = ("help", "epilog", "short_help")


def pages() -> dict[str, str]:
    """Return the pages that people write, by name."""
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", ROOT / "shared/core/README.md"]
    found = {_name(page): page.read_text(encoding="utf-8") for page in [*files, *sorted((ROOT / "docs").rglob("*.md"))]}
    return {name: text for name, text in found.items() if not name.startswith(GENERATED)}


def code() -> dict[str, str]:
    """Return what the sources say to people, by the file's name: paragraphs of Markdown."""
    python = [path for folder in PYTHON for path in sorted((ROOT / folder).rglob("*.py"))]
    found = {_name(path): python_text(path.read_text(encoding="utf-8")) for path in python}
    found |= c_code()
    found |= {name: table_text(read_toml(ROOT / name)) for name in TABLES if (ROOT / name).is_file()}
    return found


def python_text(source: str) -> str:
    """Return docstrings, also those below a name, help texts of commands and options, and comments."""
    parts = "\n\n".join((*_python_parts(ast.parse(source)), *_comments(source)))
    return _TABLE.sub("", parts)


def _comments(source: str) -> Iterator[str]:
    """Return the comments; lines below each other are one. What is said to tools is none."""
    block: list[str] = []
    row = 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT or _FOR_TOOLS.match(token.string):
            continue
        alone = not token.line[: token.start[1]].strip()
        if block and not (alone and token.start[0] == row + 1):
            yield " ".join(block)
            block = []
        block.append(token.string.lstrip("# "))
        row = token.start[0] if alone else -1
    yield " ".join(block)


def _python_parts(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield inspect.cleandoc(node.value.value)
        elif isinstance(node, ast.Call):
            for word in node.keywords:
                if word.arg in _HELP and isinstance(word.value, ast.Constant) and isinstance(word.value.value, str):
                    yield word.value.value


def table_text(table: Any) -> str:
    """Return all texts called ``doc`` or ``description`` of a TOML file."""
    if isinstance(table, dict):
        own = [text for key, text in table.items() if key in ("doc", "description") and isinstance(text, str)]
        return "\n\n".join([*own, *(table_text(entry) for entry in table.values())])
    if isinstance(table, list):
        return "\n\n".join(table_text(entry) for entry in table)
    return ""


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()
