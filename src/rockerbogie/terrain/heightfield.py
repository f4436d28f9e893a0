"""Terrain: a height field z(x, y) over a map frame, with bilinear or C2 cubic interpolation."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.jit.parallel import parallel_for
from .._kernels.model import ground
from ..arrays import floats
from ..errors import RockerbogieError, TerrainError, TerrainWarning
from .labelled import is_labelled, read_labelled
from .window import Datum, Derived, Interpolation, MapExtent, check_grid, derive

Array = NDArray[np.float64]

#: Heights of an array that usually mean missing data.
SUSPECT = frozenset({-99999.0, -32768.0, -32767.0, -9999.0, 9999.0, 99999.0})


@dataclass(frozen=True, eq=False, repr=False)
class Terrain:
    """Height field, made by `from_array`, `from_raster` or `rockerbogie.surfaces`.

    `z[row, col]` is the height at (x0 + col·dx, y0 + row·dy); NaN is missing data. A cell has data if every node that its
    surface depends on has: its four corners (linear), or those and the ring around them (cubic).

    `dataclasses.replace(terrain, z=...)` makes a new surface: the arrays for the kernels are derived from the other fields.
    """

    z: Array  # (rows, cols), read-only
    spacing: tuple[float, float]  # dx, dy, m
    origin: tuple[float, float] = (0.0, 0.0)  # x0, y0, m
    interpolation: Interpolation = "cubic"
    crs: str | None = None
    name: str = "terrain"
    grid: Array = field(init=False, repr=False)  # window.Derived
    upper_bound: Array = field(init=False, repr=False)
    meta: Array = field(init=False, repr=False)
    bridged: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the fields, and derive the arrays for the kernels."""
        heights, spacing, origin = _numbers(self.z, self.spacing, self.origin)
        if self.interpolation not in ("cubic", "linear"):
            raise TerrainError(f"interpolation {self.interpolation!r} is not known; give 'cubic' or 'linear'")
        least = 4 if self.interpolation == "cubic" else 2
        if heights.ndim != 2 or min(heights.shape) < least:
            raise TerrainError(
                f"heights have shape {heights.shape}; {self.interpolation} terrain needs (rows, cols) of at least {least} each"
            )
        shape = heights.shape
        check_grid(self.name, shape, spacing, origin)
        datum = Datum(self.name, shape, spacing, origin)
        datum.add(0, heights)
        whole = MapExtent(shape, spacing, origin, self.interpolation, self.crs, self.name, datum.height(), None)
        part, derived = derive(heights, (0, 0), (0, shape[0]), (0, shape[1]), whole)
        _fill(self, part, spacing, origin, self.interpolation, self.crs, self.name, derived)

    def __repr__(self) -> str:
        (xmin, ymin, xmax, ymax), (dx, dy) = self.bounds, self.spacing
        cell = f"{dx:.6g} m" if dx == dy else f"{dx:.6g} by {dy:.6g} m"
        crs = f", {self.crs}" if self.crs and len(self.crs) <= 20 else ", georeferenced" if self.crs else ""
        return (
            f"<Terrain {self.name}: {self.z.shape[0]} by {self.z.shape[1]} nodes, cell {cell}, {self.interpolation},"
            f" x {xmin:.10g} to {xmax:.10g}, y {ymin:.10g} to {ymax:.10g} m{crs}>"
        )

    def _repr_html_(self) -> str:
        """Return the table that a notebook shows."""
        known = np.isfinite(self.z)
        low, high = (float(f(self.z[known])) if known.any() else np.nan for f in (np.min, np.max))
        rows = (("heights", f"{low:.6g} to {high:.6g} m"), ("missing data", f"{100 * (1 - known.mean()):.3g} % of the nodes"))
        cells = "".join(f"<tr><td>{label}</td><td>{text}</td></tr>" for label, text in rows)
        return f"<div>{escape(repr(self))}<table>{cells}</table></div>"

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled terrain, with writable arrays for the kernels."""
        for name, value in state.items():
            derived = name in Derived._fields and not value.flags.writeable
            object.__setattr__(self, name, np.array(value) if derived else value)

    @classmethod
    def from_array(
        cls,
        z: ArrayLike,
        spacing: float | tuple[float, float] | None = None,
        origin: tuple[float, float] | None = None,
        interpolation: Interpolation = "cubic",
        *,
        crs: str | None = None,
        name: str = "terrain",
    ) -> Terrain:
        """Make terrain from an array of heights.

        Args:
            z: (rows, cols) heights, m, at most `MAX_HEIGHT` up or down; y grows with the row. NaN is missing data. An
                xarray.DataArray is read by its own coordinates x and y, in any order and direction.
            spacing: dx, or (dx, dy), m. None: from the DataArray's coordinates.
            origin: (x, y) of z[0, 0], m. None: (0, 0), or from the DataArray's coordinates.
            interpolation: "cubic", the C2 spline through the nodes (not-a-knot at the edge), or "linear", bilinear.
            crs: coordinate reference system of x and y, as rasterio takes it. None: of the DataArray, if it has one.
            name: for messages and titles.

        Returns:
            The terrain.

        Raises:
            TerrainError: not a height field; the message gives the reason and the remedy.

        Warns:
            TerrainWarning: the lowest or highest value is one that usually means missing data (-9999, …).
        """
        if is_labelled(z):
            found = read_labelled(z)
            z, crs = found.z, crs or found.crs
            if found.spacing is not None and found.origin is not None:
                _check_given(spacing, origin, found.spacing, found.origin)
                spacing, origin = found.spacing, found.origin
        if spacing is None:
            raise TerrainError("give the spacing of the nodes, dx or (dx, dy), in metres")
        terrain = cls(z, spacing, (0.0, 0.0) if origin is None else origin, interpolation, crs, name)  # type: ignore[arg-type]
        for value in (np.nanmin(terrain.z), np.nanmax(terrain.z)):
            if value in SUSPECT:
                warnings.warn(
                    f"{name} reaches {value:g} m, which usually means missing data: if so, set it to NaN",
                    TerrainWarning,
                    stacklevel=2,
                )
        return terrain

    @classmethod
    def from_raster(
        cls,
        path: str | Path,
        *,
        band: int = 1,
        interpolation: Interpolation = "cubic",
        window: tuple[float, float, float, float] | None = None,
        cell: float | None = None,
    ) -> Terrain:
        """Read terrain from a GeoTIFF or any other raster that GDAL reads.

        Rows are flipped so that north is +y. Coordinates and heights are converted to metres; missing data becomes NaN,
        declared or not. See docs/terrain.md.

        Args:
            path: a file, or a name that GDAL takes: "netcdf:file.nc:z", "/vsizip/file.zip/dem.tif". Needs the `geo` extra.
            band: number of the band with the heights, from 1.
            interpolation: as `from_array`.
            window: (xmin, ymin, xmax, ymax) m, in the coordinates of the terrain: read this part only.
            cell: side of a cell, m, for a file without georeference; its south-west corner is then (0, 0).

        Returns:
            The terrain, with the file's CRS in metres.

        Raises:
            TerrainError: missing file, no such band, a picture, a rotated or geographic grid, a projection that stretches
                lengths by more than 1 %, no rasterio; with the remedy.

        Warns:
            TerrainWarning: missing data that is not declared, zeros beside cliffs, heights in coarse steps, a projection
                that stretches by more than 0.2 %.
        """
        from .raster import read_raster, short_name

        heights, spacing, origin, crs = read_raster(path, band, window, cell)
        return cls(heights, spacing, origin, interpolation, crs, Path(short_name(str(path))).stem)

    @property
    def packed(self) -> ground.Ground:
        """Arguments that kernels take for the terrain."""
        kind = ground.CubicGround if self.interpolation == "cubic" else ground.LinearGround
        return kind(self.grid, self.upper_bound, self.meta)

    @property
    def packed_bridged(self) -> ground.Ground:
        """Arguments that kernels take for bilinear terrain without missing data: near nodes fill it."""
        return ground.LinearGround(self.bridged, self.bridged, self.meta)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the nodes, m."""
        rows, cols = self.z.shape
        (x0, y0), (dx, dy) = self.origin, self.spacing
        return x0, y0, x0 + (cols - 1) * dx, y0 + (rows - 1) * dy

    @property
    def x(self) -> Array:
        """(cols,) x of the nodes, m."""
        return self.origin[0] + self.spacing[0] * np.arange(self.z.shape[1], dtype=float)

    @property
    def y(self) -> Array:
        """(rows,) y of the nodes, m."""
        return self.origin[1] + self.spacing[1] * np.arange(self.z.shape[0], dtype=float)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Compute heights.

        Args:
            x: (...) m, broadcasts with y.
            y: (...) m.

        Returns:
            (...) m; NaN off the map and where data is missing.
        """
        return self._surface(x, y)[..., 0]

    def gradient(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Compute slopes dz/dx, dz/dy.

        Args:
            x: (...) m, broadcasts with y.
            y: (...) m.

        Returns:
            (..., 2) m/m; NaN as `height`. On a grid line of linear terrain: of the cell to the north-east.
        """
        return self._surface(x, y)[..., 1:]

    def normal(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Compute upward unit normals.

        Args:
            x: (...) m, broadcasts with y.
            y: (...) m.

        Returns:
            (..., 3); NaN as `height`.
        """
        slope = self.gradient(x, y)
        n = np.concatenate([-slope, np.ones((*slope.shape[:-1], 1))], axis=-1)
        n[np.isnan(slope).any(axis=-1)] = np.nan
        return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))

    def _surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return height and slopes (..., 3)."""
        try:
            px, py = np.broadcast_arrays(floats(x), floats(y))
        except (TypeError, ValueError, OverflowError) as error:
            shapes = " and ".join(str(np.shape(value)) for value in (x, y))
            raise RockerbogieError(
                f"x and y of shapes {shapes} must be numbers that broadcast together, as x[None, :] and y[:, None] do: {error}"
            ) from None
        out = np.empty((px.size, 3))
        parallel_for(ground.surface_batch, px.size, self.packed, px.ravel(), py.ravel(), out)
        return out.reshape(*px.shape, 3)


def build_window(
    heights: Array, first: tuple[int, int], rows: tuple[int, int], cols: tuple[int, int], whole: MapExtent
) -> Terrain:
    """Make a window of a map. The rover must lie entirely inside it.

    Args:
        heights: of the nodes from `first` on, m; at least those of `window.nodes_needed`.
        first: row and column of heights[0, 0] in the map.
        rows: first, one past the last of the window.
        cols: the same.
        whole: the map.

    Returns:
        The window, bit-identical to the same part of the whole map.
    """
    part, derived = derive(heights, first, rows, cols, whole)
    (dx, dy), (x0, y0) = whole.spacing, whole.origin
    origin = (x0 + cols[0] * dx, y0 + rows[0] * dy)
    return assemble(part, whole.spacing, origin, whole.interpolation, whole.crs, whole.name, derived)


def crop(terrain: Terrain, rows: tuple[int, int], cols: tuple[int, int]) -> Terrain:
    """Cut a window out of a whole terrain, as `build_window` makes it.

    Args:
        terrain: a whole map.
        rows: first, one past the last.
        cols: the same.

    Returns:
        The window, with the same name, CRS and datum.
    """
    ring = terrain.grid.shape[0] - terrain.upper_bound.shape[0]
    grid = np.ascontiguousarray(terrain.grid[rows[0] : rows[1] + ring, cols[0] : cols[1] + ring])
    z, upper_bound = (np.ascontiguousarray(a[slice(*rows), slice(*cols)]) for a in (terrain.z, terrain.upper_bound))
    bridged = grid
    if terrain.bridged is not terrain.grid:
        bridged = np.ascontiguousarray(terrain.bridged[slice(*rows), slice(*cols)])
    meta = terrain.meta.copy()
    meta[[ground.META_ROW, ground.META_COL]] = rows[0], cols[0]
    (dx, dy), (x0, y0) = terrain.spacing, terrain.origin
    origin = (x0 + cols[0] * dx, y0 + rows[0] * dy)
    derived = Derived(grid, upper_bound, meta, bridged)
    return assemble(z, terrain.spacing, origin, terrain.interpolation, terrain.crs, terrain.name, derived)


def assemble(*values: Any) -> Terrain:
    """Make a terrain from its fields, without any check.

    Args:
        values: the fields before `grid` in the order of the class, then a `Derived`.

    Returns:
        The terrain; its `z` is the array given, set read-only.
    """
    terrain = object.__new__(Terrain)
    _fill(terrain, *values)
    return terrain


def _fill(terrain: Terrain, *values: Any) -> None:
    """Set all fields: those before `grid`, then a `Derived`."""
    values[0].setflags(write=False)
    for part, value in zip(fields(Terrain), (*values[:-1], *values[-1]), strict=True):
        object.__setattr__(terrain, part.name, value)


def _numbers(z: Any, spacing: Any, origin: Any) -> tuple[Array, tuple[float, float], tuple[float, float]]:
    """Return heights, spacing and origin as floats; raise TerrainError if they are not numbers."""
    try:
        with np.errstate(over="ignore"):  # a long double may become infinite, which is refused
            heights = floats(np.ma.asarray(z))  # a copy, as of any masked array; rows may have masks of their own
        step = np.broadcast_to(floats(spacing), (2,))
        corner = floats(origin)
    except (TypeError, ValueError, OverflowError) as error:
        raise TerrainError(
            f"heights must be an array of numbers, spacing ({spacing!r}) one number or two, origin ({origin!r}) two: {error}"
        ) from None
    if not (np.isfinite(step).all() and (step > 0).all()):
        raise TerrainError(f"spacing is {spacing}; give one finite step above 0, or two (dx, dy), in metres")
    if corner.shape != (2,) or not np.isfinite(corner).all():
        raise TerrainError(f"origin is {origin}; give the finite (x, y) of the first node, in metres")
    return heights, (float(step[0]), float(step[1])), (float(corner[0]), float(corner[1]))


def _check_given(spacing: Any, origin: Any, own_spacing: tuple[float, float], own_origin: tuple[float, float]) -> None:
    """Raise TerrainError if a DataArray's coordinates differ from a given spacing or origin."""
    for given, own, word in ((spacing, own_spacing, "spacing"), (origin, own_origin, "origin")):
        try:
            same = given is None or np.allclose(np.broadcast_to(given, (2,)), own, rtol=1e-9, atol=1e-3 * min(own_spacing))
        except (TypeError, ValueError):
            same = False
        if not same:
            raise TerrainError(
                f"{word} is {given!r}, but the DataArray's own coordinates give {tuple(float(f'{v:.10g}') for v in own)}: leave "
                "it out, or pass the DataArray's .values"
            )
