# SPDX-License-Identifier: MIT
"""The text of a robot file with some of its numbers replaced; comments and order stay."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

from omniwheel.errors import RobotFileError

Value = float | int | str | Sequence[float]

Changes = Mapping[str, tuple[Value, str]]
"""section.key: the new value and what is said of it in a comment."""

DIGITS = 6
_HEADING = re.compile(r"^\s*\[([a-z_]+)\]")
_ENTRY = re.compile(r"^\s*([a-zA-Z_0-9]+)\s*=")


def edited(text: str, replaced: Changes) -> str:
    """Return a robot file's text with these keys replaced in place, or added at the end of their section."""
    lines: list[str] = []
    left = dict(replaced)
    section = ""
    for line in text.splitlines():
        heading, entry = _HEADING.match(line), _ENTRY.match(line)
        if heading:
            _add_missing(lines, section, left)
            section = heading.group(1)
        key = f"{section}.{entry.group(1)}" if entry else ""
        lines.append(_line(key, *left.pop(key)) if key in left else line)
    _add_missing(lines, section, left)
    for key in left:
        raise RobotFileError(f"the template has no section [{key.partition('.')[0]}] for {key}")
    return "\n".join(lines) + "\n"


def written(sections: Changes) -> str:
    """Return these keys as text, each section under its heading, in the order given."""
    lines: list[str] = []
    section = ""
    for key, (value, comment) in sections.items():
        if key.partition(".")[0] != section:
            section = key.partition(".")[0]
            lines += ["", f"[{section}]"]
        lines.append(_line(key, value, comment))
    return "\n".join(lines) + "\n"


def section_text(text: str, section: str) -> str:
    """Return the lines of a section of a robot file as they stand, without its heading and empty lines at its end."""
    lines: list[str] = []
    inside = False
    for line in text.splitlines():
        heading = _HEADING.match(line)
        if heading:
            inside = heading.group(1) == section
        elif inside:
            lines.append(line)
    return "\n".join(lines).rstrip() + "\n"


def _line(key: str, value: Value, comment: str) -> str:
    shown = _shown(value) if isinstance(value, (str, int, float)) else f"[{', '.join(_shown(item) for item in value)}]"
    line = f"{key.partition('.')[2]} = {shown}"
    return f"{line}  # {comment}" if comment else line


def _shown(value: float | int | str) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int):
        return str(value)
    text = f"{value:.{DIGITS}g}"
    return text if "." in text or "e" in text else f"{text}.0"


def _add_missing(lines: list[str], section: str, left: dict[str, tuple[Value, str]]) -> None:
    """Add the section's keys that were not in it, before the empty lines at its end."""
    keys = [key for key in left if key.partition(".")[0] == section]
    at = len(lines)
    while at > 0 and not lines[at - 1].strip():
        at -= 1
    lines[at:at] = [_line(key, *left.pop(key)) for key in keys]
