"""A plane of known slope through every driver and convention that GDAL can write.

Each file gives pitch and roll within 0.01 degrees of the closed form, or a refusal. If a driver does not keep what was written
(orientation, units, fractions of heights), which rasterio alone shows, there is nothing to compare.
"""

from __future__ import annotations

import itertools
import math
import random
import shutil
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import rockerbogie as rb
from support.plane_files import CENTRE, SHAPE, UTM, assert_plane, grid, plane, read, write

rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")

#: Drivers that can write, and the ending they need.
DRIVERS = {
    "AAIGrid": "asc", "BT": "bt", "COG": "tif", "EHdr": "bil", "ELAS": "dat", "ENVI": "dat", "ERS": "ers", "FIT": "fit",
    "GPKG": "gpkg", "GRIB": "grb", "GS7BG": "grd", "GSAG": "grd", "GSBG": "grd", "GTiff": "tif", "HF2": "hf2", "HFA": "img",
    "ILWIS": "mpr", "ISCE": "isce", "ISIS2": "cub", "ISIS3": "cub", "JP2OpenJPEG": "jp2", "KRO": "kro", "LAN": "lan",
    "MRF": "mrf", "PAux": "raw", "PCIDSK": "pix", "PDS4": "xml", "RRASTER": "grd", "RST": "rst", "SAGA": "sdat",
    "SIGDEM": "sigdem", "USGSDEM": "dem", "VICAR": "vic", "XYZ": "xyz", "ZMap": "dat", "Zarr": "zarr",
}  # fmt: skip
ORIENTATIONS = {
    "north up": (0.5, -0.5, 0.0),
    "south up": (0.5, 0.5, 0.0),
    "east to west": (-0.5, -0.5, 0.0),
    "both": (-0.5, 0.5, 0.0),
    "unequal": (0.5, -0.25, 0.0),
    "noise": (0.5, -0.5, 1e-13),
    "turned 90": (0.5, -0.5, math.pi / 2),
    "turned -90": (0.5, -0.5, -math.pi / 2),
    "turned 30": (0.5, -0.5, math.pi / 6),
}
FOOT = 1200 / 3937
#: CRS, length of its unit in metres, and a centre in that unit where it is true to scale.
FRAMES: dict[str, tuple[Any, float, tuple[float, float]]] = {
    "UTM": (UTM, 1.0, CENTRE),
    "none": (None, 1.0, CENTRE),
    "state plane, US feet": ("EPSG:6529", FOOT, (1_640_000.0, 1_500_000.0)),
    "UTM, km": ("+proj=utm +zone=33 +datum=WGS84 +units=km", 1000.0, (500.02, 4000.02)),
    "site grid, feet": ('LOCAL_CS["site",UNIT["foot",0.3048],AXIS["x",EAST],AXIS["y",NORTH]]', 0.3048, (100.0, 50.0)),
    "Web Mercator at 60 N": ("EPSG:3857", 1.0, (1_669_792.4, 8_399_737.9)),
    "Mars, lat_ts 0 at 18 N": ("+proj=eqc +lat_ts=0 +lon_0=0 +R=3396190", 1.0, (4_590_825.0, 1_093_025.0)),
    "Moon, polar": ("+proj=stere +lat_0=-90 +R=1737400", 1.0, (2000.0, 3000.0)),
    "degrees": ("EPSG:4326", math.nan, (15.0, 45.0)),
}
#: Name of a height's unit, and its length in metres.
UNITS = {None: 1.0, "m": 1.0, "metre": 1.0, "ft": 0.3048, "US survey foot": FOOT, "km": 1000.0, "cm": 0.01}
#: Value stored where data is missing, and the tag.
FILLS: list[tuple[float | None, float | None]] = [
    *((None, None), (np.nan, None), (np.nan, np.nan), (-9999.0, -9999.0), (-9999.0, None), (-9999.0, np.nan), (0.0, None)),
    *((9999.0, None), (-32768.0, None), (-3.4028226550889045e38, None), (1e20, None), (-32767.0, -9999.0), (99999.0, -1.0)),
    (np.inf, None),
]
HIDDEN = (slice(2, 8), slice(3, 12))  # pixels where data is missing, away from the middle


class Convention(NamedTuple):
    """One way to write the plane."""

    driver: str
    kind: str
    orientation: str
    frame: str
    unit: str | None
    fill: tuple[float | None, float | None]


def write_plane(folder: Path, way: Convention) -> tuple[Path, np.ndarray, Any]:
    """Write the plane; return the file, its heights in its unit, and its transform."""
    crs, length, centre = FRAMES[way.frame]
    step_x, step_y, turn = ORIENTATIONS[way.orientation]
    scale = 1e-5 if math.isnan(length) else 1 / length
    transform = grid(step_x * scale, step_y * scale, centre, turn=turn)
    heights = z = plane(transform, centre, unit=1 / scale) / UNITS[way.unit]
    fill, tag = way.fill
    more: dict[str, Any] = {} if tag is None else {"nodata": tag}
    if way.unit is not None:
        more["units"] = (way.unit,)
    if way.kind.startswith("int"):
        step = 0.0002 / UNITS[way.unit]
        offset = 90.0 / UNITS[way.unit]
        z = np.rint((z - offset) / step)
        more |= {"scales": (step,), "offsets": (offset,)}
    z = z.astype(way.kind)
    if fill is not None:
        z[HIDDEN] = fill
    return write(folder / f"plane.{DRIVERS[way.driver]}", z, transform, crs, way.driver, **more), heights, transform


def kept(path: Path, way: Convention, z: np.ndarray, transform: Any) -> bool:
    """Return True if a file holds what was written, by rasterio's own reading."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(path) as file:
            if file.count == 0:
                return True
            values = file.read(1).astype(float) * file.scales[0] + file.offsets[0]
            length = file.crs.linear_units_factor[1] if file.crs and not file.crs.is_geographic else FRAMES[way.frame][1]
            cell = max(abs(transform.a), abs(transform.b))
            known = np.ones(SHAPE, dtype=bool)
            if way.fill[0] is not None:
                known[HIDDEN] = False
            return bool(
                values.shape == SHAPE
                and np.abs((values - z)[known]).max() * UNITS[way.unit] < 2e-4
                and np.abs(np.subtract(file.transform, transform)[[0, 1, 3, 4]]).max() < 1e-6 * cell
                and np.abs(np.subtract(file.transform, transform)[[2, 5]]).max() < 0.01 * cell
                and (way.unit in (None, "m", "metre") or file.units[0] == way.unit)
                and bool(file.crs) == (way.frame != "none")
                and (math.isnan(length) or math.isclose(length, FRAMES[way.frame][1], rel_tol=1e-5))
            )


def check(folder: Path, way: Convention) -> str:
    """Write one file, read it, compare; return what happened."""
    try:
        path, z, transform = write_plane(folder, way)
        whole = kept(path, way, z, transform)
    except Exception:  # the driver cannot write this: nothing to read
        return "not written"
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            terrain = rb.Terrain.from_raster(path)
        except rb.TerrainError:
            return "refused"
    if not whole:
        return "lost by the driver"
    assert way.frame not in ("Web Mercator at 60 N", "Mars, lat_ts 0 at 18 N", "degrees"), way
    assert way.orientation != "turned 30", way
    assert_plane(terrain, says=str(way))
    fill, _ = way.fill
    if fill is not None:
        assert np.isnan(terrain.z).sum() == np.zeros(SHAPE)[HIDDEN].size, way
        with rasterio.open(path) as file:
            declared = not file.read_masks(1)[HIDDEN].any()
        if np.isfinite(fill) and not declared:
            assert any("taken as missing" in str(w.message) or "stores" in str(w.message) for w in told), way
    return "right"


def conventions(driver: str, count: int, seed: int = 0) -> list[Convention]:
    """Return the plain convention and random others."""
    rng = random.Random(f"{driver} {seed}")
    plain = Convention(driver, "float32", "north up", "UTM", None, (None, None))
    every = (plain._replace(orientation=name) for name in ORIENTATIONS)
    more = itertools.chain(
        (plain._replace(frame=name) for name in FRAMES),
        (plain._replace(unit=unit) for unit in UNITS),
        (plain._replace(fill=fill) for fill in FILLS),
        (plain._replace(kind=kind) for kind in ("float64", "int16", "int32")),
    )
    mixed = (
        Convention(
            driver, rng.choice(("float32", "float64", "int32")), rng.choice(list(ORIENTATIONS)), rng.choice(list(FRAMES)),
            rng.choice(list(UNITS)), (None, None) if rng.random() < 0.3 else rng.choice(FILLS),
        )
        for _ in range(count)
    )  # fmt: skip
    return [*every, *(more if driver == "GTiff" else ()), *mixed]


def run(driver: str, folder: Path, count: int, seed: int = 0) -> Counter[str]:
    """Check the conventions of one driver; return how often each outcome was met."""
    outcomes: Counter[str] = Counter()
    for n, way in enumerate(conventions(driver, count, seed)):
        if way.kind.startswith("int") and way.fill[0] is not None and not (np.isfinite(way.fill[0]) and abs(way.fill[0]) < 2**31):
            continue
        place = folder / f"{driver}{n}"
        place.mkdir()
        outcomes[check(place, way)] += 1
        shutil.rmtree(place)
    return outcomes


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_plane_is_right_or_refused(driver: str, tmp_path: Path) -> None:
    outcomes = run(driver, tmp_path, 8)
    if set(outcomes) == {"not written"}:
        pytest.skip(f"this GDAL cannot write {driver}")


def test_geotiff_keeps_every_convention(tmp_path: Path) -> None:
    """Most of the product is right, and what is refused is what must be."""
    outcomes = run("GTiff", tmp_path, 0)
    assert outcomes["right"] >= 35
    assert outcomes["refused"] == 4  # turned by 30 degrees, and three frames


@pytest.mark.parametrize("frame", ["Web Mercator at 60 N", "Mars, lat_ts 0 at 18 N", "degrees"])
def test_frames_that_are_not_true_to_scale_are_refused(frame: str, tmp_path: Path) -> None:
    found = read(write_plane(tmp_path, Convention("GTiff", "float32", "north up", frame, None, (None, None)))[0])
    assert isinstance(found, rb.TerrainError)
    assert "gdalwarp -r cubic -et 0 -ot Float32 -dstnodata nan -t_srs '+proj=stere" in str(found)


if __name__ == "__main__":
    import tempfile

    for name in DRIVERS:
        with tempfile.TemporaryDirectory() as made:
            print(name, dict(run(name, Path(made), int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)), flush=True)
