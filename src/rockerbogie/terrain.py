"""Ground: a height field z(x, y) over a map frame, with bilinear or C2 cubic interpolation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import spline
from ._kernels import ground
from ._kernels.jit import spread
from .errors import RockerbogieError, TerrainError

Array = NDArray[np.float64]
Interpolation = Literal["cubic", "linear"]

MAX_HEIGHT = 1e7  # m: heights may be radii of a planet; what is beyond marks missing data
MAX_ORIGIN = 1e9  # m: where double precision resolves 1e-7 m
SPACING_RANGE = (1e-6, 1e6)  # m
DATUM_SIDE = 1000  # nodes: a side of the subgrid whose median is the reference height


@dataclass(frozen=True, eq=False)
class Terrain:
    """A height field. Make one with `Terrain.from_array`, `Terrain.from_raster` or `rockerbogie.surfaces`.

    `z[row, col]` is the height at (x0 + col·dx, y0 + row·dy); nan is no data. A cell is known when every node its
    surface leans on is: its four corners (linear), or those and the ring around them (cubic).
    """

    z: Array  # (rows, cols)
    spacing: tuple[float, float]  # dx, dy
    origin: tuple[float, float]  # x0, y0
    interpolation: Interpolation
    crs: str | None
    name: str
    grid: Array  # what the kernels read: nodes, or spline coefficients with a ring around
    roof: Array  # (rows, cols) nodes of a bilinear surface that the ground nowhere rises over
    meta: Array  # and where it lies: _kernels.ground.META_*

    @classmethod
    def from_array(
        cls,
        z: ArrayLike,
        spacing: float | tuple[float, float],
        origin: tuple[float, float] = (0.0, 0.0),
        interpolation: Interpolation = "cubic",
        *,
        crs: str | None = None,
        name: str = "terrain",
    ) -> Terrain:
        """Ground from an array of heights.

        Args:
            z: (rows, cols) heights, m; y grows with the row. nan is no data.
            spacing: dx, or (dx, dy), m.
            origin: (x, y) of z[0, 0], m.
            interpolation: "cubic", the C2 spline through the nodes (not-a-knot at the rim), or "linear", bilinear.

        Raises:
            TerrainError: not a height field; the message says why and what to do.
        """
        try:
            if np.iscomplexobj(z):
                raise TypeError("they are complex")
            heights: Array = np.array(np.ma.filled(np.ma.asarray(z, dtype=float), np.nan))
            step = np.broadcast_to(np.asarray(spacing, dtype=float), (2,))
            corner = np.asarray(origin, dtype=float)
        except (TypeError, ValueError) as error:
            raise TerrainError(
                f"heights must be an array of numbers, spacing ({spacing!r}) one number or two, origin ({origin!r}) two: {error}"
            ) from None
        if interpolation not in ("cubic", "linear"):
            raise TerrainError(f"interpolation {interpolation!r} is not known; give 'cubic' or 'linear'")
        least = 4 if interpolation == "cubic" else 2
        if heights.ndim != 2 or min(heights.shape) < least:
            raise TerrainError(
                f"heights have shape {heights.shape}; {interpolation} ground needs (rows, cols) of at least {least} each"
            )
        if not (np.isfinite(step).all() and (step > 0).all()):
            raise TerrainError(f"spacing is {spacing}; give one finite step above 0, or two (dx, dy), in metres")
        if corner.shape != (2,) or not np.isfinite(corner).all():
            raise TerrainError(f"origin is {origin}; give the finite (x, y) of the first node, in metres")
        if not ((step >= SPACING_RANGE[0]) & (step <= SPACING_RANGE[1])).all():
            raise TerrainError(f"spacing is {spacing} m; give steps from {SPACING_RANGE[0]:g} to {SPACING_RANGE[1]:g} m")
        if np.abs(corner).max() > MAX_ORIGIN:
            raise TerrainError(
                f"origin is {origin} m; more than {MAX_ORIGIN:g} m from zero a position has no digits left for a rover: "
                "subtract an offset from x and y"
            )
        datum = Datum(heights.shape)
        datum.add(0, heights, name)
        shape = heights.shape
        size = float(step[0]), float(step[1])
        level = datum.height(name)
        whole = Whole(shape, size, (float(corner[0]), float(corner[1])), interpolation, crs, name, level, None)
        return lay(heights, (0, 0), (0, shape[0]), (0, shape[1]), whole)

    @classmethod
    def from_raster(
        cls,
        path: str | Path,
        *,
        band: int = 1,
        interpolation: Interpolation = "cubic",
        window: tuple[float, float, float, float] | None = None,
    ) -> Terrain:
        """Ground from a GeoTIFF or any raster GDAL reads: CRS kept, nodata to nan, rows flipped so that north is +y.

        Args:
            path: the file. Needs the `geo` extra (rasterio).
            band: which band holds the heights, from 1.
            window: (xmin, ymin, xmax, ymax) in the file's CRS, m: read this part only.

        Raises:
            TerrainError: missing file, no such band, rotated or geographic grid, no rasterio; with the way out.

        Warns of a file that marks nothing as no data, but whose lowest value looks like it (-9999, -32768, …).
        """
        from .raster import read_raster

        heights, spacing, origin, crs = read_raster(Path(path), band, window)
        return cls.from_array(heights, spacing, origin, interpolation, crs=crs, name=Path(path).stem)

    @property
    def packed(self) -> ground.Ground:
        """All that a kernel reads of the ground."""
        kind = ground.CubicGround if self.interpolation == "cubic" else ground.LinearGround
        return kind(self.grid, self.roof, self.meta)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the nodes, m."""
        rows, cols = self.z.shape
        (x0, y0), (dx, dy) = self.origin, self.spacing
        return x0, y0, x0 + (cols - 1) * dx, y0 + (rows - 1) * dy

    @property
    def x(self) -> Array:
        """(cols,) of the nodes, m."""
        return self.origin[0] + self.spacing[0] * np.arange(self.z.shape[1], dtype=float)

    @property
    def y(self) -> Array:
        """(rows,) of the nodes, m."""
        return self.origin[1] + self.spacing[1] * np.arange(self.z.shape[0], dtype=float)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height (...) at (x, y), m; nan off the map and where the ground is not known."""
        return self._surface(x, y)[..., 0]

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Slope (..., 2): dz/dx, dz/dy. On a linear ground's grid line, that of the cell to the north-east."""
        return self._surface(x, y)[..., 1:]

    def normal(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Upward unit normal (..., 3); nan off the map and where the ground is not known."""
        slope = self.gradient(x, y)
        n = np.concatenate([-slope, np.ones((*slope.shape[:-1], 1))], axis=-1)
        n[np.isnan(slope).any(axis=-1)] = np.nan
        return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))

    def _surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        try:
            px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        except (TypeError, ValueError) as error:
            shapes = " and ".join(str(np.shape(value)) for value in (x, y))
            raise RockerbogieError(
                f"x and y of shapes {shapes} must be numbers that broadcast together, as x[None, :] and y[:, None] do: {error}"
            ) from None
        out = np.empty((px.size, 3))
        spread(ground.surface_batch, px.size, self.packed, px.ravel(), py.ravel(), out)
        return out.reshape(*px.shape, 3)


class Whole(NamedTuple):
    """What a window must know of the map that it is part of."""

    shape: tuple[int, int]  # rows, cols
    spacing: tuple[float, float]  # dx, dy, m
    origin: tuple[float, float]  # x, y of the first node, m
    interpolation: Interpolation
    crs: str | None
    name: str
    level: float  # m, the reference height (`Datum`), subtracted so that -4,450 m does not cost the last digits
    bend: float | None  # ground.META_BEND; None: to be found, as this is all of the map
    steep: float = np.inf  # ground.META_STEEP


class Datum:
    """Reference height of a map, found in one pass over its rows; it is subtracted from heights before the kernels see them.

    It is the median of the known nodes of a regular subgrid of at most `DATUM_SIDE` by `DATUM_SIDE` nodes, so that single extreme
    heights do not move it; if none of these is known, the median of the first row that has a known node.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.steps = [-(-count // DATUM_SIDE) for count in shape]
        self.sample: list[Array] = []
        self.first_known: Array | None = None

    def add(self, row: int, z: Array, name: str) -> None:
        """Take in the next rows of the map and check their heights.

        Args:
            row: index of the first of them.
            z: (rows, cols) all columns of these rows, m; NaN is missing data.
            name: of the map, for the error.

        Raises:
            TerrainError: a height that is infinite or beyond `MAX_HEIGHT`.
        """
        with np.errstate(invalid="ignore"):
            absurd = np.abs(z) > MAX_HEIGHT
        if absurd.any():
            at = tuple(int(n) for n in np.argwhere(absurd)[0])
            raise TerrainError(
                f"{name} has a height of {z[at]:g} m at row {row + at[0]}, column {at[1]} of Terrain.z "
                f"({int(absurd.sum())} beyond {MAX_HEIGHT:g} m): if it marks missing data, replace it with NaN, or declare it "
                "as no data in the file"
            )
        part = z[-row % self.steps[0] :: self.steps[0], :: self.steps[1]]
        self.sample.append(part[np.isfinite(part)])
        if self.first_known is None:
            known = np.isfinite(z)
            rows = known.any(axis=1)
            if rows.any():
                first = int(np.argmax(rows))
                self.first_known = z[first, known[first]]

    def height(self, name: str) -> float:
        """Return the reference height, m.

        Args:
            name: of the map, for the error.

        Raises:
            TerrainError: no node is known.
        """
        if self.first_known is None:
            raise TerrainError(f"every height of {name} is missing (NaN): there is no terrain")
        values = np.concatenate(self.sample)
        values = values if values.size > 0 else self.first_known
        return float(np.partition(values, values.size // 2)[values.size // 2])


def nodes_needed(start: int, stop: int, count: int, interpolation: Interpolation) -> tuple[int, int]:
    """The first and one past the last node, of `count` along an axis, that ground of nodes start..stop is made from."""
    if interpolation == "linear":
        return start, stop
    return spline.nodes_needed(max(start - 1, 0), min(stop + 1, count), count)


def lay(heights: Array, first: tuple[int, int], rows: tuple[int, int], cols: tuple[int, int], whole: Whole) -> Terrain:
    """Ground of the nodes rows × cols (first, one past the last) of a map, out of its heights from node `first` on.

    To the last bit what the whole map has there. Whoever settles on a window keeps all of the rover well within it.
    """
    part = heights[rows[0] - first[0] : rows[1] - first[0], cols[0] - first[1] : cols[1] - first[1]]
    bend = steep = np.inf
    if whole.interpolation == "linear":
        grid = roof = np.ascontiguousarray(part - whole.level)
        steep = slope(greatest_rises(part), whole.spacing) if whole.bend is None else whole.steep
    else:
        # a node more around, as the roof over a node leans on the four cells about it
        (r0, r1), (c0, c1) = ((max(a - 1, 0), min(b + 1, n)) for (a, b), n in zip((rows, cols), whole.shape, strict=True))
        c = spline.coefficients(heights - whole.level, first, whole.shape, (r0, r1), (c0, c1))
        bend = spline.greatest_bend(spline.greatest_differences(c), whole.spacing) if whole.bend is None else whole.bend
        grid = np.ascontiguousarray(c[rows[0] - r0 : rows[1] - r0 + 2, cols[0] - c0 : cols[1] - c0 + 2])
        roof = np.ascontiguousarray(spline.roof(c)[rows[0] - r0 : rows[1] - r0, cols[0] - c0 : cols[1] - c0])
    (dx, dy), (x0, y0) = whole.spacing, whole.origin
    meta = np.zeros(ground.META_SIZE)
    meta[[ground.META_X, ground.META_Y, ground.META_Z, ground.META_DX, ground.META_DY]] = x0, y0, whole.level, dx, dy
    meta[[ground.META_NX, ground.META_NY, ground.META_ROW, ground.META_COL]] = *whole.shape[::-1], rows[0], cols[0]
    meta[[ground.META_CUBIC, ground.META_BEND, ground.META_STEEP]] = whole.interpolation == "cubic", bend, steep
    part.setflags(write=False)
    origin = (x0 + cols[0] * dx, y0 + rows[0] * dy)
    return Terrain(part, whole.spacing, origin, whole.interpolation, whole.crs, whole.name, grid, roof, meta)


def greatest_rises(z: Array, so_far: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """The greatest height between neighbouring nodes along x and along y, and no less than `so_far`; nan beside holes."""
    bands = [z[row : row + 257] for row in range(0, max(z.shape[0] - 1, 1), 256)]  # so much at once
    along_x, along_y = (
        np.max([np.abs(np.diff(band, axis=axis)).max(initial=least) for band in bands])
        for axis, least in zip((1, 0), so_far, strict=True)
    )
    return float(along_x), float(along_y)


def slope(rises: tuple[float, float], spacing: tuple[float, float]) -> float:
    """A slope that bilinear ground of such rises nowhere exceeds; inf where it has holes."""
    steepest = float(np.hypot(rises[0] / spacing[0], rises[1] / spacing[1]))
    return steepest if np.isfinite(steepest) else np.inf


def cut(terrain: Terrain, rows: tuple[int, int], cols: tuple[int, int]) -> Terrain:
    """The window of nodes rows × cols (first, one past the last) of a whole terrain, as `lay` would make it."""
    ring = terrain.grid.shape[0] - terrain.roof.shape[0]
    grid = np.ascontiguousarray(terrain.grid[rows[0] : rows[1] + ring, cols[0] : cols[1] + ring])
    z, roof = (np.ascontiguousarray(a[slice(*rows), slice(*cols)]) for a in (terrain.z, terrain.roof))
    meta = terrain.meta.copy()
    meta[[ground.META_ROW, ground.META_COL]] = rows[0], cols[0]
    (dx, dy), (x0, y0) = terrain.spacing, terrain.origin
    return replace(terrain, z=z, origin=(x0 + cols[0] * dx, y0 + rows[0] * dy), grid=grid, roof=roof, meta=meta)
