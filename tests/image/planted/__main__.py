# SPDX-License-Identifier: MIT
"""Plants each bug in turn, builds the image and looks which check finds it.

usage: python -m tests.image.planted [--only NAME ...] [--survivors] [--write] [--results FILE.json]

All images are built first and kept, then they are searched side by side. What was found is kept in ``--results`` after
each bug, so a run that was cut goes on where it was. A change of a patch makes its result void; ``--survivors`` makes
those of the bugs void that were not found. Exit code 1 if a bug was not found and its patch does not say why none can.
Needs what `make firmware` needs.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from image_check.worker_processes import ProcessFailure, call_in_processes
from tests.image.planted.bugs import ROOT, Bug, Tree, all_bugs
from tests.image.planted.page import PAGE, filled_in, finders, summary
from tests.image.planted.search import Result, Search

FOLDER = ROOT / "build" / "planted"


def load(path: Path) -> dict[str, Result]:
    """Return what earlier runs have found."""
    if not path.is_file():
        return {}
    return {name: Result(**fields) for name, fields in json.loads(path.read_text(encoding="utf-8")).items()}


def store(path: Path, results: dict[str, Result]) -> None:
    """Keep what has been found so far."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({name: vars(result) for name, result in results.items()}, indent=1), encoding="utf-8")


def known(result: Result | None, bug: Bug | None, again: bool) -> bool:
    """Whether a bug's result still counts."""
    return (
        result is not None and bug is not None and result.digest == bug.digest and (bool(result.found_by) or not again)
    )


def look_for(
    todo: Sequence[Bug], first: Mapping[str, str], results: dict[str, Result], arguments: argparse.Namespace
) -> None:
    """Build what is to be searched and search it, each first with what found it the last time; keep each result."""
    tree = Tree(FOLDER / "tree")
    clean = tree.image(None, FOLDER / "images")
    images = [tree.image(bug, FOLDER / "images") for bug in todo]
    kept: Path = arguments.results
    search = Search.by_all(
        arguments.depth, kept.with_suffix(".clean.json"), clean, quick=arguments.quick, workers=arguments.workers
    )
    calls = [(image, bug, first[bug.name]) for image, bug in zip(images, todo, strict=True)]
    for number, result in call_in_processes(search.of, calls, arguments.workers):
        name = todo[number].name
        if isinstance(result, ProcessFailure):
            raise SystemExit(f"{name}: the search failed: {result.why}")
        if result is not None:
            results[name] = result
            store(kept, results)
        sys.stdout.write(f"{name:28} {result.line() if result else 'not found quickly'}\n")
        sys.stdout.flush()


def parse() -> argparse.Namespace:
    """Return what was asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.image.planted", description=__doc__)
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="these bugs")
    parser.add_argument("--survivors", action="store_true", help="look again for what was not found")
    parser.add_argument("--quick", action="store_true", help="leave out the checks that take long")
    parser.add_argument("--write", action="store_true", help="put the table into found.md")
    parser.add_argument("--results", type=Path, default=FOLDER / "results.json", help="what has been found so far")
    parser.add_argument("--depth", default="ci", help="of the checks: short, ci or nightly")
    parser.add_argument("--workers", type=int, default=2, help="images that are searched at the same time")
    return parser.parse_args()


def main() -> int:
    """Run what is asked for; return the exit code."""
    arguments = parse()
    results = load(arguments.results)
    page = PAGE.read_text(encoding="utf-8")
    bugs = {bug.name: bug for bug in all_bugs()}
    unknown = [name for name in arguments.only if name not in bugs]
    if unknown:
        raise SystemExit(f"there is no planted bug {unknown[0]}; there are {', '.join(bugs)}")
    wanted = [bugs[name] for name in arguments.only] if arguments.only else list(bugs.values())
    todo = [bug for bug in wanted if not known(results.get(bug.name), bug, arguments.survivors)]
    told = finders(page)
    first = {bug.name: results[bug.name].found_by if bug.name in results else told.get(bug.title, "") for bug in todo}
    todo.sort(key=lambda bug: not first[bug.name])  # those found before are found soon
    if todo:
        look_for(todo, first, results, arguments)
    results = {name: result for name, result in sorted(results.items()) if known(result, bugs.get(name), False)}
    sys.stdout.write(f"{summary(bugs, results)}\n")
    if arguments.write:
        PAGE.write_text(filled_in(page, bugs, results), encoding="utf-8")
    unexplained = [name for name, result in results.items() if not result.found_by and not bugs[name].missed]
    if unexplained:
        sys.stdout.write(f"Not found, and nothing says why: {', '.join(unexplained)}\n")
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main())
