# SPDX-License-Identifier: MIT
"""What the plots of a robot show, kept on this computer beside the history of its parameters."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from omni.studio.actions import BadRequestError
from omniwheel import files

MOST_PLOTS, MOST_KEYS, LONGEST_KEY = 20, 12, 80
_LONGEST_S = 3600.0


def view_file(history: Path, simulated: str) -> Path:
    """Return where the view of a robot is kept: beside ``history``, a simulated one's by the name of the robot."""
    name = f"simulated-{Path(simulated).stem}" if simulated else history.stem
    return history.parent.parent / "views" / f"{name}.json"


def checked_view(view: Any) -> dict[str, Any]:
    """Return ``{"plots": [{"keys": [...], "xy": bool}], "span_s": S}`` of what a page sent. Raises BadRequestError."""
    plots = view.get("plots") if isinstance(view, dict) else None
    span_s = view.get("span_s") if isinstance(view, dict) else None
    if not isinstance(plots, list) or len(plots) > MOST_PLOTS or not all(map(_is_plot, plots)):
        raise BadRequestError(f"a view is at most {MOST_PLOTS} plots of at most {MOST_KEYS} signals")
    if isinstance(span_s, bool) or not isinstance(span_s, int | float) or not math.isfinite(span_s):
        raise BadRequestError("a view's span must be a number")
    if not 0.0 < span_s <= _LONGEST_S:
        raise BadRequestError(f"a view's span must be more than 0 and at most {_LONGEST_S:g} s")
    return {"plots": [{"keys": plot["keys"], "xy": plot["xy"]} for plot in plots], "span_s": float(span_s)}


def read_view(path: Path) -> dict[str, Any] | None:
    """Return a view; None if there is none that can be read: then the page shows its usual plots."""
    try:
        return checked_view(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError, BadRequestError):
        return None


def write_view(path: Path, view: dict[str, Any]) -> None:
    """Keep a view. Raises OutputFileError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise files.write_error(path, error) from error
    files.write_json(path, view)


def _is_plot(plot: Any) -> bool:
    keys = plot.get("keys") if isinstance(plot, dict) else None
    if not isinstance(keys, list) or len(keys) > MOST_KEYS or not isinstance(plot.get("xy"), bool):
        return False
    named = all(isinstance(key, str) and len(key) <= LONGEST_KEY for key in keys)
    return named and (not plot["xy"] or len(keys) == 2)
