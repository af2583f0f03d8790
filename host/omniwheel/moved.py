# SPDX-License-Identifier: MIT
"""Old places and old names of what lives elsewhere now: they work for one more release and warn.

A module that gave names away ends with ``__getattr__ = moved(__name__, {"name": "new.module"})``. The new module is
imported by its name when somebody asks. So the old place depends on nothing and may stand below the new one. If the
name has changed, too, the table says ``{"name": "new.module:new_name"}``.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def moved(module: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of ``module``, whose names in ``places`` are now found in other modules.

    It gives a DeprecationWarning with the new place. Any other name raises AttributeError.
    """

    def get(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, _, new = places[name].partition(":")
        new = new or name
        text = f"{module}.{name} is now {place}.{new}; the old name goes away with the next release"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(import_module(place), new)

    return get
