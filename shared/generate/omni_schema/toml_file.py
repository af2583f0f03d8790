# SPDX-License-Identifier: MIT
"""Reads a TOML file and takes typed values out of it, with errors that say what to do."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from omni_schema.errors import SchemaError, did_you_mean

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_DEEPEST = 16
_LARGEST = 2**64


def read_toml(path: Path) -> dict[str, Any]:
    """Parse the TOML file at ``path``; raise SchemaError if it cannot be read or is not TOML."""
    try:
        if path.is_char_device():  # /dev/zero has no end
            raise SchemaError(str(path), "", "is a device; give a file")
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise SchemaError(str(path), "", "no such file; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise SchemaError(str(path), "", f"cannot be read as UTF-8 text: {error}") from error
    return parse_toml(str(path), text)


def parse_toml(source: str, text: str) -> dict[str, Any]:
    """Parse TOML that errors say is ``source``'s; raise SchemaError if it is not TOML."""
    try:
        document: dict[str, Any] = tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as error:
        raise SchemaError(source, "", f"is not valid TOML: {error}") from error
    except ValueError as error:  # a number of more digits than Python reads
        raise SchemaError(source, "", f"cannot be read: {error}") from error
    except RecursionError:
        raise SchemaError(source, "", "cannot be read: its tables or lists are nested too deep") from None
    _refuse_monsters(source, "", document, 0)
    return document


def _refuse_monsters(source: str, key: str, value: object, depth: int) -> None:
    """Refuse what no check could handle or even show: nesting without end and integers that no float holds."""
    if depth > _DEEPEST:
        raise SchemaError(source, key, f"is nested deeper than {_DEEPEST} levels")
    if isinstance(value, dict):
        for name, item in value.items():
            _refuse_monsters(source, f"{key}.{name}" if key else name, item, depth + 1)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            _refuse_monsters(source, f"{key}[{number}]", item, depth + 1)
    elif isinstance(value, int) and abs(value) > _LARGEST:
        raise SchemaError(source, key, "is a number too large for a robot")


def take_table(source: str, key: str, value: object) -> dict[str, Any]:
    """Return ``value`` if it is a table."""
    if not isinstance(value, dict):
        raise SchemaError(source, key, f"is {value!r}; a table [{key}] is needed here")
    return value


def take_text(source: str, key: str, value: object) -> str:
    """Return ``value`` if it is a string."""
    if not isinstance(value, str):
        raise SchemaError(source, key, f"is {value!r}; a string is needed here")
    return value


def take_number(source: str, key: str, value: object) -> float:
    """Return ``value`` as a float if it is a finite number; booleans are no numbers."""
    needed = "a finite number is needed here"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise SchemaError(source, key, f"is {value!r}; {needed}")
    try:
        number = float(value)
    except OverflowError as error:  # an integer of hundreds of digits
        raise SchemaError(source, key, f"is an integer that is too large; {needed}") from error
    if not math.isfinite(number):
        raise SchemaError(source, key, f"is {value!r}; {needed}")
    return number


def number_within(source: str, key: str, value: object, low: float, high: float) -> float:
    """Return a number from ``low`` to ``high``. Raises SchemaError that names it and what is allowed."""
    number = take_number(source, key, value)
    if not low <= number <= high:
        raise SchemaError(source, key, f"is {number:g}; allowed is a number from {low:g} to {high:g}")
    return number


def take_chip(source: str, key: str, value: object, chips: Iterable[str]) -> str:
    """Return ``value`` if it is the name of one of the ``chips`` that the firmware has drivers for."""
    known = list(chips)
    if not isinstance(value, str) or value not in known:
        problem = f"is {value!r}{did_you_mean(str(value), known)}; the firmware has drivers for {', '.join(known)}"
        raise SchemaError(source, key, problem)
    return value


def refuse_misplaced_parameters(source: str, document: Mapping[str, object]) -> None:
    """Raise SchemaError for the first parameter outside the section ``[parameters]`` of a document that may have one.

    In such documents parameters are the only names in capitals.
    """
    others = {name: section for name, section in document.items() if name != "parameters"}
    inside = [f"{name}.{key}" for name, section in others.items() if isinstance(section, Mapping) for key in section]
    for key in (*others, *inside):
        if key.rpartition(".")[2].isupper():
            raise SchemaError(source, key, "is a parameter; write it in the section [parameters]")


def refuse_unknown_keys(source: str, prefix: str, table: Mapping[str, object], known: Iterable[str]) -> None:
    """Raise SchemaError for the first key of ``table`` that is not in ``known``."""
    allowed = list(known)
    for key in table:
        if key not in allowed:
            hint = did_you_mean(key, allowed)
            raise SchemaError(source, f"{prefix}{key}", f"unknown key{hint}; allowed are {', '.join(allowed)}")
