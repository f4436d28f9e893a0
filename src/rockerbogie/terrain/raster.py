"""Heights out of a raster file, north up: whatever GDAL reads, through rasterio."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import TerrainError

Array = NDArray[np.float64]

#: Most pixels read at once: 3.2 GB of heights.
MOST_PIXELS = 400_000_000
CACHE = 64 << 20  # bytes of a file that GDAL may keep
#: Values that files use for no data and that are no height anybody drives at; `terrain.MAX_HEIGHT` refuses greater ones.
LOOK_UNKNOWN = (-99999.0, -32768.0, -32767.0, -9999.0)
METRES = frozenset({"", "m", "metre", "meter", "metres", "meters"})


@dataclass(frozen=True)
class Raster:
    """A file of heights, known by its outline and read by windows. A node is a pixel's centre; rows are counted from the
    south, columns from the west."""

    path: Path
    band: int  # from 1
    shape: tuple[int, int]  # rows, cols
    spacing: tuple[float, float]  # dx, dy, m
    corner: tuple[float, float]  # x, y of the file's own corner, m
    step: tuple[float, float]  # from one of the file's pixels to the next, m; -dy where the file begins in the north
    crs: str | None

    def x(self, first: int, last: int) -> Array:
        """(last - first,) of the nodes first..last, m."""
        return _places(self.corner[0], self.step[0], self.shape[1], first, last)

    def y(self, first: int, last: int) -> Array:
        """(last - first,) of the nodes first..last, m."""
        return _places(self.corner[1], self.step[1], self.shape[0], first, last)

    @property
    def origin(self) -> tuple[float, float]:
        """x, y of the south-west node, m."""
        return float(self.x(0, 1)[0]), float(self.y(0, 1)[0])

    def read(self, rows: tuple[int, int], cols: tuple[int, int]) -> Array:
        """Heights (rows, cols) of the nodes rows × cols (first, one past the last), m; y grows with the row, nan is no
        data. The file's scale and offset are applied, and what it marks as no data (by value or by mask) is nan. A warning
        tells of a file that marks nothing and holds what looks like it.

        Raises:
            TerrainError: the file cannot be read.
        """
        from rasterio.windows import Window

        size = (cols[1] - cols[0], rows[1] - rows[0])
        left = cols[0] if self.step[0] > 0 else self.shape[1] - cols[1]
        top = rows[0] if self.step[1] > 0 else self.shape[0] - rows[1]
        with _opened(self.path) as raster:
            raw = raster.read(self.band, masked=True, window=Window(left, top, *size))
            scale, offset = raster.scales[self.band - 1], raster.offsets[self.band - 1]
            unmarked = raster.nodata is None
        lowest = raw.min()
        if unmarked and lowest in LOOK_UNKNOWN:
            warnings.warn(
                f"{self.path.name} marks nothing as no data, but its lowest value is {lowest:g}: if that means no data, say "
                f"so in the file, with gdal_edit.py -a_nodata {lowest:g} {self.path.name}",
                stacklevel=3,
            )
        with np.errstate(over="ignore", invalid="ignore"):  # heights that overflow are refused with the terrain
            heights = np.ma.filled(raw.astype(np.float64), np.nan) * scale + offset
        if self.step[0] < 0:
            heights = heights[:, ::-1]
        if self.step[1] < 0:
            heights = heights[::-1]
        return np.ascontiguousarray(heights)


def open_raster(path: Path, band: int = 1) -> Raster:
    """The outline of a file of heights: whatever GDAL reads.

    Raises:
        TerrainError: rasterio is not installed; no such file or band; not a raster; a grid that is rotated, not in
            metres or without a place.
    """
    with _opened(path) as raster:
        _check(raster, path.name, band)
        T = raster.transform
        crs = raster.crs.to_string() if raster.crs else None
        size = (raster.height, raster.width)
    return Raster(path, band, size, (abs(T.a), abs(T.e)), (T.c, T.f), (T.a, T.e), crs)


def read_raster(
    path: Path, band: int = 1, window: tuple[float, float, float, float] | None = None
) -> tuple[Array, tuple[float, float], tuple[float, float], str | None]:
    """Heights (rows, cols) with y growing with the row, their spacing (dx, dy), the first node (x0, y0), and the CRS.

    Args:
        path: the file.
        band: which band holds the heights, from 1.
        window: (xmin, ymin, xmax, ymax) in the file's CRS, m: only the pixels whose centres lie in it.

    Raises:
        TerrainError: as `open_raster`; a window that holds fewer than two pixels a side; too many pixels.
    """
    raster = open_raster(path, band)
    rows, cols = (0, raster.shape[0]), (0, raster.shape[1])
    if window is not None:
        cols, rows = _inside((raster.x(*cols), raster.y(*rows)), window, path.name)
    count = (cols[1] - cols[0]), (rows[1] - rows[0])
    if count[0] * count[1] > MOST_PIXELS:
        raise TerrainError(f"{path.name} would be {count[0]} x {count[1]} pixels, more than {MOST_PIXELS:g}: give a window")
    origin = float(raster.x(cols[0], cols[0] + 1)[0]), float(raster.y(rows[0], rows[0] + 1)[0])
    return raster.read(rows, cols), raster.spacing, origin, raster.crs


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, open; what rasterio says against it said in our words."""
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
    except ImportError:
        raise TerrainError("reading a raster needs rasterio: pip install 'rockerbogie[geo]'") from None
    if not path.exists():
        raise TerrainError(f"no file {str(path)!r}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # said by `_check`, in our words and as an error
            with rasterio.Env(GDAL_CACHEMAX=CACHE), rasterio.open(path) as raster:
                yield raster
    except RasterioError as error:
        raise TerrainError(f"{str(path)!r} is not a raster that GDAL can read: {error}") from None


def _places(corner: float, step: float, count: int, first: int, last: int) -> Array:
    """The nodes first..last of an axis that is counted from its low end."""
    at = np.arange(first, last)
    if step < 0:
        at = count - 1 - at
    with np.errstate(over="ignore", invalid="ignore"):  # positions that are not finite are refused with the terrain
        return np.asarray(corner + step * (at + 0.5))


def _check(raster: Any, name: str, band: int) -> None:
    """Refuse what is not a north-south grid of heights in metres, with the way out."""
    if not isinstance(band, int | np.integer) or not 1 <= band <= raster.count:
        raise TerrainError(f"{name} has {raster.count} band(s), counted from 1; band {band!r} is not one of them")
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
