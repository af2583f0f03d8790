# SPDX-License-Identifier: MIT
"""Prints the packages of extras of pyproject.toml, one a line, for pip's -r: ``pip install -e '.[test]'`` also builds.

usage: python tests/ci/requirements.py EXTRA ...
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from omni_schema import toml_file

PROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


def requirements(extras: Sequence[str]) -> list[str]:
    """Return what pip is to install. Raises KeyError for an extra that is not there."""
    table = toml_file.read_toml(PROJECT)["project"]["optional-dependencies"]
    return [package for extra in extras for package in table[extra]]


if __name__ == "__main__":
    print(*requirements(sys.argv[1:]), sep="\n")
