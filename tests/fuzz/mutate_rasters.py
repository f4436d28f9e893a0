"""Mutation of raster files.

`python tools/fuzz_files.py --kind raster` mutates 10,000.

Each mutated file gives terrain or one `TerrainError`, within `LONGEST` seconds. Terrain whose heights differ from those of the
file before mutation must differ in rasterio's own reading too: no height is made up here.
"""

from __future__ import annotations

import random
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import rasterio

import rockerbogie as rb
from support.plane_files import grid, plane, write

LONGEST = 10.0  # s of processor time


def sources(folder: Path) -> list[Path]:
    """Write the files to mutate."""
    place = grid(0.5, -0.5)
    z = plane(place).astype("f4")
    spoilt = z.copy()
    spoilt[3:6, 3:6] = -9999
    ways = (("a.tif", "GTiff", {}), ("b.asc", "AAIGrid", {}), ("c.img", "HFA", {}), ("d.tif", "COG", {}), ("e.cub", "ISIS3", {}))
    made = [write(folder / name, z, place, driver=driver, **more) for name, driver, more in ways]
    made.append(write(folder / "f.tif", spoilt, place, compress="deflate", nodata=np.nan))
    made.append(write(folder / "g.tif", np.rint(z * 100).astype("i2"), place, scales=(0.01,), units=("m",), tiled=True))
    return made


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Return a copy with a few bytes changed, removed, doubled or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        if not out:
            break
        at = min(int(rng.random() ** 2 * len(out)), len(out) - 1)  # headers more often than data
        way = rng.randrange(5)
        if way < 3:
            out[at] = rng.choice((0, 1, 127, 128, 255, out[at] ^ (1 << rng.randrange(8)), rng.randrange(256)))
        elif way == 3:
            del out[at : at + rng.choice((1, 4, 100))]
        else:
            out = out[:at] if rng.random() < 0.3 else out[:at] + out[at : at + 8] + out[at:]
    return bytes(out)


def check(path: Path) -> str:
    """Read one file; compare what is known of its heights with rasterio's own reading."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            terrain = rb.Terrain.from_raster(path, interpolation="linear")
        except rb.RockerbogieError as error:
            return "refused" if "\n" not in str(error) else f"two lines: {error}"
        with rasterio.open(path) as file:
            stored = file.read(1, masked=True)
            own = stored.astype(float) * file.scales[0] + file.offsets[0]
        for _ in range(3):  # a damaged stream may leave GDAL's buffer undefined: then there is no reading to compare with
            with rasterio.open(path) as file:
                again = file.read(1, masked=True)
            if not np.array_equal(np.ma.getdata(again), np.ma.getdata(stored), equal_nan=True):
                return "undefined"
        with rasterio.open(path) as file:
            unit = {"ft": 0.3048, "km": 1000.0}.get(file.units[0] or "m", 1.0)
    known = terrain.z[np.isfinite(terrain.z)]
    values = np.sort(np.ma.compressed(own) * unit)
    values = values[np.isfinite(values)]
    at = np.clip(np.searchsorted(values, known), 1, max(len(values) - 1, 1))
    apart = np.minimum(np.abs(known - values[at - 1]), np.abs(known - values[np.minimum(at, len(values) - 1)]))
    if apart.max() <= 1e-9 * max(1.0, np.abs(known).max()):
        return "read"
    return "heights that the file does not hold" if _repeats(path, terrain) else "undefined"


def _repeats(path: Path, terrain: rb.Terrain) -> bool:
    """Return True if the file gives the same terrain again, so that its heights are defined."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            again = rb.Terrain.from_raster(path, interpolation="linear")
        except rb.RockerbogieError:
            return False
    return np.array_equal(again.z, terrain.z, equal_nan=True)


def run(count: int, seed: int = 0) -> Counter[str]:
    """Mutate and read so many files; raise at the first that breaks a rule."""
    rng = random.Random(seed)
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        originals = [(path, path.read_bytes()) for path in sources(folder)]
        spoilt = folder / "spoilt"
        spoilt.mkdir()
        for n in range(count):
            path, data = rng.choice(originals)
            target = spoilt / path.name
            target.write_bytes(mutate(data, rng))
            start = time.process_time()
            try:
                outcome = check(target)
            except Exception as error:
                raise AssertionError(f"seed {seed}, file {n} ({path.name}): {type(error).__name__}: {error}") from error
            taken = time.process_time() - start
            assert outcome in ("read", "refused", "undefined"), f"seed {seed}, file {n} ({path.name}): {outcome}"
            assert taken < LONGEST, f"seed {seed}, file {n} ({path.name}) took {taken:.1f} s"
            tally[outcome] += 1
            target.unlink()
    return tally
