"""Maps with given values, in the layout of `traversability`."""

from __future__ import annotations

import numpy as np
import xarray as xr

import rockerbogie as rb
from rockerbogie.maps.layers import LAYERS, dataset
from rockerbogie.maps.limits import BITS, Limits

ANGLES = ("tilt", "roll", "pitch", "rocker", "bogie_left", "bogie_right")


def drawn_map(rng: np.random.Generator, headings: int, rows: int, cols: int, blocked: float = 0.3) -> xr.Dataset:
    """Return a map of random values, cells of 0.5 m.

    A share `blocked` of its states is beyond a limit; some cells have no data.
    """
    shape = (headings, rows, cols)
    tilt = rng.uniform(0, 0.5, shape)
    exceeded = np.where(rng.random(shape) < blocked, 1 << rng.integers(0, 7, shape), 0).astype(np.uint8)
    unknown = rng.random((rows, cols)) < 0.05
    exceeded[:, unknown] = BITS["unsettled"]
    return map_of(exceeded, tilt, unknown, rng)


def map_of(exceeded: np.ndarray, tilt: np.ndarray, unknown: np.ndarray, rng: np.random.Generator) -> xr.Dataset:
    """Return a map of given limits exceeded and tilts (heading, y, x); all else is random."""
    headings, rows, cols = exceeded.shape
    data = {name: np.where(unknown, np.nan, rng.uniform(-0.3, 0.3, exceeded.shape)) for name in ANGLES}
    data["tilt"] = np.where(unknown, np.nan, tilt)
    data["clearance"] = np.where(unknown, np.nan, rng.uniform(-0.1, 0.7, exceeded.shape))
    data["status"] = np.where(unknown, rb.Status.NO_DATA, rb.Status.CONVERGED) * np.ones(exceeded.shape, dtype=np.uint8)
    data["exceeded"] = exceeded
    free = exceeded == 0
    heading = 2 * np.pi * np.arange(headings) / headings
    data["passable"] = np.where(unknown, np.nan, free.mean(axis=0)).astype(np.float32)
    data["worst_tilt"], data["best_tilt"] = (np.where(unknown, np.nan, least(tilt, axis=0)) for least in (np.max, np.min))
    flattest = heading[np.argmin(np.where(free, data["tilt"], np.inf), axis=0)]
    data["best_heading"] = np.where(free.any(axis=0) & ~unknown, flattest, np.nan)
    data["worst_clearance"] = data["clearance"].min(axis=0)
    data["worst_exceeded"] = np.bitwise_or.reduce(exceeded, axis=0)
    data = {name: data[name].astype(layer.kind) for name, layer in LAYERS.items() if name in data}
    limits = Limits(tilt=0.5, pitch=0.3, roll=0.3, clearance=0.0).to_json()
    about = {
        "crs": "EPSG:32633",
        "rover": "curiosity",
        "terrain": "drawn",
        "limits": limits,
        "resolution": 0.5,
        "mode": "contact",
    }
    x, y = 1000.25 + 0.5 * np.arange(cols), 2000.25 + 0.5 * np.arange(rows)
    return dataset(data, heading, x, y, about | {"rockerbogie_version": rb.__version__})
