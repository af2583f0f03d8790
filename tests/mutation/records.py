# SPDX-License-Identifier: MIT
"""What became of mutants: results that can be gone on with, judgements of survivors, and the figures of both."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.mutation.operators import OPERATORS, Mutant
from tests.native import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

JUDGEMENTS = Path(__file__).with_name("survivors.toml")
EQUIVALENT, MISSING = "equivalent", "missing"
KILLED, SURVIVED, GOLDEN, REFUSED, SAME = "killed", "survived", "golden", "does not compile", "same object code"
"""``golden``: no test of a property or against a reference fails, but the recorded bits of the parity program do."""
FOLDERS = ("firmware/app", "shared/core/src")
COUNTED = (KILLED, GOLDEN, SURVIVED)


@dataclass(frozen=True)
class Result:
    """One mutant's fate; ``source``, ``tests`` and ``text`` are digests of what it was found with.

    ``text`` is the mutant's own: of the function around it. ``commit`` names the sources as Git does. ``longest_s`` is
    the processor time that its tests were allowed.
    """

    key: str
    outcome: str
    source: str
    tests: str
    by: str = ""
    how: str = ""
    text: str = ""
    commit: str = ""
    longest_s: float = 15.0


class Results:
    """A file of results that grows line by line, so that an interrupted run goes on where it was."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[str, Result] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                try:
                    result = Result(**json.loads(line))
                except (json.JSONDecodeError, TypeError):
                    continue  # the last line of a run that was killed
                self._known[result.key] = result

    def get(self, key: str, source: str, tests: str, test_file: str = "", longest_s: float = 0.0) -> Result | None:
        """Return a mutant's result if it still holds.

        A kill holds as long as the mutated file and the file of the test that killed are what they were
        (``test_file`` is that file's digest now); a survival as long as no test has changed, if its tests were allowed
        ``longest_s``.
        """
        result = self._known.get(key)
        if result is None or result.source != source:
            return None
        if result.outcome in (SURVIVED, GOLDEN):
            return result if result.tests == tests and result.longest_s >= longest_s else None
        if result.outcome == KILLED:
            return result if result.tests == test_file else None
        return result

    def carried(self, mutant: Mutant, tests: Collection[str]) -> Result | None:
        """Return the kill of an older run, if the mutant's function reads as it did and the test still exists.

        ``tests`` are the names of all tests there are now. What the function calls, and what the test does, may have
        changed since: whoever counts such kills says how many they are. A survivor is never carried over.
        """
        result = self._known.get(mutant.key)
        if result is None or result.outcome != KILLED or not result.text:
            return None
        return result if result.text == mutant.text and result.by in tests else None

    def found(self, key: str, source: str) -> Result | None:
        """Return a mutant's last result, whatever tests there are now: a survivor is one until it is tried again."""
        result = self._known.get(key)
        return result if result is not None and result.source == source else None

    def killer(self, key: str) -> str:
        """Return the test that killed a mutant the last time, or nothing."""
        result = self._known.get(key)
        return result.by if result is not None else ""

    def add(self, result: Result) -> None:
        """Keep a result."""
        self._known[result.key] = result
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(result)) + "\n")


@dataclass(frozen=True)
class Judgement:
    """Why a survivor is no matter, or what is missing."""

    file: str
    function: str
    operator: str
    was: str
    becomes: str
    verdict: str
    why: str
    number: int = 0

    @property
    def key(self) -> str:
        """The mutant's."""
        return Mutant(self.file, self.function, "", self.operator, 0, 0, "", self.was, self.becomes, self.number).key


def read_judgements(path: Path = JUDGEMENTS) -> dict[str, Judgement]:
    """Return the judgements by the mutants' keys. Raises ValueError for one that says nothing."""
    entries = tomllib.loads(path.read_text(encoding="utf-8")).get("survivor", []) if path.exists() else []
    judged = {}
    for entry in entries:
        judgement = Judgement(**entry)
        if judgement.verdict not in (EQUIVALENT, MISSING) or not judgement.why:
            raise ValueError(f"{path.name}: {judgement.function}: verdict '{EQUIVALENT}' or '{MISSING}', and why")
        judged[judgement.key] = judgement
    return judged


@dataclass(frozen=True)
class Score:
    """Counts of a sample; ``equivalent``: survivors judged so."""

    outcomes: Counter[str]
    equivalent: int = 0

    @property
    def counted(self) -> int:
        """Mutants that compile and are not proved equivalent by their object code."""
        return sum(self.outcomes[name] for name in COUNTED)

    @property
    def killed_percent(self) -> float:
        """Share that a property or a reference kills, survivors that were judged equivalent among the others."""
        return 100.0 * self.outcomes[KILLED] / self.counted if self.counted else 100.0

    @property
    def killed_percent_of_different(self) -> float:
        """The same, without survivors that were judged equivalent."""
        different = self.counted - self.equivalent
        return 100.0 * self.outcomes[KILLED] / different if different else 100.0


def score(pairs: Iterable[tuple[Mutant, Result]], judged: dict[str, Judgement]) -> Score:
    """Count."""
    outcomes: Counter[str] = Counter()
    equivalent = 0
    for mutant, result in pairs:
        outcomes[result.outcome] += 1
        judgement = judged.get(mutant.key)
        if result.outcome in (SURVIVED, GOLDEN) and judgement is not None and judgement.verdict == EQUIVALENT:
            equivalent += 1
    return Score(outcomes, equivalent)


def table(rows: Sequence[tuple[str, Score]]) -> str:
    """Return Markdown: one row per name."""
    lines = [
        "| | sampled | do not compile | same object code | counted | killed | seen by recorded bits only | survived "
        "| of these judged equivalent | killed of counted | killed of different |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for name, figures in rows:
        n = figures.outcomes
        cells = [sum(n.values()), n[REFUSED], n[SAME], figures.counted, n[KILLED], n[GOLDEN], n[SURVIVED]]
        percents = (figures.killed_percent, figures.killed_percent_of_different)
        words = [name, *map(str, cells), str(figures.equivalent), *(f"{percent:.1f} %" for percent in percents)]
        lines.append("| " + " | ".join(words) + " |")
    return "\n".join(lines)


def report(pairs: Sequence[tuple[Mutant, Result]], judged: dict[str, Judgement]) -> str:
    """Return the tables by area and by operator, without those of which none has been run."""
    here = [folder for folder in FOLDERS if any(mutant.file.startswith(folder + "/") for mutant, _ in pairs)]
    rows = [(f"`{f}`", score([p for p in pairs if p[0].file.startswith(f + "/")], judged)) for f in here]
    used = [name for name in OPERATORS if any(mutant.operator == name for mutant, _ in pairs)]
    by_operator = [(name, score([p for p in pairs if p[0].operator == name], judged)) for name in used]
    return "\n\n".join((table([*rows, ("**all**", score(pairs, judged))]), table(by_operator)))


def origins(pairs: Sequence[tuple[Mutant, Result]], carried: Collection[str]) -> str:
    """Return a sentence that says how many verdicts are of the sources as they are, and from which commits the others.

    ``carried`` are the keys of those that :meth:`Results.carried` gave.
    """
    older = Counter(result.commit or "unknown" for mutant, result in pairs if mutant.key in carried)
    text = f"{len(pairs) - sum(older.values())} verdicts are of the sources as they are."
    if not older:
        return text
    names = ", ".join(f"{count} from {commit}" for commit, count in older.most_common())
    return (
        f"{text} {sum(older.values())} kills are carried over ({names}): "
        "the function reads as it did, and the test that killed still exists."
    )


def survivor_text(mutant: Mutant) -> str:
    """Return a survivor as an entry to be judged in survivors.toml."""
    lines = ["[[survivor]]"]
    for name in ("file", "function", "operator", "was", "becomes"):
        lines.append(f"{name} = {json.dumps(getattr(mutant, name), ensure_ascii=False)}")
    if mutant.number:
        lines.append(f"number = {mutant.number}")
    return "\n".join([*lines, f'verdict = "{MISSING}"', 'why = ""'])


def line_of(mutant: Mutant) -> int:
    """Return where a mutant is now."""
    return (ROOT / mutant.file).read_bytes()[: mutant.start].count(b"\n") + 1
