# SPDX-License-Identifier: MIT
"""The signing key of connections that are opened without one of their own: what ``omni --signing-key`` gives."""

from __future__ import annotations

_default_key: bytes | None = None


def set_default_key(key: bytes | None) -> None:
    """Sign with this key on every connection that is opened from now on without one of its own."""
    global _default_key
    _default_key = key


def default_key() -> bytes | None:
    """Return the key of :func:`set_default_key`."""
    return _default_key
