"""Map files: cloud-optimised GeoTIFF, Zarr and NetCDF (CF), written and read."""

from __future__ import annotations

import json
import os
import shutil
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, expect, require
from ..outputs import check_outputs, remove_sidecars
from .layers import LAYERS, REACH

if TYPE_CHECKING:
    import xarray as xr

ENDINGS = (".tif", ".tiff", ".zarr", ".nc")
#: Side of a GeoTIFF's tile, and rows and columns of the pieces in which a map is read and written, cells.
TILE = 256
PIECE = (1024, 2048)
#: Shape of the blocks in Zarr and NetCDF.
BLOCK = {"heading": 16, "y": 256, "x": 256}
CACHE = 256 << 20  # bytes that GDAL may keep
#: Unit of a layer -> factor on its values in a GeoTIFF, and ending of its band's name.
BANDS = {"rad": (180 / np.pi, "_deg"), "m": (1.0, "_m"), "1": (1.0, "")}
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


def write_map(
    maps: xr.Dataset, file: str | Path, *, per_heading: bool = False, force: bool = False, progress: Progress | None = None
) -> Path:
    """Write a map in the format of the file's ending; equal maps give equal bytes.

    - `.tif`: a cloud-optimised GeoTIFF, float32, north up, one band per layer, named with its unit (`worst_tilt_deg`); angles
      in degrees; nodata is NaN. It holds the summaries over headings, and with `per_heading` the layers of every heading.
    - `.zarr`, `.nc`: all layers unchanged (SI, rad, float64), with the names and the grid mapping of CF.

    The map is written in pieces, so it may be larger than memory. It is written to a temporary file beside the target and
    then renamed.

    Args:
        maps: from `traversability`.
        file: ends in .tif, .tiff, .zarr or .nc. An existing map is replaced, and the statistics that GDAL keeps beside it
            (.aux.xml) are removed.
        per_heading: write every heading's layers into a GeoTIFF too.
        force: replace a file that this package did not write.
        progress: called with (parts done, all parts).

    Returns:
        The path of the file.

    Raises:
        RockerbogieError: another ending, a file that this package did not write (without `force`), a path that cannot be
            written, a full disk (an existing file is then kept), rasterio or zarr not installed.
    """
    import xarray as xr

    path = Path(file)
    kind = path.suffix.lower()
    check_place(path)
    check_outputs([path], force=force)
    expect(maps, xr.Dataset, "maps", "give the Dataset of rockerbogie.traversability")
    tell = progress or (lambda done, total: None)
    maps = _ordered(maps)
    partial = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{kind}")
    try:
        if kind in (".tif", ".tiff"):
            _write_geotiff(maps, partial, per_heading, tell)
        elif kind == ".zarr":
            _write_zarr(maps, partial)
        else:
            _write_netcdf(maps, partial, tell)
        if path.is_dir():
            shutil.rmtree(path)
        os.replace(partial, path)
        remove_sidecars(path)
    except OSError as error:
        raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(partial, ignore_errors=True) if partial.is_dir() else partial.unlink(missing_ok=True)
    tell(1, 1)
    return path


def check_place(path: Path) -> None:
    """Check that a map can be written to a path.

    Args:
        path: of the map.

    Raises:
        RockerbogieError: an unknown ending, a folder that is not a Zarr group, rasterio (.tif) or zarr (.zarr) not installed.
    """
    _check_ending(path)
    if path.suffix.lower() == ".zarr":
        require("a .zarr file", "scale", "zarr", "dask")
    elif path.suffix.lower() != ".nc":
        require("a GeoTIFF", "geo", "rasterio")
    if path.is_dir() and not _is_zarr(path):
        raise RockerbogieError(f"{str(path)!r} is a folder but not a map: give another name")


def _check_ending(path: Path) -> None:
    """Raise if a path does not end like a map."""
    if path.suffix.lower() not in ENDINGS:
        raise RockerbogieError(f"{str(path)!r} is not the name of a map: end it in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")


def read_map(file: str | Path) -> xr.Dataset:
    """Read a map that `write_map` wrote.

    Layers of Zarr and NetCDF are loaded at first use. Angles of a GeoTIFF are converted back to radians.

    Args:
        file: ends in .tif, .tiff, .zarr or .nc.

    Returns:
        Dataset as of `traversability`; from a GeoTIFF only its bands, in float32.

    Raises:
        RockerbogieError: no such file, or not a map of this package.
    """
    import xarray as xr

    path = Path(file)
    _check_ending(path)
    if not path.exists():
        raise RockerbogieError(f"no map at {str(file)!r}")
    if path.suffix.lower() in (".tif", ".tiff"):
        return _read_geotiff(path)
    if path.suffix.lower() == ".zarr":
        require("a .zarr file", "scale", "zarr", "dask")
    maps: xr.Dataset
    try:
        if path.suffix.lower() == ".zarr":
            maps = xr.open_zarr(path, chunks=None, consolidated=False)
        else:
            maps = xr.open_dataset(path, engine="h5netcdf")
    except (OSError, ValueError, KeyError) as error:
        raise RockerbogieError(f"{str(file)!r} cannot be read as {path.suffix}: {' '.join(str(error).split())}") from None
    if not (LAYERS.keys() | REACH.keys()) & set(maps.data_vars):
        raise RockerbogieError(
            f"{str(file)!r} is not a traversability map: it has no layer {FIRST!r}, nor any other layer of one"
        )
    return maps


def bands(maps: xr.Dataset, per_heading: bool) -> list[Band]:
    """Return the bands of a map's GeoTIFF.

    Args:
        maps: the map.
        per_heading: include the layers of every heading.

    Returns:
        Summaries, `FIRST` first; then the layers heading by heading.
    """
    found = []
    for name, variable in _ordered(maps).data_vars.items():
        if set(variable.dims) == {"y", "x"}:
            scale, ending = BANDS.get(variable.attrs.get("units", "1"), BANDS["1"])
            found.append(Band(RENAMED.get(str(name), f"{name}{ending}"), str(name), None, scale))
    found.sort(key=lambda band: band.variable != FIRST)
    if per_heading:
        for k, heading in enumerate(np.degrees(maps["heading"].values)):
            for name, variable in _ordered(maps).data_vars.items():
                if "heading" in variable.dims:
                    scale, ending = BANDS.get(variable.attrs.get("units", "1"), BANDS["1"])
                    found.append(Band(f"{name}{ending}_h{heading:05.1f}", str(name), k, scale))
    return found


def _ordered(maps: xr.Dataset) -> xr.Dataset:
    """Return the map with its layers in the order of `LAYERS`."""
    place = {name: k for k, name in enumerate(LAYERS)}
    names = sorted(maps.data_vars, key=lambda name: (place.get(str(name), len(place)), str(name)))
    return maps.drop_vars(names).assign({name: maps[name] for name in names})


def _write_geotiff(maps: xr.Dataset, path: Path, per_heading: bool, tell: Progress) -> None:
    """Write a GeoTIFF: a plain one first, from which GDAL makes the cloud-optimised one."""
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
    """Write names, units and meanings into the file, for people and for `_read_geotiff`."""
    kept: dict[str, Any] = {"attrs": maps.attrs, "heading": maps["heading"].values if "heading" in maps.coords else []}
    raster.update_tags(**{name: str(maps.attrs.get(name, "")) for name in ("rover", "terrain", "mode")}, map=_json(kept))
    for k, band in enumerate(layers, 1):
        variable = maps[band.variable]
        raster.set_band_description(k, band.name)
        raster.set_band_unit(k, "deg" if band.scale != 1 else variable.attrs.get("units", "1"))
        about = {"variable": band.variable, "dtype": str(variable.dtype), "attrs": variable.attrs, "heading": band.heading}
        raster.update_tags(k, long_name=variable.attrs.get("long_name", band.variable), layer=_json(about))


def _copy_piece(maps: xr.Dataset, layers: list[Band], raster: Any, rows: slice, cols: slice) -> None:
    """Write one piece of every band. The headings of a layer are loaded at once."""
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


def pieces(maps: xr.Dataset) -> Iterator[tuple[slice, slice]]:
    """Cut a map into pieces that fit in memory, from the north.

    Args:
        maps: the map.

    Yields:
        Slices of rows and columns.
    """
    rows, cols = maps.sizes["y"], maps.sizes["x"]
    for row in range(rows, 0, -PIECE[0]):
        for col in range(0, cols, PIECE[1]):
            yield slice(max(row - PIECE[0], 0), row), slice(col, min(col + PIECE[1], cols))


def cell_size(maps: xr.Dataset) -> tuple[float, float]:
    """Return the sides of a map's cells, from its coordinates.

    The attribute `resolution` is used where it agrees with them, or where there is one cell; a resampled map may differ.

    Args:
        maps: the map.

    Returns:
        dx and dy, m.

    Raises:
        RockerbogieError: coordinates that are not evenly spaced or do not grow, or one cell without `resolution`.
    """
    given = maps.attrs.get("resolution")
    stated = None if given is None else np.broadcast_to(np.asarray(given, dtype=float), (2,))
    sides = []
    for k, axis in enumerate(("x", "y")):
        at = np.asarray(maps[axis].values, dtype=float)
        if len(at) > 1:
            side = (at[-1] - at[0]) / (len(at) - 1)
            rounding = 4 * float(np.spacing(np.abs(at).max()))
            if not side > 0 or np.abs(np.diff(at) - side).max() > 1e-3 * side + rounding:
                raise RockerbogieError(
                    f"the map's {axis} is not evenly spaced and growing: sort it (sortby({axis!r})) or resample it to even steps"
                )
            kept = stated is not None and abs(side - stated[k]) <= 1e-6 * side + rounding
            sides.append(float(stated[k]) if kept and stated is not None else float(side))
        elif stated is not None:
            sides.append(float(stated[k]))
        else:
            raise RockerbogieError(
                f"the map has one cell along {axis} and no attribute 'resolution': set that to the side of a cell, m"
            )
    return sides[0], sides[1]


def crs_of(maps: xr.Dataset) -> str | None:
    """Return the CRS of a map.

    Args:
        maps: the map.

    Returns:
        The attribute `crs`, or else that of the grid mapping, which resampling keeps; None if there is none.
    """
    if maps.attrs.get("crs"):
        return str(maps.attrs["crs"])
    mapping = maps.coords["spatial_ref"].attrs if "spatial_ref" in maps.coords else {}
    return mapping.get("crs_wkt") or mapping.get("spatial_ref") or None


def transform(maps: xr.Dataset) -> Any:
    """Return the affine transform of a map's raster, north up.

    Args:
        maps: the map.

    Returns:
        rasterio's Affine from pixels to m; the centre of a cell is the centre of its pixel.
    """
    from rasterio import Affine

    dx, dy = cell_size(maps)
    return Affine(dx, 0.0, float(maps["x"][0]) - dx / 2, 0.0, -dy, float(maps["y"][-1]) + dy / 2)


def _read_geotiff(path: Path) -> xr.Dataset:
    """Read a map from the bands and tags of a GeoTIFF."""
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


def _write_zarr(maps: xr.Dataset, path: Path) -> None:
    """Write a Zarr group in blocks."""
    sizes = _blocks(maps)
    maps = maps.chunk({dim: min(side, maps.sizes[dim]) for dim, side in BLOCK.items()}) if maps.chunks else maps.copy()
    for variable in maps.variables.values():
        variable.encoding = {}  # remove that of a file from which it was read
    maps.to_zarr(path, mode="w", consolidated=False, zarr_format=3, encoding={n: {"chunks": s} for n, s in sizes.items()})


def _write_netcdf(maps: xr.Dataset, path: Path, tell: Progress) -> None:
    """Write block by block in order, so that the same map gives the same bytes."""
    import h5netcdf

    needed, free = maps.nbytes, shutil.disk_usage(path.parent).free
    if needed > free:  # HDF5 crashes if the disk becomes full
        raise OSError(f"it may take {needed / 1e9:.3g} GB, and only {free / 1e9:.3g} GB are free")
    maps.drop_vars(maps.data_vars).to_netcdf(path, engine="h5netcdf")
    with h5netcdf.File(path, "a") as file:
        for name, shape in _blocks(maps).items():
            layer = maps[name]
            blank = np.nan if layer.dtype.kind == "f" else None
            stored = file.create_variable(
                name, layer.dims, layer.dtype, chunks=shape, compression="gzip", compression_opts=4, shuffle=True, fillvalue=blank
            )
            stored.attrs.update(layer.attrs)
        windows = list(pieces(maps))
        for n, (rows, cols) in enumerate(windows):
            piece = maps.isel(y=rows, x=cols)
            for name, layer in piece.data_vars.items():
                file.variables[name][..., rows, cols] = layer.transpose(..., "y", "x").values
            tell(n + 1, len(windows))


def _blocks(maps: xr.Dataset) -> dict[Any, tuple[int, ...]]:
    """Return the shapes of the blocks in which layers are stored."""
    side = {dim: min(BLOCK[str(dim)], size) for dim, size in maps.sizes.items()}
    return {name: tuple(side[dim] for dim in variable.dims) for name, variable in maps.data_vars.items()}


def _is_zarr(path: Path) -> bool:
    """Return True for the folder of a Zarr group."""
    return (path / "zarr.json").exists() or (path / ".zgroup").exists()


def _json(value: Any) -> str:
    """Return attributes as JSON, arrays as lists, keys sorted: equal maps give equal bytes."""
    return json.dumps(value, sort_keys=True, default=lambda v: v.tolist() if hasattr(v, "tolist") else str(v))


def _rasterio() -> Any:
    """Return the module rasterio; raise if it is not installed."""
    require("a GeoTIFF", "geo", "rasterio")
    import rasterio

    return rasterio
