# SPDX-License-Identifier: MIT
"""The diagram of the safety states in the documentation is the robot's own table."""

from __future__ import annotations

from pathlib import Path

from bench.figures.fault_table import STATES, with_part
from hil_sim.state_diagram import EVENTS, diagram
from omniwheel._core import lib

DOCUMENT = Path(__file__).parents[2] / "docs" / "reference" / "safety.md"


def test_the_documentation_shows_the_table_that_the_robot_uses() -> None:
    """After a change, ``python -m bench.figures.fault_table --write`` brings it up to date."""
    document = DOCUMENT.read_text()
    assert with_part(document, STATES, diagram()) == document


def test_every_event_is_drawn() -> None:
    assert len(EVENTS) == lib.OMNI_SAFETY_EVENT_COUNT
    assert all(words in diagram() for words in EVENTS.values())
    assert sum("emergency stop" in line for line in diagram().splitlines()) == lib.OMNI_STATE_COUNT - 1
