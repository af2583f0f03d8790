# SPDX-License-Identifier: MIT
"""A stop acts within two ticks in every case that can be listed; docs/reference/safety.md says how many."""

from __future__ import annotations

import pytest

from tests.firmware import stop_latency, stop_loads

EVERY = 9
"""Of the cases in turn; all of them in `make nightly`."""


@pytest.mark.full
def test_stops_of_every_kind_and_moment_act_within_two_ticks() -> None:
    ticks, late = stop_latency.measure(every=EVERY)
    assert not late, late[:10]
    assert all(sum(counted.values()) > 100 for counted in ticks.values())


@pytest.mark.nightly
def test_every_stop_acts_within_two_ticks_and_the_page_has_the_distribution() -> None:
    content, late = stop_latency.page_content()
    assert not late, late[:10]
    page = stop_latency.PAGE.read_text(encoding="utf-8")
    assert stop_latency.in_page(page, content) == page, "run python -m tests.firmware.stop_latency --write"


def test_without_a_stop_the_arm_commands_before_it_arm() -> None:
    assert stop_loads.arms_if_nobody_stops()
