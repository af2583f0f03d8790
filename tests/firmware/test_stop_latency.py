# SPDX-License-Identifier: MIT
"""A stop acts within two ticks in every case that can be listed; docs/reference/safety.md says how many."""

from __future__ import annotations

from tests.firmware import stop_latency


def test_every_stop_acts_within_two_ticks_and_the_page_has_the_distribution() -> None:
    ticks, late = stop_latency.measure()
    assert not late, [str(case) for case in late[:10]]
    page = stop_latency.PAGE.read_text(encoding="utf-8")
    assert stop_latency.in_page(page, stop_latency.table(ticks)) == page, (
        "run python -m tests.firmware.stop_latency --write"
    )
