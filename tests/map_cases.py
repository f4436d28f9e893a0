"""Maps made by hand, as `traversability` lays them out."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

NAMES = ("pitch", "roll", "tilt", "rocker", "bogie", "clearance", "unsettled")
ANGLES = ("tilt", "roll", "pitch", "rocker", "bogie_left", "bogie_right")


def drawn_map(rng: np.random.Generator, headings: int, rows: int, cols: int, blocked: float = 0.3) -> xr.Dataset:
    """A map of random numbers: a share of states beyond a limit, some cells unknown, cells of half a metre."""
    shape = (headings, rows, cols)
    tilt = rng.uniform(0, 0.5, shape)
    exceeded = np.where(rng.random(shape) < blocked, 1 << rng.integers(0, 7, shape), 0).astype(np.uint8)
    unknown = rng.random((rows, cols)) < 0.05
    exceeded[:, unknown] = 1 << NAMES.index("unsettled")
    return map_of(exceeded, tilt, unknown, rng)


def map_of(exceeded: np.ndarray, tilt: np.ndarray, unknown: np.ndarray, rng: np.random.Generator) -> xr.Dataset:
    """A map of given limits exceeded and tilts (heading, y, x); everything else random."""
    headings, rows, cols = exceeded.shape
    three, two = ("heading", "y", "x"), ("y", "x")
    layers = {name: np.where(unknown, np.nan, rng.uniform(-0.3, 0.3, exceeded.shape)) for name in ANGLES}
    layers["tilt"] = np.where(unknown, np.nan, tilt)
    layers["clearance"] = np.where(unknown, np.nan, rng.uniform(-0.1, 0.7, exceeded.shape))
    free = exceeded == 0
    heading = 2 * np.pi * np.arange(headings) / headings
    least = np.where(free, layers["tilt"], np.inf)
    data = {name: (three, values, {"units": "m" if name == "clearance" else "rad"}) for name, values in layers.items()}
    data["status"] = (three, np.where(unknown, 2, 0) * np.ones(exceeded.shape, dtype=np.uint8), {"units": "1"})
    data["status"] = (three, data["status"][1].astype(np.uint8), {"units": "1"})
    flags = {"flag_masks": (1 << np.arange(7)).astype(np.uint8), "flag_meanings": " ".join(NAMES)}
    data["exceeded"] = (three, exceeded, flags)
    data["passable"] = (two, np.where(unknown, np.nan, free.mean(axis=0)).astype(np.float32), {"units": "1"})
    worst, best = np.where(unknown, np.nan, tilt.max(axis=0)), np.where(unknown, np.nan, tilt.min(axis=0))
    data["worst_tilt"], data["best_tilt"] = (two, worst, {"units": "rad"}), (two, best, {"units": "rad"})
    towards = np.where(free.any(axis=0) & ~unknown, heading[np.argmin(least, axis=0)], np.nan)
    data["best_heading"] = (two, towards, {"units": "rad"})
    data["worst_clearance"] = (two, layers["clearance"].min(axis=0), {"units": "m"})
    data["worst_exceeded"] = (two, np.bitwise_or.reduce(exceeded, axis=0), flags)
    for name, (_, _, attrs) in data.items():
        attrs.setdefault("long_name", name.replace("_", " "))
    x, y = 1000.25 + 0.5 * np.arange(cols), 2000.25 + 0.5 * np.arange(rows)
    coords = {
        "heading": ("heading", heading, {"units": "rad"}),
        "y": ("y", y, {"units": "m"}),
        "x": ("x", x, {"units": "m"}),
    }
    limits = json.dumps({"tilt": 0.5, "pitch": 0.3, "roll": 0.3, "rocker": None, "bogie": None, "clearance": 0.0})
    attrs = {
        "crs": "EPSG:32633",
        "rover": "curiosity",
        "terrain": "drawn",
        "limits": limits,
        "resolution": 0.5,
        "mode": "contact",
    }
    return xr.Dataset(data, coords, attrs | {"rockerbogie_version": "0.1.0"})
