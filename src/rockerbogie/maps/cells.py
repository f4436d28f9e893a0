"""Cells of a map on the terrain's lattice, in tiles and chunks of tiles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError
from ..terrain.window import MapExtent

Array = NDArray[np.float64]
Span = tuple[int, int]  # first, one past the last

#: Cells a side of a tile: it is settled at once, and it is the block of a store's layers, for any size of chunks.
TILE = 128


class Tile(NamedTuple):
    """A rectangle of cells."""

    rows: Span
    cols: Span

    @property
    def region(self) -> tuple[slice, slice]:
        """Its part of a layer (y, x)."""
        return slice(*self.rows), slice(*self.cols)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows[1] - self.rows[0], self.cols[1] - self.cols[0]

    @property
    def size(self) -> int:
        """Number of its cells."""
        return math.prod(self.shape)

    def halves(self) -> tuple[Tile, ...]:
        """Cut the tile in two across its longer side.

        Returns:
            Two tiles, or the tile itself if it is one cell.
        """
        (r0, r1), (c0, c1) = self
        if self.size == 1:
            return (self,)
        if r1 - r0 >= c1 - c0:
            middle = (r0 + r1) // 2
            return Tile((r0, middle), (c0, c1)), Tile((middle, r1), (c0, c1))
        middle = (c0 + c1) // 2
        return Tile((r0, r1), (c0, middle)), Tile((r0, r1), (middle, c1))


@dataclass(frozen=True)
class Cells:
    """Cell centres x0 + (first + k)·step, k = 0.. on each axis; x first."""

    origin: tuple[float, float]  # of the terrain's first node, m
    step: tuple[float, float]  # m
    first: tuple[int, int]
    size: tuple[int, int]  # cols, rows

    def x(self, cols: Span) -> Array:
        """Return x of the cell centres of some columns.

        Args:
            cols: first column, one past the last.

        Returns:
            (n,) m. The values are bit-identical for every choice of columns.
        """
        return self._places(0, cols)

    def y(self, rows: Span) -> Array:
        """Return y of the cell centres of some rows.

        Args:
            rows: first row, one past the last.

        Returns:
            (n,) m. The values are bit-identical for every choice of rows.
        """
        return self._places(1, rows)

    def _places(self, axis: int, span: Span) -> Array:
        """Return the coordinates of the cells of a range along one axis, m."""
        first = self.first[axis]
        return self.origin[axis] + self.step[axis] * np.arange(first + span[0], first + span[1], dtype=float)

    @property
    def all(self) -> Tile:
        """Whole map as one rectangle."""
        return Tile((0, self.size[1]), (0, self.size[0]))

    def tiles(self) -> Iterator[Tile]:
        """Cut the map into tiles of `TILE` cells a side.

        Yields:
            Tiles, row by row from the first.
        """
        yield from self._rectangles(TILE)

    def chunks(self, side: int) -> Iterator[list[Tile]]:
        """Cut the map into squares, and these into tiles.

        Args:
            side: of a square, cells; a multiple of `TILE`.

        Yields:
            The tiles of one square.
        """
        for whole in self._rectangles(side):
            yield [
                Tile((row, min(row + TILE, whole.rows[1])), (col, min(col + TILE, whole.cols[1])))
                for row in range(*whole.rows, TILE)
                for col in range(*whole.cols, TILE)
            ]

    def _rectangles(self, side: int) -> Iterator[Tile]:
        """Yield rectangles of at most side × side cells that cover the map once."""
        cols, rows = self.size
        for row in range(0, rows, side):
            for col in range(0, cols, side):
                yield Tile((row, min(row + side, rows)), (col, min(col + side, cols)))


def cells_over(ground: MapExtent, resolution: float | None, bounds: tuple[float, float, float, float] | None) -> Cells:
    """Return the cells of a map.

    Args:
        ground: extent of the terrain.
        resolution: side of a cell, m, counted from the first node; None: the nodes themselves.
        bounds: (xmin, ymin, xmax, ymax) m: only cells with their centres inside.

    Returns:
        The cells.

    Raises:
        RockerbogieError: a resolution that is no length, bounds that hold no cell.
    """
    step = ground.spacing
    if resolution is not None:
        try:
            length = float(resolution)
        except (TypeError, ValueError):
            length = math.nan
        if not (math.isfinite(length) and length > 0):
            raise RockerbogieError(f"resolution is {resolution!r}: give the side of a cell, a finite number of metres above 0")
        step = (length, length)
    nodes = ground.shape[::-1]
    last = [math.floor((n - 1) * d / s + 1e-6) for n, d, s in zip(nodes, ground.spacing, step, strict=True)]
    first = [0, 0]
    if bounds is not None:
        box = np.asarray(bounds, dtype=float)
        if box.shape != (4,) or not np.isfinite(box).all() or not (box[:2] <= box[2:]).all():
            raise RockerbogieError(f"bounds are {bounds}: give (xmin, ymin, xmax, ymax), min not above max, in metres")
        for axis in (0, 1):
            low, high = ((box[axis + k] - ground.origin[axis]) / step[axis] for k in (0, 2))
            first[axis], last[axis] = max(math.ceil(low - 1e-6), 0), min(math.floor(high + 1e-6), last[axis])
        if first[0] > last[0] or first[1] > last[1]:
            (x0, y0), (dx, dy), (rows, cols) = ground.origin, ground.spacing, ground.shape
            spans = f"({x0:.10g}, {y0:.10g}, {x0 + (cols - 1) * dx:.10g}, {y0 + (rows - 1) * dy:.10g})"
            raise RockerbogieError(f"bounds {tuple(bounds)} hold no cell of {ground.name}, which spans {spans}")
    size = (last[0] - first[0] + 1, last[1] - first[1] + 1)
    return Cells(ground.origin, step, (first[0], first[1]), size)
