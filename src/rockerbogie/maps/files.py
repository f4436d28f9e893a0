"""Map files: cloud-optimised GeoTIFF, Zarr and NetCDF (CF), written and read."""

from __future__ import annotations

import os
import shutil
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RockerbogieError, expect, require
from ..files.outputs import check_outputs, remove_sidecars
from .geotiff import FIRST, Progress, read_geotiff, write_geotiff
from .grid import ordered, pieces
from .layers import LAYERS, REACH

if TYPE_CHECKING:
    import xarray as xr

ENDINGS = (".tif", ".tiff", ".zarr", ".nc")
#: Shape of the blocks in Zarr and NetCDF.
BLOCK = {"heading": 16, "y": 256, "x": 256}


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
    maps = ordered(maps)
    partial = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{kind}")
    try:
        if kind in (".tif", ".tiff"):
            write_geotiff(maps, partial, per_heading, tell)
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
        return read_geotiff(path)
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


def _write_zarr(maps: xr.Dataset, path: Path) -> None:
    """Write a Zarr group in blocks."""
    sizes = _blocks(maps)
    maps = maps.chunk({dim: min(side, maps.sizes[dim]) for dim, side in BLOCK.items()}) if maps.chunks else maps.copy()
    for variable in maps.variables.values():
        variable.encoding = {}  # remove that of a file from which it was read
    maps.to_zarr(path, mode="w", consolidated=False, zarr_format=3, encoding={n: {"chunks": s} for n, s in sizes.items()})


def _write_netcdf(maps: xr.Dataset, path: Path, tell: Progress) -> None:
    """Write a new file block by block in order, so that the same map gives the same bytes.

    Raises an OSError if the disk has too little room. `tell` is called with the numbers of blocks written and of all.
    """
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
