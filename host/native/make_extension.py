# SPDX-License-Identifier: MIT
"""Writes the C source of ``omniwheel._core`` from the public C headers.

The C compiler preprocesses the headers; the line markers that it leaves say which declarations come from our own
folders. Those are given to cffi, so that no declaration is written twice.
"""

from __future__ import annotations

import argparse
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

from cffi import FFI

MODULE = "omniwheel._core"

_LINE_MARKER = re.compile(r'^# \d+ "([^"]*)"')
_ATTRIBUTE = re.compile(r"__attribute__\s*\(\(.*?\)\)|__extension__")
_STATIC_ASSERT = re.compile(r"_Static_assert\s*\([^;]*\)\s*;")


def preprocess(compiler: str, header: Path, include_dirs: list[Path], defines: Sequence[str] = ()) -> str:
    """Return the preprocessed text of ``header``, with line markers."""
    includes = [argument for folder in include_dirs for argument in ("-I", str(folder))]
    command = [compiler, "-E", "-std=c99", *(f"-D{name}" for name in defines), *includes, str(header)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def own_declarations(preprocessed: str, include_dirs: list[Path]) -> str:
    """Keep the lines that come from files below ``include_dirs``."""
    folders = [folder.resolve() for folder in include_dirs]
    lines = []
    own = False
    for line in preprocessed.splitlines():
        marker = _LINE_MARKER.match(line)
        if marker:
            path = Path(marker.group(1)).resolve()
            own = any(folder in path.parents for folder in folders)
        elif own and line.strip():
            lines.append(line)
    text = _ATTRIBUTE.sub("", "\n".join(lines))
    return _STATIC_ASSERT.sub("", text)


def extension_source(compiler: str, header: Path, include_dirs: list[Path], out: Path) -> None:
    """Write the extension's C source to ``out``."""
    ffi = FFI()
    ffi.cdef(own_declarations(preprocess(compiler, header, include_dirs), include_dirs))
    ffi.set_source(MODULE, f'#include "{header.name}"\n')
    out.parent.mkdir(parents=True, exist_ok=True)
    ffi.emit_c_code(str(out))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="write the C source of the Python extension")
    parser.add_argument("--compiler", required=True)
    parser.add_argument("--header", type=Path, required=True)
    parser.add_argument("--include", type=Path, action="append", required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    extension_source(options.compiler, options.header, options.include, options.out)


if __name__ == "__main__":
    main()
