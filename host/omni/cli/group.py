# SPDX-License-Identifier: MIT
"""``omni`` itself: its commands by group, imported when used, and what errors look like."""

from __future__ import annotations

import errno
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup

from omni.cli.command_table import TABLE, Entry, by_name, load
from omni.cli.common import BAD_INPUT, FAILED, INTERRUPTED, JSON_WANTED, note, print_json
from omni.cli.completion import complete_words_unquoted
from omni.cli.front_page import print_front_page
from omniwheel.build_record import load_record
from omniwheel.errors import OmniError
from omniwheel.files import write_error
from omniwheel.paths import MissingFileError
from omniwheel.stale_build import HINT, stale_build

_ANYWHERE = ("--signing-key", "--system")


class OmniGroup(TyperGroup):
    """Turns expected errors into one line and a hint on standard error, and into an exit code: no tracebacks.

    Its commands are those of the table. Help and completion of ``omni`` itself show the table and import none of them.
    """

    entries: ClassVar[Mapping[str, Entry]] = by_name(TABLE)
    _listing = False

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        complete_words_unquoted(self)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names in the order of the table."""
        return list(self.entries)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command, or what stands for it while the commands are listed."""
        entry = self.entries.get(cmd_name)
        if entry is None:
            return None
        return _line_of(entry) if self._listing else load(entry)

    @contextmanager
    def _lists(self) -> Iterator[None]:
        self._listing = True
        try:
            yield
        finally:
            self._listing = False

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help page."""
        with self._lists():
            print_front_page(self, ctx, list(self.entries.values()))

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return the commands and options that begin so."""
        with self._lists():
            return super().shell_complete(ctx, incomplete)

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        warn_of_newer_sources()
        try:
            return super().invoke(ctx)
        except OmniError as error:
            raise _reported(ctx, error, error.hint, error.exit_code) from error
        except ValueError as error:
            from omni_schema.errors import SchemaError

            if not isinstance(error, SchemaError):
                raise
            raise _reported(ctx, error, error.hint, BAD_INPUT) from error
        except MissingFileError as error:
            raise _reported(ctx, error, "", FAILED) from error
        except OSError as error:  # unexpected disk errors, also of standard output
            raise _system_error(ctx, error) from error
        except (ImportError, AttributeError) as error:
            said = stale_build(error)
            if said is None:
                raise
            raise _reported(ctx, OmniError(said), HINT, FAILED) from error
        except KeyboardInterrupt:
            note("[yellow]interrupted[/]")
            raise typer.Exit(INTERRUPTED) from None

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take --signing-key and --system from wherever they stand: they belong to every command that takes --link."""
        try:
            return super().parse_args(ctx, _options_first(args))
        except OSError as error:  # --install-completion writes into the home folder
            raise _system_error(ctx, error) from error

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command; for one that does not exist suggest the closest name."""
        if args[0] not in self.entries:
            from omni_schema.errors import did_you_mean

            ctx.fail(f"no such command: {args[0]}{did_you_mean(args[0], self.entries)}")
        return super().resolve_command(ctx, args)


def warn_of_newer_sources() -> None:
    """Print a warning if the source tree has changed since what runs was built from it."""
    with suppress(MissingFileError, OSError):  # without a build there is an error of its own
        record = load_record()
        newer = record.newer_inputs() if record else []
        if record and newer:
            more = f" and {len(newer) - 1} more" if len(newer) > 1 else ""
            note(f"warning: {newer[0]}{more} changed after the build; {record.remedy}")


def _line_of(entry: Entry) -> TyperCommand:
    return TyperCommand(entry.name, help=entry.summary, rich_help_panel=entry.group, callback=None)


def _system_error(ctx: typer.Context, error: OSError) -> typer.Exit:
    if error.errno == errno.EPIPE:  # the reader of the output has closed it
        raise error
    where = f"{error.filename}: " if error.filename else ""
    return _reported(ctx, OmniError(f"{where}{error.strerror or error}"), write_error("", error).hint, FAILED)


def _options_first(args: list[str]) -> list[str]:
    end = args.index("--") if "--" in args else len(args)
    first: list[str] = []
    rest: list[str] = []
    at = 0
    while at < end:
        option, equals, _ = args[at].partition("=")
        after = at + 1 if option not in _ANYWHERE or equals else min(at + 2, end)
        (first if option in _ANYWHERE else rest).extend(args[at:after])
        at = after
    return [*first, *rest, *args[end:]]


def _reported(ctx: typer.Context, error: Exception, hint: str, exit_code: int) -> typer.Exit:
    from rich.markup import escape

    from omni.cli.common import error_console

    error_console.print(f"[bold red]error:[/] {escape(str(error))}", soft_wrap=True)
    if hint:
        error_console.print(f"[dim]hint:[/] {escape(hint)}", soft_wrap=True)
    if ctx.meta.get(JSON_WANTED):
        with suppress(OSError):  # it may be standard output that fails
            problem = {"type": type(error).__name__, "message": str(error), "hint": hint}
            print_json({**getattr(error, "found", {}), "error": problem})
    return typer.Exit(exit_code)
