# SPDX-License-Identifier: MIT
"""Upper bound of the stack below a function, from the call graphs that ``gcc -fcallgraph-info=su`` writes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

LIBRARY_BYTES = 64
"""Taken for a function that has no frame size here: the C library's and the compiler's helpers use 8 to 48."""

_NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"')
_EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
_FRAME = re.compile(r"\\n(\d+) bytes \((\w+)")


class StackBoundError(Exception):
    """There is no bound: recursion, or a frame whose size is not known when compiling."""


@dataclass
class CallGraph:
    """Frame sizes in bytes and calls, by symbol. Virtual calls lead to ``__indirect_call``, which counts as nothing."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)

    def bound(self, function: str) -> int:
        """Return the bytes that ``function`` and everything below it use at most. Raises StackBoundError, KeyError."""
        if function not in self.frames:
            raise KeyError(function)
        return self._bound(function, (), {})

    def _bound(self, function: str, path: tuple[str, ...], known: dict[str, int]) -> int:
        if function in path:
            raise StackBoundError(f"recursion: {' > '.join((*path, function))}")
        if function == "__indirect_call":
            return 0
        if function not in self.frames:
            return LIBRARY_BYTES
        if function not in known:
            below = [self._bound(callee, (*path, function), known) for callee in self.calls.get(function, ())]
            known[function] = self.frames[function] + max(below, default=0)
        return known[function]


def read_call_graph(files: Iterable[Path], aliases: dict[str, str] | None = None) -> CallGraph:
    """Read .ci files. ``aliases``: calls of the one symbol are calls of the other (the linker's --wrap)."""
    graph = CallGraph()
    names = aliases or {}
    for file in files:
        for line in file.read_text().splitlines():
            if node := _NODE.match(line):
                _add_node(graph, node[1], node[2])
            elif edge := _EDGE.match(line):
                graph.calls.setdefault(edge[1], set()).add(names.get(edge[2], edge[2]))
    return graph


def _add_node(graph: CallGraph, title: str, label: str) -> None:
    frame = _FRAME.search(label)
    if frame is None:
        return
    if frame[2].startswith("dynamic"):
        raise StackBoundError(f"{title} has a frame of unknown size")
    graph.frames[title] = max(int(frame[1]), graph.frames.get(title, 0))
