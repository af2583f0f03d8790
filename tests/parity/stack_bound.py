# SPDX-License-Identifier: MIT
"""Upper bound of the stack below a function, from the call graphs that ``gcc -fcallgraph-info=su`` writes.

A call through a pointer leads to what ``tests/image/static/indirect.toml`` lists for its caller.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

INDIRECT = Path(__file__).parents[1] / "image" / "static" / "indirect.toml"
LIBRARY_BYTES = 64
"""Taken for a function that has no frame size here: the C library's and the compiler's helpers use 8 to 48."""

_NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"')
_EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
_FRAME = re.compile(r"\\n(\d+) bytes \((\w+)")


class StackBoundError(Exception):
    """There is no bound: recursion, a frame whose size is not known when compiling, or a call that leads anywhere."""


@dataclass
class CallGraph:
    """Frame sizes in bytes and calls, by symbol. A virtual call that is not listed is the board's: it adds nothing."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)
    indirect: list[tuple[str, list[str]]] = field(default_factory=list)
    """Patterns of callers, and of what they call through pointers."""

    def bound(self, function: str) -> int:
        """Return the bytes that ``function`` and everything below it use at most. Raises StackBoundError, KeyError."""
        if function not in self.frames:
            raise KeyError(function)
        return self._bound(function, (), {})

    def _bound(self, function: str, path: tuple[str, ...], known: dict[str, int]) -> int:
        if function in path:
            raise StackBoundError(f"recursion: {' > '.join((*path, function))}")
        if function not in self.frames:
            return LIBRARY_BYTES
        if function not in known:
            below = [self._bound(callee, (*path, function), known) for callee in self._callees(function)]
            known[function] = self.frames[function] + max(below, default=0)
        return known[function]

    def _callees(self, function: str) -> set[str]:
        callees = set(self.calls.get(function, ()))
        if "__indirect_call" not in callees:
            return callees
        callees.discard("__indirect_call")
        name = _plain(function)
        targets = next((targets for caller, targets in self.indirect if re.fullmatch(caller, name)), None)
        if targets is None and not name.startswith("_Z"):
            raise StackBoundError(f"{name} calls through a pointer that {INDIRECT.name} does not list")
        found = {symbol for symbol in self.frames for target in targets or () if re.fullmatch(target, _plain(symbol))}
        if targets and not found:
            raise StackBoundError(f"{name} calls through a pointer, and no function is called {' or '.join(targets)}")
        return callees | found


def read_call_graph(files: Iterable[Path], aliases: dict[str, str] | None = None) -> CallGraph:
    """Read .ci files. ``aliases``: calls of the one symbol are calls of the other (the linker's --wrap)."""
    listed = tomllib.loads(INDIRECT.read_text())["calls"]
    graph = CallGraph(indirect=[(entry["caller"], entry["targets"]) for entry in listed])
    names = aliases or {}
    for file in files:
        for line in file.read_text().splitlines():
            if node := _NODE.match(line):
                _add_node(graph, node[1], node[2])
            elif edge := _EDGE.match(line):
                graph.calls.setdefault(edge[1], set()).add(names.get(edge[2], edge[2]))
    return graph


def _plain(symbol: str) -> str:
    """Return the name of a function; gcc puts the file before that of a static one, and its copies have a suffix."""
    return symbol.rsplit(":", 1)[-1].split(".", 1)[0]


def _add_node(graph: CallGraph, title: str, label: str) -> None:
    frame = _FRAME.search(label)
    if frame is None:
        return
    if frame[2].startswith("dynamic"):
        raise StackBoundError(f"{title} has a frame of unknown size")
    graph.frames[title] = max(int(frame[1]), graph.frames.get(title, 0))
