# SPDX-License-Identifier: MIT
"""Options of the command line that are declared twice, or that mean different things in different commands.

An option that several commands share is declared once, and all of them use it. Where a name means something else in
another command, MEANINGS says how many meanings it has, so that no further one comes unseen.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

CLI = Path(__file__).resolve().parents[2] / "host" / "omni" / "cli"


def declarations(folder: Path = CLI) -> Iterator[tuple[str, str, str]]:
    """Yield name, help text and place of every option that a ``typer.Option(...)`` in this folder declares."""
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "typer.Option":
                said = next((ast.unparse(word.value) for word in node.keywords if word.arg == "help"), "")
                for name in node.args:
                    if isinstance(name, ast.Constant) and str(name.value).startswith("--"):
                        yield str(name.value), said, f"{path.name}:{node.lineno}"


def declared_twice(folder: Path = CLI) -> list[str]:
    """Return the options that two places declare with the same words."""
    places: dict[tuple[str, str], list[str]] = defaultdict(list)
    for name, said, place in declarations(folder):
        places[name, said].append(place)
    return [f"{name} at {' and '.join(found)}" for (name, _), found in sorted(places.items()) if len(found) > 1]


def meanings(commands: Mapping[str, Any]) -> dict[str, dict[str, list[str]]]:
    """Return per option of these commands its help texts, each with the commands that have it."""
    found: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for name, command in commands.items():
        for option in command.params:
            for word in option.opts if option.param_type_name == "option" else ():
                if word.startswith("--"):
                    found[word][option.help or ""].append(name)
    return found
