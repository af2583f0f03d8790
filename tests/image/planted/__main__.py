# SPDX-License-Identifier: MIT
"""Plants each bug in turn, builds the image and looks which check finds it.

usage: python -m tests.image.planted [--only NAME ...] [--survivors] [--write] [--results FILE.json]

What was found is kept in ``--results`` after each bug, so a run that was cut goes on where it was. A change of a patch
makes its result void; ``--survivors`` makes those of the bugs void that were not found. Exit code 1 if a bug was not
found and its patch does not say why none can. Needs what `make firmware` needs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

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


def look_for(bug: Bug, tree: Tree, search: Search, pio: Path, first: str) -> Result | None:
    """Plant one bug and look for it, first with what found it the last time."""
    try:
        tree.plant(bug)
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"{bug.name}.patch does not fit the sources any more: {error.stderr.strip()}") from error
    image, words = tree.build(pio)
    if image is None:
        raise SystemExit(f"{bug.name}: does not build, so it is no bug that could be flashed: {words}")
    return search.of(image, bug, first)


def main() -> int:
    """Run what is asked for; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.image.planted", description=__doc__)
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="these bugs")
    parser.add_argument("--survivors", action="store_true", help="look again for what was not found")
    parser.add_argument("--quick", action="store_true", help="leave out the checks that take long")
    parser.add_argument("--write", action="store_true", help="put the table into docs/teensy.md")
    parser.add_argument("--results", type=Path, default=FOLDER / "results.json", help="what has been found so far")
    parser.add_argument("--depth", default="ci", help="of the checks: short, ci or nightly")
    arguments = parser.parse_args()
    kept = arguments.results
    results = load(kept)
    page = PAGE.read_text(encoding="utf-8")
    bugs = [bug for bug in all_bugs() if not arguments.only or bug.name in arguments.only]
    todo = [bug for bug in bugs if not known(results.get(bug.name), bug, arguments.survivors)]
    told = finders(page)
    first = {bug.name: results[bug.name].found_by if bug.name in results else told.get(bug.title, "") for bug in todo}
    todo.sort(key=lambda bug: not first[bug.name])  # those found before are found soon
    if todo:
        pio = Path(sys.executable).parent / "pio"
        tree = Tree(FOLDER / "tree")
        image, words = tree.build(pio)
        if image is None:
            raise SystemExit(f"the image without any bug does not build: {words}")
        search = Search.by_all(arguments.depth, kept.with_suffix(".clean.json"), image, quick=arguments.quick)
        for bug in todo:
            result = look_for(bug, tree, search, pio, first[bug.name])
            if result is not None:
                results[bug.name] = result
                store(kept, results)
            sys.stdout.write(f"{bug.name:28} {result.line() if result else 'not found quickly'}\n")
            sys.stdout.flush()
    current = {bug.name: bug for bug in all_bugs()}
    results = {name: result for name, result in sorted(results.items()) if known(result, current.get(name), False)}
    sys.stdout.write(f"{summary(results)}\n")
    if arguments.write:
        PAGE.write_text(filled_in(page, current, results), encoding="utf-8")
    unexplained = [name for name, result in results.items() if not result.found_by and not current[name].missed]
    if unexplained:
        sys.stdout.write(f"Not found, and nothing says why: {', '.join(unexplained)}\n")
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main())
