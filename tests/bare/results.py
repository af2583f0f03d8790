# SPDX-License-Identifier: MIT
"""Reads what the README's commands left and printed, for `.ci/bare`. Plain Python: it runs outside the environment.

usage: python3 tests/bare/results.py demo, or: python3 tests/bare/results.py tests LOG
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

# The fast tier has more; far fewer passed tests mean that a folder was not collected.
FEWEST_PASSED = 5000
RMSE = re.compile(r"off its path by ([\d.]+) mm and ([\d.]+) mrad")
CLOSING = re.compile(r"^=+ (?P<counts>(?:\d+ \w+(?:, )?)+) in [\d.]+s.*=+$", re.MULTILINE)


def faults_of_demo(readme: str, folder: Path) -> list[str]:
    """Return what is wrong with the folder of a demo run, measured by the README."""
    promised = RMSE.search(readme)
    if promised is None:
        return ["README.md does not say how far the robot is off its path"]
    faults = []
    if not (folder / "run.png").read_bytes().startswith(b"\x89PNG"):
        faults.append("run.png is no PNG picture")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    if not summary["completed"]:
        faults.append("the path was not driven to its end")
    for name, wanted in zip(("position_m", "theta_rad"), promised.groups(), strict=True):
        digits = len(wanted.partition(".")[2])
        if f"{summary['rmse'][name] * 1000:.{digits}f}" != wanted:
            faults.append(f"{name} is off by {summary['rmse'][name] * 1000} thousandths, not by {wanted}")
    return faults


def faults_of_tests(log: str) -> list[str]:
    """Return what is wrong with the output of a run of the tests on a bare machine."""
    closings = list(CLOSING.finditer(log))
    if not closings:
        return ["no closing line of pytest"]
    counts = {kind: int(number) for number, kind in re.findall(r"(\d+) (\w+)", closings[-1]["counts"])}
    faults = [f"{counts[kind]} {kind}" for kind in ("failed", "error", "errors") if counts.get(kind)]
    if counts.get("passed", 0) < FEWEST_PASSED:
        faults.append(f"{counts.get('passed', 0)} tests passed, fewer than {FEWEST_PASSED}")
    table = log.partition("= not tested here =")[2]
    if counts.get("skipped") and "apt install" not in table:
        faults.append("no table says what was not tested, and what to install")
    rows = [int(number) for number in re.findall(r"^ *(\d+) tests  ", table, re.MULTILINE)]
    if sum(rows) != counts.get("skipped", 0):
        faults.append(f"the table counts {sum(rows)} tests, pytest {counts.get('skipped', 0)}")
    return faults


def main(arguments: list[str]) -> int:
    """Print the faults; return 1 if there are any."""
    if arguments == ["demo"]:
        faults = faults_of_demo(Path("README.md").read_text(encoding="utf-8"), Path("runs/fast-seed1"))
    else:
        faults = faults_of_tests(Path(arguments[1]).read_text(encoding="utf-8"))
    for fault in faults:
        sys.stdout.write(f"{arguments[0]}: {fault}\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
