# SPDX-License-Identifier: MIT
"""Runs the report's experiments in full and compares each with its section of docs/report/results.md.

usage: python -m tests.omni_reproduce.kept_page [EXPERIMENT ...] [--write] [--results FILE.json]

The page is the summary of ``omni reproduce``. The same seeds give the same bits on every machine, so the sections must
be equal to the letter: rows, names of pictures, and the digest of all rows, notes and footnotes. Differences are
printed as a diff, and the exit code is 1; with ``--write`` the page and its pictures are updated instead. If only the
digest differs, run ``omni reproduce EXPERIMENT`` of both commits and compare the two reproduction.md. An experiment
whose section was equal is kept in ``--results`` and not run again until the section changes: so a run that was cut
goes on where it was. Use another file for another commit. Experiments that cannot be run here (the real robot's logs
are not part of the project) are named, and are no failure.
"""

from __future__ import annotations

import argparse
import difflib
import json
import re
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from hil_sim.processes import worker_pool
from omni_reproduce import page, study
from omni_reproduce.experiment import Context
from omni_reproduce.registry import Experiment, select

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "report" / "results.md"
WIDTH = 1300
PICTURES = ROOT / "docs" / "images" / "reproduce"
NO_PICTURE = {"real_logs.png": "(The logs are not part of this project, and neither is their picture.)"}
_PICTURE = re.compile(r"!\[[^]]*\]\(([^)/]+)\)")
_SECTION = "\n## "


class NotRunError(RuntimeError):
    """An experiment lacks what it needs; says what."""


def sections(markdown: str) -> dict[str, str]:
    """Return a page's sections by title, each without the line of its title."""
    parts = markdown.split(_SECTION)[1:]
    return {title: body.strip("\n") for title, _, body in (part.partition("\n") for part in parts)}


def as_kept(body: str) -> str:
    """Return a section as the kept page has it: its pictures are in another folder, and one is not kept."""

    def kept(picture: re.Match[str]) -> str:
        name = picture[1]
        return NO_PICTURE.get(name) or picture[0].replace(f"({name})", f"(../images/reproduce/{name})")

    return _PICTURE.sub(kept, body)


def with_section(markdown: str, title: str, body: str) -> str:
    """Return a page with another body under this title."""
    head, found, rest = markdown.partition(f"{_SECTION}{title}\n")
    if not found:
        raise KeyError(f"{PAGE.name} has no section {title!r}: run `omni reproduce` and keep its summary")
    _, following, others = rest.partition(_SECTION)
    return f"{head}{found}\n{body}\n{following}{others}"


def differences(title: str, kept: str, today: str) -> list[str]:
    """Return the lines that differ as a unified diff, nothing if the section is of today."""
    old, new = kept.splitlines(), today.splitlines()
    return list(difflib.unified_diff(old, new, f"{PAGE.name}: {title}", "today", lineterm="", n=0))


def section_of(experiment: Experiment, context: Context) -> str:
    """Run an experiment with all its seeds and return its section as the page would keep it. Raises NotRunError."""
    (outcome,) = study.run_all([experiment], context, lambda _number, _share: None)
    if outcome.error:
        raise NotRunError(f"{outcome.error}; {outcome.hint}")
    if outcome.result.incomplete:
        raise NotRunError(outcome.result.incomplete)
    return as_kept(sections(page.summary([outcome], ""))[experiment.title])


def keep_picture(made: Path, kept: Path) -> None:
    """Write a picture as the documentation keeps it: WIDTH wide at most, with a palette, a third of the bytes."""
    with Image.open(made) as picture:
        width = min(WIDTH, picture.width)
        height = round(picture.height * width / picture.width)
        picture.convert("RGB").resize((width, height)).quantize(256).save(kept, optimize=True)


def equal_before(path: Path) -> dict[str, str]:
    """Return the digest of the section that each experiment was found equal to."""
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}


class Comparison:
    """Compares experiments with the page and keeps what was equal in ``results``."""

    def __init__(self, results: Path, write: bool) -> None:
        self.differ: list[str] = []
        self.not_run: list[str] = []
        self._results, self._write = results, write
        self._equal = equal_before(results)

    def take(self, experiment: Experiment, context: Context) -> None:
        """Compare one experiment, unless it is known to be equal."""
        text = PAGE.read_text(encoding="utf-8")
        kept = sections(text).get(experiment.title, "")
        if self._equal.get(experiment.name) == page.digest(kept):
            say(f"{experiment.name}: equal, found by an earlier run")
            return
        begin = time.monotonic()
        try:
            today = section_of(experiment, context)
        except NotRunError as error:
            self.not_run.append(experiment.name)
            say(f"{experiment.name}: not run: {error}")
            return
        found = differences(experiment.title, kept, today)
        say(f"{experiment.name}: {'differs' if found else 'equal'} ({time.monotonic() - begin:.1f} s)", *found)
        if found and self._write:
            PAGE.write_text(with_section(text, experiment.title, today), encoding="utf-8")
            for picture in context.folder.glob("*.png"):
                if picture.name not in NO_PICTURE:
                    keep_picture(picture, PICTURES / picture.name)
        elif found:
            self.differ.append(experiment.name)
            return
        self._equal[experiment.name] = page.digest(today)
        self._results.parent.mkdir(parents=True, exist_ok=True)
        self._results.write_text(json.dumps(self._equal, indent=1), encoding="utf-8")


def say(*lines: str) -> None:
    """Print lines at once, so that the log of a run that is cut has them."""
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Run what is asked for; exit code 1 if a section is not what its experiment gives."""
    parser = argparse.ArgumentParser(prog="python -m tests.omni_reproduce.kept_page", description=__doc__)
    parser.add_argument("experiments", nargs="*", help="all by default")
    parser.add_argument("--write", action="store_true", help="put what is of today into the page")
    parser.add_argument("--results", type=Path, default=ROOT / "build" / "nightly" / "reproduce.json")
    arguments = parser.parse_args()
    comparison = Comparison(arguments.results, arguments.write)
    with worker_pool() as pool:
        for experiment in select(arguments.experiments):
            with tempfile.TemporaryDirectory() as folder:
                comparison.take(experiment, Context(Path(folder), pool=pool))
    if comparison.not_run:
        say(f"not run here: {', '.join(comparison.not_run)}")
    if comparison.differ:
        sys.exit(f"not what {PAGE.name} has: {', '.join(comparison.differ)}; mend it, or keep what is new by --write")


if __name__ == "__main__":
    main()
