"""Maps as GeoTIFF: one band per layer, written cloud-optimised, and read."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, require
from .grid import crs_of, ordered, pieces, transform

if TYPE_CHECKING:
    import xarray as xr

#: Side of a GeoTIFF's tile, cells.
TILE = 256
CACHE = 256 << 20  # bytes that GDAL may keep
#: Unit of a layer -> factor on its values in a GeoTIFF, and ending of its band's name.
BANDS = {"rad": (180 / np.pi, "_deg"), "m": (1.0, "_m"), "N m": (1.0, "_n_m"), "1": (1.0, "")}
RENAMED = {"passable": "passable_share"}
#: First band of a GeoTIFF.
FIRST = "passable"

Progress = Callable[[int, int], None]


class Band(NamedTuple):
    """One band of a GeoTIFF: a layer of the map, or one heading's."""

    name: str
    variable: str
    heading: int | None
    scale: float


def bands(maps: xr.Dataset, per_heading: bool) -> list[Band]:
    """Return the bands of a map's GeoTIFF.

    Args:
        maps: the map.
        per_heading: include the layers of every heading.

    Returns:
        Summaries, `FIRST` first; then the layers heading by heading.
    """
    found = []
    for name, variable in ordered(maps).data_vars.items():
        if set(variable.dims) == {"y", "x"}:
            scale, ending = BANDS.get(variable.attrs.get("units", "1"), BANDS["1"])
            found.append(Band(RENAMED.get(str(name), f"{name}{ending}"), str(name), None, scale))
    found.sort(key=lambda band: band.variable != FIRST)
    if per_heading:
        for k, heading in enumerate(np.degrees(maps["heading"].values)):
            for name, variable in ordered(maps).data_vars.items():
                if "heading" in variable.dims:
                    scale, ending = BANDS.get(variable.attrs.get("units", "1"), BANDS["1"])
                    found.append(Band(f"{name}{ending}_h{heading:05.1f}", str(name), k, scale))
    return found


def write_geotiff(maps: xr.Dataset, path: Path, per_heading: bool, tell: Progress) -> None:
    """Write a GeoTIFF: a plain one first, from which GDAL makes the cloud-optimised one.

    Args:
        maps: the map.
        path: the file to write.
        per_heading: write the layers of every heading too.
        tell: called with (parts done, all parts).

    Raises:
        OSError: GDAL cannot write the file.
        RockerbogieError: rasterio is not installed.
    """
    rasterio = _rasterio()
    from rasterio._err import CPLE_BaseError
    from rasterio.shutil import copy

    layers = bands(maps, per_heading)
    plain = path.with_suffix(".plain.tif")  # GDAL makes a cloud-optimised file from a plain one
    rows, cols = maps.sizes["y"], maps.sizes["x"]
    profile = {
        "driver": "GTiff", "dtype": "float32", "count": len(layers), "height": rows, "width": cols, "nodata": np.nan,
        "crs": crs_of(maps), "transform": transform(maps), "tiled": True, "blockxsize": TILE, "blockysize": TILE,
        "interleave": "band", "compress": "deflate", "predictor": 3, "zlevel": 1, "bigtiff": "if_safer",
    }  # fmt: skip
    try:
        with rasterio.Env(GDAL_PAM_ENABLED="NO", GDAL_CACHEMAX=CACHE):
            with rasterio.open(plain, "w", **profile) as raster:
                _describe(raster, maps, layers)
                windows = list(pieces(maps))
                for n, window in enumerate(windows):
                    _copy_piece(maps, layers, raster, *window)
                    tell(7 * (n + 1), 10 * len(windows))
            copy(
                plain, path, driver="COG", compress="DEFLATE", predictor="YES", blocksize=TILE, bigtiff="IF_SAFER",
                overviews="AUTO", overview_resampling="NEAREST",
            )  # fmt: skip
    except (rasterio.errors.RasterioError, CPLE_BaseError) as error:
        raise OSError(f"GDAL reports: {str(error).rstrip('.')}; check that the disk is not full") from None
    finally:
        plain.unlink(missing_ok=True)


def _describe(raster: Any, maps: xr.Dataset, layers: list[Band]) -> None:
    """Write names, units and meanings into the file, for people and for `read_geotiff`."""
    kept: dict[str, Any] = {"attrs": maps.attrs, "heading": maps["heading"].values if "heading" in maps.coords else []}
    raster.update_tags(**{name: str(maps.attrs.get(name, "")) for name in ("rover", "terrain", "mode")}, map=_json(kept))
    for k, band in enumerate(layers, 1):
        variable = maps[band.variable]
        raster.set_band_description(k, band.name)
        raster.set_band_unit(k, "deg" if band.scale != 1 else variable.attrs.get("units", "1"))
        about = {"variable": band.variable, "dtype": str(variable.dtype), "attrs": variable.attrs, "heading": band.heading}
        raster.update_tags(k, long_name=variable.attrs.get("long_name", band.variable), layer=_json(about))


def _copy_piece(maps: xr.Dataset, layers: list[Band], raster: Any, rows: slice, cols: slice) -> None:
    """Write one window into every band of an open GeoTIFF, all headings of a layer at once."""
    from rasterio.windows import Window

    piece = maps.isel(y=rows, x=cols)
    window = Window(cols.start, maps.sizes["y"] - rows.stop, piece.sizes["x"], piece.sizes["y"])
    loaded: tuple[str, NDArray[Any]] = ("", np.empty(0))
    for k, band in sorted(enumerate(layers, 1), key=lambda item: (item[1].variable, item[0])):
        if loaded[0] != band.variable:
            dims = ("y", "x") if band.heading is None else ("heading", "y", "x")
            loaded = band.variable, piece[band.variable].transpose(*dims).values
        values = loaded[1] if band.heading is None else loaded[1][band.heading]
        raster.write((values[::-1] * band.scale).astype(np.float32), k, window=window)


def read_geotiff(path: Path) -> xr.Dataset:
    """Read a map from the bands and tags of a GeoTIFF.

    Args:
        path: a file that `write_geotiff` wrote.

    Returns:
        Dataset over (heading, y, x) or (y, x), with angles in rad.

    Raises:
        RockerbogieError: not a raster, or not a map; rasterio is not installed.
    """
    import xarray as xr

    rasterio = _rasterio()
    try:
        raster = rasterio.open(path)
    except rasterio.errors.RasterioError as error:
        raise RockerbogieError(f"{str(path)!r} is not a raster that GDAL can read: {error}") from None
    with raster:
        try:
            about = json.loads(raster.tags()["map"])
            layers = [json.loads(raster.tags(k)["layer"]) for k in raster.indexes]
        except (KeyError, ValueError):
            raise RockerbogieError(f"{str(path)!r} is a raster, but not a map that rockerbogie wrote") from None
        T = raster.transform
        x = T.c + T.a * (np.arange(raster.width) + 0.5)
        y = (T.f + T.e * (np.arange(raster.height) + 0.5))[::-1]
        stack = raster.read()  # all bands at once, as they share tiles
        data: dict[str, Any] = {}
        for k, layer in enumerate(layers, 1):
            scale = BANDS.get(layer["attrs"].get("units", "1"), BANDS["1"])[0]
            values = stack[k - 1, ::-1]
            values = (values / scale if scale != 1 else values).astype(layer["dtype"])
            if layer["heading"] is None:
                data[layer["variable"]] = (("y", "x"), values, layer["attrs"])
            else:
                parts = data.setdefault(layer["variable"], (("heading", "y", "x"), [], layer["attrs"]))[1]
                parts.append(values)
    for name, (dims, values, attrs) in data.items():
        data[name] = (dims, np.stack(values) if isinstance(values, list) else values, attrs)
    return xr.Dataset(data, {"heading": ("heading", about["heading"], {"units": "rad"}), "y": y, "x": x}, about["attrs"])


def _json(value: Any) -> str:
    """Return attributes as JSON, arrays as lists, keys sorted: equal maps give equal bytes."""
    return json.dumps(value, sort_keys=True, default=lambda v: v.tolist() if hasattr(v, "tolist") else str(v))


def _rasterio() -> Any:
    """Return the module rasterio; raise if it is not installed."""
    require("a GeoTIFF", "geo", "rasterio")
    import rasterio

    return rasterio
