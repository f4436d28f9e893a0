"""Heights out of a raster file, north up: whatever GDAL reads, through rasterio."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import TerrainError

Array = NDArray[np.float64]

#: Most pixels read at once: 3.2 GB of heights.
MOST_PIXELS = 400_000_000
METRES = frozenset({"", "m", "metre", "meter", "metres", "meters"})


def read_raster(
    path: Path, band: int = 1, window: tuple[float, float, float, float] | None = None
) -> tuple[Array, tuple[float, float], tuple[float, float], str | None]:
    """Heights (rows, cols) with y growing with the row, their spacing (dx, dy), the first node (x0, y0), and the CRS.

    A node is a pixel's centre; the first is the south-west pixel's. The file's scale and offset are applied, and what
    it marks as no data (by value or by mask) is nan.

    Args:
        path: the file.
        band: which band holds the heights, from 1.
        window: (xmin, ymin, xmax, ymax) in the file's CRS, m: only the pixels whose centres lie in it.

    Raises:
        TerrainError: rasterio is not installed; no such file or band; not a raster; a grid that is rotated, not in
            metres or without a place; a window that holds fewer than two pixels a side; too many pixels.
    """
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
    except ImportError:
        raise TerrainError("reading a raster needs rasterio: pip install 'rockerbogie[geo]'") from None
    if not path.exists():
        raise TerrainError(f"no file {str(path)!r}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # said below, in our words and as an error
            with rasterio.open(path) as raster:
                return _read(raster, path.name, band, window)
    except RasterioError as error:
        raise TerrainError(f"{str(path)!r} is not a raster that GDAL can read: {error}") from None


def _read(
    raster: Any, name: str, band: int, window: tuple[float, float, float, float] | None
) -> tuple[Array, tuple[float, float], tuple[float, float], str | None]:
    from rasterio.windows import Window

    _check(raster, name, band)
    T = raster.transform
    centres = (T.c + T.a * (np.arange(raster.width) + 0.5), T.f + T.e * (np.arange(raster.height) + 0.5))
    (first_col, last_col), (first_row, last_row) = (0, raster.width), (0, raster.height)
    if window is not None:
        (first_col, last_col), (first_row, last_row) = _inside(centres, window, name)
    cols, rows = last_col - first_col, last_row - first_row
    if cols * rows > MOST_PIXELS:
        raise TerrainError(f"{name} would be {cols} x {rows} pixels, more than {MOST_PIXELS:g}: give a window")
    raw = raster.read(band, masked=True, window=Window(first_col, first_row, cols, rows))
    heights = np.ma.filled(raw.astype(np.float64), np.nan) * raster.scales[band - 1] + raster.offsets[band - 1]
    x, y = centres[0][first_col:last_col], centres[1][first_row:last_row]
    if T.a < 0:
        heights, x = heights[:, ::-1], x[::-1]
    if T.e < 0:
        heights, y = heights[::-1], y[::-1]
    crs = raster.crs.to_string() if raster.crs else None
    return np.ascontiguousarray(heights), (abs(T.a), abs(T.e)), (float(x[0]), float(y[0])), crs


def _check(raster: Any, name: str, band: int) -> None:
    """Refuse what is not a north-south grid of heights in metres, with the way out."""
    if not 1 <= band <= raster.count:
        raise TerrainError(f"{name} has {raster.count} band(s), counted from 1; band {band} is not one of them")
    if np.dtype(raster.dtypes[band - 1]).kind not in "iuf":
        raise TerrainError(f"band {band} of {name} holds {raster.dtypes[band - 1]}, not heights: choose another band")
    T = raster.transform
    if T.is_identity:
        raise TerrainError(f"{name} does not say how large its cells are: load its array by Terrain.from_array with your spacing")
    if T.b or T.d:
        raise TerrainError(f"{name} is a rotated grid: turn it north up first, with gdalwarp {name} north_up.tif")
    crs = raster.crs
    if crs and crs.is_geographic:
        raise TerrainError(
            f"{name} counts in degrees ({crs.to_string()}): reproject it to metres first, as with gdalwarp -t_srs EPSG:326NN"
        )
    if crs and crs.is_projected and abs(crs.linear_units_factor[1] - 1) > 1e-9:
        raise TerrainError(f"{name} counts in {crs.linear_units_factor[0]}: reproject it to metres first, with gdalwarp -t_srs")
    unit = raster.units[band - 1] or ""
    if unit.lower() not in METRES:
        raise TerrainError(f"band {band} of {name} holds heights in {unit!r}: convert them to metres first, with gdal_calc.py")


def _inside(
    centres: tuple[Array, Array], window: tuple[float, float, float, float], name: str
) -> tuple[tuple[int, int], tuple[int, int]]:
    """First and one-past-last column and row whose centres lie in the window."""
    box = np.asarray(window, dtype=float)
    if box.shape != (4,) or not np.isfinite(box).all() or not (box[:2] < box[2:]).all():
        raise TerrainError(f"window {tuple(window)} is not (xmin, ymin, xmax, ymax) with min below max, in metres")
    spans = []
    for axis, at in enumerate(centres):
        slack = 1e-6 * abs(at[1] - at[0]) if len(at) > 1 else 0.0
        inside = np.flatnonzero((at >= box[axis] - slack) & (at <= box[axis + 2] + slack))
        if len(inside) < 2:
            limits = ", ".join(f"{v:.10g}" for v in (*(c.min() for c in centres), *(c.max() for c in centres)))
            raise TerrainError(f"window {tuple(window)} holds fewer than two pixels a side of {name}, which spans ({limits})")
        spans.append((int(inside[0]), int(inside[-1]) + 1))
    return spans[0], spans[1]
