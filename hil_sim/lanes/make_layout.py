# SPDX-License-Identifier: MIT
"""Writes down where every member of the structs lies that move between eight runs and lanes.

The C compiler preprocesses the headers (as for the Python extension), cffi reads the types. The output is a header of
macros, ``HIL_LAYOUT_type(X)``: ``X(kind, type, first member, last member, count)`` for each stretch of neighbours of a
kind. C and C++ take the offsets from the compiler.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from cffi import FFI

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "host"))

from native.make_extension import own_declarations, preprocess

LANE_TYPES = {
    "omni_real_t": ("WORD", "float"),
    "omni_int_t": ("WORD", "int32_t"),
    "omni_uint_t": ("WORD", "uint32_t"),
    "omni_ns_t": ("WIDE", "uint64_t"),
    "omni_flag_t": ("FLAG", "bool"),
    "hil_real_t": ("WIDE", "double"),
    "hil_int_t": ("WORD", "int32_t"),
    "hil_time_t": ("WIDE", "uint64_t"),
    "hil_seed_t": ("WIDE", "uint64_t"),
    "hil_flag_t": ("FLAG", "bool"),
    "hil_steps_t": ("WORD", "uint16_t"),
}
"""Kind of the types that differ from run to run, and what they are in C."""

WIDTHS = {"WORD": 4, "FLAG": 1, "WIDE": 8}
"""Bytes of a member of these kinds; members of kind SAME stay alone."""


@dataclass
class Stretch:
    """Neighbouring members of one kind."""

    kind: str
    first: str
    last: str
    count: int
    end: int


def members(ffi: FFI, ctype: FFI.CType, path: str, offset: int) -> Iterator[Stretch]:
    """Yield the members of a type, pointers left out, each as a stretch of its own."""
    size = ffi.sizeof(ctype)
    lane = LANE_TYPES.get(ctype.cname)
    if lane:
        yield Stretch(lane[0], path, path, 1, offset + size)
    elif ctype.kind == "array" and ctype.item.kind in ("primitive", "enum") and ctype.item.cname not in LANE_TYPES:
        yield Stretch("SAME", path, path, 1, offset + size)
    elif ctype.kind == "array":
        step = ffi.sizeof(ctype.item)
        for index in range(ctype.length):
            yield from members(ffi, ctype.item, f"{path}[{index}]", offset + index * step)
    elif ctype.kind == "struct":
        for name, field in ctype.fields:
            yield from members(ffi, field.type, f"{path}.{name}" if path else name, offset + field.offset)
    elif ctype.kind != "pointer":
        yield Stretch("SAME", path, path, 1, offset + size)


def stretches(ffi: FFI, name: str) -> list[Stretch]:
    """Return the members of a struct with neighbours of a kind that differs between the runs put together."""
    found: list[Stretch] = []
    for member in members(ffi, ffi.typeof(name), "", 0):
        before = found[-1] if found else None
        if before is not None and before.kind == member.kind and member.end - before.end == WIDTHS.get(member.kind):
            before.last, before.end, before.count = member.last, member.end, before.count + 1
        else:
            found.append(member)
    return found


def layout(compiler: str, header: Path, include_dirs: list[Path], types: list[str]) -> str:
    """Return the text of the header of macros."""
    ffi = FFI()
    own = "".join(f"typedef struct {{ {plain} lane; }} {name};\n" for name, (_, plain) in LANE_TYPES.items())
    text = preprocess(compiler, header, include_dirs, ["OMNI_OWN_NUMBERS", "HIL_OWN_NUMBERS"])
    ffi.cdef(own + own_declarations(text, include_dirs))
    lines = ["/* Written by hil_sim/lanes/make_layout.py. */"]
    for name in types:
        rows = [f"X({s.kind}, {name}, {s.first}, {s.last}, {s.count})" for s in stretches(ffi, name)]
        lines += [f"#define HIL_LAYOUT_{name}(X) \\", " \\\n".join(f"    {row}" for row in rows)]
    lines += ["#define HIL_LAYOUT_TYPES(X) \\", " ".join(f"X({name})" for name in types)]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="write the layout of the structs that go into lanes")
    parser.add_argument("--compiler", required=True)
    parser.add_argument("--header", type=Path, required=True)
    parser.add_argument("--include", type=Path, action="append", required=True)
    parser.add_argument("--type", action="append", required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    text = layout(options.compiler, options.header, options.include, options.type)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(text, encoding="ascii")


if __name__ == "__main__":
    main()
