"""Ground: a height field z(x, y) over a map frame, with bilinear or C2 cubic interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._kernels import ground
from ._kernels.jit import spread
from .errors import TerrainError

Array = NDArray[np.float64]
Interpolation = Literal["cubic", "linear"]


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
        if np.isinf(heights).any():
            raise TerrainError("heights hold infinite values; mark what is not known with nan")
        known = np.isfinite(heights)
        if not known.any():
            raise TerrainError("every height is nan: there is no ground here")
        level = float(np.median(heights[known]))  # kept apart, so that -4,450 m does not eat the last digits
        meta = np.zeros(ground.META_SIZE)
        meta[: ground.META_SIZE] = (*corner, level, *step, heights.shape[1], heights.shape[0], interpolation == "cubic", np.inf)
        grid = roof = np.ascontiguousarray(heights - level)
        if interpolation == "cubic":
            grid = _spline_coefficients(grid, known)
            roof = _roof(grid)
            meta[ground.META_BEND] = _greatest_bend(grid, step)
        heights.setflags(write=False)
        return cls(
            heights, (float(step[0]), float(step[1])), (float(corner[0]), float(corner[1])), interpolation, crs, name,
            grid, roof, meta,
        )  # fmt: skip

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
        """
        from .raster import read_raster

        heights, spacing, origin, crs = read_raster(Path(path), band, window)
        return cls.from_array(heights, spacing, origin, interpolation, crs=crs, name=Path(path).stem)

    @property
    def packed(self) -> tuple[Array, Array, Array]:
        """All that a kernel reads of the ground."""
        return self.grid, self.roof, self.meta

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
        px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        out = np.empty((px.size, 3))
        spread(ground.surface_batch, px.size, self.grid, self.meta, px.ravel(), py.ravel(), out)
        return out.reshape(*px.shape, 3)


def _spline_coefficients(z: Array, known: NDArray[np.bool_]) -> Array:
    """Coefficients (rows + 2, cols + 2) of the uniform cubic B-spline through z, not-a-knot at the rim.

    Unknown nodes are bridged by their nearest known neighbour, so that the spline exists; their coefficients are then
    struck out again, which makes every cell that leans on one unknown. What a bridge leaks further in dies off by
    0.27 a cell.
    """
    from scipy.ndimage import distance_transform_edt

    if not known.all():
        nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
        z = z[tuple(nearest)]
    c = _spline_rows(_spline_rows(z).T).T.copy()
    c[1:-1, 1:-1][~known] = np.nan
    return c


def _greatest_bend(c: Array, step: Array) -> float:
    """A bound on the spline's second derivative along any direction: those of a spline lie within the second differences
    of its coefficients. inf where ground is missing."""
    xx = np.abs(np.diff(c, 2, axis=1)).max() / step[0] ** 2
    yy = np.abs(np.diff(c, 2, axis=0)).max() / step[1] ** 2
    xy = np.abs(np.diff(np.diff(c, axis=0), axis=1)).max() / (step[0] * step[1])
    bound = float(max(xx, yy) + xy)
    return bound if np.isfinite(bound) else np.inf


def _roof(c: Array) -> Array:
    """Node heights (rows, cols) whose bilinear surface the spline of coefficients c nowhere rises over.

    A cell's spline lies under its Bézier ordinates; by what these exceed the plane-like surface through the cell's
    corners, its corners are lifted. inf around cells that are not known.
    """
    bezier = np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6
    rows, cols = c.shape[0] - 3, c.shape[1] - 3  # cells
    across = [sum(w * c[:, n : n + cols] for n, w in enumerate(weights)) for weights in bezier]

    def ordinate(k: int, m: int) -> Array:
        return np.asarray(sum(w * across[m][n : n + rows] for n, w in enumerate(bezier[k])))

    a, b, d, e = ordinate(0, 0), ordinate(0, 3), ordinate(3, 0), ordinate(3, 3)
    bulge = np.zeros((rows, cols))
    for k in range(4):
        for m in range(4):
            u, v = m / 3, k / 3
            bulge = np.maximum(bulge, ordinate(k, m) - ((a * (1 - u) + b * u) * (1 - v) + (d * (1 - u) + e * u) * v))
    bulge[np.isnan(bulge)] = np.inf
    lift = np.zeros((rows + 1, cols + 1))
    node = np.zeros((rows + 1, cols + 1))
    for i in (0, 1):
        for j in (0, 1):
            part = (slice(i, rows + i), slice(j, cols + j))
            lift[part] = np.maximum(lift[part], bulge)
            node[part] = np.where(np.isnan(corner := (a, b, d, e)[2 * i + j]), node[part], corner)
    return node + lift


def _spline_rows(z: Array) -> Array:
    """Solve (c[i-1] + 4 c[i] + c[i+1]) / 6 = z[i] down axis 0, the third derivative continuous at the first and last
    inner knots; c has two rows more than z."""
    from scipy.linalg import solve_banded

    n = z.shape[0] + 2
    band = np.zeros((9, n))
    band[3, 2:], band[4, 1:-1], band[5, :-2] = 1 / 6, 4 / 6, 1 / 6
    for k, jump in enumerate((1.0, -4.0, 6.0, -4.0, 1.0)):  # fourth difference of the coefficients
        band[4 - k, k] = jump
        band[4 + k, n - 1 - k] = jump
    rhs = np.zeros((n, z.shape[1]))
    rhs[1:-1] = z
    return np.asarray(solve_banded((4, 4), band, rhs, overwrite_ab=True, overwrite_b=True))
