# SPDX-License-Identifier: MIT
"""Which tests belong to which tier, and how long one may take.

| Tier | Tests | Run by |
|---|---|---|
| fast | those of at most 0.3 s of processor time, and one whole drive over a link | ``make test`` |
| all | and those marked ``full``: over 0.3 s of processor time, browsers, images | ``make test-all``, CI |
| nightly | those marked ``nightly`` alone | ``make nightly ARGS=tests`` |

A run without ``--tier`` takes the fast tier, or all where files are named: who names a test wants it run.
"""

from __future__ import annotations

import faulthandler
import os
from collections.abc import Iterator

import pytest

TIERS = ("fast", "all", "nightly")
FULL_FIXTURES = {"browser", "simulated", "shared_studio", "image", "flashed_image", "sitl"}
"""A test with one of these starts a browser, an emulated chip or a whole command."""
FULL_FOLDERS = ("emulated", "faults", "fuzz", "image", "image_build", "recipes", "soak")
"""Folders of tests that do nothing else."""
STUCK_S = 30.0
"""After a test's time limit, until the process ends: a test that waits in C code does not see the limit."""


def add_options(parser: pytest.Parser) -> None:
    """Add --tier."""
    parser.addoption(
        "--tier", choices=TIERS, help="tests to run: fast (default), all (default if files are named), nightly"
    )


def choose_tier(config: pytest.Config) -> None:
    """Fix the tier before workers start: they are given all files by name."""
    if config.getoption("tier") is None:
        named = config.args_source is pytest.Config.ArgsSource.ARGS
        config.option.tier = "all" if named else "fast"


def tier_of(item: pytest.Item) -> str:
    """Return the lowest tier that has a test."""
    if item.get_closest_marker("nightly") is not None:
        return "nightly"
    fixtures = FULL_FIXTURES.intersection(getattr(item, "fixturenames", ()))
    if fixtures or item.get_closest_marker("full") is not None or item.path.parent.name in FULL_FOLDERS:
        return "all"
    return "fast"


def select(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the tests of the chosen tier."""
    tier = config.getoption("tier")
    wanted = {"fast": ("fast",), "all": ("fast", "all"), "nightly": ("nightly",)}[tier]
    kept: list[pytest.Item] = []
    others: list[pytest.Item] = []
    for item in items:
        (kept if tier_of(item) in wanted else others).append(item)
    config.hook.pytest_deselected(items=others)
    items[:] = kept


def limit_s(item: pytest.Item) -> float:
    """Return a test's time limit in seconds: its marker's, else the configured one; 0: none."""
    marker = item.get_closest_marker("timeout")
    if marker is not None:
        return float(marker.args[0] if marker.args else marker.kwargs.get("timeout", 0))
    given = item.config.getoption("timeout", None)
    return float(given if given is not None else item.config.getini("timeout") or 0)


def end_when_stuck(item: pytest.Item) -> Iterator[None]:
    """Around a test: end the process with the stacks of all threads if it outlives its limit by STUCK_S."""
    seconds = limit_s(item)
    if seconds > 0 and "PYTEST_XDIST_WORKER" in os.environ:
        faulthandler.dump_traceback_later(seconds + STUCK_S, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()
