# SPDX-License-Identifier: MIT
"""The guide shows the page of today."""

from __future__ import annotations

from tests.studio import picture


def test_the_picture_is_of_this_page() -> None:
    """After a change of the page: ``python -m tests.studio.picture``, and look at it."""
    assert picture.FINGERPRINT.read_text(encoding="ascii").strip() == picture.fingerprint()
    assert picture.PICTURE.read_bytes().startswith(b"\x89PNG")
