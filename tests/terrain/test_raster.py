"""Rasters against rasterio's own sampling, and a sentence for each that cannot be used."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.maps.ground import open_ground
from rockerbogie.terrain.raster import read_raster
from support.helpers import assert_close

rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")

from rasterio.transform import Affine  # noqa: E402

RELIEF = np.random.default_rng(0).normal(-4450, 3, (12, 9)).astype(np.float32)
NORTH_UP = Affine(0.5, 0, 501000, 0, -0.25, 2000)  # half a metre by a quarter, corner at (501000, 2000)


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write bands as a GeoTIFF."""

    def make(*bands: np.ndarray, transform: Affine | None = NORTH_UP, crs: str | None = "EPSG:32633", **more: Any) -> Path:
        path = tmp_path / "ground.tif"
        rows, cols = bands[0].shape
        profile = {"driver": "GTiff", "height": rows, "width": cols, "count": len(bands), "dtype": bands[0].dtype, "crs": crs}
        after = {key: more.pop(key) for key in ("scales", "offsets", "units") if key in more}
        with rasterio.open(path, "w", **profile, transform=transform, **more) as raster:
            for k, band in enumerate(bands):
                raster.write(band, k + 1)
            for key, value in after.items():
                setattr(raster, key, value)
        return path

    return make


def sampled(path: Path, terrain: rb.Terrain, stride: int = 1) -> np.ndarray:
    """Rasterio's value at every (stride-th) node of a terrain, and nan where it has none."""
    x, y = np.meshgrid(terrain.x[::stride], terrain.y[::stride])
    with rasterio.open(path) as raster:
        found = raster.sample(zip(x.ravel(), y.ravel(), strict=True), masked=True)
        return np.array([np.ma.filled(v.astype(float), np.nan)[0] for v in found]).reshape(x.shape)


@pytest.mark.parametrize("name", ["marsyard2021/marsyard_terrain_hm.tif", "gale/missionDEM.tif", "perseverance/site78.tif"])
def test_real_rasters_are_as_rasterio_samples_them(data: Callable[[str], Path], name: str) -> None:
    terrain = rb.Terrain.from_raster(data(name))
    assert_close(terrain.z[::11, ::11], sampled(data(name), terrain, 11), 0, "m", "the same pixels")
    assert_close(
        terrain.height(*np.meshgrid(terrain.x[5:9], terrain.y[7:12])), terrain.z[7:12, 5:9], 1e-9, "m", "nodes are centres"
    )
    with rasterio.open(data(name)) as raster:
        assert (terrain.crs is None) == (raster.crs is None)
        assert terrain.crs is None or rasterio.CRS.from_string(terrain.crs) == raster.crs


@pytest.mark.parametrize(
    "transform",
    [
        NORTH_UP,
        Affine(0.5, 0, 501000, 0, 0.25, 2000),
        Affine(-0.5, 0, 501000, 0, -0.25, 2000),
        Affine(-0.5, 0, 501000, 0, 0.25, 2000),
    ],
    ids=["north up", "south up", "east to west", "both"],
)
def test_any_orientation_in_the_file_gives_the_same_terrain(write: Callable[..., Path], transform: Affine) -> None:
    path = write(RELIEF, transform=transform)
    terrain = rb.Terrain.from_raster(path)
    assert terrain.spacing == (0.5, 0.25)
    assert terrain.z.shape == RELIEF.shape
    assert (np.diff(terrain.x) > 0).all()
    assert_close(terrain.z, sampled(path, terrain), 0, "m", "the same pixels")
    left, bottom, right, top = rasterio.open(path).bounds
    west, south = min(left, right) + 0.25, min(bottom, top) + 0.125
    assert terrain.bounds[:2] == (west, south)  # the first node is the south-west pixel's centre


def test_north_is_up_and_the_first_row_is_the_south(write: Callable[..., Path]) -> None:
    heights, spacing, origin, crs = read_raster(write(RELIEF))
    assert np.array_equal(heights, RELIEF[::-1].astype(float))
    assert (spacing, origin, crs) == ((0.5, 0.25), (501000.25, 1997.125), "EPSG:32633")


def test_no_crs_is_allowed(write: Callable[..., Path]) -> None:
    assert rb.Terrain.from_raster(write(RELIEF, crs=None)).crs is None


def test_scaled_and_offset_integers(write: Callable[..., Path]) -> None:
    raw = np.arange(108, dtype=np.int16).reshape(12, 9)
    raw[3, 4] = -32768
    path = write(raw, nodata=-32768, scales=(0.01,), offsets=(-4400.0,), units=("m",))
    heights, *_ = read_raster(path)
    expected = raw[::-1] * 0.01 - 4400
    expected[8, 4] = np.nan
    assert_close(heights, expected, 1e-9, "m", "raw · scale + offset, and no data before that")


@pytest.mark.parametrize("nodata", [-9999.0, np.nan, None])
def test_no_data_is_nan(write: Callable[..., Path], nodata: float | None) -> None:
    relief = RELIEF.copy()
    relief[2, 3] = np.nan if nodata is None else nodata
    terrain = rb.Terrain.from_raster(write(relief, nodata=nodata), interpolation="linear")
    assert np.argwhere(np.isnan(terrain.z)).tolist() == [[9, 3]]


def test_a_mask_is_no_data_too(write: Callable[..., Path]) -> None:
    path = write(RELIEF)
    with rasterio.open(path, "r+") as raster:
        raster.write_mask(np.where(RELIEF < -4450, 0, 255).astype(np.uint8))
    heights, *_ = read_raster(path)
    assert np.array_equal(np.isnan(heights), (RELIEF < -4450)[::-1])


def test_another_band(write: Callable[..., Path]) -> None:
    heights, *_ = read_raster(write(RELIEF, RELIEF + 1), band=2)
    assert np.array_equal(heights, (RELIEF + 1)[::-1].astype(float))


def test_a_window_equals_that_part_of_the_whole(write: Callable[..., Path]) -> None:
    path = write(RELIEF)
    whole, part = rb.Terrain.from_raster(path), rb.Terrain.from_raster(path, window=(501001.0, 1997.6, 501003.25, 5000.0))
    assert part.bounds == (501001.25, 1997.625, 501003.25, 1999.875)  # centres within; beyond the file there is nothing
    assert_close(part.z, whole.z[2:, 2:7], 0, "m", "the same pixels")


def refused(path: Path, sentence: str, **options: Any) -> None:
    with pytest.raises(rb.TerrainError, match=sentence) as caught:
        rb.Terrain.from_raster(path, **options)
    assert "\n" not in str(caught.value)


def test_missing_files_and_other_files_are_refused(tmp_path: Path) -> None:
    refused(tmp_path / "nowhere.tif", "no file '.*nowhere.tif'")
    (tmp_path / "words.tif").write_text("not a raster")
    refused(tmp_path / "words.tif", "words.tif' is not a raster that GDAL can read")
    refused(tmp_path, "is not a raster that GDAL can read")


def test_a_file_cut_short(write: Callable[..., Path]) -> None:
    path = write(np.random.default_rng(0).normal(size=(300, 300)))
    path.write_bytes(path.read_bytes()[:300_000])
    refused(path, "is not a raster that GDAL can read")


@pytest.mark.parametrize("band", [0, 2, -1])
def test_missing_bands_are_refused(write: Callable[..., Path], band: int) -> None:
    refused(write(RELIEF), rf"has 1 band\(s\), counted from 1; band {band} is not one", band=band)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")  # of writing them
@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (
            {"transform": Affine(0.43, 0.12, 501000, 0.25, -0.22, 2000)},
            "rotated grid: turn it north up first, with gdalwarp -r cubic -et 0 -ot Float32 -dstnodata nan",
        ),
        ({"transform": Affine(1, 0, 0, 0, 1, 0)}, "has no georeference, .*: give the side of a cell in metres"),
        ({"transform": None}, "has no georeference, .*: give the side of a cell in metres"),
        (
            {"crs": "EPSG:4326", "transform": Affine(1e-6, 0, 12, 0, -1e-6, 45)},
            r"counts in degrees .*'\+proj=stere \+lat_0=45 \+lon_0=12 \+a=",
        ),
        ({"crs": "EPSG:2048"}, "axes of ground.tif point west and south"),
        ({"units": ("degree",)}, "holds values in 'degree', which is not a known length"),
    ],
    ids=["rotated", "identity", "no place", "degrees", "westing", "slopes"],
)
def test_unusable_grids_are_refused_with_the_remedy(write: Callable[..., Path], options: dict[str, Any], sentence: str) -> None:
    refused(write(RELIEF, **options), sentence)


def test_complex_numbers_are_not_heights(write: Callable[..., Path]) -> None:
    refused(write(RELIEF.astype(np.complex64)), "holds complex64, not heights")


@pytest.mark.parametrize(
    ("window", "sentence"),
    [
        ((0, 0, 10, 10), r"fewer than two pixels a side of ground.tif, which spans \(501000.25, 1997.125, 501004.25, 1999.875\)"),
        ((501000, 1998, 501000.4, 1999), "fewer than two pixels"),
        ((501002, 1999, 501001, 2000), "min below max"),
        ((501000, 1998, np.nan, 2000), "min below max"),
    ],
)
def test_empty_windows_are_refused(write: Callable[..., Path], window: tuple[float, ...], sentence: str) -> None:
    refused(write(RELIEF), sentence, window=window)


def test_all_no_data_is_refused(write: Callable[..., Path]) -> None:
    refused(write(np.full((12, 9), -9999, np.float32), nodata=-9999), "every height of .* is missing")


@pytest.mark.parametrize("fill", [-3.4028234663852886e38, 1e20, np.inf, 1e9, -9999.0, 32767.0, 0.0])
def test_undeclared_missing_data_is_found(write: Callable[..., Path], fill: float) -> None:
    """The same nodes from a file read whole and from one read by windows."""
    relief = RELIEF.copy()
    relief[2, 3] = fill
    expected = RELIEF[::-1].astype(float)
    expected[9, 3] = np.nan
    with pytest.warns(rb.TerrainWarning, match=r"ground.tif stores .*, far from its other heights"):
        terrain = rb.Terrain.from_raster(write(relief), interpolation="linear")
    assert_close(terrain.z, expected, 0, "m", "all other nodes as stored")
    for kind in ("linear", "cubic"):
        with pytest.warns(rb.TerrainWarning, match="taken as missing"):
            held = open_ground(write(relief), 1, kind)  # type: ignore[arg-type]
        assert_close(held.raster.read((0, 12), (0, 9)), expected, 0, "m", "all other nodes as stored")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        declared = rb.Terrain.from_raster(write(relief, nodata=fill), interpolation="linear")
    assert_close(declared.z, expected, 0, "m", "declared: no warning")


@pytest.mark.filterwarnings("error")
def test_heights_that_a_scale_makes_absurd_are_refused(write: Callable[..., Path]) -> None:
    refused(write(RELIEF.astype(np.float64), scales=(1e307,)), "a height of -inf m at row 0, column 0")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("transform", "sentence"),
    [
        (Affine(1e20, 0, 0, 0, -1, 0), r"spacing of .* along x is 1e\+20 m"),
        (Affine(1, 0, 0, 0, -1e-300, 0), "spacing of .* along y is 1e-300 m"),
        (Affine(1, 0, 0, 0, -1e308, 0), r"spacing of .* along y is 1e\+308 m|origin is"),
        (Affine(0.5, 0, 1e12, 0, -0.5, 0), r"reaches to x = 1e\+12 m"),
    ],
)
def test_coordinates_that_lose_digits_are_refused(write: Callable[..., Path], transform: Affine, sentence: str) -> None:
    path = write(RELIEF, transform=transform)
    refused(path, sentence)
    with pytest.raises(rb.TerrainError, match=sentence):
        open_ground(path, 1, "linear")


def test_files_with_too_many_pixels_need_a_window(write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rockerbogie.terrain.raster.MOST_PIXELS", 50)
    refused(write(RELIEF), "would be 9 x 12 pixels, more than 50: give a window")
    assert rb.Terrain.from_raster(write(RELIEF), window=(501001.0, 1997.6, 501003.25, 5000.0)).z.shape == (10, 5)


def test_without_rasterio_the_error_names_the_remedy(write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(RELIEF)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    refused(path, r"pip install 'rockerbogie\[geo\]'")
