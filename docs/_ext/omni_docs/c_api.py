# SPDX-License-Identifier: MIT
"""One page per header of the control core: its head comment, then each declaration with its comment.

libclang's wheel brings no headers of the compiler, so the few that the core includes are stubs here. Nothing is
compiled: only names, comments and the text of the declarations count.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from clang.cindex import CursorKind, Index, TranslationUnit

from hil_sim.schema import WORLD
from omni_docs.markdown import escaped, page


def reading_members() -> str:
    """Return the members of omni_inputs_t that the build makes of the sensors' readings."""
    lines = []
    for reading in WORLD.readings:
        kind, count = {"real": "omni_real_t", "int": "omni_int_t"}[reading.kind], f"[{reading.count}]"
        lines.append(f"{kind} {reading.name}{count if reading.count else ''}; /**< {reading.meaning} */")
        if reading.valid:
            lines.append(f"uint8_t {reading.valid}; /**< {reading.valid_meaning} */")
    return "\n".join(lines) + "\n"


_STUBS = {
    "stdbool.h": "#define bool _Bool\n",
    "stddef.h": "typedef unsigned long size_t;\n#define NULL 0\n",
    "stdint.h": "".join(
        f"typedef {sign} {kind} {name}{bits}_t;\n"
        for sign, name in (("signed", "int"), ("unsigned", "uint"))
        for kind, bits in (("char", 8), ("short", 16), ("int", 32), ("long long", 64))
    ),
    "string.h": "",
    "omni/input_readings_gen.h": reading_members(),
    "omni/params_gen.h": "enum { OMNI_PARAM_COUNT = 1 };\n",
    "omni/modules_gen.h": '#include "omni/direct_torque.h"\n#include "omni/ismc.h"\n'
    "#define OMNI_CTL_MODE_CONFIG_MEMBERS\n#define OMNI_CTL_MODE_STATE_MEMBERS\n",
}
_STUB_FILES = {f"/stubs/{name}": f"#pragma once\n{body}" for name, body in _STUBS.items()}
_HEAD = re.compile(r"/\*\*\s*\n \* @file (\S+)\s*\n(.*?)\*/", re.DOTALL)


def _words(comment: str | None) -> str:
    if not comment:
        return ""
    text = re.sub(r"^/\*\*?<?|\*/$", "", comment.strip())
    return re.sub(r"^\s*\* ?", "", text, flags=re.MULTILINE).strip()


def _prose(comment: str | None) -> str:
    text, *tagged = re.split(r"(?=@(?:param|return)\b)", _words(comment))
    paragraphs = [escaped(" ".join(part.split())) for part in text.split("\n\n")]
    fields = []
    for entry in tagged:
        entry = " ".join(entry.split())
        if entry.startswith("@return"):
            fields.append(f"Returns: {escaped(entry[7:].strip())}")
        else:
            name, _, about = entry[6:].strip().partition(" ")
            fields.append(f"`{name}`: {escaped(about)}")
    return "\n\n".join(part for part in [*paragraphs, *fields] if part)


def _declaration(cursor: Any, text: bytes) -> str:
    extent = text[cursor.extent.start.offset : cursor.extent.end.offset].decode()
    return " ".join(re.sub(r"/\*.*?\*/", " ", extent, flags=re.DOTALL).split())


def _block(kind: str, signature: str, body: str, depth: int) -> str:
    fence = "`" * (8 - depth)
    return f"{fence}{{c:{kind}}} {signature}\n\n{body}\n{fence}"


def _fields(cursor: Any, text: bytes) -> Iterator[str]:
    for field in cursor.get_children():
        if field.kind == CursorKind.FIELD_DECL and not field.is_anonymous():
            where = _STUB_FILES.get(str(field.location.file))
            declaration = _declaration(field, text if where is None else where.encode())
            yield _block("member", declaration, _prose(field.raw_comment), 1)


def _enumerators(cursor: Any, text: bytes) -> Iterator[str]:
    for entry in cursor.get_children():
        if entry.kind == CursorKind.ENUM_CONSTANT_DECL:
            yield _block("enumerator", _declaration(entry, text), _prose(entry.raw_comment), 1)


def _part(cursor: Any, text: bytes) -> str:
    comment = _prose(cursor.raw_comment)
    if cursor.kind == CursorKind.FUNCTION_DECL:
        return _block("function", _declaration(cursor, text), comment, 0)
    if cursor.kind == CursorKind.STRUCT_DECL and cursor.is_definition():
        return _block("struct", cursor.spelling, "\n\n".join([comment, *_fields(cursor, text)]), 0)
    if cursor.kind == CursorKind.ENUM_DECL:
        if cursor.is_anonymous() or not cursor.spelling or "(unnamed" in cursor.spelling:
            return "\n\n".join(
                _block("macro", entry.spelling, _prose(entry.raw_comment), 0) for entry in cursor.get_children()
            )
        return _block("enum", cursor.spelling, "\n\n".join([comment, *_enumerators(cursor, text)]), 0)
    if cursor.kind == CursorKind.VAR_DECL:
        return _block("var", _declaration(cursor, text).removeprefix("extern "), comment, 0)
    if cursor.kind == CursorKind.TYPEDEF_DECL and "{" not in _declaration(cursor, text):
        return _block("type", _declaration(cursor, text).removeprefix("typedef "), comment, 0)
    return ""


def header_page(header: Path, include: Path, index: Index) -> str:
    """Return the page of one header."""
    text = header.read_bytes()
    unit = index.parse(
        str(header),
        ["-x", "c", "-std=c99", "-nostdinc", f"-I{include}", "-I/stubs"],
        list(_STUB_FILES.items()),
        TranslationUnit.PARSE_SKIP_FUNCTION_BODIES,
    )
    broken = [found.spelling for found in unit.diagnostics if found.severity >= 3]
    if broken:
        raise ValueError(f"{header}: {broken[0]}")
    head = _HEAD.search(text.decode())
    about = re.sub(r"^ \* ?", "", head[2], flags=re.MULTILINE).rstrip() if head else ""
    here = [item for item in unit.cursor.get_children() if str(item.location.file) == str(header)]
    parts = [_part(item, text) for item in here]
    return page(f"# {header.name}", f'`#include "omni/{header.name}"`', f"```text\n{about}\n```", *parts)


def pages(root: Path) -> dict[str, str]:
    """Return the pages by their names: an index, and one for each header."""
    include = root / "shared" / "core" / "include"
    index = Index.create()
    headers = sorted((include / "omni").glob("*.h"))
    made = {f"c/{header.stem}.md": header_page(header, include, index) for header in headers}
    names = "\n".join(["```{toctree}", ":maxdepth: 1", "", *[header.stem for header in headers], "```"])
    first = page(
        "# C API",
        "The control core: C99, no heap, no globals, no clock.",
        "One function is the whole robot: {c:func}`omni_robot_tick`.",
        names,
    )
    return {"c/index.md": first, **made}
