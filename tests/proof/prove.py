# SPDX-License-Identifier: MIT
"""Proofs over the control core: Frama-C's Eva looks at every input at once, NaN and infinities too.

usage: python -m tests.proof.prove [--write] [--nightly] [PROOF ...]

A proof is not made again while everything it depends on has the same content (tests/kept.py); a named one is.
Exit code 1: something is not proved that docs/checks/proof.md does not list, or the page says something else. Without
Frama-C nothing is proved, and it says so; with CI=true that is an error.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from omni_schema.toml_file import read_toml
from tests import kept
from tests.needs import missing, remedies
from tests.parity.budget_page import replace_block
from tests.proof.frama_c import (
    FOLDER,
    NOT_PROVED,
    ROOT,
    Place,
    Proof,
    ProofError,
    Result,
    core_functions,
    fingerprint,
    generate,
    run,
)

PAGE = ROOT / "docs" / "checks" / "proof.md"
COMMAND = "make prove ARGS=--write"


def read_proofs() -> list[Proof]:
    """Return the proofs of proofs.toml in its order."""
    return [
        Proof(
            name,
            entry["shows"],
            entry["given"],
            tuple(" ".join(entry.get("options", [])).split()),
            entry.get("nightly", False),
            entry.get("driver", ""),
        )
        for name, entry in read_toml(FOLDER / "proofs.toml").items()
    ]


@dataclass(frozen=True)
class Unreached:
    """Functions that no proof may reach: these, and all in these files of ``shared/core/src``."""

    names: tuple[str, ...]
    files: tuple[str, ...]
    why: str


def read_not_proved() -> tuple[dict[Place, str], list[Unreached]]:
    """Return why each listed place is not proved, and which functions no proof reaches."""
    document = read_toml(NOT_PROVED)
    places = {Place(row["function"], row["kind"], row["text"]): row["why"] for row in document.get("place", [])}
    rows = document.get("functions", [])
    return places, [Unreached(tuple(row["names"]), tuple(row["files"]), row["why"]) for row in rows]


def differences(results: Sequence[Result], listed: Mapping[Place, str], all_ran: bool) -> list[str]:
    """Return a sentence for every place that is not proved and not listed, and for every one that is listed in vain."""
    met: dict[Place, str] = {place: result.proof.name for result in results for place in result.open}
    sentences = [f"{name}: not proved: {place}" for place, name in sorted(met.items()) if place not in listed]
    if all_ran:
        sentences += [
            f"not_proved.toml lists what is proved by now: {place}" for place in sorted(set(listed) - set(met))
        ]
    return sentences


def unreached(results: Sequence[Result], listed: Sequence[Unreached]) -> list[str]:
    """Return a sentence for every function of the core that no proof reaches, or that is listed though one does."""
    missed = _functions() - {name for result in results for name in result.reached}
    names = {name for row in listed for name in row.names}
    files = {pattern: _functions(pattern) for row in listed for pattern in row.files}
    sentences = [f"no proof reaches {name}" for name in sorted(missed - names.union(*files.values()))]
    sentences += [f"not_proved.toml says that no proof reaches {name}" for name in sorted(names - missed)]
    in_vain = sorted(pattern for pattern, functions in files.items() if not functions & missed)
    return sentences + [f"not_proved.toml lists {pattern}, all of which is proved by now" for pattern in in_vain]


def kept_name(proof: Proof) -> str:
    """Return the name under which tests/kept.txt has a proof."""
    return f"proof: {proof.name}"


def to_make(chosen: Sequence[Proof], prints: Mapping[str, str]) -> list[Proof]:
    """Return the proofs that have not been made for what they depend on now."""
    return [proof for proof in chosen if not kept.has_passed(kept_name(proof), prints[proof.name])]


def _functions(pattern: str = "*/*.[ch]") -> set[str]:
    return core_functions(sorted((ROOT / "shared" / "core" / "src").glob(pattern)))


def page_blocks(
    proofs: Sequence[Proof], places: Mapping[Place, str], functions: Sequence[Unreached]
) -> dict[str, list[str]]:
    """Return the tables of docs/checks/proof.md. They need no run: that they are true is what a run shows."""
    proved = ["| Proof | What holds | Given | When |", "|---|---|---|---|"]
    proved += [f"| `{proof.name}` | {proof.shows} | {proof.given} | {_when(proof)} |" for proof in proofs]
    rest = ["| Function | What | Why not |", "|---|---|---|"]
    rest += [
        f"| `{place.function}` | {place.kind}: `{_cell(place.text)}` | {why} |" for place, why in sorted(places.items())
    ]
    for row in functions:
        what = [f"all in `shared/core/src/{pattern}`" for pattern in row.files] + [f"`{name}`" for name in row.names]
        rest.append(f"| {', '.join(what)} | reached by no proof | {row.why} |")
    return {"proofs": proved, "not-proved": rest}


def _when(proof: Proof) -> str:
    return "nightly" if proof.nightly else "nightly, and when a source changed"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def with_blocks(page: str, blocks: Mapping[str, list[str]]) -> str:
    """Return the page with the tables in it."""
    for name, lines in blocks.items():
        page = replace_block(page, name, lines)
    return page


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("proofs", nargs="*", metavar="PROOF", help="run these only")
    parser.add_argument("--nightly", action="store_true", help="all of them")
    parser.add_argument("--write", action="store_true", help="write docs/checks/proof.md")
    options = parser.parse_args(arguments)
    everything = read_proofs()
    unknown = set(options.proofs) - {proof.name for proof in everything}
    if unknown:
        parser.error(f"no such proof: {', '.join(sorted(unknown))}; there are {', '.join(p.name for p in everything)}")
    chosen = [
        p for p in everything if (p.name in options.proofs if options.proofs else options.nightly or not p.nightly)
    ]
    console, errors = Console(soft_wrap=True, highlight=False), Console(stderr=True, soft_wrap=True, highlight=False)
    if missing("frama-c"):
        errors.print(f"NOTHING WAS PROVED: frama-c is not installed: {remedies('frama-c')}")
        return int(os.environ.get("CI") == "true")
    places, functions = read_not_proved()
    generate()
    prints = {proof.name: fingerprint(proof) for proof in chosen}
    made = chosen if options.nightly or options.proofs else to_make(chosen, prints)
    for proof in chosen:
        if proof not in made:
            console.print(f"{proof.name}: not made again: nothing changed since (--nightly makes it)")
    try:
        results = _run_all(made, console)
    except ProofError as error:
        errors.print(f"error: {error}", markup=False)
        return 1
    all_ran = len(made) == len(everything)
    sentences = differences(results, places, all_ran) + (unreached(results, functions) if all_ran else [])
    sentences += _page(page_blocks(everything, places, functions), options.write)
    if not sentences:
        kept.note_passed((kept_name(result.proof), prints[result.proof.name]) for result in results)
        kept.drop(kept_name(Proof("", "", "")), map(kept_name, everything))
    for sentence in sentences:
        errors.print(f"error: {sentence}", markup=False)
    return int(bool(sentences))


def _run_all(proofs: Sequence[Proof], console: Console) -> list[Result]:
    results = []
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for result in pool.map(run, proofs):
            results.append(result)
            console.print(f"{result.proof.name}: {len(result.reached)} functions, {len(result.open)} places not proved")
    return results


def _page(blocks: Mapping[str, list[str]], write: bool, path: Path = PAGE) -> list[str]:
    page = path.read_text(encoding="utf-8")
    wanted = with_blocks(page, blocks)
    if write:
        path.write_text(wanted, encoding="utf-8")
    return [] if write or wanted == page else [f"{path.name} does not say what is proved: {COMMAND}"]


if __name__ == "__main__":
    sys.exit(main())
