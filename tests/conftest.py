# SPDX-License-Identifier: MIT
"""Settings for all tests: the same examples in every run, and no time limits that a busy machine could miss."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("search", max_examples=3000, deadline=None)
settings.load_profile("repeatable")
