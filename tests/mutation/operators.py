# SPDX-License-Identifier: MIT
"""All small changes that the operators can make to C and C++ sources, found through Clang's syntax tree.

A mutant is known by its function, its operator and the text of its line before and after, so that lines that move do
not matter. What a macro brings is left alone; ``omni_select``, ``omni_all`` and ``omni_any`` are read as what they are
in C.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from clang.cindex import CursorKind, Index, TokenKind, TypeKind

OPERATORS = (
    "comparison",
    "arithmetic",
    "constant",
    "off by one",
    "negated condition",
    "removed statement",
    "swapped arguments",
    "early return",
    "logical connector",
    "sign",
)

COMPARISONS = {
    "<": ("<=", ">="),
    "<=": ("<", ">"),
    ">": (">=", "<="),
    ">=": (">", "<"),
    "==": ("!=",),
    "!=": ("==",),
}
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "*", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "^": "&"}
CONNECTORS = {"&&": "||", "||": "&&"}
FUNCTIONS = (
    CursorKind.FUNCTION_DECL,
    CursorKind.CXX_METHOD,
    CursorKind.CONSTRUCTOR,
    CursorKind.DESTRUCTOR,
    CursorKind.FUNCTION_TEMPLATE,
)
LOOPS = (CursorKind.WHILE_STMT, CursorKind.DO_STMT, CursorKind.FOR_STMT)
FLOATS = (TypeKind.FLOAT, TypeKind.DOUBLE)
SIGNED = (*FLOATS, TypeKind.INT, TypeKind.LONG, TypeKind.LONGLONG, TypeKind.SHORT, TypeKind.SCHAR)
SCALARS = (*SIGNED, TypeKind.UINT, TypeKind.ULONG, TypeKind.ULONGLONG, TypeKind.USHORT, TypeKind.UCHAR, TypeKind.BOOL)
FILE_SCOPE = "(file)"
_CHOICE = re.compile(rb"\bomni_(?:select|all|any)(?=\()")
_INTEGER = re.compile(r"(0[xX][0-9a-fA-F]+|\d+)([uUlL]*)")
_OPERATOR_ONLY = re.compile(r"\s*([-+*/%<>=!&|^]{1,3})\s*")


@dataclass(frozen=True)
class Mutant:
    """One change: ``new`` in place of the bytes from ``start`` to ``end`` of ``file`` (relative to the root)."""

    file: str
    function: str
    symbol: str
    """How the linker calls the function, of a template a pattern with stars; empty at file scope."""
    operator: str
    start: int
    end: int
    new: str
    was: str
    """The line or lines that change, spaces collapsed."""
    becomes: str
    number: int = 0
    """Tells mutants apart that read the same."""
    text: str = ""
    """Digest of the text around it: of its function, or of the whole file if it is in none."""

    @property
    def key(self) -> str:
        """Identity that does not depend on where the lines are, nor on the folder of the file."""
        words = (Path(self.file).name, self.function, self.operator, self.was, self.becomes, str(self.number))
        return hashlib.sha256("\0".join(words).encode()).hexdigest()[:16]

    def apply(self, source: bytes) -> bytes:
        """Return the changed source."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def text_digest(text: bytes) -> str:
    """Return a short name of a text that does not depend on how its lines are broken."""
    return hashlib.sha256(b" ".join(text.split())).hexdigest()[:16]


def resource_dir() -> list[str]:
    """Return the options that let libclang find its own headers: the PyPI package brings none."""
    if clang := shutil.which("clang"):
        found = subprocess.run(
            [clang, "-print-resource-dir"], capture_output=True, text=True, check=True
        ).stdout.strip()
        return ["-resource-dir", found]
    gcc = subprocess.run(["cc", "-print-file-name=include"], capture_output=True, text=True, check=True).stdout.strip()
    return ["-isystem", gcc]


def find_mutants(root: Path, sources: Sequence[Path], folder: Path, options: Sequence[str]) -> list[Mutant]:
    """Return the mutants of ``sources`` and of the headers in ``folder`` that they include, in order.

    Raises ValueError if a source does not compile with ``options``.
    """
    texts = {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.suffix in (".c", ".cpp", ".h")}
    # A choice is read as `(condition, a, b)`: the same length, and the type of what it yields.
    readable = {path: _CHOICE.sub(lambda match: b" " * len(match[0]), text) for path, text in texts.items()}
    unsaved = [(str(path), text.decode()) for path, text in readable.items()]
    index = Index.create()
    options = [*options, *resource_dir()]
    done: set[Path] = set()
    found: list[Mutant] = []
    for source in sources:
        unit = index.parse(str(source), args=list(options), unsaved_files=unsaved)
        wrong = [str(note) for note in unit.diagnostics if note.severity >= 3]
        if wrong:
            raise ValueError(f"{source}: {wrong[0]}")
        seen: set[Path] = set()
        for cursor in unit.cursor.get_children():
            _visit_declaration(cursor, _Reader(root, texts, done, seen, found))
        done |= seen
    return _numbered(found)


def _numbered(mutants: Sequence[Mutant]) -> list[Mutant]:
    """Return them without doubles; those that read the same get numbers."""
    places: set[tuple[str, int, int, str]] = set()
    counts: dict[str, int] = {}
    result = []
    for mutant in sorted(mutants, key=lambda m: (m.file, m.start, m.end, m.operator, m.new)):
        place = (mutant.file, mutant.start, mutant.end, mutant.new)
        if place in places:
            continue
        places.add(place)
        number = counts.get(mutant.key, 0)
        counts[mutant.key] = number + 1
        result.append(Mutant(**{**mutant.__dict__, "number": number}))
    return result


class _Reader:
    """What the visitors share: the texts, the file and the function they are in, and where mutants go."""

    def __init__(
        self, root: Path, texts: dict[Path, bytes], done: set[Path], seen: set[Path], found: list[Mutant]
    ) -> None:
        self.root, self.texts, self.done, self.seen, self.found = root, texts, done, seen, found
        self.path = Path()
        self.text = b""
        self.function = FILE_SCOPE
        self.symbol = ""
        self.around = ""
        """Digest of the function's text; empty at file scope."""
        self.cpp = False
        self.void = False
        """The function has no result."""

    def enter(self, cursor: Any) -> bool:
        """Go to the file of a declaration; False if it is none of ours or has been read."""
        location = cursor.extent.start.file
        path = Path(os.path.normpath(location.name)) if location is not None else Path()
        if path not in self.texts or path in self.done:
            return False
        self.seen.add(path)
        self.path, self.text = path, self.texts[path]
        return True

    def span(self, cursor: Any) -> tuple[int, int]:
        return int(cursor.extent.start.offset), int(cursor.extent.end.offset)

    def words(self, cursor: Any) -> str:
        start, end = self.span(cursor)
        return self.text[start:end].decode(errors="replace")

    def add(self, operator: str, start: int, end: int, new: str) -> None:
        first = self.text.rfind(b"\n", 0, start) + 1
        last = self.text.find(b"\n", end)
        before, behind = self.text[first:start], self.text[end : last if last >= 0 else len(self.text)]
        was = " ".join((before + self.text[start:end] + behind).decode().split())
        becomes = " ".join((before + new.encode() + behind).decode().split())
        file = self.path.relative_to(self.root).as_posix()
        if was != becomes:
            text = self.around or text_digest(self.text)
            self.found.append(
                Mutant(file, self.function, self.symbol, operator, start, end, new, was, becomes, text=text)
            )


def _visit_declaration(cursor: Any, reader: _Reader) -> None:
    """Go through namespaces, classes, functions and constants of our files."""
    if cursor.kind in (CursorKind.NAMESPACE, CursorKind.LINKAGE_SPEC, CursorKind.UNEXPOSED_DECL):
        for child in cursor.get_children():
            _visit_declaration(child, reader)
        return
    if not reader.enter(cursor):
        return
    if cursor.kind in (CursorKind.CLASS_DECL, CursorKind.STRUCT_DECL, CursorKind.CLASS_TEMPLATE):
        for child in cursor.get_children():
            if child.kind in (*FUNCTIONS, CursorKind.CLASS_DECL, CursorKind.STRUCT_DECL):
                _visit_declaration(child, reader)
    elif cursor.kind in FUNCTIONS and cursor.is_definition():
        _visit_function(cursor, reader)
    elif cursor.kind in (CursorKind.VAR_DECL, CursorKind.ENUM_DECL):
        reader.function, reader.symbol, reader.around = FILE_SCOPE, "", ""
        for child in cursor.get_children():
            _visit(child, reader)


def _visit_function(cursor: Any, reader: _Reader) -> None:
    reader.cpp = reader.path.suffix == ".cpp" or (reader.path.suffix == ".h" and cursor.mangled_name != cursor.spelling)
    reader.void = cursor.result_type.kind == TypeKind.VOID
    parent = cursor.semantic_parent
    scope = f"{parent.spelling}::" if parent is not None and parent.kind.name in ("CLASS_DECL", "STRUCT_DECL") else ""
    reader.function, reader.symbol = scope + cursor.spelling, cursor.mangled_name or _pattern(cursor)
    start, end = reader.span(cursor)
    reader.around = text_digest(reader.text[start:end])
    for child in cursor.get_children():
        if child.kind == CursorKind.COMPOUND_STMT:
            _add_early_return(cursor, child, reader)
            _visit(child, reader)
        elif cursor.kind == CursorKind.CONSTRUCTOR and child.kind.is_expression():
            _visit(child, reader)


def _pattern(function: Any) -> str:
    """Return what the linker's names of a template's function look like: *8Snapshot*6update*."""
    parent = function.semantic_parent
    names = [parent.spelling] if parent is not None and parent.kind == CursorKind.CLASS_TEMPLATE else []
    names += [function.spelling] if function.kind != CursorKind.CONSTRUCTOR else []
    return f"*{'*'.join(f'{len(name)}{name}' for name in names)}*"


def _add_early_return(function: Any, body: Any, reader: _Reader) -> None:
    kind = function.result_type.get_canonical().kind
    start = reader.span(body)[0] + 1
    if reader.text[start - 1 : start] != b"{":
        return
    if kind == TypeKind.VOID or function.kind in (CursorKind.CONSTRUCTOR, CursorKind.DESTRUCTOR):
        values = [""]
    elif kind == TypeKind.BOOL:
        values = [" false", " true"]
    elif kind in SCALARS or kind in (TypeKind.POINTER, TypeKind.ENUM):
        values = [" {}" if reader.cpp else " 0"]
    elif kind == TypeKind.RECORD:
        values = [" {}" if reader.cpp else f" ({function.result_type.spelling}){{0}}"]
    else:
        return
    for value in values:
        reader.add("early return", start, start, f" if (1) {{ return{value}; }}")


def _visit(cursor: Any, reader: _Reader) -> None:
    if cursor.kind == CursorKind.STATIC_ASSERT:
        return
    if (visitor := _VISITORS.get(cursor.kind)) is not None:
        visitor(cursor, reader)
    for child in cursor.get_children():
        _visit(child, reader)


def _children(cursor: Any) -> list[Any]:
    return list(cursor.get_children())


def _binary(cursor: Any, reader: _Reader) -> None:
    sides = _children(cursor)
    if len(sides) != 2:
        return
    left, right = reader.span(sides[0]), reader.span(sides[1])
    between = _OPERATOR_ONLY.fullmatch(reader.text[left[1] : right[0]].decode(errors="replace"))
    if between is None:
        return
    sign = between[1]
    start = left[1] + between.start(1)
    end = left[1] + between.end(1)
    for other in COMPARISONS.get(sign, ()):
        reader.add("comparison", start, end, other)
    if sign in ARITHMETIC:
        reader.add("arithmetic", start, end, ARITHMETIC[sign])
    if sign[-1] == "=" and sign[:-1] in ARITHMETIC:
        reader.add("arithmetic", start, end, ARITHMETIC[sign[:-1]] + "=")
    if sign in CONNECTORS:
        reader.add("logical connector", start, end, CONNECTORS[sign])
        reader.add("logical connector", left[0], right[1], reader.words(sides[0]))
        reader.add("logical connector", left[0], right[1], reader.words(sides[1]))
    if sign == "=":
        _turned(sides[1], cursor.type, reader)


def _turned(value: Any, kind: Any, reader: _Reader) -> None:
    """The other sign of what is assigned or returned."""
    start, end = reader.span(value)
    if reader.text[:start].endswith((b"omni_select", b"omni_all", b"omni_any")):
        start = reader.text.rfind(b"omni_", 0, start)
    words = reader.text[start:end].decode()
    if kind.get_canonical().kind in SIGNED and end > start and not re.fullmatch(r"[-\d.fuxe]+", words):
        reader.add("sign", start, end, f"-({words})")


def _unary(cursor: Any, reader: _Reader) -> None:
    text = reader.words(cursor)
    start, end = reader.span(cursor)
    inner = _children(cursor)
    if text.startswith(("++", "--")):
        reader.add("arithmetic", start, start + 2, "--" if text[0] == "+" else "++")
    elif text.endswith(("++", "--")):
        reader.add("arithmetic", end - 2, end, "--" if text[-1] == "+" else "++")
    elif text.startswith("-") and inner and reader.span(inner[0])[0] > start:
        reader.add("sign", start, start + 1, " ")
    elif text.startswith("!") and inner and reader.span(inner[0])[0] > start:
        reader.add("negated condition", start, start + 1, " ")


def _integer(cursor: Any, reader: _Reader) -> None:
    text = reader.words(cursor)
    start = reader.span(cursor)[0]
    if text == "":
        token = next((token for token in cursor.get_tokens() if token.kind == TokenKind.LITERAL), None)
        text = token.spelling if token is not None else ""
    word = re.match(rb"\w+", reader.text[start:])
    text = word[0].decode() if word else text
    end = start + len(text)
    if text in ("true", "false"):
        reader.add("constant", start, end, "false" if text == "true" else "true")
        return
    number = _INTEGER.fullmatch(text)
    if number is None:
        return
    value, suffix = int(number[1], 0 if number[1][:2] in ("0x", "0X") else 10), number[2]
    reader.add("off by one", start, end, f"{value + 1}{suffix}")
    if value > 0:
        reader.add("off by one", start, end, f"{value - 1}{suffix}")
    if value > 1:
        reader.add("constant", start, end, f"0{suffix}")


def _floating(cursor: Any, reader: _Reader) -> None:
    start, end = reader.span(cursor)
    text = reader.words(cursor)
    if not re.fullmatch(r"[\d.]+(?:[eE][-+]?\d+)?[fF]?", text):
        return
    one = "1.0f" if text[-1] in "fF" else "1.0"
    if float(text.rstrip("fF")) == 0.0:
        reader.add("constant", start, end, one)
        return
    reader.add("constant", start, end, one.replace("1", "0"))
    reader.add("constant", start, end, f"({one.replace('1', '2')} * {text})")


def _condition(cursor: Any, reader: _Reader) -> None:
    children = _children(cursor)
    if not children:
        return
    if cursor.kind == CursorKind.DO_STMT:
        condition = children[-1]
    elif cursor.kind == CursorKind.FOR_STMT:
        condition = next((c for c in children if c.kind.is_expression() and c.type.kind in SCALARS), None)
        if condition is None or condition.kind == CursorKind.UNARY_OPERATOR:
            return
    else:
        condition = children[0]
    if condition is not None and condition.kind.is_expression():
        _negate(condition, reader)
    if cursor.kind == CursorKind.IF_STMT and len(children) > 1 and children[1].kind == CursorKind.COMPOUND_STMT:
        _leave(children[1], reader)


def _leave(block: Any, reader: _Reader) -> None:
    """Leave a function without a result at the start of a block."""
    start = reader.span(block)[0] + 1
    if reader.void and reader.text[start - 1 : start] == b"{":
        reader.add("early return", start, start, " if (1) { return; }")


def _negate(condition: Any, reader: _Reader) -> None:
    start, end = reader.span(condition)
    if end > start:
        reader.add("negated condition", start, end, f"!({reader.words(condition)})")


def _parenthesis(cursor: Any, reader: _Reader) -> None:
    """The condition of omni_select."""
    start = reader.span(cursor)[0]
    if not reader.text[:start].endswith(b"omni_select"):
        return
    inner = _children(cursor)
    while inner and inner[0].kind == CursorKind.BINARY_OPERATOR and len(_children(inner[0])) == 2:
        left, right = _children(inner[0])
        if b"," not in reader.text[reader.span(left)[1] : reader.span(right)[0]]:
            break
        inner = [left]
    if inner:
        _negate(inner[0], reader)


def _call(cursor: Any, reader: _Reader) -> None:
    arguments = list(cursor.get_arguments())
    for first, second in pairwise(arguments):
        if first is None or second is None:
            continue
        a, b = reader.span(first), reader.span(second)
        if not a[0] < a[1] < b[0] < b[1]:
            continue
        same = first.type.get_canonical().spelling == second.type.get_canonical().spelling
        if same and reader.text[a[1] : b[0]].strip() == b",":
            between = reader.text[a[1] : b[0]].decode()
            reader.add("swapped arguments", a[0], b[1], f"{reader.words(second)}{between}{reader.words(first)}")


def _block(cursor: Any, reader: _Reader) -> None:
    for statement in cursor.get_children():
        start, end = reader.span(statement)
        bare = statement.kind in (CursorKind.BREAK_STMT, CursorKind.CONTINUE_STMT)
        bare = bare or (statement.kind == CursorKind.RETURN_STMT and not _children(statement))
        nothing = re.fullmatch(r"\(void\)\s*\w+", reader.words(statement))
        if (bare or statement.kind.is_expression()) and end > start and not nothing:
            reader.add("removed statement", start, end, "(void)0")


def _returned(cursor: Any, reader: _Reader) -> None:
    for value in _children(cursor):
        if value.type.get_canonical().kind == TypeKind.BOOL:
            _negate(value, reader)
        elif value.type.get_canonical().kind in FLOATS:
            _turned(value, value.type, reader)


def _variable(cursor: Any, reader: _Reader) -> None:
    value = next((child for child in reversed(_children(cursor)) if child.kind.is_expression()), None)
    if value is not None and b"=" in reader.text[reader.span(cursor)[0] : reader.span(value)[0]]:
        _turned(value, cursor.type, reader)


_VISITORS: dict[Any, Callable[[Any, _Reader], None]] = {
    CursorKind.BINARY_OPERATOR: _binary,
    CursorKind.COMPOUND_ASSIGNMENT_OPERATOR: _binary,
    CursorKind.UNARY_OPERATOR: _unary,
    CursorKind.INTEGER_LITERAL: _integer,
    CursorKind.CXX_BOOL_LITERAL_EXPR: _integer,
    CursorKind.FLOATING_LITERAL: _floating,
    CursorKind.IF_STMT: _condition,
    CursorKind.CONDITIONAL_OPERATOR: _condition,
    **dict.fromkeys(LOOPS, _condition),
    CursorKind.PAREN_EXPR: _parenthesis,
    CursorKind.CALL_EXPR: _call,
    CursorKind.COMPOUND_STMT: _block,
    CursorKind.RETURN_STMT: _returned,
    CursorKind.VAR_DECL: _variable,
}


def chosen(mutants: Sequence[Mutant], count: int, seed: int) -> Iterator[Mutant]:
    """Yield a sample of ``count``: the same ones for a seed, also after the code around them has changed."""
    order = sorted(mutants, key=lambda m: hashlib.sha256(f"{seed} {m.key}".encode()).digest())
    yield from order[:count]
