# SPDX-License-Identifier: MIT
"""Asks the parity program whether a mutant changes any bit: that something changed, not that it is wrong."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from tests.mutation.builds import CORE_LIBRARY, SITE, run
from tests.native import ROOT, generated_dir

TICKS = 50_000
TIMEOUT_S = 60.0


class Golden:
    """The parity program around the core's library. Raises BuildError."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._program = folder / "parity"
        sources = sorted(map(str, (ROOT / "tests" / "parity" / "program").glob("*.c")))
        includes = [f"-I{ROOT / 'shared' / 'core' / 'include'}", f"-I{generated_dir() / 'include'}"]
        command = ["cc", "-std=c99", "-O1", "-ffp-contract=off", *includes, *sources, str(SITE / CORE_LIBRARY)]
        run([*command, f"-Wl,-rpath,{SITE}", "-o", str(self._program)])
        self._expected = self._hashes(SITE / CORE_LIBRARY)

    def differs(self, library: Path) -> bool:
        """Tell whether the program prints other hashes with this core."""
        return self._hashes(library) != self._expected

    def _hashes(self, library: Path) -> str:
        command = [str(self._program), "--ticks", str(TICKS), "--seed", "1", "--least", "0"]
        environment = {**os.environ, "LD_PRELOAD": str(library)}
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
            )
        except subprocess.TimeoutExpired:
            return "no end"
        return f"{done.returncode} {done.stdout}"
