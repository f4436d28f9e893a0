"""Hub curve of a wheel on a profile: the exact offset curve at the wheel's radius.

Points of the plane are complex numbers x + i z. The offset of a polyline consists of straight pieces, parallel to its
segments, and arcs about its convex vertices. At concave vertices pieces cross each other and are cut at the crossing: there the
wheel has two contacts. Where the wheel does not fit (a ditch narrower than the wheel), whole pieces drop out.
"""

from __future__ import annotations

import cmath
import math
from bisect import bisect_right
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]

#: Vertices whose directions differ by less than this, rad, are no vertices.
STRAIGHT = 1e-9
#: Distances below this share of the radius count as 0.
CLOSE = 1e-9
LINE, ARC = 0, 1


class HubCurve:
    """Curve of a hub by its arc length s from its first point.

    Attributes:
        radius: of the wheel, m.
        start: list of the arc length at which each piece starts, m, and the total length.
        kind: list of `LINE` or `ARC`, one a piece.
        base: list of the start point of a line or the centre of an arc.
        turn: list of the unit direction of a line, or of the unit normal at the start of an arc.
    """

    def __init__(self, vertices: Complex, radius: float) -> None:
        """Build the curve.

        Args:
            vertices: (n,) corners of the terrain, x never decreasing, m.
            radius: of the wheel, m.
        """
        self.radius = radius
        kind, base, turn, length = _offset_pieces(_without_straight(vertices), radius)
        kept = _kept_parts(kind, base, turn, length, vertices, radius)
        self.kind, self.base, self.turn, self.start = [], [], [], [0.0]
        last: complex | None = None
        for k, low, high in kept:
            if kind[k] == LINE:
                at, direction = complex(base[k] + low * turn[k]), complex(turn[k])
                first, end = at, complex(base[k] + high * turn[k])
            else:
                at, direction = complex(base[k]), complex(turn[k]) * cmath.exp(-1j * low / radius)
                first, end = at + radius * direction, at + radius * complex(turn[k]) * cmath.exp(-1j * high / radius)
            if last is not None and abs(first - last) > 1e-6 * radius:
                raise RockerbogieError(f"the hub curve has a gap at x = {last.real:.6g} m: simplify the profile there")
            last = end
            self.kind.append(int(kind[k]))
            self.base.append(at)
            self.turn.append(direction)
            self.start.append(self.start[-1] + float(high - low))

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.kind)

    @property
    def length(self) -> float:
        """Length of the curve, m."""
        return self.start[-1]

    def piece_at(self, s: float) -> int:
        """Return the piece at an arc length, the later one at a corner.

        Args:
            s: arc length, m.

        Returns:
            Index of the piece.
        """
        return min(max(bisect_right(self.start, s) - 1, 0), self.pieces - 1)

    def at(self, piece: int, s: float) -> tuple[complex, complex]:
        """Return hub and unit normal on a piece or on its continuation.

        The tangent is −i times the normal.

        Args:
            piece: index of the piece.
            s: arc length, m; may lie beyond the ends of the piece.

        Returns:
            Hub, m, and unit normal from the terrain into the wheel.
        """
        local = s - self.start[piece]
        if self.kind[piece] == LINE:
            return self.base[piece] + local * self.turn[piece], 1j * self.turn[piece]
        normal = self.turn[piece] * cmath.exp(-1j * local / self.radius)
        return self.base[piece] + self.radius * normal, normal

    def near_x(self, x: float) -> float:
        """Return an arc length at which the hub is at x, on the first piece that reaches it.

        Args:
            x: m.

        Returns:
            Arc length, m; beyond the ends on the continuation.
        """
        ends = [self.at(k, self.start[k + 1])[0].real for k in range(self.pieces)]
        piece = min(int(np.searchsorted(ends, x)), self.pieces - 1)
        low, high = self.start[piece], self.start[piece + 1]
        if self.kind[piece] == LINE and abs(self.turn[piece].real) > 1e-12:
            return low + (x - self.base[piece].real) / self.turn[piece].real
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.at(piece, middle)[0].real < x else (low, middle)
        return 0.5 * (low + high)


def _without_straight(vertices: Complex) -> Complex:
    """Return the vertices without repeated ones and without those on a straight line."""
    points = vertices[np.concatenate([[True], np.abs(np.diff(vertices)) > 0.0])]
    while points.size > 2:
        edge = np.diff(points)
        turn = np.abs(np.angle(edge[1:] / edge[:-1]))
        if (turn >= STRAIGHT).all():
            break
        points = points[np.concatenate([[True], turn >= STRAIGHT, [True]])]
    return np.asarray(points)


def _offset_pieces(points: Complex, radius: float) -> tuple[NDArray[np.int64], Complex, Complex, Array]:
    """Return kind, base, turn (see `HubCurve`) and length of the pieces before cutting."""
    edge = np.diff(points)
    unit = edge / np.abs(edge)
    kind, base, turn, length = [], [], [], []
    for k in range(edge.size):
        if k > 0:
            angle = cmath.phase(unit[k] / unit[k - 1])
            if angle < 0.0:
                kind.append(ARC)
                base.append(points[k])
                turn.append(1j * unit[k - 1])
                length.append(-angle * radius)
        kind.append(LINE)
        base.append(points[k] + 1j * radius * unit[k])
        turn.append(unit[k])
        length.append(abs(edge[k]))
    return np.array(kind), np.array(base), np.array(turn), np.array(length)


def _kept_parts(
    kind: NDArray[np.int64], base: Complex, turn: Complex, length: Array, vertices: Complex, radius: float
) -> list[tuple[int, float, float]]:
    """Return the parts of the offset pieces on which the wheel is not below the terrain.

    Returns:
        Piece, and arc lengths from its start at which the part starts and ends, in the order along the profile.
    """
    cuts: list[list[float]] = [[0.0, float(size)] for size in length]
    for j, k in _close_pairs(kind, base, turn, length, radius):
        for point in _crossings(kind, base, turn, radius, j, k):
            for piece in (j, k):
                local = _position(kind[piece], base[piece], turn[piece], radius, point)
                if 0.0 < local < length[piece]:
                    cuts[piece].append(local)
    parts = [
        (k, low, high) for k, at in enumerate(map(sorted, cuts)) for low, high in pairwise(at) if high - low > CLOSE * radius
    ]
    index = np.array([part[0] for part in parts])
    middle = np.array([0.5 * (part[1] + part[2]) for part in parts])
    on_arc = kind[index] == ARC
    hub = np.where(on_arc, base[index] + radius * turn[index] * np.exp(-1j * middle / radius), base[index] + middle * turn[index])
    clear = _distance(hub, vertices) >= radius * (1.0 - CLOSE)
    return [part for part, free in zip(parts, clear, strict=True) if free]


def _close_pairs(kind: NDArray[np.int64], base: Complex, turn: Complex, length: Array, radius: float) -> list[tuple[int, int]]:
    """Return the pairs of pieces that may cross: their bounding boxes overlap.

    An arc and the line that continues it do not cross.
    """
    line = kind == LINE
    end = np.where(line, base + length * turn, base)
    grow = np.where(line, 0.0, radius) + CLOSE * radius
    low = np.minimum(base.real, end.real) - grow, np.minimum(base.imag, end.imag) - grow
    high = np.maximum(base.real, end.real) + grow, np.maximum(base.imag, end.imag) + grow
    pairs = []
    for j in range(kind.size - 1):
        rest = slice(j + 1, None)
        near = (kind[rest] == kind[j]) | (np.arange(j + 1, kind.size) > j + 1)
        near &= (low[0][rest] <= high[0][j]) & (high[0][rest] >= low[0][j])
        near &= (low[1][rest] <= high[1][j]) & (high[1][rest] >= low[1][j])
        pairs += [(j, j + 1 + int(k)) for k in np.flatnonzero(near)]
    return pairs


def _crossings(kind: NDArray[np.int64], base: Complex, turn: Complex, radius: float, j: int, k: int) -> list[complex]:
    """Return the crossings of the infinite lines or full circles of two pieces."""
    if kind[j] == LINE and kind[k] == LINE:
        across = (np.conj(turn[j]) * turn[k]).imag
        if abs(across) < 1e-12:
            return []
        local = (np.conj(base[k] - base[j]) * turn[k]).imag / across
        return [complex(base[j] + local * turn[j])]
    if kind[j] == ARC and kind[k] == ARC:
        apart = base[k] - base[j]
        size = abs(apart)
        if not 0.0 < size <= 2.0 * radius:
            return []
        aside = 1j * apart / size * math.sqrt(max(radius**2 - 0.25 * size**2, 0.0))
        return [complex(base[j] + 0.5 * apart + sign * aside) for sign in (-1.0, 1.0)]
    line, arc = (j, k) if kind[j] == LINE else (k, j)
    local = np.conj(turn[line]) * (base[arc] - base[line])
    if abs(local.imag) > radius:
        return []
    half = math.sqrt(radius**2 - local.imag**2)
    return [complex(base[line] + (local.real + sign * half) * turn[line]) for sign in (-1.0, 1.0)]


def _position(kind: int, base: complex, turn: complex, radius: float, point: complex) -> float:
    """Return the signed length along a piece of the hub's curve to a point, m.

    Arcs turn clockwise.
    """
    if kind == LINE:
        return float((np.conj(turn) * (point - base)).real)
    return float(-cmath.phase((point - base) / (radius * turn)) * radius)


def _distance(points: Complex, vertices: Complex) -> Array:
    """Return the distance of each point from a polyline, m."""
    edge = np.diff(vertices)
    size = np.abs(edge) ** 2
    edge, start, size = edge[size > 0], vertices[:-1][size > 0], size[size > 0]
    least = np.empty(points.size)
    for first in range(0, points.size, 512):
        some = points[first : first + 512, None]
        share = np.clip((np.conj(edge) * (some - start)).real / size, 0.0, 1.0)
        least[first : first + 512] = np.abs(some - start - share * edge).min(axis=1)
    return least
