# SPDX-License-Identifier: MIT
"""``make help`` names every target that a person may type."""

from __future__ import annotations

import re
from pathlib import Path

MAKEFILE = Path(__file__).resolve().parents[2] / "Makefile"


def test_make_help_names_every_target() -> None:
    text = MAKEFILE.read_text(encoding="utf-8").replace("\\\n", " ")
    found = re.search(r"^\.PHONY:(.*)$", text, re.MULTILINE)
    assert found is not None
    targets = set(found[1].split()) - {"help"}
    told = set(re.findall(r"@echo '  make ([a-z-]+) ", text))
    assert told == targets
