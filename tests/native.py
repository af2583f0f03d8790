# SPDX-License-Identifier: MIT
"""Builds C and C++ of the firmware into a shared library, so that tests can call it through a small extern "C" shim."""

from __future__ import annotations

import os
import shlex
import subprocess
import sysconfig
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror")
_SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


def generated_dir() -> Path:
    """Return the folder of the generated headers that the installed package was built from."""
    candidates = sorted((ROOT / "build").glob("cp*/generated"), key=lambda path: path.stat().st_mtime)
    if not candidates:
        raise FileNotFoundError(f"no generated headers below {ROOT / 'build'}: run make setup")
    return candidates[-1]


def build_library(
    out_dir: Path,
    name: str,
    sources: Sequence[Path],
    includes: Sequence[Path] = (),
    system_includes: Sequence[Path] = (),
    flags: Sequence[str] = (),
    archives: Sequence[Path] = (),
) -> Path:
    """Compile ``sources`` (.c as C99, .cpp as C++17), warnings as errors, and return the path of the shared library.

    ``includes`` come before the firmware's and the core's own folders, so that a fake header can take the place of a
    vendor's; ``archives`` are linked behind the sources. Raises AssertionError with the compiler's words.
    """
    folders = [*includes, ROOT / "firmware", ROOT / "shared" / "core" / "include", generated_dir() / "include"]
    common = ["-O1", "-fPIC", "-ffp-contract=off", *WARNINGS, *flags]
    common += [f"-I{folder}" for folder in folders]
    common += [word for folder in (*system_includes, generated_dir() / "mavlink") for word in ("-isystem", str(folder))]
    if os.environ.get("OMNI_SANITIZED"):
        common += _SANITIZERS

    def compiled(number: int, source: Path) -> str:
        target = out_dir / f"{number}-{source.stem}.o"
        cpp = source.suffix == ".cpp"
        compiler = _compiler("CXX", "c++") if cpp else _compiler("CC", "cc")
        standard = ["-std=c++17", "-fno-exceptions", "-fno-rtti"] if cpp else ["-std=c99"]
        _run([*compiler, *standard, *common, "-c", str(source), "-o", str(target)])
        return str(target)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(pool.map(compiled, range(len(sources)), sources))
    library = out_dir / f"{name}{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    sanitizers = _SANITIZERS if os.environ.get("OMNI_SANITIZED") else ()
    _run([*_compiler("CXX", "c++"), "-shared", *sanitizers, *objects, *map(str, archives), "-o", str(library)])
    return library


def core_archive() -> Path:
    """Return the control core as the installed package was built from it, tables included (not sanitized)."""
    return generated_dir().parent / "shared" / "core" / "libomni_core.a"


def _compiler(variable: str, default: str) -> list[str]:
    return shlex.split(os.environ.get(variable, default))


def _run(command: list[str]) -> None:
    # The sanitizers' runtime, when it is preloaded into the tests, has no business in the compiler.
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stderr}"
