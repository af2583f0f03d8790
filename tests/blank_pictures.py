# SPDX-License-Identifier: MIT
"""PNG files without pixels, for tests that are not about them: drawing them is most of a command's time."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any
from unittest.mock import patch

from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure

_DRAW = Figure.draw


def _draw(figure: Figure, renderer: Any) -> None:
    if not isinstance(renderer, RendererAgg):
        _DRAW(figure, renderer)


def blank_pictures() -> AbstractContextManager[Any]:
    """Return a context in which pictures are made and written in the same way, and stay blank."""
    return patch.object(Figure, "draw", _draw)
