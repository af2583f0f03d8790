# SPDX-License-Identifier: MIT
"""Settings for all tests: the same examples in every run, and no time limits that a busy machine could miss."""

from __future__ import annotations

import os
import signal
import tempfile

import pytest
from hypothesis import settings

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


def pytest_configure(config: pytest.Config) -> None:
    """Make warnings errors in CI, where somebody reads them, and not at a user's with other versions of libraries."""
    if os.environ.get("CI"):
        for kind in ("RuntimeWarning", "DeprecationWarning", "FutureWarning", "UserWarning"):
            config.addinivalue_line("filterwarnings", f"error::{kind}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the studio: its files are the longest, and one that starts last keeps a single worker busy."""
    items.sort(key=lambda item: "studio" not in item.path.parts)
