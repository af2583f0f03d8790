# SPDX-License-Identifier: MIT
"""Makes the methods of a class hold their connection's monitor, so that several threads may call them."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import isfunction, isgeneratorfunction
from typing import Any, TypeVar

Kind = TypeVar("Kind", bound=type)
_SPECIAL = ("__getitem__", "__setitem__", "__iter__", "__len__")


def monitored(attribute: str, *left_out: str) -> Callable[[Kind], Kind]:
    """Return a decorator for a class whose ``attribute`` is a :class:`~omniwheel.connection.Connection`.

    Its public methods hold the connection's monitor while they run, and let go of it only where they wait for messages.
    A generator holds it in none of its steps. ``left_out``: methods that do without.
    """

    def decorate(kind: Kind) -> Kind:
        for name, method in list(vars(kind).items()):
            public = not name.startswith("_") or name in _SPECIAL
            if public and name not in left_out and isfunction(method) and not isgeneratorfunction(method):
                setattr(kind, name, _held(method, attribute))
        return kind

    return decorate


def _held(method: Callable[..., Any], attribute: str) -> Callable[..., Any]:
    @wraps(method)
    def call(self: Any, *arguments: Any, **named: Any) -> Any:
        with getattr(self, attribute).monitor:
            return method(self, *arguments, **named)

    return call
