# SPDX-License-Identifier: MIT
"""Runs chosen tests against one mutant after another, each in a fork of a process that has everything else loaded.

usage: python -m tests.mutation.runner own|all FILE... ; a job per line comes in, a verdict per line goes out.
FILE: tests that show what has to be loaded. ``own``: our packages are left to the forks, because they load the mutant.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import select
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import hypothesis
import pytest

GRACE_S = 20.0
"""Processor time that a test may take beyond its measured one: alone, it pays for what its whole file shares."""
FACTOR = 6.0
WAITING_S = 1.0
"""Processor time of a silence in which a test waits for what does not come, and does not compute."""
PATIENCE = 6
"""Silences in which a test computes, until it hangs after all."""
OPTIONS = (
    "-q",
    "-p",
    "pytest_timeout",
    "--timeout=0",
    "-p",
    "no:cacheprovider",
    "-p",
    "no:xdist",
    "--no-header",
    "--tb=no",
    "--assert=plain",
)
OURS = (
    "omniwheel",
    "omni",
    "bench",
    "emulated_teensy",
    "hil_sim",
    "image_check",
    "omni_reproduce",
    "omni_schema",
    "tests",
)


def use_quick_profile() -> None:
    """No example is made smaller: that it fails is enough."""
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(
        "mutation", parent=hypothesis.settings.get_profile("repeatable"), phases=phases
    )
    hypothesis.settings.load_profile("mutation")


class Judge:
    """Runs the tests of a job in its order, and says which one is running and which one failed."""

    def __init__(self, costs_s: dict[str, float], pipe: int) -> None:
        self._costs_s = costs_s
        self._pipe = pipe

    def _say(self, word: str, test: str) -> None:
        os.write(self._pipe, f"{word} {test}\n".encode())

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        use_quick_profile()

    def pytest_collectreport(self, report: Any) -> None:
        if report.failed:
            self._say("failed", report.nodeid)
            os._exit(1)

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        order = {test: place for place, test in enumerate(self._costs_s)}
        items[:] = sorted((item for item in items if item.nodeid in order), key=lambda item: order[item.nodeid])
        for test in order.keys() - {item.nodeid for item in items}:
            self._say("gone", test)
            os._exit(1)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._say("runs", nodeid)
        signal.setitimer(signal.ITIMER_PROF, GRACE_S + FACTOR * self._costs_s[nodeid])

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, item: Any, call: Any) -> None:
        if call.excinfo is None or call.excinfo.errisinstance(pytest.skip.Exception):
            return
        if item.get_closest_marker("xfail") is None:
            self._say("failed", item.nodeid)
            os._exit(1)


def modules_of(files: Sequence[str]) -> list[str]:
    """Return the names of all modules that tests load, found in a fork."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _be_quiet()
        pytest.main([*OPTIONS, "--collect-only", *files])
        with os.fdopen(writer, "w") as pipe:
            pipe.write("\n".join(sys.modules))
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        names = pipe.read().splitlines()
    os.waitpid(child, 0)
    return names


def serve(whose: str, files: Sequence[str]) -> None:
    """Answer jobs until the input ends."""
    left_out = OURS if whose == "own" else OURS[-1:]
    for module in modules_of(files):
        if module.split(".")[0] not in (*left_out, "__main__") and module not in sys.modules:
            with suppress(Exception):  # some names are no modules of their own
                importlib.import_module(module)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    for line in sys.stdin:
        sys.stdout.write(json.dumps(verdict(json.loads(line))) + "\n")
        sys.stdout.flush()


def verdict(job: dict[str, Any]) -> dict[str, str]:
    """Return the test that failed and how; empty if none did."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _run_tests(job, writer)
    os.close(writer)
    said, silent = _listen(reader, job["silent_s"], child)
    os.close(reader)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    with suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    if not said and os.WIFEXITED(status):
        raise RuntimeError(f"pytest ended with {os.WEXITSTATUS(status)} before any test")
    last = said[-1].split(" ", 1) if said else ["runs", "(start)"]
    if last[0] == "gone":
        raise RuntimeError(f"there is no {last[1]}: leave out --old-map, so that what tests reach is measured again")
    if last[0] == "done":
        return {"test": "", "how": ""}
    if last[0] == "failed":
        return {"test": last[1], "how": "failed"}
    number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    how = (
        "hang" if silent or number == signal.SIGPROF else f"crash ({signal.Signals(number).name if number else status})"
    )
    return {"test": last[1], "how": how}


def _listen(reader: int, silent_s: float, child: int) -> tuple[list[str], bool]:
    """Return what the child said until it ended, and whether it was silent for too long.

    Who is silent and computes is only slow, as on a busy machine: that ends after PATIENCE times as long.
    """
    data = b""
    silences, used_s = 0, 0.0
    while True:
        if not select.select([reader], [], [], silent_s)[0]:
            silences, before_s, used_s = silences + 1, used_s, processor_s(child)
            if silences >= PATIENCE or used_s - before_s < WAITING_S:
                return data.decode().splitlines(), True
            continue
        silences = 0
        part = os.read(reader, 65536)
        data += part
        if not part or data.endswith(b"done \n"):
            return data.decode().splitlines(), False


def processor_s(session: int) -> float:
    """Return the processor time of all processes of a session, and of those that they have waited for."""
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text(encoding="utf-8").rpartition(")")[2].split()
            if int(fields[3]) == session:
                ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def _run_tests(job: dict[str, Any], pipe: int) -> None:
    """The child: never returns."""
    os.setsid()
    os.set_inheritable(pipe, False)
    _be_quiet()
    os.environ.update(job["environment"])
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    if job["library"]:
        ctypes.CDLL(job["library"], ctypes.RTLD_GLOBAL)
    files = sorted({test.split("::")[0] for test in job["costs_s"]})
    status = pytest.main([*OPTIONS, "--basetemp", job["folder"], *files], plugins=[Judge(job["costs_s"], pipe)])
    if status == 0:
        os.write(pipe, b"done \n")
    os._exit(int(status))


def _be_quiet() -> None:
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)


if __name__ == "__main__":
    serve(sys.argv[1], sys.argv[2:])
