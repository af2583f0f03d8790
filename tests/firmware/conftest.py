# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import Client, lockstep_robot


@pytest.fixture
def robot() -> Iterator[Client]:
    """A fresh three-wheel robot in lockstep."""
    with lockstep_robot() as client:
        yield client
