# SPDX-License-Identifier: MIT
"""The inputs that are kept in the tree: replays them, and says how much of the firmware they reach.

usage: python -m tests.fuzz.corpus [--make SECONDS] [TARGET...]

A replay runs every kept input and fails if fewer places of a folder are reached than its floor says. `make fuzz` does
one, unless it has passed (tests/kept.py). A place is a line of source on which an edge of the program's flow ends.
--make searches for so long per target with libFuzzer, from what is there, and keeps the smallest set that reaches all
that was reached.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests import kept
from tests.fuzz import fuzz

KEPT = Path(__file__).parent / "corpus"
TARGETS = ("app", "sequence", "parser", "params_file", "store")
LONGEST = {"app": 400, "sequence": 400, "parser": 300, "params_file": 300, "store": 400}
FLOORS = {"firmware/app": 0.73, "firmware/boards/common": 0.66, "shared/core": 0.37}
"""Share of a folder's places that the kept inputs reach at least. shared/link has no code of its own that runs here."""
LENGTH_BYTES = 2


def unpack(target: str, folder: Path) -> list[Path]:
    """Write the kept inputs of a target into a folder, one file each, and return them."""
    folder.mkdir(parents=True, exist_ok=True)
    packed = (KEPT / f"{target}.bin").read_bytes() if (KEPT / f"{target}.bin").exists() else b""
    paths: list[Path] = []
    while packed:
        size = int.from_bytes(packed[:LENGTH_BYTES], "little")
        paths.append(folder / f"kept-{len(paths)}")
        paths[-1].write_bytes(packed[LENGTH_BYTES : LENGTH_BYTES + size])
        packed = packed[LENGTH_BYTES + size :]
    return paths


def pack(target: str, inputs: Sequence[bytes]) -> None:
    """Keep these inputs: length and bytes of each, the shortest first, so that equal sets make equal files."""
    ordered = sorted(set(inputs), key=lambda data: (len(data), data))
    packed = b"".join(len(data).to_bytes(LENGTH_BYTES, "little") + data for data in ordered)
    KEPT.mkdir(exist_ok=True)
    (KEPT / f"{target}.bin").write_bytes(packed)


def places_of(program: Path, edges: Path) -> dict[tuple[str, str], bool]:
    """Return the places of a program, as file and line, and whether each was reached."""
    lines = [line.split() for line in edges.read_text(encoding="ascii").splitlines()]
    command = ["llvm-symbolizer", f"--obj={program}", "--output-style=GNU", "--no-inlines", "--functions=none"]
    done = subprocess.run(
        command, input="\n".join(line[0] for line in lines), capture_output=True, text=True, check=True
    )
    found = [line for line in done.stdout.splitlines() if line]
    places: dict[tuple[str, str], bool] = {}
    for (_, taken), place in zip(lines, found, strict=True):
        source, _, line = place.partition(" ")[0].rpartition(":")
        source = os.path.normpath(source)  # a header of another room is named through it
        if source.startswith(str(fuzz.ROOT)):
            key = (str(Path(source).relative_to(fuzz.ROOT)), line)
            places[key] = places.get(key, False) or taken == "1"
    return places


def replay(targets: Sequence[str]) -> dict[tuple[str, str], bool] | None:
    """Run all kept inputs; return the places reached, or None if something was found."""
    places: dict[tuple[str, str], bool] = {}
    for target in targets:
        with tempfile.TemporaryDirectory() as folder:
            paths = unpack(target, Path(folder) / "kept")
            edges = Path(folder) / "edges"
            command = [str(fuzz.program(target)), *map(str, paths)]
            if not fuzz.run(target, command, FUZZ_EDGES=str(edges)):
                return None
            for place, taken in places_of(fuzz.program(target), edges).items():
                places[place] = places.get(place, False) or taken
    return places


def shares(places: dict[tuple[str, str], bool]) -> dict[str, tuple[int, int]]:
    """Return how many places of each folder with a floor were reached, and how many there are."""
    counts = {}
    for folder in FLOORS:
        of_folder = [taken for (source, _), taken in places.items() if source.startswith(f"{folder}/")]
        counts[folder] = (sum(of_folder), len(of_folder))
    return counts


def check_floors(places: dict[tuple[str, str], bool]) -> bool:
    """Say what was reached; False if a folder is below its floor."""
    good = True
    for folder, (reached, there_are) in shares(places).items():
        share = reached / there_are if there_are else 0.0
        enough = share >= FLOORS[folder]
        good = good and enough
        verdict = "" if enough else ": LESS THAN ITS FLOOR"
        sys.stdout.write(
            f"{folder}: {reached} of {there_are} places reached, {share:.3f}, floor {FLOORS[folder]}{verdict}\n"
        )
    return good


def taken_by(target: str, path: Path, edges: Path) -> set[str]:
    """Return the edges that one input takes. Raises CalledProcessError."""
    environment = {**os.environ, "FUZZ_EDGES": str(edges)}
    subprocess.run([str(fuzz.program(target)), str(path)], check=True, capture_output=True, env=environment)
    return {line.split()[0] for line in edges.read_text(encoding="ascii").splitlines() if line.endswith(" 1")}


def thin_out(target: str, folder: Path) -> list[bytes]:
    """Return inputs that together take every edge that those of a folder take: libFuzzer also keeps how often."""
    edges = folder.parent / "edges"
    taken = {path: taken_by(target, path, edges) for path in sorted(folder.iterdir())}
    kept, reached = [], set[str]()
    while taken:
        best = max(taken, key=lambda path: (len(taken[path] - reached), -path.stat().st_size))
        if not taken[best] - reached:
            break
        reached |= taken.pop(best)
        kept.append(best.read_bytes())
    return kept


def make(target: str, seconds: int, seed: int) -> None:
    """Search from what is kept, then keep the smallest set that reaches as much. Raises CalledProcessError."""
    with tempfile.TemporaryDirectory() as folder:
        found, least = Path(folder) / "found", Path(folder) / "least"
        unpack(target, found)
        least.mkdir()
        fuzz.first_inputs(found, seed)
        program = fuzz.PROGRAMS / f"fuzz_{target}"
        limits = [f"-seed={seed}", f"-max_len={LONGEST[target]}", "-timeout=10", f"-artifact_prefix={fuzz.FINDINGS}/"]
        fuzz.FINDINGS.mkdir(parents=True, exist_ok=True)
        for arguments in (
            [*limits, f"-max_total_time={seconds}", "-reduce_inputs=1", str(found)],
            [*limits, "-set_cover_merge=1", str(least), str(found)],
        ):
            subprocess.run([str(program), *arguments], check=True, capture_output=True)
        inputs = thin_out(target, least)
    pack(target, inputs)
    size = (KEPT / f"{target}.bin").stat().st_size
    sys.stdout.write(f"{target}: {len(inputs)} inputs kept, {size} bytes\n")


def main() -> int:
    """Replay, or make; exit code 1 if something was found or too little was reached."""
    parser = argparse.ArgumentParser(description="Replay the kept inputs of the fuzzers, or make them anew.")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"any of {', '.join(TARGETS)}; all by default")
    parser.add_argument("--make", type=int, metavar="SECONDS", help="search for so long per target, keep what it takes")
    parser.add_argument("--seed", type=int, default=1, help="[%(default)s]")
    options = parser.parse_args()
    unknown = [target for target in options.targets if target not in TARGETS]
    if unknown:
        parser.error(f"nothing is kept for {', '.join(unknown)}; there are {', '.join(TARGETS)}")
    if shutil.which("llvm-symbolizer") is None:
        parser.error("llvm-symbolizer missing (Debian: apt-get install llvm)")
    targets = options.targets or TARGETS
    if options.make is not None:
        fuzz.build()
        for target in targets:
            make(target, options.make, options.seed)
        return 0
    name, inputs = "fuzz: kept inputs", kept.digest(fuzz.sources_digest(), kept.files_digest([KEPT, Path(__file__)]))
    if not options.targets and kept.has_passed(name, inputs):
        sys.stdout.write(
            f"kept inputs: not run again: nothing changed since ({kept.VARIABLE}={kept.IGNORE} runs them)\n"
        )
        return 0
    fuzz.build([f"seeded_{target}" for target in targets])
    places = replay(targets)
    if places is None:
        return 1
    good = check_floors(places)
    if good and not options.targets:
        kept.note_passed([(name, inputs)])
    return 0 if good or options.targets else 1


if __name__ == "__main__":
    os.environ["ASAN_OPTIONS"] = "detect_leaks=0"  # what is not freed at exit is the driver's own
    sys.exit(main())
