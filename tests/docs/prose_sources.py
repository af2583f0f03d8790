# SPDX-License-Identifier: MIT
"""What people read: pages, docstrings and help texts of Python, comments of headers, texts of the tables."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from omni_schema.toml_file import read_toml

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ("docs/reference/generated/", "docs/report/results.md")
PYTHON = ("host/omniwheel", "hil_sim", "omni_reproduce", "bench", "shared/generate")
HEADERS = ("shared/core/include", "hil_sim/include", "firmware/app")
TABLES = ("shared/params.toml", "shared/world.toml")

_BLOCK = re.compile(r"/\*\*<?(.*?)\*/", re.DOTALL)
_LINES = re.compile(r"(?:^[ \t]*///<?.*\n)+", re.MULTILINE)
_TRAILING = re.compile(r"\S[^\n]*?///<[ \t]*(.*)$", re.MULTILINE)
_TAG = re.compile(r"@(?:param\s+\S+|return\b)")
_HELP = ("help", "epilog", "short_help")


def pages() -> dict[str, str]:
    """Return the pages that people write, by name."""
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "shared/core/README.md"]
    found = {_name(page): page.read_text(encoding="utf-8") for page in [*files, *sorted((ROOT / "docs").rglob("*.md"))]}
    return {name: text for name, text in found.items() if not name.startswith(GENERATED)}


def code() -> dict[str, str]:
    """Return what the sources say to people, by the file's name: paragraphs of Markdown."""
    python = [path for folder in PYTHON for path in sorted((ROOT / folder).rglob("*.py"))]
    headers = [path for folder in HEADERS for path in sorted((ROOT / folder).rglob("*.h"))]
    found = {_name(path): python_text(path.read_text(encoding="utf-8")) for path in python}
    found |= {_name(path): header_text(path.read_text(encoding="utf-8")) for path in headers}
    found |= {name: table_text(read_toml(ROOT / name)) for name in TABLES if (ROOT / name).is_file()}
    return found


def python_text(source: str) -> str:
    """Return the docstrings of what is public, and the help texts of commands and options."""
    return "\n\n".join(_python_parts(ast.parse(source)))


def _python_parts(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            docstring = ast.get_docstring(node)
            if docstring and not getattr(node, "name", "").startswith("_"):
                yield docstring
        elif isinstance(node, ast.Call):
            for word in node.keywords:
                if word.arg in _HELP and isinstance(word.value, ast.Constant) and isinstance(word.value.value, str):
                    yield word.value.value


def header_text(source: str) -> str:
    """Return the comments that document a header, without its laws: indented lines behind an empty one."""
    blocks = [re.sub(r"^[ \t]*\*[ \t]?", "", match[1], flags=re.MULTILINE) for match in _BLOCK.finditer(source)]
    blocks += [re.sub(r"^[ \t]*///<?[ \t]?", "", match[0], flags=re.MULTILINE) for match in _LINES.finditer(source)]
    blocks += [match[1] for match in _TRAILING.finditer(source)]
    texts = [re.sub(r"@file \S+", "", _without_laws(block)) for block in blocks]
    return "\n\n".join("\n\n".join(_TAG.split(text)) for text in texts)


def _without_laws(block: str) -> str:
    kept: list[str] = []
    law = True
    for line in block.splitlines():
        law = not line.strip() or (law and line.startswith("  "))
        kept.append("" if law else line.strip())
    return "\n".join(kept)


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
