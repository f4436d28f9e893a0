"""Arrays that kernels read, derived from a map or a window, and checks of grid and heights."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.model import ground
from ..errors import TerrainError
from . import spline

Array = NDArray[np.float64]
Interpolation = Literal["cubic", "linear"]

MAX_HEIGHT = 1e7  # m: heights may be radii of a planet; greater values mark missing data
MAX_COORDINATE = 1e9  # m: where double precision resolves 1e-7 m
SPACING_RANGE = (1e-6, 1e6)  # m
RESOLVED = 1e-6  # cells: the greatest rounding error of a coordinate, as in _kernels.ground.onto
DATUM_SIDE = 1000  # nodes: a side of the subgrid whose median is the reference height


class MapExtent(NamedTuple):
    """Properties of a whole map that each of its windows needs."""

    shape: tuple[int, int]  # rows, cols
    spacing: tuple[float, float]  # dx, dy, m
    origin: tuple[float, float]  # x, y of the first node, m
    interpolation: Interpolation
    crs: str | None
    name: str
    level: float  # m, the reference height (`Datum`), subtracted to keep digits of heights such as -4,450 m
    curvature: float | None  # ground.META_MAX_CURVATURE; None: compute it, as the window is the whole map
    steep: float = np.inf  # ground.META_STEEP


class Derived(NamedTuple):
    """Arrays that follow from the heights of a window."""

    grid: Array  # nodes, or spline coefficients with a ring around them, above the reference height
    upper_bound: Array  # (rows, cols) nodes of a bilinear surface that the terrain never exceeds
    meta: Array  # position, spacing and bounds: _kernels.model.ground.META_*
    bridged: Array  # grid of bilinear terrain with missing nodes filled from near ones (`spline.bridge`); else `grid` itself


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
        self.room = DATUM_SIDE**2  # number of further ones to keep

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
        """Raise the error for the first height beyond `MAX_HEIGHT` in rows z that begin at `row`."""
        at = int(np.argmax(np.abs(z) > MAX_HEIGHT))
        i, col = row + at // z.shape[1], at % z.shape[1]
        x, y = (first + n * step for first, n, step in zip(self.origin, (col, i), self.spacing, strict=True))
        raise TerrainError(
            f"{self.name} has a height of {float(z.flat[at])!r} m at row {i}, column {col} (x = {x:.10g}, y = {y:.10g} m); "
            f"the limit is {MAX_HEIGHT:g} m: mark missing data as NaN, or as no data in a file (gdal_edit.py -a_nodata)"
        )

    def height(self) -> float:
        """Return the reference height.

        Returns:
            m, a whole number.

        Raises:
            TerrainError: every height is missing.
        """
        values = np.concatenate([*(self.sample or self.first), np.empty(0)])
        if values.size == 0:
            raise TerrainError(f"every height of {self.name} is missing (NaN): there is no terrain")
        return float(np.floor(np.partition(values, values.size // 2)[values.size // 2] + 0.5))


def nodes_needed(start: int, stop: int, count: int, interpolation: Interpolation) -> tuple[int, int]:
    """Return the nodes that the arrays of a window are computed from, along one axis.

    Args:
        start: first node of the window.
        stop: one past its last.
        count: nodes of the map along the axis.
        interpolation: of the map.

    Returns:
        First and one past the last.
    """
    if interpolation == "linear":
        return max(start - spline.BRIDGE, 0), min(stop + spline.BRIDGE, count)
    return spline.nodes_needed(max(start - 1, 0), min(stop + 1, count), count)


def derive(
    heights: Array, first: tuple[int, int], rows: tuple[int, int], cols: tuple[int, int], whole: MapExtent
) -> tuple[Array, Derived]:
    """Compute the arrays of a window from heights around it.

    Args:
        heights: of the nodes from `first` on, m; at least those of `nodes_needed`.
        first: row and column of heights[0, 0] in the map.
        rows: first, one past the last of the window.
        cols: the same.
        whole: the map.

    Returns:
        Heights of the window, and its arrays: bit-identical to the same part of the whole map's.
    """
    part = heights[rows[0] - first[0] : rows[1] - first[0], cols[0] - first[1] : cols[1] - first[1]]
    curvature = steep = np.inf
    if whole.interpolation == "linear":
        grid = upper_bound = bridged = np.ascontiguousarray(part - whole.level)
        if np.isnan(part).any():
            within = tuple(slice(a - start, b - start) for (a, b), start in zip((rows, cols), first, strict=True))
            bridged = np.ascontiguousarray(spline.bridge(heights - whole.level)[within])
        steep = slope(greatest_rises(part), whole.spacing) if whole.curvature is None else whole.steep
    else:
        # one node more around, because the upper bound at a node needs the four cells around it
        (r0, r1), (c0, c1) = ((max(a - 1, 0), min(b + 1, n)) for (a, b), n in zip((rows, cols), whole.shape, strict=True))
        c = spline.coefficients(heights - whole.level, first, whole.shape, (r0, r1), (c0, c1))
        curvature = (
            spline.greatest_curvature(spline.greatest_differences(c), whole.spacing)
            if whole.curvature is None
            else whole.curvature
        )
        grid = bridged = np.ascontiguousarray(c[rows[0] - r0 : rows[1] - r0 + 2, cols[0] - c0 : cols[1] - c0 + 2])
        upper_bound = np.ascontiguousarray(spline.upper_bound(c)[rows[0] - r0 : rows[1] - r0, cols[0] - c0 : cols[1] - c0])
    (dx, dy), (x0, y0) = whole.spacing, whole.origin
    meta = np.zeros(ground.META_SIZE)
    meta[[ground.META_X, ground.META_Y, ground.META_Z, ground.META_DX, ground.META_DY]] = x0, y0, whole.level, dx, dy
    meta[[ground.META_NX, ground.META_NY, ground.META_ROW, ground.META_COL]] = *whole.shape[::-1], rows[0], cols[0]
    meta[[ground.META_CUBIC, ground.META_MAX_CURVATURE, ground.META_STEEP]] = whole.interpolation == "cubic", curvature, steep
    return part, Derived(grid, upper_bound, meta, bridged)


def greatest_rises(z: Array, so_far: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """Return the greatest height differences between neighbouring nodes.

    Args:
        z: (rows, cols) m.
        so_far: lower limits of the result, m: the differences of other parts of the map.

    Returns:
        Along x and along y, m; NaN beside missing data.
    """
    bands = [z[row : row + 257] for row in range(0, max(z.shape[0] - 1, 1), 256)]  # to limit memory
    along_x, along_y = (
        np.max([np.abs(np.diff(band, axis=axis)).max(initial=least) for band in bands])
        for axis, least in zip((1, 0), so_far, strict=True)
    )
    return float(along_x), float(along_y)


def slope(rises: tuple[float, float], spacing: tuple[float, float]) -> float:
    """Return a slope that bilinear terrain nowhere exceeds.

    Args:
        rises: as `greatest_rises`, m.
        spacing: dx, dy, m.

    Returns:
        m/m; inf where data is missing.
    """
    steepest = float(np.hypot(rises[0] / spacing[0], rises[1] / spacing[1]))
    return steepest if np.isfinite(steepest) else np.inf
