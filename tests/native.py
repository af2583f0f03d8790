# SPDX-License-Identifier: MIT
"""Builds C and C++ of the firmware into a shared library, so that tests can call it through a small extern "C" shim."""

from __future__ import annotations

import faulthandler
import fcntl
import hashlib
import os
import shlex
import signal
import subprocess
import sysconfig
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror")
BUILD_S = 600.0
CAST_TRAPS = ("-fsanitize=float-cast-overflow", "-fsanitize-undefined-trap-on-error", "-Wno-conversion")
_TEST_PROCESS = os.getpid()
_ENVIRONMENT = ("CC", "CXX", "OMNI_SANITIZED")
_MUTANT = ("OMNI_CHANGED", "OMNI_OPTIONS")
"""What tests/mutation/builds.py sets."""
_SHARED_FOLDERS = (ROOT / "firmware", ROOT / "shared" / "core")
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
    static: bool = False,
) -> Path:
    """Compile ``sources`` (.c as C99, .cpp as C++17), warnings as errors, and return the path of the shared library.

    ``includes`` come before the firmware's and the core's own folders, so that a fake header can take the place of a
    vendor's; ``archives`` are linked behind the sources. With ``static`` it is an archive itself. Raises AssertionError
    with the compiler's words.
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
    if static:
        _run(["ar", "rcsD", str(out_dir / f"{name}.a"), *objects])
        return out_dir / f"{name}.a"
    library = out_dir / f"{name}{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    sanitizers = _SANITIZERS if os.environ.get("OMNI_SANITIZED") else ()
    _run([*_compiler("CXX", "c++"), "-shared", *sanitizers, *objects, *map(str, archives), "-o", str(library)])
    return library


def kept_library(name: str, sources: Sequence[Path], includes: Sequence[Path] = (), **options: Any) -> Path:
    """Return ``build_library`` of the same arguments, built once for all test processes and kept for the next run.

    What it is recognised by: its arguments, compilers and environment, and the content of everything it may include.
    With a mutant's compiler, which changes what it reads, nothing is kept.
    """
    if any(os.environ.get(key) for key in _MUTANT):
        with untimed():
            return build_library(Path(mkdtemp(prefix="omni-library-")), name, sources, includes, **options)
    headers = sorted(
        {
            *(path for folder in (*includes, *_SHARED_FOLDERS, generated_dir()) for path in folder.rglob("*.h")),
            *(path for source in sources for path in source.parent.glob("*.h")),
        }
    )
    digest = hashlib.sha256(repr((includes, options, *map(os.environ.get, _ENVIRONMENT))).encode())
    for path in (*sources, *headers, *options.get("archives", ())):
        digest.update(f"{path}\0".encode() + path.read_bytes())
    folder = ROOT / "build" / "test-libraries" / f"{name}-{digest.hexdigest()[:16]}"
    folder.mkdir(parents=True, exist_ok=True)
    with untimed(), (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        kept = folder / "kept"
        if not kept.exists():
            built = build_library(folder, name, sources, includes, **options)
            built.rename(kept)  # a build that was cut off has no such file
    return kept


def core_archive() -> Path:
    """Return the control core as the installed package was built from it, tables included (not sanitized)."""
    return generated_dir().parent / "shared" / "core" / "libomni_core.a"


@contextmanager
def untimed() -> Iterator[None]:
    """Stop the clock of a test's time limit: which test builds first, and how long others wait for it, is chance.

    A compiler that hangs ends at its own limit (BUILD_S).
    """
    left_s, _ = signal.setitimer(signal.ITIMER_REAL, 0.0)
    if os.getpid() == _TEST_PROCESS:  # a fork has no such thread, and would wait for it for ever
        faulthandler.cancel_dump_traceback_later()  # tests/tiers.py: nothing tells how much of it is left
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, left_s)


@cache
def app_archive() -> Path:
    """Return the firmware's program, without a board, built once for all libraries that have it.

    A conversion of a number that a whole number cannot hold ends the process (``CAST_TRAPS``), but for sanitized tests,
    where that would hide what the sanitizers say.
    """
    sources = sorted((ROOT / "firmware" / "app").rglob("*.cpp"))
    return kept_library("app", sources, flags=() if os.environ.get("OMNI_SANITIZED") else CAST_TRAPS, static=True)


def _compiler(variable: str, default: str) -> list[str]:
    return shlex.split(os.environ.get(variable, default))


def _run(command: list[str]) -> None:
    # The sanitizers' runtime, when it is preloaded into the tests, has no business in the compiler.
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=BUILD_S)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stderr}"
