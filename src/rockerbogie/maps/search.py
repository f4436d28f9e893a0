"""Dijkstra's search through the graph of a map's states, to one goal after another."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def reach_from(costs: Any, begin: list[int]) -> Array:
    """Return the least cost of reaching each state.

    Args:
        costs: sparse (states, states).
        begin: states of the start.

    Returns:
        (states,) m; infinite if there is no route.
    """
    from scipy.sparse.csgraph import dijkstra

    return np.asarray(dijkstra(costs, indices=begin, min_only=True), dtype=float)


def through(costs: Any, stops: list[list[int]]) -> tuple[Array, Array, Array] | tuple[int, Array]:
    """Find the least-cost route from the first stop through all others, in order.

    Each stop is a set of states (a cell at several headings). One of them is chosen so that the sum over all legs is least.

    Args:
        costs: sparse (states, states).
        stops: states of the start and of each goal.

    Returns:
        States of the route, the cost at each, and the number of the goal that it leads to, from 1. If a goal cannot be reached:
        the number of goals before it, and the cost (states,) of each state on the last leg, infinite if there is no route.
    """
    from scipy.sparse.csgraph import dijkstra

    reached, before, _ = dijkstra(costs, indices=stops[0], min_only=True, return_predecessors=True)
    legs = [(reached, before)]
    for number, ends in enumerate(stops[1:]):
        if not np.isfinite(reached[ends]).any():
            return number, reached
        if number < len(stops) - 2:
            reached, before = _onward(costs, ends, reached)
            legs.append((reached, before))
    state = min(stops[-1], key=lambda end: (reached[end], end))
    way: list[tuple[int, float, int]] = []
    for number in range(len(legs), 0, -1):
        reached, before = legs[number - 1]
        while True:
            way.append((state, float(reached[state]), number))
            previous = int(before[state])
            if not 0 <= previous < costs.shape[0]:
                break
            state = previous
        if number > 1:
            way.pop()  # the first state of a leg is the last one of the leg before
    way.reverse()
    nodes, price, goal = (np.array(values) for values in zip(*way, strict=True))
    return nodes, price, goal


def _onward(costs: Any, ends: list[int], reached: Array) -> tuple[Array, Array]:
    """Return the least cost to each state, and the state before it, from the states of a goal.

    Each state of the goal starts with its cost so far.

    The search starts in an extra state with an edge to each of them. Its costs are higher by 1, because a sparse edge of 0 is
    no edge.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    some = np.array([end for end in dict.fromkeys(ends) if np.isfinite(reached[end])])
    size = costs.shape[0]
    data = np.concatenate([costs.data, reached[some] + 1.0])
    to = np.concatenate([costs.indices, some.astype(costs.indices.dtype)])
    where = np.append(costs.indptr, costs.indptr[-1] + len(some))
    longer = csr_array((data, to, where), shape=(size + 1, size + 1))
    onward, before = dijkstra(longer, indices=size, return_predecessors=True)
    return np.asarray(onward[:size] - 1.0), np.asarray(before[:size])
