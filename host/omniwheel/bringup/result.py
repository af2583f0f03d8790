# SPDX-License-Identifier: MIT
"""What a check found: pass or fail, what was seen, what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Finding:
    """One thing looked at: ``seen`` says what was measured, ``advice`` what to do, "" where nothing is wrong."""

    name: str
    ok: bool
    seen: str
    advice: str = ""


@dataclass(frozen=True)
class Result:
    """A check's findings in order and its figures by name (units in the names)."""

    check: str
    findings: tuple[Finding, ...]
    measured: dict[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether everything passed."""
        return all(finding.ok for finding in self.findings)

    @property
    def advice(self) -> tuple[str, ...]:
        """What to do, in order."""
        return tuple(finding.advice for finding in self.findings if finding.advice)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        findings = [vars(finding) for finding in self.findings]
        return {"check": self.check, "ok": self.ok, "findings": findings, "measured": self.measured}


class Findings:
    """Collects findings."""

    def __init__(self, check: str) -> None:
        self._check = check
        self._findings: list[Finding] = []
        self.measured: dict[str, Any] = {}

    def good(self, name: str, seen: str) -> None:
        """Note something that is as it should be."""
        self._findings.append(Finding(name, True, seen))

    def bad(self, name: str, seen: str, advice: str) -> None:
        """Note something that is not, and what to do."""
        self._findings.append(Finding(name, False, seen, advice))

    def judge(self, name: str, ok: bool, seen: str, advice: str) -> bool:
        """Note either; return ``ok``."""
        self._findings.append(Finding(name, ok, seen, "" if ok else advice))
        return ok

    def result(self) -> Result:
        """Return what was collected."""
        return Result(self._check, tuple(self._findings), self.measured)
