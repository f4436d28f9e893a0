"""A map on disk while it is made: layers, finished tiles, and the inputs it is made from.

store/made_from.json   rover, ground, limits, ...: a store is only ever gone on with from the very same
store/map.zarr/        the layers, a Zarr group; laid out the same however a map is cut in chunks
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

from .._version import __version__
from ..errors import RockerbogieError, require
from .cells import TILE, Tile
from .ground import Ground
from .layers import LAYERS, chosen_layers
from .tile import HEADINGS, Job

#: Version of the numbers in a map: raised by 1 with every change of kernels, splines, windows, limits or summaries that changes a
#: map's values. Unfinished maps of another version are not continued. A test holds known maps against it.
NUMERICS = 1


@dataclass(frozen=True)
class Store:
    """One map's folder. Any number of processes may write tiles into it at once."""

    path: Path

    @cached_property
    def arrays(self) -> dict[str, Any]:
        """The layers, open for writing."""
        zarr = import_zarr()
        group = zarr.open_group(self.path / "map.zarr", mode="r+")
        return {name: group[name] for name in group.array_keys()}

    def take(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Write a part of a layer."""
        self.arrays[name][region] = values

    def is_done(self, tile: Tile) -> bool:
        """Return True if all layers of a tile are written."""
        return self._mark(tile).exists()

    def finish(self, tile: Tile) -> None:
        """Say that a tile's layers are all written. Done in one stroke, after they are."""
        self._mark(tile).touch()

    def tidy(self) -> None:
        """Take away what writers that were killed left half written."""
        for scrap in (self.path / "map.zarr").rglob("*.partial"):
            scrap.unlink(missing_ok=True)

    def _mark(self, tile: Tile) -> Path:
        return self.path / "done" / f"{tile.rows[0]}_{tile.cols[0]}"


def open_store(path: Path, job: Job, made_from: dict[str, Any]) -> Store:
    """The store at a path, new or to be gone on with.

    Raises:
        RockerbogieError: zarr is not installed; the folder is something else, or a map made from something else; it
            cannot be written.
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
        raise RockerbogieError(f"{str(record)!r} is damaged: take {str(path)!r} away and begin anew") from None
    except OSError as error:
        raise RockerbogieError(f"cannot make a map in {str(path)!r}: {error.strerror or error}") from None
    return store


def check_store(path: Path) -> None:
    """Raise if a path is taken by something that is not a map's store.

    Raises:
        RockerbogieError: a file is there, or a folder that holds something else.
    """
    if not path.exists() or (path / "made_from.json").exists():
        return
    if not path.is_dir() or any(not item.name.startswith(".made_from") for item in path.iterdir()):
        raise RockerbogieError(f"{str(path)!r} exists and is not an unfinished map: give another name, or remove it")


def discard_store(path: Path) -> None:
    """Remove a map's store; other files in its folder are kept, and the folder with them."""
    for folder in ("map.zarr", "done"):
        shutil.rmtree(path / folder, ignore_errors=True)
    for file in ("ready", "made_from.json"):
        (path / file).unlink(missing_ok=True)
    with suppress(OSError):
        path.rmdir()


def made_from(job: Job, ground: Ground) -> dict[str, Any]:
    """Return the inputs of a map: equal inputs give equal bytes."""
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
        "layers": list(job.layers),
        "rockerbogie": [__version__, NUMERICS],
    }


def _check_same(path: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    """Refuse to mix two maps."""
    now = json.loads(json.dumps(now))
    if other := [name for name in now if before.get(name) != now[name]]:
        what = {
            "heights": "heights of the terrain", "ground": "place of the terrain", "cells": "cells (resolution, bounds)",
            "rockerbogie": "version of rockerbogie",
        }  # fmt: skip
        told = ", ".join(f"another {what.get(name, name)}{_told(before.get(name), now[name])}" for name in other)
        raise RockerbogieError(f"{str(path)!r} holds a map made from {told}: give another name, or take it away to begin anew")


def _told(before: Any, now: Any) -> str:
    """Both values, where they are short enough to help."""
    for value in (before, now):
        if isinstance(value, list) and len(value) == 2 and all(isinstance(v, str) for v in value):
            return f" ({before[0]}, now {now[0]})" if before and before[0] != now[0] else ""
    told = f" ({before}, now {now})"
    return told if len(told) < 60 and not (isinstance(now, str) and len(now) == 64) else ""


def _lay_out(path: Path, job: Job) -> None:
    """Make the layers, blank."""
    zarr = import_zarr()
    group = zarr.create_group(path)
    for name in chosen_layers(job.layers):
        layer = LAYERS[name]
        lead = (min(HEADINGS, len(job.headings)),) if layer.per_heading else ()
        group.create_array(
            name,
            shape=job.shape(name, job.cells.all),
            chunks=(*lead, TILE, TILE),
            dtype=layer.kind,
            fill_value=layer.blank,
            dimension_names=layer.dims,
            # angles are noise to a compressor, and would cost it more time than their settling leaves to spare
            compressors=None if layer.per_heading and layer.kind == "float64" else "auto",
        )


def read(store: Store, lazily: bool) -> dict[str, Any]:
    """The layers of a finished store: lazy dask arrays, or NumPy's."""
    if not lazily:
        return {name: np.asarray(store.arrays[name][...]) for name in store.arrays}
    import dask.array as da

    return {name: da.from_zarr(str(store.path / "map.zarr"), component=name) for name in store.arrays}


def import_zarr() -> Any:
    """Return the zarr package; raise if it is not installed."""
    require("a map on disk", "scale", "zarr", "dask")
    import zarr

    return zarr
