# SPDX-License-Identifier: MIT
"""Tables as CSV files: the heading line says which column is what, and every row has as many cells.

Without a heading line, which is one of numbers only, the columns are in their documented order. A byte order mark and
blank lines are passed over. Numbers have decimal points.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omni_schema.errors import did_you_mean
from omniwheel.errors import OmniError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Table:
    """The numbers of a table: an array (n,) per column, by its name, and the line of the file of each row (n,)."""

    columns: dict[str, Array]
    lines: tuple[int, ...]


@dataclass(frozen=True)
class TableFormat:
    """What a table may hold, and the error that says what is wrong with it.

    ``needed`` and ``optional`` are the columns in their documented order; without any, all names are allowed and there
    has to be a heading line. ``delimiter`` None: semicolons or tabs if there are some, else commas. ``comments``: lines
    with # are passed over, but for one before the numbers that names the columns, as numpy.savetxt writes it, with any
    separator between the names.
    """

    error: type[OmniError]
    hint: str
    needed: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    delimiter: str | None = None
    comments: bool = False

    def wrong(self, text: str) -> OmniError:
        """Return the error of a table that is not as it should be."""
        return self.error(text, hint=self.hint)


def read_table(path: Path, wanted: TableFormat) -> Table:
    """Read the table of a file. Raises the error of ``wanted``, which names the line."""
    rows, named = _rows(path, wanted)
    if not rows:
        raise wanted.wrong(f"{path} has no rows")
    if named is not None and not _is_heading(rows[0][1]):
        rows.insert(0, named)
    line, first = rows[0]
    if _is_heading(first):
        names, rows = tuple(first), rows[1:]
        _check_names(f"{path}:{line}", names, wanted)
    elif wanted.needed:
        names = _documented(f"{path}:{line}", len(first), wanted)
    else:
        raise wanted.wrong(f"{path}:{line}: no header line that names the columns")
    for number, row in rows:
        if len(row) != len(names):
            text = f"{path}:{number}: {len(row)} cells beside {len(names)} columns ({', '.join(names)})"
            raise wanted.error(text, hint=f"drop or repair that row; {wanted.hint}")
    numbers = [[_number(path, line, *pair, wanted) for pair in zip(names, row, strict=True)] for line, row in rows]
    table = np.array(numbers, dtype=np.float64).reshape(len(rows), len(names))
    return Table({name: table[:, index] for index, name in enumerate(names)}, tuple(line for line, _ in rows))


_Row = tuple[int, list[str]]
"""Number of its line, cells."""


def _rows(path: Path, wanted: TableFormat) -> tuple[list[_Row], _Row | None]:
    """Return the rows, and the comment before them that names columns, if there is one."""
    if path.is_char_device():  # /dev/zero has no end
        raise wanted.wrong(f"{path} is a device; give a file")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        comments = [
            (number, line) for number, line in enumerate(lines, start=1) if wanted.comments and _is_comment(line)
        ]
        for number, _ in comments:
            lines[number - 1] = ""
        delimiter = wanted.delimiter or next((sign for sign in ";\t" if any(sign in line for line in lines)), ",")
        reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=True)
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise wanted.wrong(f"{path}: cannot be read: {reason}") from error
    rows = [(line, row) for line, row in rows if any(row)]
    if not rows:
        return rows, None
    first_line, first = rows[0]
    before = [(number, line.lstrip("# \t")) for number, line in reversed(comments) if number < first_line]
    named = ((number, _names_in(text, delimiter, len(first), wanted)) for number, text in before)
    return rows, next(((number, names) for number, names in named if names is not None), None)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _names_in(comment: str, delimiter: str, count: int, wanted: TableFormat) -> list[str] | None:
    """Return what a comment names the columns, for a table of ``count`` columns; None if it is about something else.

    It is about them if all of its words are names of columns, whatever is between these, perhaps with units. Or it has
    as many cells as a row, and a column's name in one of them. What it says may be wrong: then the names are, too.
    """
    known = {*wanted.needed, *wanted.optional}
    words = re.findall(r"\w+", comment)
    if words and all(word.lower() in known for word in words):
        return words
    for sign in (delimiter, *",;\t|"):
        cells = [cell.strip() for cell in comment.split(sign)]
        if len(cells) == count > 1 and any(word.lower() in known for word in words):
            return cells
    without_units = re.findall(r"\w+", re.sub(r"\[.*?\]|\(.*?\)", " ", comment))
    if without_units and all(word.lower().split("_")[0] in known for word in without_units):
        return [comment.strip()]
    return None


def _is_heading(row: Sequence[str]) -> bool:
    """Say whether a row names columns: there are letters in it, and no numbers."""
    return any(re.search(r"[^\W\d_]", cell) for cell in row) and not any(_is_number(cell) for cell in row)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _check_names(where: str, names: Sequence[str], wanted: TableFormat) -> None:
    known = (*wanted.needed, *wanted.optional)
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise wanted.wrong(f"{where}: duplicate column name {twice!r}")
    if not known:
        if len(names) == 1:
            raise wanted.wrong(f"{where}: only one column: {names[0]!r}")
        return
    missing = [name for name in wanted.needed if name not in names]
    unknown = next((name for name in names if name not in known), None)
    if unknown is not None:
        guess = did_you_mean(unknown, list(known))
        raise wanted.wrong(f"{where}: unknown column {unknown!r}{guess}; the columns are {', '.join(known)}")
    if missing:
        raise wanted.wrong(f"{where}: the column {missing[0]} is missing; the columns are {', '.join(known)}")


def _documented(where: str, count: int, wanted: TableFormat) -> tuple[str, ...]:
    """Return the names of so many columns without a heading line."""
    for names in (wanted.needed, (*wanted.needed, *wanted.optional)):
        if count == len(names):
            return names
    raise wanted.wrong(f"{where}: {count} cells instead of {len(wanted.needed)} ({', '.join(wanted.needed)})")


def _number(path: Path, line: int, column: str, text: str, wanted: TableFormat) -> float:
    try:
        if "_" in text:  # which Python reads as nothing
            raise ValueError(text)
        return float(text)
    except ValueError:
        raise wanted.wrong(f"{path}:{line}: {column} is {text!r}, which is not a number with a decimal point") from None
