# SPDX-License-Identifier: MIT
"""The process that runs tests against mutants, seen from the harness."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

from tests.mutation.builds import Area, BuildError, python
from tests.native import ROOT

SILENT_S = 150.0
"""A test that says nothing for so long hangs. Only for what waits: what computes is stopped by its processor time."""


class Runner:
    """The process that runs tests in forks of itself."""

    def __init__(self, area: Area, folder: Path) -> None:
        program, environment = python()
        self._folder = folder
        self._process = subprocess.Popen(
            [program, "-m", "tests.mutation.runner", "own" if area.name == "core" else "all", *area.tests],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", **environment},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        if self._out.readline() != "ready\n":
            raise BuildError("the process that runs the tests does not start")

    def verdict(
        self, costs_s: dict[str, float], environment: dict[str, str], library: str, silent_s: float = SILENT_S
    ) -> dict[str, str]:
        """Return the test that failed and how."""
        folder = self._folder / "tmp"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        environment = {**environment, "TMPDIR": str(folder)}
        job = {"costs_s": costs_s, "environment": environment, "library": library, "folder": str(folder / "pytest")}
        job["silent_s"] = silent_s
        self._in.write(json.dumps(job) + "\n")
        self._in.flush()
        if not (line := self._out.readline()):
            raise BuildError("the process that runs the tests has ended: see its words above")
        answer: dict[str, str] = json.loads(line)
        return answer

    def close(self) -> None:
        """End it."""
        self._in.close()
        self._process.wait()
