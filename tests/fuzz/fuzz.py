# SPDX-License-Identifier: MIT
"""Builds and runs the firmware's fuzzers: a bounded seeded run that is the same everywhere, or libFuzzer for a while.

usage: python -m tests.fuzz.fuzz [--bytes N] [--seconds N] [--seed N] [TARGET...]

Without --seconds every target gets a seeded run of --bytes bytes, unless the same run of the same sources has passed
(tests/kept.py). With it, libFuzzer searches for that long per target,
from the corpus it leaves in build/fuzz/corpus; the reader of robot files, which is Python, has its seeded run all the
same. What breaks a promise stays in build/fuzz/findings; build/fuzz/tests/fuzz/seeded_TARGET FILE runs it again.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests import kept
from tests.needs import missing, remedies

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "fuzz"
BUILDS = {"sanitizers": BUILD, "nothing": ROOT / "build" / "fuzz-plain", "coverage": ROOT / "build" / "fuzz-coverage"}
"""What the fuzzers can be built with, and where: see OMNI_FUZZ_WITH."""
PROGRAMS = BUILD / "tests" / "fuzz"
FINDINGS = BUILD / "findings"
ROBOT_WITH_MOTOR_PINS = ROOT / "shared" / "robots" / "examples" / "three_wheel_pins.toml"
"""Built in besides the others, so that motors hang on the processor's own pins, too."""
ROBOT_FILE = "robot_file"
TARGETS = ("app", "sequence", "parser", "params_file", "store", ROBOT_FILE)
SHARES = {"app": 0.5, "sequence": 0.5, "parser": 0.5, "params_file": 0.1, "store": 0.5, ROBOT_FILE: 1.0}
"""Bytes of a target per byte asked for: a byte of one costs more time than one of the other."""
DEFAULT_BYTES = 4_000_000
GENERATED = ("omni_tables", "omni_mavlink", "omni_version")
BUILT_FROM = ("firmware/", "shared/", "tests/fuzz/", "build/")
"""Where the sources of the fuzzers are; the simulated world is not in them."""
SETTINGS = ("tests/fuzz/CMakeLists.txt", "cmake/flags.cmake")
READER = ("shared/generate/omni_schema", "shared/robots", "shared/params.toml", "shared/world.toml")
"""What the reader of robot files consists of, and what it reads."""
FIRST_INPUTS = 100


def program(target: str, built_with: str = "sanitizers") -> Path:
    """Return where the seeded fuzzer of a target is."""
    return BUILDS[built_with] / "tests" / "fuzz" / f"seeded_{target}"


def build(targets: Sequence[str] = ("fuzzers",), built_with: str = "sanitizers") -> None:
    """Configure and build in a folder of BUILDS; what is up to date is left alone. Raises CalledProcessError."""
    folder = BUILDS[built_with]
    tools = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}"}
    options = ["OMNI_PYTHON=OFF", "OMNI_FUZZ=ON", f"OMNI_FUZZ_WITH={built_with}", f"Python_EXECUTABLE={sys.executable}"]
    options.append(f"OMNI_ROBOTS={ROBOT_WITH_MOTOR_PINS}")
    if built_with == "sanitizers":
        options.append("OMNI_LEVEL=-O1")  # around so many checks -O3 takes twice as long to compile
    compilers = ["CMAKE_C_COMPILER=clang", "CMAKE_CXX_COMPILER=clang++"]
    settings = [f"-D{option}" for option in (*options, *compilers)]
    configure = ["cmake", "-S", str(ROOT), "-B", str(folder), "-G", "Ninja", *settings]
    for command in (configure, ["cmake", "--build", str(folder), "--target", *targets]):
        subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)


def sources_digest() -> str:
    """Return a digest of all that the fuzzers are built from. Builds the generated headers, which are a part of it."""
    build(GENERATED)
    sources = kept.compiled_sources(BUILD / "compile_commands.json")
    ours = [path for path in sorted(sources) if str(path.relative_to(ROOT)).startswith(BUILT_FROM)]
    texts = [(ROOT / name).read_text(encoding="utf-8") for name in SETTINGS]
    return kept.digest(kept.version_of("clang"), *texts, *(kept.source_digest(path, *sources[path]) for path in ours))


def run_digest(target: str, seed: int, size: int, sources: str) -> str:
    """Return a digest of all that the outcome of a seeded run depends on."""
    if target == ROBOT_FILE:
        here = Path(__file__).with_name(f"{ROBOT_FILE}.py")
        sources = sys.version + kept.files_digest([here, *(ROOT / name for name in READER)])
    return kept.digest(target, str(seed), str(size), sources)


def seeded_command(target: str, seed: int, size: int) -> list[str]:
    """Return the command of a seeded run."""
    if target == ROBOT_FILE:
        return [sys.executable, "-m", "tests.fuzz.robot_file", str(seed), str(size)]
    return [str(program(target)), str(seed), str(size)]


def first_inputs(corpus: Path, seed: int) -> None:
    """Give an empty corpus something to begin with."""
    corpus.mkdir(parents=True, exist_ok=True)
    if not any(corpus.iterdir()):
        rng = random.Random(seed)
        for number in range(FIRST_INPUTS):  # inputs are scripts: every byte string is a good one to begin with
            (corpus / f"first-{number}").write_bytes(rng.randbytes(rng.randrange(1, 1000)))


def search_command(target: str, seed: int, seconds: int) -> list[str]:
    """Return the command of a search by libFuzzer."""
    corpus = BUILD / "corpus" / target
    first_inputs(corpus, seed)
    limits = [f"-seed={seed}", f"-max_total_time={seconds}", "-timeout=10", "-max_len=4000", "-len_control=0"]
    return [str(PROGRAMS / f"fuzz_{target}"), *limits, f"-artifact_prefix={FINDINGS / target}-", str(corpus)]


def run(target: str, command: list[str], **more: str) -> bool:
    """Run one fuzzer, with ``more`` in its environment, and say how it went; False if it found something."""
    FINDINGS.mkdir(parents=True, exist_ok=True)
    paths = [str(ROOT / "shared" / "generate"), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    environment.update(more)
    environment["FUZZ_LAST"] = str(FINDINGS / f"{target}-last")
    begin = time.monotonic()
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", env=environment, check=False, cwd=ROOT
    )
    seconds = time.monotonic() - begin
    if done.returncode != 0:
        sys.stdout.write(f"{target}: FOUND SOMETHING (exit code {done.returncode}), see {FINDINGS}\n")
        sys.stdout.write(f"{done.stdout[-4000:]}\n{done.stderr[-8000:]}\n")
        return False
    figures = json.loads(next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{")))
    rate = figures["executions"] / seconds if seconds > 0 else 0.0
    covered = re.findall(r" cov: (\d+)", done.stderr)
    edges = f", {covered[-1]} edges covered" if covered else ""
    sys.stdout.write(f"{target}: nothing found in {seconds:.1f} s, {rate:.0f} inputs/s{edges}, {json.dumps(figures)}\n")
    return True


def main() -> int:
    """Run the fuzzers named on the command line; exit code 1 if one found something."""
    parser = argparse.ArgumentParser(description="Fuzz the firmware and the reader of robot files.")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"any of {', '.join(TARGETS)}; all by default")
    parser.add_argument("--bytes", type=int, default=DEFAULT_BYTES, help="size of the seeded run [%(default)s]")
    parser.add_argument("--seconds", type=int, help="let libFuzzer search for so long per target instead")
    parser.add_argument("--seed", type=int, default=1, help="[%(default)s]")
    options = parser.parse_args()
    unknown = [target for target in options.targets if target not in TARGETS]
    if unknown:
        parser.error(f"there is no target {', '.join(unknown)}; there are {', '.join(TARGETS)}")
    if missing("clang"):
        parser.error(f"clang is not installed: {remedies('clang')}")
    searches = options.seconds is not None
    sources = sources_digest() if not searches else ""
    sizes = {target: int(options.bytes * SHARES[target]) for target in options.targets or TARGETS}
    names = {target: f"fuzz: {target}, seed {options.seed}, {size} bytes" for target, size in sizes.items()}
    inputs = {target: run_digest(target, options.seed, size, sources) for target, size in sizes.items()}
    wanted = [t for t in sizes if (searches and t != ROBOT_FILE) or not kept.has_passed(names[t], inputs[t])]
    for target in sizes:
        if target not in wanted:
            sys.stdout.write(
                f"{target}: not run again: nothing changed since ({kept.VARIABLE}={kept.IGNORE} runs it)\n"
            )
    seeded = [f"seeded_{target}" for target in wanted if target != ROBOT_FILE]
    if seeded:
        build(["fuzzers"] if searches else seeded)
    good = True
    for target in wanted:
        if not searches or target == ROBOT_FILE:
            if run(target, seeded_command(target, options.seed, sizes[target])):
                kept.note_passed([(names[target], inputs[target])])
            else:
                good = False
        else:
            good = run(target, search_command(target, options.seed, options.seconds)) and good
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
