# SPDX-License-Identifier: MIT
"""Tests that build the firmware's sources themselves get the mutant, of sources and of headers, one after another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from tests.mutation.builds import Builder, BuildError, areas, prepare_site
from tests.mutation.operators import Mutant
from tests.mutation.process import Runner
from tests.native import ROOT

FILE = "tests/firmware/test_tick_parts.py"
LAMP, JITTER = "firmware/app/services/status_light.h", "firmware/app/tick/tick_jitter.h"
SPREAD = f"{FILE}::test_jitter_is_the_spread_of_the_starts_whatever_the_first_tick_did[pc]"
PLAYS = f"{FILE}::test_the_lamp_plays_its_pattern_every_two_seconds[pc-2]"
PLANTED = {
    SPREAD: ("firmware/app/tick/tick_jitter.cpp", "earliest_ns_) * 1e-3f", "earliest_ns_) * 2e-3f"),
    PLAYS: (LAMP, "light_slots = 20", "light_slots = 19"),
    f"{SPREAD} once more": (JITTER, "window_ticks = 1000", "window_ticks = 999"),
}
"""By the test that kills each. The last one's source was compiled with a changed header that it does not include."""


def planted(file: str, was: str, becomes: str) -> Mutant:
    text = (ROOT / file).read_bytes()
    start = text.index(was.encode())
    return Mutant(file, "(file)", "", "constant", start, start + len(was), becomes, was, becomes)


@pytest.fixture(scope="module")
def tried() -> Iterator[tuple[Builder, Runner]]:
    prepare_site()
    area = replace(areas()["app"], tests=(FILE,))
    builder = Builder(area)
    runner = Runner(area, builder.folder)
    yield builder, runner
    runner.close()


@pytest.mark.full
def test_mutants_are_killed_by_tests_that_build_the_sources(tried: tuple[Builder, Runner]) -> None:
    builder, runner = tried

    def killed(mutant: Mutant | None) -> str:
        environment = builder.test_environment(mutant, builder.folder)
        return runner.verdict({SPREAD: 1.0, PLAYS: 1.0}, environment, "")["test"]

    assert killed(None) == ""
    for by, change in PLANTED.items():
        assert killed(planted(*change)) == by.removesuffix(" once more")


@pytest.mark.full
def test_a_test_that_is_not_there_is_no_test_that_passes(tried: tuple[Builder, Runner]) -> None:
    builder, _ = tried
    runner = Runner(replace(areas()["app"], tests=(FILE,)), builder.folder)
    with pytest.raises(BuildError, match="has ended"):
        runner.verdict({SPREAD: 1.0, f"{FILE}::renamed": 1.0}, {}, "")
    runner.close()
