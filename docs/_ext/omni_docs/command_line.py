# SPDX-License-Identifier: MIT
"""One page per command of ``omni``, from the parsers themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer
from rich.text import Text

from omni import checks
from omni.cli import app
from omni_docs.markdown import code, escaped, page, table


def plain(marked: str | None) -> str:
    """Return a help text without the terminal's colours."""
    return Text.from_markup(marked).plain if marked else ""


def _prose(text: str) -> str:
    return escaped(plain(text).replace("\b", "")).strip()


def _argument(option: Any) -> str:
    name = option.metavar or option.name.upper()
    return name if option.required or name.startswith("[") else f"[{name}]"


def _usage(command: Any, words: tuple[str, ...]) -> str:
    given = [_argument(option) for option in command.params if option.param_type_name == "argument"]
    below = ["COMMAND"] if hasattr(command, "list_commands") else []
    return " ".join([*words, "[OPTIONS]", *given, *below])


def _options(command: Any) -> str:
    rows = []
    for option in command.params:
        names = ", ".join(code(name) for name in [*option.opts, *option.secondary_opts])
        if option.param_type_name == "argument":
            names = code(_argument(option))
        elif option.metavar:
            names += f" {code(option.metavar)}"
        rows.append([names, _prose(getattr(option, "help", "") or "")])
    return table(["Option", "Meaning"], rows) if rows else ""


def _examples(command: Any) -> str:
    lines = [line.strip() for line in plain(command.epilog).splitlines()]
    shown = [line for line in lines if line.startswith(("omni", "python", "make", "mavproxy"))]
    return "\n".join(["```console", *[f"$ {line}" for line in shown], "```"]) if shown else ""


def _context(command: Any, name: str, parent: Any = None) -> Any:
    return command.context_class(command, info_name=name, parent=parent)


def _parts(command: Any, context: Any, words: tuple[str, ...]) -> Iterator[str]:
    yield f"{'#' * (len(words) - 1)} {' '.join(words)}"
    yield _prose(command.help or "")
    yield f"```text\n{_usage(command, words)}\n```"
    yield _options(command)
    yield _examples(command)
    for name, child in _children(command, context):
        yield from _parts(child, _context(child, name, context), (*words, name))


def _children(command: Any, context: Any) -> list[tuple[str, Any]]:
    if not hasattr(command, "list_commands"):
        return []
    found = [(name, command.get_command(context, name)) for name in command.list_commands(context)]
    return [(name, child) for name, child in found if child is not None and not child.hidden]


def pages() -> dict[str, str]:
    """Return the pages by their names: an index, and one for each command of the first level."""
    root: Any = typer.main.get_command(app)
    context = _context(root, "omni")
    made = {}
    rows = []
    for name, child in _children(root, context):
        made[f"cli/{name}.md"] = page(*_parts(child, _context(child, name, context), ("omni", name)))
        rows.append([f"[`omni {name}`]({name}.md)", _prose(re.split(r"[.](?:\s|$)|\n\n", child.help or "")[0])])
    project: Any = typer.main.get_command(checks.app)
    words = ("python -m", "omni.checks")
    made["cli/checks.md"] = page(*_parts(project, _context(project, " ".join(words)), words))
    rows.append([f"[`{' '.join(words)}`](checks.md)", _prose(project.help)])
    names = "\n".join(["```{toctree}", ":hidden:", *[name.partition("/")[2][:-3] for name in made], "```"])
    first = [
        "# The command line",
        "Every command has `--help`. Those that report have `--json`. Exit codes: 0 done, 1 failed, 2 bad input, "
        "130 interrupted.",
        table(["Command", "What it does"], rows),
        "## Options of every command",
        _options(root),
        names,
    ]
    return {"cli/index.md": page(*first), **made}
