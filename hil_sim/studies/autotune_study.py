# SPDX-License-Identifier: MIT
"""``python -m omni.checks autotune``: drawn robots are tuned and judged, some against an optimiser, some are stopped.

Three parts, each kept in a folder of its own and resumed from there: ``robots``, ``rivals`` and ``stops``.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import omniwheel.autotune
from hil_sim.processes import worker_pool
from hil_sim.studies import autotune_rival, autotune_robot, autotune_stop, drawn_robots, engine
from hil_sim.studies.autotune_link import CABLE, Way
from hil_sim.studies.autotune_summary import document, page
from hil_sim.studies.folder import Definition, StudyFolder
from hil_sim.studies.store import KEY_BYTES
from hil_sim.studies.study import Progress, no_progress
from omniwheel import files, wheel_loop
from omniwheel.autotune.procedure import Settings
from omniwheel.number_text import finite

Array = NDArray[Any]
SUMMARY_FILE, PAGE_FILE, ROBOTS_FILE = "summary.json", "report.md", "robots.csv"

DECIDING = ("choice", "comparison", "design", "gains", "motor_values", "procedure", "room", "sweep")
"""Modules of autotune that decide what it finds."""


@dataclass(frozen=True)
class Plan:
    """How many robots, from which seed on, in which way; how many meet a rival; how many tunings are stopped."""

    robots: int
    first_seed: int = 1
    rivals: int = 0
    stops: int = 0
    settings: Settings = field(default_factory=Settings)
    way: Way = CABLE


@dataclass(frozen=True)
class Part:
    """A part of the study: what makes the row of a number, and the row's layout."""

    name: str
    row: np.dtype[Any]
    work: Callable[[int, Any], Array]


PARTS = (
    Part("robots", autotune_robot.ROW, autotune_robot.robot_row),
    Part("rivals", autotune_rival.ROW, autotune_rival.rival_row),
    Part("stops", autotune_stop.ROW, autotune_stop.stop_row),
)


def sources_digest() -> str:
    """Return a digest of the code whose results are kept: autotune's, and how robots are drawn."""
    folder = Path(next(iter(omniwheel.autotune.__path__)))
    paths = [*(folder / f"{name}.py" for name in DECIDING), Path(wheel_loop.__file__), Path(drawn_robots.__file__)]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:16]


def run_study(
    plan: Plan, path: Path, jobs: int = 1, *, fresh: bool = False, told: Progress = no_progress
) -> dict[str, Any]:
    """Do what is missing and write the results; return the summary. Raises StudyFolderError, OutputFileError."""
    seeds = range(plan.first_seed, plan.first_seed + plan.robots)
    robots = _done(PARTS[0], plan, path, seeds, [(plan.settings, plan.way)] * plan.robots, jobs, fresh, told)
    tuned = [(row["seed"], autotune_robot.values_after(row)) for row in robots[: plan.rivals]]
    rivals = _done(PARTS[1], plan, path, [int(seed) for seed, _ in tuned], [v for _, v in tuned], jobs, fresh, told)
    stops = range(plan.first_seed, plan.first_seed + plan.stops)
    stopped = _done(PARTS[2], plan, path, stops, [plan.settings] * plan.stops, jobs, fresh, told)
    summary: dict[str, Any] = finite(document(robots, rivals, stopped))
    files.write_text(path / SUMMARY_FILE, json.dumps(summary, indent=1, allow_nan=False) + "\n")
    files.write_text(path / ROBOTS_FILE, robot_table(robots))
    files.write_text(path / PAGE_FILE, page(summary))
    return summary


def _done(
    part: Part,
    plan: Plan,
    path: Path,
    seeds: Sequence[int],
    given: Sequence[Any],
    jobs: int,
    fresh: bool,
    told: Progress,
) -> Array:
    """Return the rows of these seeds; those that the folder does not hold are made first."""
    if not seeds:
        return np.empty(0, part.row)
    content = {
        "settings": asdict(plan.settings),
        "way": asdict(plan.way),
        "sources": sources_digest(),
        "engine": engine.identity(),
        "row": list(part.row.names or ()),
    }
    definition = Definition(f"study autotune, {part.name}", content)
    with StudyFolder(path / part.name, definition, part.row, 1, fresh=fresh) as folder:
        missing = {}
        for seed, argument in zip(seeds, given, strict=True):
            if folder.store.holds(_key(seed), 1):
                told(1, 0.0, kept=True)
            else:
                missing[seed] = argument
        for seed, row in _rows(part, missing, jobs):
            folder.store.put(_key(seed), row)
            told(1, float(row["simulated_s"][0]), kept=False)
        return np.concatenate([folder.store.get(_key(seed), 1) for seed in seeds])


def _rows(part: Part, missing: Mapping[int, Any], jobs: int) -> Iterator[tuple[int, Array]]:
    """Yield each row as it gets done: here, or by several processes."""
    if jobs == 1:
        for seed, argument in missing.items():
            yield seed, part.work(seed, argument)
        return
    with worker_pool(jobs) as pool:
        waiting = {pool.submit(part.work, seed, argument): seed for seed, argument in missing.items()}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def _key(seed: int) -> bytes:
    return hashlib.blake2b(str(seed).encode(), digest_size=KEY_BYTES).digest()


def robot_table(rows: Array) -> str:
    """Return the robots as CSV, a line each."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = rows.dtype.names or ()
    writer.writerow(names)
    for row in rows:
        writer.writerow([_cell(row[name]) for name in names])
    return out.getvalue()


def _cell(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else f"{value:.6g}"
