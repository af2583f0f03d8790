# SPDX-License-Identifier: MIT
"""Settings for all tests: the same examples in every run, and no time limits that a busy machine could miss."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests import needs, passed, tiers

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("search", max_examples=3000, deadline=None)
# Sanitizers slow everything down several times; what they look for shows with fewer examples too.
settings.register_profile("sanitized", parent=settings.get_profile("repeatable"), max_examples=25)
settings.load_profile("sanitized" if os.environ.get("OMNI_SANITIZED") else "repeatable")

# Histories of parameters stay out of the user's own; programs under test inherit this.
os.environ["OMNI_STATE_DIR"] = tempfile.mkdtemp(prefix="omni-state-")

# A shell starts background jobs with Ctrl-C ignored, and programs under test would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    tiers.add_options(parser)
    passed.add_option(parser)


def pytest_configure(config: pytest.Config) -> None:
    """Make warnings errors in CI, where somebody reads them, and not at a user's with other versions of libraries."""
    tiers.choose_tier(config)
    if os.environ.get("CI"):
        for kind in ("RuntimeWarning", "DeprecationWarning", "FutureWarning", "UserWarning"):
            config.addinivalue_line("filterwarnings", f"error::{kind}")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    tiers.select(config, items)
    passed.leave_out(config, items)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    yield from tiers.end_when_stuck(item)


def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker in item.iter_markers("needs"):
        needs.need(*marker.args)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was not tested here, and what to install; keep what passed."""
    passed.record(terminalreporter.stats.get("passed", []))
    if lines := needs.Skips.of(terminalreporter.stats.get("skipped", [])).table():
        terminalreporter.section("not tested here")
        for line in lines:
            terminalreporter.write_line(line)
