# SPDX-License-Identifier: MIT
"""The pictures of the pages, and the numbers behind them: ``python -m tests.docs.pictures [--write] [NAME...]``.

Each picture is made by a command of ``omni``, in simulated time, so that it is the same each time. The numbers that the
command printed are kept beside the pictures in pictures.json. A test runs the commands again: other numbers mean that
the pictures are old, and ``--write`` makes them anew.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from omni.cli import app
from tests.host.stepped import robot

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
NUMBERS = IMAGES / "pictures.json"
DIGITS = 6


@dataclass(frozen=True)
class Picture:
    """How a picture is made: by a command that writes into ``{folder}``, where the picture is ``file`` then.

    ``keys`` are the parts of the command's JSON document that are kept: the numbers behind the picture.
    """

    command: str
    file: str
    keys: tuple[str, ...]
    during: Callable[[], AbstractContextManager[Any]] = ExitStack


PICTURES: Mapping[str, Picture] = {
    "demo.png": Picture("run fast --out {folder}", "fast-seed1/run.png", ("rmse", "effort", "change")),
    "tune.png": Picture(
        "tune --set LIM_V=0.06 --revert --plot {folder}/tune.png",
        "tune.png",
        ("before", "after"),
        partial(robot, end_s=600.0),
    ),
    "experiment.png": Picture(
        "experiment wheel-chirp --out {folder}", "wheel-chirp/experiment.png", ("figures",), partial(robot, end_s=600.0)
    ),
    "host_control.png": Picture(
        "host-control trajectory rose --simulate --deadband 60 --pwm-min 60 --full-speed 2.53 --plot {folder}/rose.png",
        "rose.png",
        ("error",),
    ),
    "montecarlo.png": Picture(
        "montecarlo tolerances --runs 200 --out {folder}/study", "study/spread.png", ("figures",)
    ),
}


def made(name: str, folder: Path) -> tuple[Path, dict[str, float]]:
    """Make a picture; return its file and the numbers behind it."""
    picture = PICTURES[name]
    with picture.during():
        result = CliRunner().invoke(app, [*shlex.split(picture.command.format(folder=folder)), "--json"])
    if result.exit_code != 0:
        raise RuntimeError(f"{name}: {result.output}")
    document = json.loads(result.stdout)
    return folder / picture.file, dict(_numbers({key: document[key] for key in picture.keys}))


def _numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Return the numbers of a document by their place, rounded: the last bits are no news."""
    if isinstance(value, dict):
        for key, entry in value.items():
            yield from _numbers(entry, f"{name}.{key}".lstrip("."))
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            yield from _numbers(entry, f"{name}.{number}")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(f"{value:.{DIGITS}g}")


def kept() -> dict[str, dict[str, float]]:
    """Return the numbers of all pictures as they were when the pictures were made."""
    numbers: dict[str, dict[str, float]] = json.loads(NUMBERS.read_text(encoding="utf-8"))
    return numbers


def main() -> int:
    """Say which pictures are old, or make them anew."""
    parser = argparse.ArgumentParser(prog="python -m tests.docs.pictures", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="*", default=list(PICTURES), help="only these: %(default)s")
    parser.add_argument("--write", action="store_true", help="make them anew, with their numbers")
    options = parser.parse_args()
    known = kept() if NUMBERS.is_file() else {}
    old = []
    for name in options.names:
        with tempfile.TemporaryDirectory() as folder:
            file, numbers = made(name, Path(folder))
            if numbers == known.get(name):
                continue
            old.append(name)
            if options.write:
                (IMAGES / name).write_bytes(file.read_bytes())
                known[name] = numbers
    if options.write:
        NUMBERS.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    print(f"{'made anew' if options.write else 'old'}: {', '.join(old) or 'none'}")
    return 1 if old and not options.write else 0


if __name__ == "__main__":
    sys.exit(main())
