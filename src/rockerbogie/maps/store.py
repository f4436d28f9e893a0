"""Unfinished map on disk: layers, finished tiles, and the inputs of the map.

store/made_from.json   rover, terrain, limits, ...: a store is continued only with equal inputs
store/map.zarr/        the layers, a Zarr group; its layout does not depend on the chunks
store/done/ROW_COL     an empty file for each tile whose layers are all on disk
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, require
from ..files.version import __version__
from .cells import TILE, Tile
from .ground import Ground
from .layers import LAYERS, chosen_layers, kind_of
from .tile import HEADINGS, Job

#: Version of the numbers in a map: raised by 1 with every change of kernels, splines, windows, limits or summaries that changes a
#: map's values. Unfinished maps of another version are not continued. A test holds known maps against it.
NUMERICS = 1


@dataclass(frozen=True)
class Store:
    """Folder of one map. Several processes may write tiles into it at the same time."""

    path: Path

    @cached_property
    def arrays(self) -> dict[str, Any]:
        """Layers, open for writing."""
        zarr = import_zarr()
        group = zarr.open_group(self.path / "map.zarr", mode="r+")
        return {name: group[name] for name in group.array_keys()}

    def take(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Write a part of a layer.

        Args:
            name: of the layer.
            region: its indices.
            values: of that part.
        """
        self.arrays[name][region] = values

    def is_done(self, tile: Tile) -> bool:
        """Return True if all layers of a tile are written.

        Args:
            tile: the tile.

        Returns:
            True if it is marked as finished.
        """
        return self._mark(tile).exists()

    def finish(self, tile: Tile) -> None:
        """Mark a tile as finished, in one atomic step; call it after all its layers are written.

        Args:
            tile: the tile.
        """
        self._mark(tile).touch()

    def tidy(self) -> None:
        """Remove partial files of writers that were killed."""
        for scrap in (self.path / "map.zarr").rglob("*.partial"):
            scrap.unlink(missing_ok=True)

    def _mark(self, tile: Tile) -> Path:
        """Return the file that marks a tile as finished."""
        return self.path / "done" / f"{tile.rows[0]}_{tile.cols[0]}"


def open_store(path: Path, job: Job, made_from: dict[str, Any]) -> Store:
    """Open the store at a path: a new one, or one to continue.

    Args:
        path: its folder.
        job: gives the layers.
        made_from: the inputs, of `made_from`.

    Returns:
        The store.

    Raises:
        RockerbogieError: zarr is not installed; the folder is something else, or a map made from other inputs; it cannot be
            written.
    """
    import_zarr()
    store = Store(path)
    record = path / "made_from.json"
    try:
        if record.exists():
            _check_same(path, json.loads(record.read_text()), made_from)
            if (path / "ready").exists():
                return store
        else:
            check_store(path)
        path.mkdir(parents=True, exist_ok=True)
        draft = path / f".made_from.{os.getpid()}"
        draft.write_text(json.dumps(made_from, indent=1, sort_keys=True))
        os.replace(draft, record)
        shutil.rmtree(path / "map.zarr", ignore_errors=True)
        shutil.rmtree(path / "done", ignore_errors=True)
        _lay_out(path / "map.zarr", job)
        (path / "done").mkdir()
        (path / "ready").touch()
    except json.JSONDecodeError:
        raise RockerbogieError(f"{str(record)!r} is damaged: remove {str(path)!r} and start again") from None
    except OSError as error:
        raise RockerbogieError(f"cannot make a map in {str(path)!r}: {error.strerror or error}") from None
    return store


def check_store(path: Path) -> None:
    """Raise if a path exists and is not the store of a map.

    Args:
        path: of the store.

    Raises:
        RockerbogieError: a file is there, or a folder that holds something else.
    """
    if not path.exists() or (path / "made_from.json").exists():
        return
    if not path.is_dir() or any(not item.name.startswith(".made_from") for item in path.iterdir()):
        raise RockerbogieError(f"{str(path)!r} exists and is not an unfinished map: give another name, or remove it")


def discard_store(path: Path) -> None:
    """Remove a map's store; other files in its folder are kept, and the folder with them.

    Args:
        path: of the store.
    """
    for folder in ("map.zarr", "done"):
        shutil.rmtree(path / folder, ignore_errors=True)
    for file in ("ready", "made_from.json"):
        (path / file).unlink(missing_ok=True)
    with suppress(OSError):
        path.rmdir()


def made_from(job: Job, ground: Ground) -> dict[str, Any]:
    """Return the inputs of a map: equal inputs give equal bytes.

    Args:
        job: the work.
        ground: the terrain.

    Returns:
        Values for JSON: digests of rover and heights, extent, headings, cells, limits, mode, layers, versions.
    """
    whole = ground.whole
    packed = hashlib.sha256(job.rover.packed.tobytes()).hexdigest()
    return {
        "rover": [job.rover.name, packed],
        "heights": ground.digest(),
        "ground": [list(whole.shape), list(whole.spacing), list(whole.origin), whole.crs, whole.name],
        "interpolation": whole.interpolation,
        "headings": job.headings.tolist(),
        "cells": [list(job.cells.step), list(job.cells.first), list(job.cells.size)],
        "limits": json.loads(job.limits.to_json()),
        "mode": job.mode,
        "gravity": job.gravity,
        "layers": list(job.layers),
        "rockerbogie": [__version__, NUMERICS],
    }


def _check_same(path: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    """Raise if a store was made from other inputs."""
    now = json.loads(json.dumps(now))
    if other := [name for name in now if before.get(name) != now[name]]:
        what = {
            "heights": "heights of the terrain", "ground": "extent of the terrain", "cells": "cells (resolution, bounds)",
            "rockerbogie": "version of rockerbogie",
        }  # fmt: skip
        told = ", ".join(f"another {what.get(name, name)}{_told(before.get(name), now[name])}" for name in other)
        raise RockerbogieError(f"{str(path)!r} holds a map made from {told}: give another name, or remove it to start again")


def _told(before: Any, now: Any) -> str:
    """Return both values as text if they are short enough, otherwise ""."""
    for value in (before, now):
        if isinstance(value, list) and len(value) == 2 and all(isinstance(v, str) for v in value):
            return f" ({before[0]}, now {now[0]})" if before and before[0] != now[0] else ""
    told = f" ({before}, now {now})"
    return told if len(told) < 60 and not (isinstance(now, str) and len(now) == 64) else ""


def _lay_out(path: Path, job: Job) -> None:
    """Create the layers with their blank values."""
    zarr = import_zarr()
    group = zarr.create_group(path)
    for name in chosen_layers(job.layers):
        layer = LAYERS[name]
        lead = (min(HEADINGS, len(job.headings)),) if layer.per_heading else ()
        group.create_array(
            name,
            shape=job.shape(name, job.cells.all),
            chunks=(*lead, TILE, TILE),
            dtype=kind_of(name, job.limits),
            fill_value=layer.blank,
            dimension_names=layer.dims,
            # angles hardly compress, and trying to takes more time than settling them
            compressors=None if layer.per_heading and layer.kind == "float64" else "auto",
        )


def read(store: Store, lazily: bool) -> dict[str, Any]:
    """Return the layers of a finished store.

    Args:
        store: the store.
        lazily: return dask arrays, which read the store at use.

    Returns:
        Layers by name, NumPy or dask arrays.
    """
    if not lazily:
        return {name: np.asarray(store.arrays[name][...]) for name in store.arrays}
    import dask.array as da

    return {name: da.from_zarr(str(store.path / "map.zarr"), component=name) for name in store.arrays}


def import_zarr() -> Any:
    """Return the module zarr.

    Returns:
        The module.

    Raises:
        RockerbogieError: zarr or dask is not installed.
    """
    require("a map on disk", "scale", "zarr", "dask")
    import zarr

    return zarr
