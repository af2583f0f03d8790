# SPDX-License-Identifier: MIT
from __future__ import annotations

from pathlib import Path

import pytest

from tests.image import flashed


@pytest.fixture(scope="session")
def image() -> Path:
    """Path of the image that `make firmware` linked; skips without it."""
    path = flashed.image_path()
    flashed.need(flashed.missing_image(path))
    return path
