# SPDX-License-Identifier: MIT
"""Days on end: the firmware, the simulated world and a ground station on two links, in one process on the PC.

usage: python -m tests.soak.soak [--hours N] [--days N] [--write]

Simulated hours with everything on (signed radio, telemetry, pose fixes, saves, emergency stops, a reboot at the end of
each), then a drive across every wrap of the robot's clocks in so many days. Each hour that is done stands in
build/nightly/soak; an interrupted run goes on behind it. A program built from other sources begins anew. --write puts
the figures into docs/checks/fuzzing.md. Exit code 1 if the robot did what it must not, or if memory or drift were not
flat.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from hil_sim.c_scenario import scenario_world
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi
from tests.fuzz import fuzz
from tests.fuzz.long_run import PAGE, commit

STATE = fuzz.ROOT / "build" / "nightly" / "soak"
BEGIN, END = "<!-- soak: python -m tests.soak.soak --write -->", "<!-- end of soak -->"
SCENARIO = "demo"
HEAP_GROWTH = 4096
"""Bytes that the process's heap may differ between the second hour and the last."""
ERROR_RATIO = 1.5
"""The estimate's worst error in the last hours beside the first ones."""


class SoakError(Exception):
    """A robot that did not do what it must; the message says when and what."""


def program() -> Path:
    """Return the plain build's program, built."""
    fuzz.build(["soak"], "nothing")
    return fuzz.BUILDS["nothing"] / "tests" / "soak" / "soak"


def folder_of(built: Path) -> Path:
    """Return the folder of this very program, with a copy of it and what it reads."""
    folder = STATE / hashlib.sha256(built.read_bytes()).hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "soak").exists():
        shutil.copy2(built, folder / "soak")
        (folder / "commit").write_text(commit(), encoding="utf-8")
    scenario = load_scenario(SCENARIO)
    config = scenario_world(scenario)
    (folder / "world").write_bytes(bytes(ffi.buffer(config)))
    ours = {**scenario.parameters, "TRJ_LAPS": 0.0}
    (folder / "parameters").write_text(
        "".join(f"{name} {float(value)!r}\n" for name, value in ours.items()), encoding="utf-8"
    )
    return folder


def run(folder: Path, *arguments: str) -> dict[str, Any]:
    """Run the program once and return what it printed. Raises SoakError."""
    begin = time.monotonic()
    done = subprocess.run([str(folder / "soak"), *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SoakError(
            f"{' '.join(arguments)}: exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        )
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-2 if "executions" in done.stdout else -1])
    return {**figures, "wall_s": time.monotonic() - begin}


def done_hours(folder: Path) -> list[dict[str, Any]]:
    """Return the figures of the hours that have been done."""
    path = folder / "hours.jsonl"
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def do_hours(folder: Path, hours: int) -> None:
    """Go on until so many hours are done."""
    robot = load_scenario(SCENARIO).robot.name
    while len(done := done_hours(folder)) < hours:
        state = folder / "state"
        kept = folder / f"state-{len(done)}"  # the state that this hour begins with: a failure can be run again
        if done:
            shutil.copy2(kept, state)
        else:
            state.unlink(missing_ok=True)
        figures = run(folder, "hours", str(folder / "world"), str(folder / "parameters"), str(state), robot)
        shutil.copy2(state, folder / f"state-{len(done) + 1}")
        kept.unlink(missing_ok=True)
        with (folder / "hours.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(figures) + "\n")
        sys.stdout.write(f"hour {len(done) + 1} of {hours}: {json.dumps(figures)}\n")
        sys.stdout.flush()


def check_flat(hours: list[dict[str, Any]]) -> None:
    """Compare the last hours with the first. Raises SoakError."""
    for name in ("overruns", "i2c_errors", "rx_errors", "signing_refused"):
        if any(hour[name] for hour in hours):
            raise SoakError(f"{name} is not 0: {[hour[name] for hour in hours]}")
    heap = [hour["heap"] for hour in hours[1:]]
    if heap and max(heap) - min(heap) > HEAP_GROWTH:
        raise SoakError(f"the heap is not flat: {heap}")
    third = max(1, len(hours) // 3)
    first, last = (max(hour["error_m_max"] for hour in part) for part in (hours[:third], hours[-third:]))
    if last > ERROR_RATIO * first:
        raise SoakError(f"the estimate's error grew from {first} m to {last} m")


def do_jumps(folder: Path, days: int) -> None:
    """Cross every wrap in so many days, unless that has been done."""
    path = folder / f"jumps-{days}.json"
    if not path.exists():
        robot = load_scenario(SCENARIO).robot.name
        figures = run(folder, "jumps", str(folder / "world"), str(folder / "parameters"), str(days), robot)
        path.write_text(json.dumps(figures), encoding="utf-8")
    sys.stdout.write(f"{days} days of wraps: {path.read_text(encoding='utf-8')}\n")


def table(folder: Path, days: int) -> str:
    """Return the figures in Markdown."""
    hours = done_hours(folder)
    heap = sorted({hour["heap"] for hour in hours[1:]})
    errors = [hour["error_m_max"] * 1e3 for hour in hours]
    lines = ["| | |", "|---|---|", f"| commit | {(folder / 'commit').read_text(encoding='utf-8')} |"]
    if hours:
        signing = [hour["signing_ahead_ms"] for hour in hours]
        faster = sum(hour["ticks"] for hour in hours) * 1e-3 / sum(hour["wall_s"] for hour in hours)
        lines += [
            f"| simulated hours, reboots | {len(hours)} |",
            f"| ticks up to each reboot | {sum(hour['ticks'] for hour in hours)} |",
            f"| driven | {sum(hour['distance_m'] for hour in hours) * 1e-3:.1f} km |",
            f"| frames from the robot over USB, radio | {sum(hour['frames_usb'] for hour in hours)}, "
            f"{sum(hour['frames_radio'] for hour in hours)} |",
            f"| commands acknowledged | {sum(hour['acknowledged'] for hour in hours)} |",
            f"| worst error of the estimate, by hour | {min(errors):.1f} to {max(errors):.1f} mm |",
            f"| heap of the process at the end of each hour but the first | {', '.join(map(str, heap))} bytes |",
            f"| signing clock ahead of the calendar, by hour | {min(signing):.1f} to {max(signing):.1f} ms |",
            f"| faster than real time | {faster:.0f} |",
        ]
    path = folder / f"jumps-{days}.json"
    if path.exists():
        jumps = json.loads(path.read_text(encoding="utf-8"))
        lines += [
            f"| days by jumping the clocks | {jumps['days']:.1f} |",
            f"| wraps and changes of sign driven across | {jumps['crossings']} |",
            f"| … ticks, worst error of the estimate | {jumps['ticks']}, {jumps['error_m_max'] * 1e3:.1f} mm |",
        ]
    return "\n".join(lines)


def write_page(folder: Path, days: int) -> None:
    """Put the table between its marks."""
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n{table(folder, days)}\n{END}{rest.split(END)[1]}", encoding="utf-8")


def main() -> int:
    """Do what was asked for; exit code 1 if the robot failed."""
    parser = argparse.ArgumentParser(description="Simulated days of the firmware, resumable by the hour.")
    parser.add_argument("--hours", type=int, default=24, help="[%(default)s]")
    parser.add_argument("--days", type=int, default=60, help="by jumping the clocks [%(default)s]")
    parser.add_argument("--write", action="store_true", help="put what is done so far into docs/checks/fuzzing.md")
    options = parser.parse_args()
    if options.write:  # the latest run that did hours, whatever it was built from: the table names the commit
        runs = sorted(STATE.glob("*/hours.jsonl"), key=lambda path: path.stat().st_mtime)
        if not runs:
            parser.error(f"nothing has been run: there are no hours in {STATE}")
        write_page(runs[-1].parent, options.days)
        return 0
    folder = folder_of(program())
    try:
        do_jumps(folder, options.days)
        do_hours(folder, options.hours)
        check_flat(done_hours(folder))
    except SoakError as error:
        sys.stdout.write(f"soak: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
