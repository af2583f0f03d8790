# SPDX-License-Identifier: MIT
"""UMBmark of real omni-directional robots, from the logs that Sousa and others published with OptiOdom (2022).

usage: python -m omni_reproduce.square_logs FOLDER

FOLDER is ``data`` in a clone of github.com/sousarbarb/optiodom (MIT licence). Its ``omni3/square`` and ``omni4/square``
have wheel counts and the pose by a motion-capture system. The robots' geometry is taken as the logs state it, so the
figures are those before any calibration. How wheels are numbered and which way they turn is as in that repository.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.square import CORNER_RAD, EDGES, end_of
from omniwheel.errors import LogError

Array = NDArray[np.float64]
KINDS = ("omni3", "omni4")
FIRST_M = 0.3
"""So far from its start the robot is still on the first edge."""


@dataclass(frozen=True)
class Session:
    """Squares that one robot drove one after another.

    ``kinds`` counts the kinds of square: direction, way of the first edge, turn of all. ``systematic_m`` is how far the
    farthest centre of gravity of a kind is from zero. ``spread_m`` is the root mean square distance of a run from its
    own centre; NaN if there is one run of each kind.
    """

    kind: str
    name: str
    runs: int
    kinds: int
    edge_m: float
    systematic_m: float
    spread_m: float


def sessions(folder: Path) -> list[Session]:
    """Return every session of squares below the folder. Raises LogError."""
    places = [place for kind in KINDS for place in sorted((folder / kind / "square").glob("*")) if place.is_dir()]
    if not places:
        raise LogError(f"{folder} has no omni3/square or omni4/square", hint="give the folder data of that repository")
    return [session(place) for place in places]


def session(place: Path) -> Session:
    """Return what the runs of one session say. Raises LogError."""
    geometry = _geometry(place / f"{place.name}_metadata.csv")
    kind = place.parent.parent.name
    errors: dict[tuple[int, ...], list[Array]] = {}
    lengths = []
    for path in sorted(place.glob(f"{place.name}_run-[0-9][0-9].csv")):
        log = _numbers(path)
        truth = log[:, 1:4] - log[0, 1:4]
        error = truth[-1] - end_of(moved(log[1:, 4:], kind, geometry))
        errors.setdefault(_kind_of_square(truth), []).append(error[:2])
        lengths.append(float(np.hypot(*np.diff(truth[::25, :2], axis=0).T).sum()))
    together = [np.array(group) for group in errors.values()]
    centres = [group.mean(axis=0) for group in together]
    free = len(lengths) - len(centres)
    if not centres:
        raise LogError(f"{place}: has no runs", hint="fetch the repository whole, with its data")
    squares = sum(float(((group - centre) ** 2).sum()) for group, centre in zip(together, centres, strict=True))
    farthest = max(float(np.hypot(*centre)) for centre in centres)
    edge_m = float(np.mean(lengths)) / EDGES
    spread = float(np.sqrt(squares / free)) if free > 0 else float("nan")
    return Session(kind, place.name, len(lengths), len(centres), edge_m, farthest, spread)


def _kind_of_square(truth: Array) -> tuple[int, ...]:
    """Return direction of the square, quarter in which its first edge leads, and quarter turns of the body."""
    x, y = truth[:, 0], truth[:, 1]
    clockwise = int(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) < 0.0)
    leads = truth[np.argmax(np.hypot(x, y) > FIRST_M)]
    return (
        clockwise,
        round(float(np.arctan2(leads[1], leads[0])) / CORNER_RAD) % EDGES,
        round(truth[-1, 2] / CORNER_RAD),
    )


def moved(counts: Array, kind: str, geometry: dict[str, list[float]]) -> list[Array]:
    """Return the body's motion per row, from the counts of each wheel since the row before."""
    turned = np.pi * np.array(geometry["Di"]) * counts / (geometry["ngear"][0] * geometry["encRes"][0])
    if kind == "omni3":
        third, distance = 1.0 / 3.0, geometry["Li"][0]
        root = np.sqrt(third)
        rows = [[-root, root, 0.0], [-third, -third, 2.0 * third], [-third / distance] * 3]
    else:
        share = -0.5 / sum(geometry["Li"])
        rows = [[0.25, -0.25, 0.25, -0.25], [-0.25, -0.25, 0.25, 0.25], [share] * 4]
    return list(turned @ np.array(rows).T)


def _geometry(path: Path) -> dict[str, list[float]]:
    try:
        lines = [line.split(",") for line in path.read_text(encoding="utf-8-sig").splitlines()]
        known = {cells[0]: [float(cell) for cell in cells[1:] if cell] for cells in lines if cells[0] != "type"}
    except (OSError, ValueError) as error:
        raise LogError(f"{path}: {error}") from error
    missing = [name for name in ("ngear", "encRes", "Li", "Di") if not known.get(name)]
    if missing:
        raise LogError(f"{path}: has no {', '.join(missing)}")
    return known


def _numbers(path: Path) -> Array:
    try:
        return np.loadtxt(path, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise LogError(f"{path}: {error}") from error


def main() -> None:
    """Print a line per session."""
    parser = argparse.ArgumentParser(description="UMBmark of the real robots of OptiOdom's logs")
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="data, in a clone of github.com/sousarbarb/optiodom"
    )
    try:
        found = sessions(parser.parse_args().folder)
    except LogError as error:
        sys.exit(f"{error}; {error.hint}" if error.hint else str(error))
    for entry in found:
        sys.stdout.write(
            f"{entry.kind} {entry.name}: {entry.runs} runs, {entry.kinds} kinds, edge {entry.edge_m:.2f} m, "
            f"E_max,syst {1e3 * entry.systematic_m:.1f} mm, spread {1e3 * entry.spread_m:.1f} mm\n"
        )


if __name__ == "__main__":
    main()
