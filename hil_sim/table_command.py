# SPDX-License-Identifier: MIT
"""What the commands that print a page's table share: numbers of runs that make sense, and lines that show at once."""

from __future__ import annotations

import argparse
import sys


def need_one_or_more(parser: argparse.ArgumentParser, chosen: argparse.Namespace, *names: str) -> None:
    """End the program with exit code 2 and a message if one of these options is below 1."""
    for name in names:
        if getattr(chosen, name) < 1:
            parser.error(f"--{name} is {getattr(chosen, name)}; must be 1 or more")


def say(text: str) -> None:
    """Print a line of a table at once: the next one can take minutes."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()
