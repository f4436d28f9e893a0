"""Heights from raster files that GDAL reads, north up and in metres."""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import TerrainError, TerrainWarning, require
from .georeference import Georeference, check_scale, georeference, refuse_angles, warp
from .missing import HUGE, Screening
from .raster_checks import check_band, height_unit, is_placed, with_cell
from .window import check_grid

Array = NDArray[np.float64]
Window = tuple[float, float, float, float]

#: Greatest number of pixels read at once: 3.2 GB of heights.
MOST_PIXELS = 400_000_000
CACHE = 64 << 20  # bytes of a file that GDAL may keep
BLOCK = 1 << 22  # pixels screened at once
NOISE = 1e-3  # cells: a rotation that moves every pixel by less than this is rounding
#: Names that GDAL takes and that are not paths: netcdf:file.nc:z, https://…, /vsizip/….
GDAL_NAME = re.compile(r"^([A-Za-z][A-Za-z0-9_+.-]+:|/vsi)")


@dataclass(frozen=True)
class Raster:
    """Outline of a file of heights, which is read by windows.

    A node is a pixel's centre; rows are counted from the south, columns from the west. Lengths are in metres, independently
    of the file's units.
    """

    source: str  # path, or GDAL's name for it
    band: int  # from 1
    shape: tuple[int, int]  # rows, cols
    spacing: tuple[float, float]  # dx, dy, m
    corner: tuple[float, float]  # x, y of the file's own corner, m
    step: tuple[float, float]  # from one pixel to the next along x and y, m; -dy where the file begins in the north
    turned: bool  # True if the file's rows run along x
    georeference: Georeference
    scale: float  # heights are scale · stored + offset, m
    offset: float
    alpha: int | None = None  # band that is 0 where data is missing
    fills: tuple[float, ...] = ()  # stored values that mean missing data beyond those that the file declares

    @property
    def name(self) -> str:
        """Name for messages: the last part of the path."""
        return short_name(self.source)

    @property
    def crs(self) -> str | None:
        """CRS of x and y in metres."""
        return self.georeference.crs

    def x(self, first: int, last: int) -> Array:
        """Return x of the nodes of some columns.

        Args:
            first: first column, counted from the west.
            last: one past the last.

        Returns:
            (last - first,) m.
        """
        return _positions(self.corner[0], self.step[0], self.shape[1], first, last)

    def y(self, first: int, last: int) -> Array:
        """Return y of the nodes of some rows.

        Args:
            first: first row, counted from the south.
            last: one past the last.

        Returns:
            (last - first,) m.
        """
        return _positions(self.corner[1], self.step[1], self.shape[0], first, last)

    @property
    def origin(self) -> tuple[float, float]:
        """x, y of the south-west node, m."""
        return float(self.x(0, 1)[0]), float(self.y(0, 1)[0])

    def read(self, rows: tuple[int, int], cols: tuple[int, int]) -> Array:
        """Read the heights of a window.

        Args:
            rows: first, one past the last, counted from the south.
            cols: the same, counted from the west.

        Returns:
            (rows, cols) m; y grows with the row. NaN is missing data: declared by value or mask, not finite, at least
            `HUGE`, or in `fills`.

        Raises:
            TerrainError: the file cannot be read.
        """
        raw = self._stored(rows, cols)
        values = np.ma.getdata(raw)
        with np.errstate(over="ignore", invalid="ignore"):  # heights that overflow are refused with the terrain
            heights = values * np.float64(self.scale) + self.offset
            if values.dtype.kind == "f":
                heights[~(np.abs(values) < HUGE)] = np.nan
        heights[np.ma.getmaskarray(raw)] = np.nan
        for fill in self.fills:
            heights[values == fill] = np.nan
        return np.ascontiguousarray(heights)

    def _stored(self, rows: tuple[int, int], cols: tuple[int, int]) -> Any:
        """Return the stored values (rows, cols) of a window as a masked array; y grows with the row."""
        from rasterio.windows import Window

        across = cols if self.step[0] > 0 else (self.shape[1] - cols[1], self.shape[1] - cols[0])
        down = rows if self.step[1] > 0 else (self.shape[0] - rows[1], self.shape[0] - rows[0])
        if self.turned:
            across, down = down, across
        with _opened(self.source) as file:
            window = Window(across[0], down[0], across[1] - across[0], down[1] - down[0])
            raw = file.read(self.band, masked=True, window=window)
            if self.alpha is not None:
                raw = np.ma.masked_where(file.read(self.alpha, window=window) == 0, raw)
        if self.turned:
            raw = raw.T
        return raw[:: 1 if self.step[1] > 0 else -1, :: 1 if self.step[0] > 0 else -1]

    def screened(
        self, rows: tuple[int, int] | None = None, cols: tuple[int, int] | None = None, *, quiet: bool = False
    ) -> Raster:
        """Search all stored values of a window for undeclared missing data and for steps.

        Args:
            rows: first, one past the last; None: all.
            cols: the same.
            quiet: do not warn.

        Returns:
            The raster with `fills`.

        Raises:
            TerrainError: the file cannot be read; its projection stretches lengths by more than 1 %.

        Warns:
            TerrainWarning: missing data that is not declared, zeros beside cliffs, heights in coarse steps, a projection that
                stretches by more than 0.2 %, coordinates that were converted to metres.
        """
        rows, cols = rows or (0, self.shape[0]), cols or (0, self.shape[1])
        check_grid(self.name, self.shape, self.spacing, self.origin)
        notes = [check_scale(self.georeference, self.name, *self._edges(rows, cols), self.spacing)]
        search = Screening(self.name, self.spacing, self.scale, self.offset)
        step = max(BLOCK // (cols[1] - cols[0]), 2)
        for row in range(rows[0], rows[1], step):
            search.add(self._stored((row, min(row + step, rows[1])), cols))
        fills = search.fills()
        search.check_relief(fills)
        if self.georeference.unit != 1.0:
            unit, name = self.georeference.unit, self.georeference.unit_name
            notes.append(f"x and y of {self.name} are converted from {name} ({unit:.7g} m) to metres: give positions in metres")
        for note in [] if quiet else [*filter(None, notes), *search.notes(fills)]:
            warnings.warn(note, TerrainWarning, stacklevel=4)
        return replace(self, fills=fills)

    def _edges(self, rows: tuple[int, int], cols: tuple[int, int]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return x of the first and last column, and y of the first and last row, m."""
        x, y = ((float(of(a, a + 1)[0]), float(of(b - 1, b)[0])) for of, (a, b) in ((self.x, cols), (self.y, rows)))
        return x, y


def open_raster(path: str | Path, band: int = 1, cell: float | None = None) -> Raster:
    """Read the outline of a file of heights.

    Args:
        path: a file, or a name that GDAL takes: netcdf:file.nc:z, /vsizip/file.zip/dem.tif.
        band: number of the band with the heights, from 1.
        cell: side of a cell, m, for a file without georeference or CRS; the map's south-west corner is then (0, 0).

    Returns:
        The outline; no heights are read.

    Raises:
        TerrainError: rasterio is not installed; no such file or band; not a raster of heights; a grid that is rotated,
            in degrees or without a cell size; units that are not lengths.
    """
    source = locate(path)
    name = short_name(source)
    with _opened(source) as file:
        check_band(file, name, band)
        shape = (file.height, file.width)
        frame = georeference(file.crs, name)
        T = [float(v) for v in tuple(file.transform)[:6]]
        if cell is not None:
            T = with_cell(cell, T, shape, frame, name)
        elif not is_placed(T):
            raise TerrainError(
                f"{name} is placed by ground control points: rectify it first, with {warp(name, None, None)}"
                if file.gcps[0]
                else f"{name} has no georeference, so the size of its cells is not known: give the side of a cell in metres "
                f"(cell=, or --cell)"
            )
        a, b, c, d, e, f = T
        size = (math.hypot(a, d), math.hypot(b, e))
        turned = max(abs(a) * shape[1], abs(e) * shape[0]) < NOISE * min(size)
        if not turned and max(abs(b) * shape[0], abs(d) * shape[1]) > NOISE * min(size):
            raise TerrainError(f"{name} is a rotated grid: turn it north up first, with {warp(name, None, None)}")
        middle = (c + 0.5 * (a * shape[1] + b * shape[0]), f + 0.5 * (d * shape[1] + e * shape[0]))
        refuse_angles(frame, name, *middle, size)
        if frame.crs is None and cell is None and max(size) < 1e-3 and abs(middle[0]) <= 360 and abs(middle[1]) <= 90:
            raise TerrainError(
                f"{name} has no CRS and cells of {size[0]:.3g}, as if it counted in degrees: assign its CRS with gdal_edit.py "
                f"-a_srs, or give the side of a cell in metres (cell=, or --cell)"
            )
        height = height_unit(file, name, band, frame)
        alpha = next((k for k, kind in zip(file.indexes, file.colorinterp, strict=True) if kind.name == "alpha"), None)
        scale, offset = float(file.scales[band - 1]) * height, float(file.offsets[band - 1]) * height
    unit = frame.unit
    step = (b * unit, d * unit) if turned else (a * unit, e * unit)
    corner = (c * unit, f * unit)
    if turned:
        shape = shape[::-1]
    return Raster(source, band, shape, (abs(step[0]), abs(step[1])), corner, step, turned, frame, scale, offset, alpha)


def read_raster(
    path: str | Path, band: int = 1, window: Window | None = None, cell: float | None = None
) -> tuple[Array, tuple[float, float], tuple[float, float], str | None]:
    """Read heights with their grid.

    Args:
        path: as `open_raster`.
        band: as `open_raster`.
        window: (xmin, ymin, xmax, ymax) m, in the coordinates of the terrain: only the pixels whose centres lie in it.
        cell: as `open_raster`.

    Returns:
        Heights (rows, cols) m with y growing with the row, spacing (dx, dy) m, the first node (x0, y0) m, and the CRS.

    Raises:
        TerrainError: as `open_raster` and `Raster.screened`; a window that holds fewer than two pixels a side; too many pixels.

    Warns:
        TerrainWarning: as `Raster.screened`.
    """
    raster = open_raster(path, band, cell)
    rows, cols = (0, raster.shape[0]), (0, raster.shape[1])
    if window is not None:
        cols, rows = _inside((raster.x(*cols), raster.y(*rows)), window, raster.name)
    count = (cols[1] - cols[0]), (rows[1] - rows[0])
    if count[0] * count[1] > MOST_PIXELS:
        raise TerrainError(f"{raster.name} would be {count[0]} x {count[1]} pixels, more than {MOST_PIXELS:g}: give a window")
    raster = raster.screened(rows, cols)
    origin = float(raster.x(cols[0], cols[0] + 1)[0]), float(raster.y(rows[0], rows[0] + 1)[0])
    return raster.read(rows, cols), raster.spacing, origin, raster.crs


def locate(path: str | Path) -> str:
    """Return the absolute path of a file, or GDAL's name for a raster.

    Args:
        path: a file, or a name that GDAL takes: netcdf:file.nc:z, /vsizip/file.zip/dem.tif.

    Returns:
        The absolute path of a file that exists; otherwise the name as given.

    Raises:
        TerrainError: no such file, and not a name of GDAL's.
    """
    text = os.fspath(path)
    if os.path.exists(text):
        return os.path.abspath(text)
    if GDAL_NAME.match(text):
        return text
    raise TerrainError(f"no file {text!r}")


def short_name(source: str) -> str:
    """Return the last part of a path or of GDAL's name.

    Args:
        source: as `locate` returns it.

    Returns:
        For example "dem.tif" or "file.nc:z".
    """
    return source.rstrip("/").rsplit("/", 1)[-1] or source


@contextmanager
def _opened(source: str) -> Iterator[Any]:
    """Open a raster and yield rasterio's dataset; raise rasterio's errors as TerrainError."""
    require("reading a raster", "geo", "rasterio", error=TerrainError)
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # `open_raster` raises an error for it
            with rasterio.Env(GDAL_CACHEMAX=CACHE), rasterio.open(source) as file:
                yield file
    except Exception as error:  # rasterio lets some of GDAL's own errors through, which have no public base class
        if not (isinstance(error, (MemoryError, UnicodeError)) or type(error).__module__.startswith("rasterio")):
            raise
        reason = " ".join(str(error).split()) or "out of memory"
        raise TerrainError(f"{source!r} is not a raster that GDAL can read: {reason}") from None


def _positions(corner: float, step: float, count: int, first: int, last: int) -> Array:
    """Return the nodes first..last of an axis that is counted from its low end."""
    at = np.arange(first, last)
    if step < 0:
        at = count - 1 - at
    with np.errstate(over="ignore", invalid="ignore"):  # positions that are not finite are refused with the terrain
        return np.asarray(corner + step * (at + 0.5))


def _inside(centres: tuple[Array, Array], window: Window, name: str) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the first and one past the last column and row whose centres lie in the window."""
    try:
        box = np.asarray(window, dtype=float)
    except (TypeError, ValueError):
        box = np.empty(0)
    if box.shape != (4,) or not np.isfinite(box).all() or not (box[:2] < box[2:]).all():
        raise TerrainError(f"window {window!r} is not (xmin, ymin, xmax, ymax) with min below max, in metres")
    spans = []
    for axis, at in enumerate(centres):
        slack = 1e-6 * abs(at[1] - at[0]) if len(at) > 1 else 0.0
        inside = np.flatnonzero((at >= box[axis] - slack) & (at <= box[axis + 2] + slack))
        if len(inside) < 2:
            limits = ", ".join(f"{v:.10g}" for v in (*(c.min() for c in centres), *(c.max() for c in centres)))
            raise TerrainError(f"window {tuple(window)} holds fewer than two pixels a side of {name}, which spans ({limits})")
        spans.append((int(inside[0]), int(inside[-1]) + 1))
    return spans[0], spans[1]
