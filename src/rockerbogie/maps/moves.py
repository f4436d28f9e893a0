"""Moves between cells and headings of a map, and the graph of all moves."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from math import ceil, floor, gcd, hypot, isfinite, pi, tan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..rover.model import Rover
from ..rover.rotations import wrap_angle

Array = NDArray[np.float64]
#: A state relative to another: index of the heading, cells to the east (x), cells to the north (y).
Place = tuple[int, int, int]

#: Headings further apart than this are not neighbours, as the poses between them were not computed.
WIDEST_TURN = pi / 2
#: Assumed greatest steering angle of a rover that cannot turn in place, rad.
STEERING_LIMIT = pi / 4
#: Longest grid step, cells: enough for 64 headings.
LONGEST_STEP = 10


class Move(NamedTuple):
    """One move from every state of one heading."""

    way: tuple[Place, ...]  # states that must be passable, from the first to the last
    length: float  # horizontal, m
    turn: float  # rad, absolute

    @property
    def end(self) -> Place:
        """Last state."""
        return self.way[-1]


def turns_in_place(rover: Rover) -> bool:
    """Return True if a rover can turn on the spot.

    Args:
        rover: the rover.

    Returns:
        True if its four corner wheels steer.
    """
    return bool(rover.steers[[0, 1, 4, 5]].all())


def turning_radius(rover: Rover) -> float:
    """Return the radius of the tightest arc of a rover with fewer than four steered corners.

    Args:
        rover: the rover; its wheels are assumed to steer by up to `STEERING_LIMIT`.

    Returns:
        m; infinite if no wheel steers.
    """
    if not rover.steers.any():
        return float("inf")
    fixed = rover.hubs[~rover.steers, 0].mean()
    steered = rover.hubs[rover.steers]
    return float((np.abs(steered[:, 0] - fixed) / tan(STEERING_LIMIT) + np.abs(steered[:, 1])).max())


def grid_steps(heading: Array, cell: tuple[float, float] = (1.0, 1.0)) -> list[tuple[int, int]]:
    """Return the shortest grid step that is closest to each heading.

    On square cells, four even headings give the steps of a chess rook, eight those of the king, sixteen those of king and
    knight.

    Args:
        heading: (n,) rad.
        cell: (dx, dy), m.

    Returns:
        (cells east, cells north) per heading; (0, 0) if headings are too close for steps of up to `LONGEST_STEP` cells.
    """
    order = np.argsort(heading % (2 * pi))
    gap = np.diff(np.append(heading[order] % (2 * pi), (heading[order][0] % (2 * pi)) + 2 * pi))
    around = range(-LONGEST_STEP, LONGEST_STEP + 1)
    straight = [(a, b) for a in around for b in around if gcd(a, b) == 1]
    steps: list[tuple[int, int]] = [(0, 0)] * len(heading)
    for k, index in enumerate(order):
        room = {1: min(gap[k], pi) / 2, -1: min(gap[k - 1], pi) / 2}  # to the left, to the right
        off = {s: wrap_angle(np.arctan2(s[1] * cell[1], s[0] * cell[0]) - heading[index]) for s in straight}
        fits = [s for s in straight if abs(off[s]) < room[1 if off[s] > 0 else -1] * (1 - 1e-9)]
        steps[index] = min(fits, key=lambda s: (hypot(*s), abs(off[s])), default=(0, 0))
    return steps


def swept(step: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the cells under the straight line between two cell centres.

    Args:
        step: (cells east, cells north) from the first to the last.

    Returns:
        (east, north) of each cell relative to the first, both ends included.
    """
    a, b = step
    cuts = {Fraction(0), Fraction(1)}
    for size in (abs(a), abs(b)):
        cuts |= {Fraction(2 * k + 1, 2 * size) for k in range(size)}
    edges = sorted(cuts)
    middle = [(s + t) / 2 for s, t in pairwise(edges)]
    return [(floor(a * t + Fraction(1, 2)), floor(b * t + Fraction(1, 2))) for t in middle]


def moves(heading: Array, cell: tuple[float, float], in_place: bool, radius: float, backward: bool) -> list[list[Move]]:
    """Return the moves out of each heading: straight ones and turns (docs/maps.md, "plan").

    Args:
        heading: (n,) rad.
        cell: (dx, dy), m.
        in_place: turn to the neighbouring headings on the spot; False: on arcs no tighter than `radius`.
        radius: m; infinite: no arcs.
        backward: include driving backwards.

    Returns:
        Per heading, its moves.
    """
    steps = grid_steps(heading, cell)
    signs = (1, -1) if backward else (1,)
    out: list[list[Move]] = []
    for k, step in enumerate(steps):
        ways = [_leg(k, step, sign, cell) for sign in signs if step != (0, 0)]
        for other, angle in _neighbours(heading, k):
            if in_place:
                ways.append(Move(((k, 0, 0), (other, 0, 0)), 0.0, angle))
            elif (0, 0) not in (step, steps[other]) and isfinite(radius):
                ways += [_arc((k, step), (other, steps[other]), angle, radius, sign, cell) for sign in signs]
        out.append(ways)
    return out


def graph(
    passable: NDArray[np.bool_], risk: NDArray[np.floating[Any]], ways: list[list[Move]], turn_cost: float
) -> tuple[Any, NDArray[np.int32]]:
    """Return the sparse costs of moves between passable states.

    A move's cost is its length times (1 + mean risk of the states on it), plus `turn_cost` per radian turned.

    Args:
        passable: (headings, rows, cols).
        risk: (headings, rows, cols) extra cost per metre, 0 or more.
        ways: of `moves`.
        turn_cost: m per radian.

    Returns:
        SciPy's csr_array (states, states) of costs, m; and the number (headings, rows, cols) of each state, -1 if it is not
        passable.
    """
    from scipy.sparse import csr_array

    number = np.full(passable.shape, -1, dtype=np.int32)
    number[passable] = np.arange(np.count_nonzero(passable), dtype=np.int32)
    where, to, cost = [0], [], []
    for k, out in enumerate(ways):
        found = [_one_move(passable, risk, number, k, move, turn_cost) for move in out]
        if not found:
            where += [where[-1]] * int(passable[k].sum())
            continue
        target = np.stack([f[0] for f in found], axis=-1)
        price = np.stack([f[1] for f in found], axis=-1)
        real = target >= 0
        to.append(target[real])
        cost.append(price[real])
        where = np.append(where, where[-1] + np.cumsum(real.sum(axis=-1)))  # type: ignore[assignment]
    size = len(where) - 1
    data = np.concatenate(cost) if cost else np.zeros(0)
    ends = np.concatenate(to) if to else np.zeros(0, dtype=np.int32)
    return csr_array((data, ends, np.asarray(where, dtype=np.int64)), shape=(size, size)), number


def _one_move(
    passable: NDArray[np.bool_],
    risk: NDArray[np.floating[Any]],
    number: NDArray[np.int32],
    k: int,
    move: Move,
    turn_cost: float,
) -> tuple[NDArray[np.int32], Array]:
    """Return the target (number or -1) and cost of a move from each passable state of heading k."""
    rows, cols = passable.shape[1:]
    east, north = np.array([p[1] for p in move.way]), np.array([p[2] for p in move.way])
    low_x, high_x = max(0, -east.min()), cols - max(0, east.max())
    low_y, high_y = max(0, -north.min()), rows - max(0, north.max())
    target = np.full((rows, cols), -1, dtype=np.int32)
    price = np.zeros((rows, cols))
    if low_x < high_x and low_y < high_y:

        def seen(values: NDArray[Any], place: Place) -> NDArray[Any]:
            h, a, b = place
            return values[h, low_y + b : high_y + b, low_x + a : high_x + a]

        here = (slice(low_y, high_y), slice(low_x, high_x))
        free = np.logical_and.reduce([seen(passable, p) for p in move.way])
        target[here] = np.where(free, seen(number, move.end), -1)
        mean = sum(seen(risk, p).astype(float) for p in move.way) / len(move.way)
        price[here] = move.length * (1 + mean) + turn_cost * move.turn
    return target[passable[k]], price[passable[k]]


def _leg(k: int, step: tuple[int, int], sign: int, cell: tuple[float, float]) -> Move:
    """Return a move of one grid step along heading k; sign -1 is backwards."""
    way = tuple((k, sign * a, sign * b) for a, b in swept(step))
    return Move(way, hypot(step[0] * cell[0], step[1] * cell[1]), 0.0)


def _arc(
    first: tuple[int, tuple[int, int]],
    then: tuple[int, tuple[int, int]],
    angle: float,
    radius: float,
    sign: int,
    cell: tuple[float, float],
) -> Move:
    """Return a move of n steps along each of two headings, with room for the arc."""
    lengths = [hypot(s[0] * cell[0], s[1] * cell[1]) for _, s in (first, then)]
    count = max(1, ceil(radius * tan(angle / 2) / min(lengths) - 1e-9))
    way: list[Place] = []
    x = y = 0
    for k, (a, b) in (first, then):
        for _ in range(count):
            way += [(k, x + sign * p, y + sign * q) for p, q in swept((a, b))]
            x, y = x + sign * a, y + sign * b
    return Move(tuple(dict.fromkeys(way)), count * sum(lengths), angle)


def _neighbours(heading: Array, k: int) -> Iterator[tuple[int, float]]:
    """Yield the next headings to the left and right of heading k, and the angle to each, rad."""
    off = np.array([wrap_angle(h - heading[k]) for h in heading])
    for side in (1, -1):
        ahead = np.flatnonzero((side * off > 1e-9) & (side * off <= WIDEST_TURN + 1e-9))
        if ahead.size:
            nearest = int(ahead[np.argmin(side * off[ahead])])
            yield nearest, float(abs(off[nearest]))
