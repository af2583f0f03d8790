# SPDX-License-Identifier: MIT
"""One proof: Frama-C's Eva over the core's sources and a driver, and what it says of every property."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from omni_schema.toml_file import read_toml
from tests import kept

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).resolve().parent
NOT_PROVED = FOLDER / "not_proved.toml"
OUT = ROOT / "build" / "proof"
TIMEOUT_S = 3600
MACHINE = ("-machdep", "gcc_x86_32", "-enums", "gcc-short-enums")
"""Integers of the Cortex-M7's sizes and byte order, and enums as small as its compiler makes them."""
EVA = [
    "-warn-special-float",
    "none",
    "-eva-no-print",
    "-eva-precision",
    "5",
    "-eva-domains",
    "equality,symbolic-locations",
    "-eva-split-return",
    "auto",
    "-eva-auto-loop-unroll",
    "300",
]
_PROVED = {"Valid", "Considered valid"}
_ABOUT_DECLARATIONS = {"assigns clause", "from clause"}


class ProofError(RuntimeError):
    """Frama-C did not come to an end; says why."""


@dataclass(frozen=True, order=True)
class Place:
    """A property that was not proved. No line numbers: code above it may move."""

    function: str
    kind: str
    text: str

    def __str__(self) -> str:
        return f"{self.function}: {self.kind}: {self.text}"


@dataclass(frozen=True)
class Proof:
    """A driver below ``drivers`` and how it is analysed."""

    name: str
    shows: str
    given: str
    options: tuple[str, ...] = ()
    nightly: bool = False
    driver_name: str = ""

    @property
    def driver(self) -> Path:
        return FOLDER / "drivers" / f"{self.driver_name or self.name}.c"


@dataclass
class Result:
    """What Eva said."""

    proof: Proof
    proved: int = 0
    reached: set[str] = field(default_factory=set)
    open: set[Place] = field(default_factory=set)


def generate() -> None:
    """Write the core's generated tables."""
    script = ROOT / "shared" / "generate" / "generate.py"
    subprocess.run([sys.executable, str(script), "--out", str(OUT / "generated"), "--part", "tables"], check=True)


def run(proof: Proof, core: Path = ROOT / "shared" / "core", out: Path = OUT) -> Result:
    """Run a proof over the sources below ``core``; logs go below ``out``. Raises ProofError."""
    folder = out / proof.name
    folder.mkdir(parents=True, exist_ok=True)
    report, log = folder / "properties.csv", folder / "frama-c.log"
    report.unlink(missing_ok=True)
    shutil.copyfile(FOLDER / "ieee.ml", folder / "ieee.ml")  # Frama-C compiles it where it lies
    command = [*_command(proof, core, folder), "-then", "-report", "-report-csv", str(report)]
    with log.open("w", encoding="utf-8") as file:
        done = subprocess.run(command, stdout=file, stderr=subprocess.STDOUT, cwd=ROOT, timeout=TIMEOUT_S, check=False)
    text = log.read_text(encoding="utf-8", errors="replace")
    if done.returncode != 0 or not report.exists():
        raise ProofError(f"{proof.name}: frama-c ended with {done.returncode}; see {log}\n{text[-2000:]}")
    with report.open(encoding="utf-8", newline="") as file:
        return judge(proof, csv.DictReader(file, delimiter="\t"), reached_functions(text))


def without_comments(text: str) -> str:
    """Return C source without what no compiler reads: comments (other than Frama-C's own, /*@ or //@) and layout."""
    kept = re.sub(
        r"""'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|/\*@.*?\*/|//@[^\n]*|/\*.*?\*/|//[^\n]*""",
        lambda match: " " if re.match(r"/[*/](?!@)", match[0]) else match[0],
        text,
        flags=re.DOTALL,
    )
    return "\n".join(" ".join(line.split()) for line in kept.splitlines() if line.strip())


def fingerprint(proof: Proof, core: Path = ROOT / "shared" / "core", generated: Path = OUT / "generated") -> str:
    """Return a digest of all that a proof depends on: sources, headers, driver, options, what may stay unproved.

    ``generate`` must have run, and Frama-C be there. Another comment or layout gives the same digest.
    """
    parts = [_version(), *MACHINE, *EVA, *proof.options, proof.name]
    folders = [core / "src", core / "include", generated / "src", generated / "include"]
    paths = [path for folder in folders for path in sorted(folder.rglob("*.[ch]"))]
    for path in [*paths, *sorted(FOLDER.glob("*.h")), FOLDER / "ieee.ml", proof.driver]:
        text = path.read_text(encoding="utf-8")
        parts += [path.name, without_comments(text) if path.suffix in (".c", ".h") else text]
    return kept.digest(*parts, repr(read_toml(NOT_PROVED).get("place")))


@cache
def _version() -> str:
    return kept.version_of("frama-c")


def _command(proof: Proof, core: Path, folder: Path) -> list[str]:
    generated = OUT / "generated"
    includes = [core / "include", generated / "include", FOLDER]
    preprocessor = f"-std=c99 -include {FOLDER / 'builtins.h'} " + " ".join(f"-I{path}" for path in includes)
    sources = [*sorted((core / "src").rglob("*.c")), *sorted((generated / "src").glob("*.c")), proof.driver]
    return [
        *("frama-c", "-load-script", str(folder / "ieee.ml"), *MACHINE, f"-cpp-extra-args={preprocessor}"),
        *map(str, sources),
        *("-eva", "-main", f"proof_{proof.name}", *EVA, *proof.options, "-metrics", "-metrics-eva-cover"),
    ]


def reached_functions(log: str) -> set[str]:
    """Return the functions of which Eva reached a statement."""
    return {base_name(name) for name in re.findall(r"^  (\w+): \d+ stmts out of \d+", log, flags=re.MULTILINE)}


def base_name(function: str) -> str:
    """Return a function's name in the sources: Frama-C numbers static functions of one name."""
    return re.sub(r"_\d+$", "", function)


def judge(proof: Proof, rows: Iterable[dict[str, str]], reached: set[str]) -> Result:
    """Count what was proved, and keep what was not.

    A check of the driver that is never reached is not proved either: then the driver does not say what it seems to.
    """
    result = Result(proof, reached=reached)
    for row in rows:
        kind, status, function = row["property kind"], row["status"], row["function"]
        if (
            kind in _ABOUT_DECLARATIONS
            or row["directory"].startswith("FRAMAC_SHARE")
            or function.startswith("Frama_C_")
        ):
            continue
        other_entry = function.startswith("proof_") and function != f"proof_{proof.name}"
        needed = kind == "user check" and row["file"] == proof.driver.name and not other_entry
        if status in _PROVED:
            result.proved += status == "Valid"
        elif status != "Dead" or needed:
            words = kind if status == "Unknown" else f"{kind} ({status.lower()})"
            result.open.add(Place(base_name(function), words, " ".join(row["property"].split())))
    return result


def core_functions(sources: Sequence[Path]) -> set[str]:
    """Return the names of the functions that the core's sources define."""
    definition = re.compile(
        r"^(?!static const|typedef|return|else)[A-Za-z][\w \t*]*?\b(\w+)\([^;{}]*\) \{$", re.MULTILINE
    )
    texts = (re.sub(r"__attribute__\(\(.*?\)\) ", "", path.read_text(encoding="utf-8")) for path in sources)
    return {name for text in texts for name in definition.findall(text)}
