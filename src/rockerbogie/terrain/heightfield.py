"""Ground: a height field z(x, y) over a map frame, with bilinear or C2 cubic interpolation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.jit.decorators import parallel_for
from .._kernels.model import ground
from ..errors import RockerbogieError, TerrainError
from . import spline

Array = NDArray[np.float64]
Interpolation = Literal["cubic", "linear"]

MAX_HEIGHT = 1e7  # m: heights may be radii of a planet; what is beyond marks missing data
MAX_COORDINATE = 1e9  # m: where double precision resolves 1e-7 m
SPACING_RANGE = (1e-6, 1e6)  # m
RESOLVED = 1e-6  # cells: the greatest rounding error of a coordinate, as in _kernels.ground.onto
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
    upper_bound: Array  # (rows, cols) nodes of a bilinear surface that the ground nowhere rises over
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
            z: (rows, cols) heights, m, at most `MAX_HEIGHT` up or down; y grows with the row. nan is no data.
            spacing: dx, or (dx, dy), m.
            origin: (x, y) of z[0, 0], m.
            interpolation: "cubic", the C2 spline through the nodes (not-a-knot at the rim), or "linear", bilinear.

        Raises:
            TerrainError: not a height field; the message says why and what to do.
        """
        try:
            if np.iscomplexobj(z):
                raise TypeError("they are complex")
            with np.errstate(over="ignore"):  # a long double may become infinite, which is refused
                heights: Array = np.array(np.ma.filled(np.ma.asarray(z, dtype=float), np.nan))
            step = np.broadcast_to(np.asarray(spacing, dtype=float), (2,))
            corner = np.asarray(origin, dtype=float)
        except (TypeError, ValueError, OverflowError) as error:
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
        shape = heights.shape
        size, first = (float(step[0]), float(step[1])), (float(corner[0]), float(corner[1]))
        check_grid(name, shape, size, first)
        datum = Datum(name, shape, size, first)
        datum.add(0, heights)
        whole = MapExtent(shape, size, first, interpolation, crs, name, datum.height(), None)
        return build_window(heights, (0, 0), (0, shape[0]), (0, shape[1]), whole)

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
        return kind(self.grid, self.upper_bound, self.meta)

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
        parallel_for(ground.surface_batch, px.size, self.packed, px.ravel(), py.ravel(), out)
        return out.reshape(*px.shape, 3)


class MapExtent(NamedTuple):
    """What a window must know of the map that it is part of."""

    shape: tuple[int, int]  # rows, cols
    spacing: tuple[float, float]  # dx, dy, m
    origin: tuple[float, float]  # x, y of the first node, m
    interpolation: Interpolation
    crs: str | None
    name: str
    level: float  # m, the reference height (`Datum`), subtracted so that -4,450 m does not cost the last digits
    curvature: float | None  # ground.META_BEND; None: to be found, as this is all of the map
    steep: float = np.inf  # ground.META_STEEP


def check_grid(name: str, shape: tuple[int, int], spacing: tuple[float, float], origin: tuple[float, float]) -> None:
    """Check that double precision resolves positions on a grid.

    Args:
        name: of the map, for the error.
        shape: rows, cols.
        spacing: dx, dy, m.
        origin: x, y of the first node, m.

    Raises:
        TerrainError: a spacing outside `SPACING_RANGE`, a coordinate beyond `MAX_COORDINATE`, or coordinates whose rounding
            error exceeds `RESOLVED` cells.
    """
    least, most = SPACING_RANGE
    for axis, step, first, count in zip("xy", spacing, origin, shape[::-1], strict=True):
        if not least <= step <= most:
            raise TerrainError(f"spacing of {name} along {axis} is {step:g} m; give a step from {least:g} to {most:g} m")
        farthest = max(abs(first), abs(first + (count - 1) * step))
        error = 0.5 * float(np.spacing(farthest))
        if not farthest <= MAX_COORDINATE or error > RESOLVED * step:
            raise TerrainError(
                f"{name} reaches to {axis} = {farthest:g} m in steps of {step:g} m, where numbers are rounded by up to "
                f"{error:.1g} m; the limits are {MAX_COORDINATE:g} m and a rounding of {RESOLVED:g} of a step: subtract an "
                f"offset from {axis}"
            )


class Datum:
    """Reference height of a map, computed in one pass over its rows.

    It is subtracted from heights before they reach the kernels. It is the median of the known nodes of a regular subgrid, rounded
    to a whole metre. The subgrid has every k-th row and every l-th column from the first on, with the least k and l that leave
    at most `DATUM_SIDE` of each. If none of its nodes is known, the median is that of the first `DATUM_SIDE`² known
    nodes, row by row. So a few extreme heights do not change it.
    """

    def __init__(self, name: str, shape: tuple[int, int], spacing: tuple[float, float], origin: tuple[float, float]) -> None:
        """Start an empty sample.

        Args:
            name: of the map, for errors.
            shape: rows, cols of the map.
            spacing: dx, dy, m, for errors.
            origin: x, y of the first node, m, for errors.
        """
        self.name, self.spacing, self.origin = name, spacing, origin
        self.steps = [-(-count // DATUM_SIDE) for count in shape]
        self.sample: list[Array] = []  # known nodes of the subgrid
        self.first: list[Array] = []  # the first known nodes, while the subgrid has none
        self.room = DATUM_SIDE**2  # how many more of them are kept

    def add(self, row: int, z: Array) -> None:
        """Add the next rows of the map after checking their heights.

        Args:
            row: index of the first of them.
            z: (rows, cols) heights, m, all columns of these rows; NaN is missing data.

        Raises:
            TerrainError: a height that is infinite or beyond `MAX_HEIGHT`.
        """
        if max(np.fmax.reduce(z, axis=None), -np.fmin.reduce(z, axis=None)) > MAX_HEIGHT:
            self._refuse(row, z)
        part = z[-row % self.steps[0] :: self.steps[0], :: self.steps[1]]
        part = part[np.isfinite(part)]
        if part.size > 0:
            self.sample.append(part)
        elif not self.sample and self.room > 0:
            known = z[np.isfinite(z)][: self.room]
            self.first.append(known)
            self.room -= known.size

    def _refuse(self, row: int, z: Array) -> None:
        """Raise the error for the first height beyond `MAX_HEIGHT` of the rows z that begin at `row`."""
        at = int(np.argmax(np.abs(z) > MAX_HEIGHT))
        i, col = row + at // z.shape[1], at % z.shape[1]
        x, y = (first + n * step for first, n, step in zip(self.origin, (col, i), self.spacing, strict=True))
        raise TerrainError(
            f"{self.name} has a height of {float(z.flat[at])!r} m at row {i}, column {col} (x = {x:.10g}, y = {y:.10g} m); "
            f"the limit is {MAX_HEIGHT:g} m: mark missing data as NaN, or as no data in a file (gdal_edit.py -a_nodata)"
        )

    def height(self) -> float:
        """Return the reference height, m.

        Raises:
            TerrainError: no node is known.
        """
        values = np.concatenate([*(self.sample or self.first), np.empty(0)])
        if values.size == 0:
            raise TerrainError(f"every height of {self.name} is missing (NaN): there is no terrain")
        return float(np.floor(np.partition(values, values.size // 2)[values.size // 2] + 0.5))


def nodes_needed(start: int, stop: int, count: int, interpolation: Interpolation) -> tuple[int, int]:
    """The first and one past the last node, of `count` along an axis, that ground of nodes start..stop is made from."""
    if interpolation == "linear":
        return start, stop
    return spline.nodes_needed(max(start - 1, 0), min(stop + 1, count), count)


def build_window(
    heights: Array, first: tuple[int, int], rows: tuple[int, int], cols: tuple[int, int], whole: MapExtent
) -> Terrain:
    """Ground of the nodes rows × cols (first, one past the last) of a map, out of its heights from node `first` on.

    To the last bit what the whole map has there. Whoever settles on a window keeps all of the rover well within it.
    """
    part = heights[rows[0] - first[0] : rows[1] - first[0], cols[0] - first[1] : cols[1] - first[1]]
    curvature = steep = np.inf
    if whole.interpolation == "linear":
        grid = upper_bound = np.ascontiguousarray(part - whole.level)
        steep = slope(greatest_rises(part), whole.spacing) if whole.curvature is None else whole.steep
    else:
        # a node more around, as the roof over a node leans on the four cells about it
        (r0, r1), (c0, c1) = ((max(a - 1, 0), min(b + 1, n)) for (a, b), n in zip((rows, cols), whole.shape, strict=True))
        c = spline.coefficients(heights - whole.level, first, whole.shape, (r0, r1), (c0, c1))
        curvature = (
            spline.greatest_curvature(spline.greatest_differences(c), whole.spacing)
            if whole.curvature is None
            else whole.curvature
        )
        grid = np.ascontiguousarray(c[rows[0] - r0 : rows[1] - r0 + 2, cols[0] - c0 : cols[1] - c0 + 2])
        upper_bound = np.ascontiguousarray(spline.upper_bound(c)[rows[0] - r0 : rows[1] - r0, cols[0] - c0 : cols[1] - c0])
    (dx, dy), (x0, y0) = whole.spacing, whole.origin
    meta = np.zeros(ground.META_SIZE)
    meta[[ground.META_X, ground.META_Y, ground.META_Z, ground.META_DX, ground.META_DY]] = x0, y0, whole.level, dx, dy
    meta[[ground.META_NX, ground.META_NY, ground.META_ROW, ground.META_COL]] = *whole.shape[::-1], rows[0], cols[0]
    meta[[ground.META_CUBIC, ground.META_MAX_CURVATURE, ground.META_STEEP]] = whole.interpolation == "cubic", curvature, steep
    part.setflags(write=False)
    origin = (x0 + cols[0] * dx, y0 + rows[0] * dy)
    return Terrain(part, whole.spacing, origin, whole.interpolation, whole.crs, whole.name, grid, upper_bound, meta)


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


def crop(terrain: Terrain, rows: tuple[int, int], cols: tuple[int, int]) -> Terrain:
    """The window of nodes rows × cols (first, one past the last) of a whole terrain, as `build_window` would make it."""
    ring = terrain.grid.shape[0] - terrain.upper_bound.shape[0]
    grid = np.ascontiguousarray(terrain.grid[rows[0] : rows[1] + ring, cols[0] : cols[1] + ring])
    z, upper_bound = (np.ascontiguousarray(a[slice(*rows), slice(*cols)]) for a in (terrain.z, terrain.upper_bound))
    meta = terrain.meta.copy()
    meta[[ground.META_ROW, ground.META_COL]] = rows[0], cols[0]
    (dx, dy), (x0, y0) = terrain.spacing, terrain.origin
    return replace(terrain, z=z, origin=(x0 + cols[0] * dx, y0 + rows[0] * dy), grid=grid, upper_bound=upper_bound, meta=meta)
