# SPDX-License-Identifier: MIT
"""The command line of a table with a row for each setting of ``omni reproduce limits``, in Markdown."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence

from hil_sim.table_command import say
from omni_schema.errors import did_you_mean


def print_table(
    program: tuple[str | None, str | None],
    known: Sequence[str],
    headings: Sequence[str],
    line: Callable[..., str],
    arguments: Sequence[str] | None,
    wheels: Sequence[str] = (),
) -> None:
    """Print the table, a row as soon as it is known.

    ``program`` is its name and its help. ``line`` makes a row from a setting and the number of seeds.
    With ``wheels``, kinds of them to choose from, it also gets the one that was chosen; the first by default.
    """
    parser = argparse.ArgumentParser(prog=program[0], description=program[1])
    parser.add_argument("settings", nargs="*", metavar="SETTING", help=f"of: {', '.join(known)}")
    parser.add_argument("--seeds", type=int, default=16, help="seeds of each cell (16)")
    if wheels:
        parser.add_argument("--wheels", choices=wheels, default=wheels[0], help=f"the world's ({wheels[0]})")
    chosen = parser.parse_args(arguments)
    for name in chosen.settings:
        if name not in known:
            parser.error(f"no setting {name!r}{did_you_mean(name, known)}; there are {', '.join(known)}")
    if chosen.seeds < 1:
        parser.error(f"--seeds is {chosen.seeds}; must be 1 or more")
    say(f"| setting | {' | '.join(headings)} |")
    say("|---" * (1 + len(headings)) + "|")
    for key in chosen.settings or known:
        say(line(key, chosen.seeds, *([chosen.wheels] if wheels else [])))
