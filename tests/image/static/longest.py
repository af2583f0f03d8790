# SPDX-License-Identifier: MIT
"""The longest way through a function and all it calls, in instructions, from its machine code and bounds of its loops.

Implicit path enumeration (Li and Malik 1995): how often each edge of the control flow is taken are the unknowns of a
linear program. What flows into a block flows out of it; a loop's body runs at most so often as its bound says for each
time that the loop is entered. The largest number of instructions under these conditions is the bound. It may belong to
a way that no input can take, never to one that is too short.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import networkx as nx
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import lil_matrix

from tests.image.static.calls import Calls
from tests.image.static.code import CodeError, Function, Step

ENTRY, EXIT = "entry", "exit"
Edge = tuple[object, object]


@dataclass(frozen=True)
class Loop:
    """A loop of the control flow: its first block, the edges that enter it and that begin it again, all its blocks."""

    function: str
    head: int
    entering: tuple[Edge, ...]
    again: tuple[Edge, ...]
    blocks: frozenset[object]


@dataclass
class Blocks:
    """A function's straight pieces of code: the graph of their first addresses, and the steps of each."""

    graph: nx.DiGraph
    steps: dict[int, list[Step]] = field(default_factory=dict)


def blocks_of(function: Function) -> Blocks:
    """Return the control flow between an entry and an exit."""
    before: dict[int, set[int]] = {}
    for step in function.steps.values():
        for following in step.after:
            before.setdefault(following, set()).add(step.address)
    firsts = {function.start}
    for step in function.steps.values():
        if len(step.after) != 1 or step.leaves:
            firsts.update(step.after)
        firsts.update(following for following in step.after if len(before[following]) > 1)
    blocks = Blocks(nx.DiGraph([(ENTRY, function.start)]))
    for first in firsts:
        steps = [function.steps[first]]
        while len(steps[-1].after) == 1 and not steps[-1].leaves and steps[-1].after[0] not in firsts:
            steps.append(function.steps[steps[-1].after[0]])
        blocks.steps[first] = steps
        blocks.graph.add_edges_from((first, following) for following in steps[-1].after)
        if steps[-1].leaves or not steps[-1].after:
            blocks.graph.add_edge(first, EXIT)
    return blocks


def loops_of(function: Function, graph: nx.DiGraph) -> list[Loop]:
    """Return all loops, the inner ones of each loop, too; also of code that enters a loop at several places."""
    found: list[Loop] = []
    open_parts: list[set[object]] = [set(graph.nodes)]
    closed: set[Edge] = set()
    while open_parts:
        part = open_parts.pop()
        inside = nx.DiGraph(edge for edge in graph.subgraph(part).edges if edge not in closed)
        for ring in nx.strongly_connected_components(inside):
            if len(ring) == 1 and not inside.has_edge(*(2 * tuple(ring))):
                continue
            entering = tuple(edge for node in ring for edge in graph.in_edges(node) if edge[0] not in ring)
            if not entering:
                raise CodeError(f"{function.name}: a loop that is never entered")
            head = _head(inside.subgraph(ring), {edge[1] for edge in entering})
            again = tuple(edge for edge in inside.in_edges(head) if edge[0] in ring)
            found.append(Loop(function.name, head, entering, again, frozenset(ring)))
            closed.update(again)
            open_parts.append(set(ring))
    return found


def most_turns(loop: Loop, loops: Sequence[Loop], bound_of: Callable[[Loop], int]) -> int:
    """Return how often a loop begins again in one run of its function: all bounds of loops around it, multiplied."""
    return math.prod(bound_of(other) for other in loops if loop.head in other.blocks)


def _head(ring: nx.DiGraph, entered: set[object]) -> int:
    """Return the block whose removal breaks most of the ring: the natural head where there is one."""

    def left(node: object) -> tuple[int, int]:
        rest = ring.copy()
        rest.remove_node(node)
        return max((len(part) for part in nx.strongly_connected_components(rest)), default=0), int(str(node))

    return int(str(min(entered, key=left)))


class Longest:
    """Instruction bounds, function by function. ``bound_of`` says how often a loop's body runs at most."""

    def __init__(self, calls: Calls, bound_of: Callable[[Function, Loop], int]) -> None:
        self._calls = calls
        self._bound_of = bound_of
        self._known: dict[int, int] = {}

    def below(self, start: int, way: tuple[int, ...] = ()) -> int:
        """Return the most instructions from a function's entry to its end. Raises CodeError, also for recursion."""
        if start in way:
            raise CodeError(f"recursion at {self._calls.program.names(start)[0]}")
        if start not in self._known:
            self._known[start] = self._solve(self._calls.program.function(start), (*way, start))
        return self._known[start]

    def _cost(self, function: Function, steps: Iterable[Step], way: tuple[int, ...]) -> int:
        total = 0
        for step in steps:
            targets = self._calls.targets(function, step)
            total += 1 + max((self.below(target, way) for target in targets), default=0)
        return total

    def _solve(self, function: Function, way: tuple[int, ...]) -> int:
        blocks = blocks_of(function)
        costs = {first: self._cost(function, steps, way) for first, steps in blocks.steps.items()}
        edges = {edge: number for number, edge in enumerate(blocks.graph.edges)}
        loops = loops_of(function, blocks.graph)
        balance = lil_matrix((len(blocks.steps) + 1, len(edges)))
        for row, first in enumerate(blocks.steps):
            for edge in blocks.graph.in_edges(first):
                balance[row, edges[edge]] += 1.0
            for edge in blocks.graph.out_edges(first):
                balance[row, edges[edge]] -= 1.0
        balance[len(blocks.steps), edges[ENTRY, function.start]] = 1.0
        wanted = np.zeros(len(blocks.steps) + 1)
        wanted[-1] = 1.0
        limits = lil_matrix((max(len(loops), 1), len(edges)))
        for row, loop in enumerate(loops):
            bound = self._bound_of(function, loop)
            for edge in loop.again:
                limits[row, edges[edge]] += 1.0
            for edge in loop.entering:
                limits[row, edges[edge]] -= bound
        gain = [-float(costs[edge[1]]) if edge[1] != EXIT else 0.0 for edge in edges]
        answer = linprog(
            gain, A_ub=limits.tocsr(), b_ub=np.zeros(max(len(loops), 1)), A_eq=balance.tocsr(), b_eq=wanted
        )
        if answer.status != 0:
            raise CodeError(f"{function.name}: no longest way: {answer.message}")
        return round(-float(answer.fun))
