# SPDX-License-Identifier: MIT
"""Runs one command of tests/faults/commands.py again and again; each of its calls to the file system fails in turn.

``LD_PRELOAD=failing_calls.so python -m tests.faults.drive`` reads lines of JSON, ``[case, folder, most]``, and prints a
line of JSON for each: how many calls there are, how many were tried (at most ``most``, all without), and what was
wrong. Whatever fails, a command must end with a clear error and a code other than 0, leave whole files only, and work
the next time. Each case runs in a forked child, which need not import anything.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import sys
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomllib
from typer.testing import CliRunner, Result

from omni import checks
from omni.cli import app
from omniwheel.tlog import whole_records
from tests.blank_pictures import blank_pictures
from tests.faults.commands import CASES, INPUTS, Case, firmware, make_inputs
from tests.faults.shim import FAILURES, FULL, Failure, chosen

_LIBC = ctypes.CDLL(None)
_LIBC.fail_last.restype = ctypes.c_char_p
_TAIL = 300
LONGEST_S = 1200
MODULES = ("cv2", "matplotlib.pyplot", "optuna", "scipy.interpolate", "scipy.optimize", "scipy.signal")
"""What the commands import when they run."""


def arm(folder: Path, number: int, failure: Failure) -> None:
    """Let call ``number`` below ``folder`` fail; 0: only count."""
    _LIBC.fail_arm(str(folder).encode(), number, failure.error, int(failure.stays), int(failure.short))


def disarm() -> tuple[int, str]:
    """Let nothing fail any more; return how many calls there were, and the name of the one that failed."""
    calls, name = int(_LIBC.fail_calls()), _LIBC.fail_last().decode()
    _LIBC.fail_arm(b"", 0, 0, 0, 0)
    return calls, name


def run(words: tuple[str, ...], values: dict[str, str]) -> Result:
    """Run a command line in this process; ``checks`` stands for ``python -m omni.checks``."""
    program, words = (checks.app, words[1:]) if words[0] == "checks" else (app, words)
    return CliRunner().invoke(program, [word.format(**values) for word in words])


def files_in(folder: Path) -> list[Path]:
    """Return every file below a folder."""
    return sorted(path for path in folder.rglob("*") if path.is_file())


def trouble(path: Path) -> str:
    """Return what is wrong with a file that a failed command has left, "" if it is whole."""
    data = path.read_bytes()
    if not data and path.name != "batches.bin":
        return f"{path.name} has no bytes"
    if path.name.endswith(".part"):
        return f"{path.name} was left behind"
    try:
        whole = _is_whole(path, data)
    except Exception as error:  # whatever a reader says of a damaged file
        return f"{path.name}: {error!r}"
    return "" if whole else f"{path.name} is not whole"


def _is_whole(path: Path, data: bytes) -> bool:
    if path.suffix == ".json":
        json.loads(data)
    elif path.suffix == ".toml":
        tomllib.loads(data.decode())
    elif path.suffix == ".npz":
        with np.load(path) as stored:
            return all(len(np.atleast_1d(stored[name])) >= 0 for name in stored.files)
    elif path.suffix == ".npy":
        np.load(path)
    elif path.suffix == ".png":
        return data.endswith(b"IEND\xaeB`\x82")
    elif path.suffix == ".tlog":
        return whole_records(data) == len(data)
    elif path.suffix in (".csv", ".md", ".svg", ".key"):
        return data.endswith((b"\n", b"</svg>"))
    return True


def judge(result: Result, failed: str, disk: Path, wanted: list[str]) -> list[str]:
    """Return what was wrong with a run in which a call failed."""
    found = [text for text in map(trouble, files_in(disk)) if text]
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        found.append(f"uncaught {result.exception!r}")
    if "Traceback" in result.output:
        found.append("a traceback")
    if result.exit_code == 0:
        missing = sorted(set(wanted) - {str(path.relative_to(disk)) for path in files_in(disk)})
        found += [f"exit code 0, but {missing} missing"] if missing else []
    elif "error:" not in result.output and "cannot write" not in result.output:
        found.append(f"no error said: {result.output[-_TAIL:]}")
    return [f"after {failed}: {text}" for text in found]


class Drive:
    """A case in its folders."""

    def __init__(self, case: Case, folder: Path, values: dict[str, str]) -> None:
        self.case = case
        self.disk = folder / "disk"
        self.values = {**values, "disk": str(self.disk)}

    def once(self, number: int, failure: Failure) -> tuple[Result, int, str]:
        """Run it in an empty folder while call ``number`` fails."""
        shutil.rmtree(self.disk, ignore_errors=True)
        self.disk.mkdir()
        arm(self.disk, number, failure)
        try:
            with self.case.during():
                result = run(self.case.words, self.values)
        finally:
            calls, failed = disarm()
        return result, calls, failed

    def all(self, most: int) -> dict[str, Any]:
        """Let every call fail in turn, each in another of the ways; of many, ``most`` of them from first to last."""
        result, calls, _ = self.once(0, FULL)
        if result.exit_code != 0:
            return {"calls": calls, "problems": [f"fails by itself: {result.output[-_TAIL:]} {result.exception!r}"]}
        wanted = [str(path.relative_to(self.disk)) for path in files_in(self.disk)]
        problems = []
        numbers = chosen(range(1, calls + 1, self.case.step), most)
        for number in numbers:
            problems += self._try(number, FAILURES[number % len(FAILURES)], wanted)
        return {"calls": calls, "tried": len(numbers), "files": wanted, "problems": problems}

    def _try(self, number: int, failure: Failure, wanted: list[str]) -> list[str]:
        result, _, failed = self.once(number, failure)
        if not failed:  # timing: this run made fewer calls
            return []
        found = judge(result, failed, self.disk, wanted)
        if self.case.driven in result.output and self.case.tells not in result.output:
            found.append(f"after {failed}: does not tell what was measured: {result.output[-_TAIL:]}")
        if self.case.again:
            with self.case.during():
                again = run(self.case.words, self.values)
            if again.exit_code != 0:
                found.append(f"the same command afterwards: {again.output[-_TAIL:]} {again.exception!r}")
        return [f"call {number}, {failure.name}: {text}" for text in found]


def prepared(folder: Path) -> Path:
    """Return a folder with what the commands read: files, two imported logs and a finished run."""
    inputs = folder / "inputs"
    inputs.mkdir(parents=True)
    make_inputs(inputs)
    values = {"inputs": str(inputs)}
    for name in ("run1", "run2"):
        words = ("logs", "import", f"{{inputs}}/{name}.csv", "--mapping", "{inputs}/mapping.toml")
        run((*words, "--truth", f"{{inputs}}/truth_{name}.csv", "--out", f"{{inputs}}/{name}.npz"), values)
    run(("run", "--core-only", "{inputs}/quick.toml", "--out", "{inputs}/runs"), values)
    (inputs / "runs" / "quick-seed1").rename(inputs / "run")
    return inputs


def result_of(name: str, folder: Path, most: int | None, inputs: Path) -> dict[str, Any]:
    """Drive one case in ``folder``; with ``most``, PNG files stay blank."""
    case = CASES[name]
    INPUTS.append(Path(shutil.copytree(inputs, folder / "inputs")))
    values = {"inputs": str(INPUTS[0])}
    with ExitStack() as stack:
        if most:
            stack.enter_context(blank_pictures())
        if case.links:
            values["link"] = stack.enter_context(firmware()).urls[0]
        return Drive(case, folder.resolve(), values).all(most or sys.maxsize)


def serve() -> None:
    """Answer each line of standard input, a case with its folder and its most, by a child that has all modules."""
    for module in MODULES:
        import_module(module)
    with TemporaryDirectory() as scratch:
        inputs = prepared(Path(scratch))
        for line in sys.stdin:
            name, folder, most = json.loads(line)
            child = os.fork()
            if child == 0:
                signal.alarm(LONGEST_S)
                result = result_of(name, Path(folder), most, inputs)
                sys.stdout.write(json.dumps(result) + "\n")
                sys.stdout.flush()
                os._exit(0)
            _, status = os.waitpid(child, 0)
            if status != 0:
                sys.stdout.write(json.dumps({"calls": 0, "problems": [f"the child ended with status {status}"]}) + "\n")
                sys.stdout.flush()


if __name__ == "__main__":
    serve()
