# SPDX-License-Identifier: MIT
"""The page of ``omni --help``: drawn with little of rich.

typer's own pages look the same. They also import what draws Markdown and tracebacks, which takes longer than all the
rest of this page together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from omni.cli.command_table import Entry


def print_front_page(group: Any, ctx: Any, entries: Sequence[Entry]) -> None:
    """Print the usage, the options and the commands (``entries``) in their groups."""
    from rich.console import Console
    from rich.padding import Padding

    console = Console(highlight=False, emoji=False)
    usage = " ".join([ctx.command_path, *group.collect_usage_pieces(ctx)])
    console.print(Padding(f"[yellow]Usage:[/] [bold]{_plain(usage)}[/]", 1))
    console.print(Padding(group.help, (0, 1, 1, 1)))
    console.print(_panel("Options", (_option_row(option, ctx) for option in group.get_params(ctx)), width=None))
    width = max(len(entry.name) for entry in entries)
    for title in dict.fromkeys(entry.group for entry in entries):
        rows = ((f"[bold cyan]{entry.name}[/]", entry.summary) for entry in entries if entry.group == title)
        console.print(_panel(title, rows, width))


def _option_row(option: Any, ctx: Any) -> tuple[str, str]:
    words = ", ".join((*option.opts, *option.secondary_opts))
    value = "" if option.is_flag else f" [bold yellow]{_plain(option.metavar or 'TEXT')}[/]"
    variable = f" [dim yellow]\\[env var: {option.envvar}][/]" if option.envvar else ""
    return f"[bold cyan]{words}[/]{value}", f"{option.help}{variable}"


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)


def _panel(title: str, rows: Iterable[tuple[str, str]], width: int | None) -> Any:
    from rich.panel import Panel
    from rich.table import Table

    table = Table(box=None, show_header=False, expand=True, pad_edge=False, padding=(0, 1))
    table.add_column(no_wrap=True, width=width)
    table.add_column(ratio=1)
    for row in rows:
        table.add_row(*row)
    return Panel(table, title=title, title_align="left", border_style="dim")
