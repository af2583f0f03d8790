# SPDX-License-Identifier: MIT
"""What make installs for tests, linters and pages are packages of pyproject.toml's extras, without another build."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.ci.requirements import requirements

MAKEFILE = (Path(__file__).resolve().parents[2] / "Makefile").read_text(encoding="utf-8")


def test_each_extra_that_make_names_has_packages() -> None:
    named = [words.split() for words in re.findall(r"\$\(call INSTALL_EXTRAS,([a-z ]+)\)", MAKEFILE)]
    assert ["test", "flash"] in named
    for extras in named:
        packages = requirements(extras)
        assert len(packages) >= len(extras)
        assert all(re.match(r"[A-Za-z]", package) for package in packages)


def test_an_extra_that_is_not_there_is_an_error() -> None:
    with pytest.raises(KeyError, match="tset"):
        requirements(["tset"])


def test_the_package_itself_is_installed_once() -> None:
    """Each editable install configures the build and packs its results again."""
    assert len(re.findall(r"PIP_INSTALL\).* -e ", MAKEFILE)) == 1
