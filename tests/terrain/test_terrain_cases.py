"""Terrain files that others have met in public: the right attitude, or one sentence."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.terrain.georeference import unit_length
from rockerbogie.terrain.raster import read_raster
from support.helpers import assert_close
from support.patience import PATIENCE
from support.plane_files import CENTRE, GX, SHAPE, YAW, Z0, assert_plane, attitude, grid, plane, read, write

rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")

from rasterio.enums import Resampling  # noqa: E402
from rasterio.warp import calculate_default_transform, reproject  # noqa: E402
from rasterio.warp import transform as transform_points  # noqa: E402

HALF = grid(0.5, -0.5)
FOOT = 1200 / 3937


def warned(path: str | Path, *sentences: str, **options: Any) -> rb.Terrain:
    """Read a file, and assert that its warnings are these."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        terrain = rb.Terrain.from_raster(path, **options)
    found = [str(w.message) for w in told if issubclass(w.category, rb.TerrainWarning)]
    assert len(found) == len(sentences), found
    for sentence, message in zip(sentences, found, strict=True):
        assert sentence in message
    return terrain


def refused(path: str | Path, *sentences: str, **options: Any) -> str:
    """Assert that a file is refused in one line that holds these sentences."""
    found = read(path, **options)
    assert isinstance(found, rb.TerrainError)
    for sentence in sentences:
        assert sentence in str(found)
    return str(found)


def label(folder: Path, unit: str, scale: str, offset: str, map_scale: str, sample: str) -> Path:
    """Write a PDS3 label of a polar map of the Moon, as LOLA's are."""
    n = 101
    kind, bits = sample.split()
    path = folder / "LDEM.LBL"
    path.write_text(
        f'PDS_VERSION_ID = "PDS3"\nRECORD_TYPE = FIXED_LENGTH\nRECORD_BYTES = {n * int(bits) // 8}\nFILE_RECORDS = {n}\n'
        f'^IMAGE = "LDEM.IMG"\nTARGET_NAME = MOON\nOBJECT = IMAGE\n NAME = HEIGHT\n LINES = {n}\n LINE_SAMPLES = {n}\n'
        f" SAMPLE_TYPE = {kind}\n SAMPLE_BITS = {bits}\n UNIT = {unit}\n SCALING_FACTOR = {scale}\n OFFSET = {offset}\n"
        'END_OBJECT = IMAGE\nOBJECT = IMAGE_MAP_PROJECTION\n MAP_PROJECTION_TYPE = "POLAR STEREOGRAPHIC"\n'
        " A_AXIS_RADIUS = 1737.4 <KM>\n B_AXIS_RADIUS = 1737.4 <KM>\n C_AXIS_RADIUS = 1737.4 <KM>\n"
        ' POSITIVE_LONGITUDE_DIRECTION = "EAST"\n CENTER_LATITUDE = -90.0 <DEGREE>\n CENTER_LONGITUDE = 0.0 <DEGREE>\n'
        f" LINE_FIRST_PIXEL = 1\n LINE_LAST_PIXEL = {n}\n SAMPLE_FIRST_PIXEL = 1\n SAMPLE_LAST_PIXEL = {n}\n"
        f" MAP_PROJECTION_ROTATION = 0.0\n MAP_RESOLUTION = 1516.17 <PIXEL/DEGREE>\n MAP_SCALE = {map_scale}\n"
        " LINE_PROJECTION_OFFSET = 50.0\n SAMPLE_PROJECTION_OFFSET = 50.0\nEND_OBJECT = IMAGE_MAP_PROJECTION\nEND\n"
    )
    return path


@pytest.mark.parametrize("map_scale", ["20 <METERS/PIXEL>", "0.02 <KM/PIXEL>"])
@pytest.mark.parametrize(
    ("unit", "scale", "offset", "sample"),
    [
        ("KILOMETER", "1", "1737.4", "PC_REAL 32"),
        ('"KM"', "1", "1737.4", "PC_REAL 32"),
        ("METER", "1", "0", "PC_REAL 32"),
        ("METER", "0.5", "1737400.", "LSB_INTEGER 16"),
        ("METER", "0.25", "-8000", "MSB_UNSIGNED_INTEGER 16"),
    ],
)
def test_pds3_labels(tmp_path: Path, unit: str, scale: str, offset: str, sample: str, map_scale: str) -> None:
    """Units, scales and offsets of labels: heights are in metres."""
    z = plane(grid(20, -20, (0, 0), (101, 101)), (0, 0), (101, 101))
    length = 1000.0 if "K" in unit else 1.0
    radius = 1737400.0 if offset.startswith("1737") else 0.0
    stored = z / length if sample == "PC_REAL 32" else np.rint((z + radius - float(offset)) / float(scale))
    kind = {"PC_REAL 32": "<f4", "LSB_INTEGER 16": "<i2", "MSB_UNSIGNED_INTEGER 16": ">u2"}[sample]
    stored.astype(kind).tofile(tmp_path / "LDEM.IMG")
    terrain = read(label(tmp_path, unit, scale, offset, map_scale, sample))
    assert isinstance(terrain, rb.Terrain), terrain
    assert terrain.spacing == (20.0, 20.0)
    assert_plane(terrain)
    assert_close(terrain.height(0, 0), Z0 + radius, 0.2, "m", "above the centre, or the label's radius")


@pytest.mark.parametrize(
    ("name", "length"),
    [
        *((name, 1.0) for name in ("", "m", "Metre", "METERS", "[m]", "m.", "meters above areoid", "metres (EGM96)")),
        *((name, 1000.0) for name in ("km", "KILOMETER", "kilometres")),
        *((name, 0.01) for name in ("cm", "centimeters")),
        *((name, 0.3048) for name in ("ft", "feet", "Foot", "international foot")),
        *((name, FOOT) for name in ("US survey foot", "us_survey_feet", "ftUS", "us-ft", "Foot_US")),
        *((name, None) for name in ("degree", "deg", "%", "K", "DN", "m/s", "counts")),
    ],
)
def test_names_of_units(name: str, length: float | None) -> None:
    assert unit_length(name) == length


def test_heights_and_positions_in_feet(tmp_path: Path) -> None:
    """A vertical CRS in feet over metres, and a state plane in feet with heights in feet."""
    path = write(tmp_path / "navd.tif", (plane(HALF) / FOOT).astype("f4"), HALF, "EPSG:26913+6360")
    terrain = warned(path)
    assert_plane(terrain)
    assert terrain.crs == "EPSG:26913"
    centre = (1_640_000.0, 1_500_000.0)
    place = grid(0.5 / FOOT, -0.5 / FOOT, centre)
    path = write(tmp_path / "state.tif", (plane(place, centre, unit=FOOT) / FOOT).astype("f4"), place, "EPSG:6529+6360")
    terrain = warned(path, "x and y of state.tif are converted from US survey foot (0.3048006 m) to metres")
    assert_plane(terrain)
    lon, lat = (v[0] for v in transform_points("EPSG:6529", "EPSG:4326", [centre[0]], [centre[1]]))
    xmin, ymin, xmax, ymax = terrain.bounds
    there = transform_points(terrain.crs, "EPSG:4326", [(xmin + xmax) / 2], [(ymin + ymax) / 2])
    assert_close([there[0][0], there[1][0]], [lon, lat], 1e-9, "deg", "the CRS in metres has the same places")


def test_a_local_crs_in_feet(tmp_path: Path) -> None:
    crs = 'LOCAL_CS["site grid",UNIT["foot",0.3048],AXIS["x",EAST],AXIS["y",NORTH]]'
    place = grid(0.5 / 0.3048, -0.5 / 0.3048, (0, 0))
    terrain = warned(
        write(tmp_path / "site.tif", plane(place, (0, 0), unit=0.3048).astype("f4"), place, crs), "converted from foot"
    )
    assert_plane(terrain)
    assert_close(terrain.spacing, 0.5, 1e-12, "m", "half a metre")


def test_depths_are_refused(tmp_path: Path) -> None:
    refused(write(tmp_path / "sea.tif", plane(HALF).astype("f4"), HALF, "EPSG:32633+5831"), "depths, counted downwards")


@pytest.mark.parametrize(
    ("crs", "place", "low", "high"),
    [
        ("EPSG:3857", (1_669_792.4, 8_399_737.9), "1.995", "1.998"),
        ("+proj=eqc +lat_ts=0 +R=3396190", (4_590_825.3, 1_093_025.4), "1", "1.054"),
        ("+proj=eqc +lat_ts=0 +R=3396190", (1000.0, 2_667_361.0), "1", "1.414"),
    ],
)
def test_projections_not_true_to_scale_are_refused_with_a_command_that_helps(
    tmp_path: Path, crs: str, place: tuple[float, float], low: str, high: str
) -> None:
    """Factors are those of the closed form; the command, run to its end, gives the plane."""
    path = write(tmp_path / "stretched.tif", local_plane(grid(1, -1, place), crs), grid(1, -1, place), crs)
    said = refused(path, f"a metre on the ground is {low} to {high} m in the projection of stretched.tif")
    assert_plane(warned(run_advice(said, path)))


def test_degrees_are_refused_with_a_local_projection_on_the_same_body(tmp_path: Path) -> None:
    moon = 'GEOGCS["Moon 2000",DATUM["D",SPHEROID["Moon",1737400,0]],PRIMEM["Greenwich",0],UNIT["Degree",0.0174532925199433]]'
    step = math.degrees(0.5 / 1737400)
    place = grid(step / math.cos(math.radians(60)), -step, (10.0, 60.0))
    path = write(tmp_path / "moon.tif", local_plane(place, moon), place, moon)
    said = refused(path, "moon.tif counts in degrees", "'+proj=stere +lat_0=60 +lon_0=10 +R=1737400'")
    assert_plane(warned(run_advice(said, path)))


def local_plane(transform: Any, crs: str) -> np.ndarray:
    """Return the plane over true metres east and north of the middle of the map."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    x, y = transform * (col + 0.5, row + 0.5)
    given = rasterio.CRS.from_user_input(crs)
    body = "+proj=longlat +datum=WGS84" if crs == "EPSG:3857" else f"+proj=longlat +R={1737400 if 'Moon' in crs else 3396190}"
    lon, lat = (np.asarray(v).reshape(x.shape) for v in transform_points(given, body, x.ravel(), y.ravel()))
    middle = math.radians(float(lat.mean()))
    if "WGS84" in body:
        square = 0.00669437999014
        under = 1 - square * math.sin(middle) ** 2
        across, along = 6378137 / math.sqrt(under), 6378137 * (1 - square) / under**1.5
    else:
        across = along = float(body.split("=")[-1])
    east, north = np.radians(lon - lon.mean()) * across * math.cos(middle), np.radians(lat - lat.mean()) * along
    return (Z0 + GX * east - 0.05 * north).astype("f4")


def run_advice(said: str, path: Path) -> Path:
    """Run the gdalwarp command of a message; without gdalwarp, the same in rasterio."""
    command = said[said.index("gdalwarp") :]
    words = [word.strip("'") for word in shlex.split(command)]
    made = path.with_name(words[-1])
    assert words[-2] == path.name
    if tool := shutil.which("gdalwarp"):
        subprocess.run([tool, "-q", "-overwrite", *words[1:]], cwd=path.parent, check=True, timeout=PATIENCE)
        return made
    assert words[1:8] == ["-r", "cubic", "-et", "0", "-ot", "Float32", "-dstnodata"]
    with rasterio.open(path) as source:
        target = words[words.index("-t_srs") + 1] if "-t_srs" in words else source.crs
        size = (source.width, source.height)
        side = float(words[words.index("-tr") + 1]) if "-tr" in words else None
        place, cols, rows = calculate_default_transform(source.crs, target, *size, *source.bounds, resolution=side)
        z, crs = np.full((rows, cols), np.nan, "f4"), target
        reproject(
            rasterio.band(source, 1), z, dst_transform=place, dst_crs=crs, dst_nodata=np.nan, resampling=Resampling.cubic,
            tolerance=0,
        )  # fmt: skip
    return write(made, z, place, crs, nodata=math.nan)


def test_rotated_grids(tmp_path: Path) -> None:
    """Quarter turns and noise are read; the command for other turns gives the plane."""
    for turn in (0.0, 1e-13, math.radians(1e-7), math.pi / 2, -math.pi / 2):
        place = grid(0.5, -0.5, turn=turn)
        assert_plane(warned(write(tmp_path / "turned.tif", plane(place).astype("f4"), place)), says=str(turn))
    for turn in (math.radians(0.1), math.radians(30)):
        place = grid(0.5, -0.5, turn=turn)
        path = write(tmp_path / "turned.tif", plane(place).astype("f4"), place)
        made = warned(run_advice(refused(path, "turned.tif is a rotated grid"), path))
        assert_plane(made)
        if turn > 0.1:
            assert 0.2 < np.isnan(made.z).mean() < 0.6


GAP = (slice(None), slice(12, 18))


@pytest.mark.parametrize(
    ("stored", "tag"),
    [
        *((v, None) for v in (-9999, 9999, 99999, -32768, -32767, 0, -10000, -9999.9, 65535, 1e20, -1e32, 1.70141e38, np.inf)),
        *((-3.4028234663852886e38, tag) for tag in (None, -3.4e38, -3.40282e38, -3.4028226550889045e38)),
        *((-9999, tag) for tag in (-9999, np.nan, -32768)),
        *((v, None) for v in (-3.4028226550889045e38, -3.4028228579130005e38, 9.969209968386869e36)),
    ],
)
def test_missing_data_by_its_values(tmp_path: Path, stored: float, tag: float | None) -> None:
    z = plane(HALF)
    z[GAP] = stored
    path = write(tmp_path / "gap.tif", z.astype("f4"), HALF, nodata=tag)
    terrain = read(path)
    assert isinstance(terrain, rb.Terrain)
    assert np.isnan(terrain.z[GAP]).all()
    assert np.isnan(terrain.z).sum() == z[GAP].size
    assert_plane(terrain, lambda t: (t.x[31], t.y[20]))
    over = rb.settle(rb.load_rover("curiosity"), terrain, terrain.x[15], terrain.y[20], YAW)
    assert over.status == rb.Status.NO_DATA


def test_missing_data_beside_wide_relief(tmp_path: Path) -> None:
    """Fill values are found by their cliffs; the same heights on a slope are kept."""
    high = np.linspace(-9900, -2000, 44) + np.zeros((40, 1))
    spoilt = high.copy()
    spoilt[5:9, 20:24] = -9999
    place = grid(200.0, -200.0)
    terrain = read(write(tmp_path / "low.tif", spoilt.astype("f4"), place))
    assert isinstance(terrain, rb.Terrain)
    # -9999 lies within 1 % of a height: it is not taken as missing, and nothing else may be
    assert np.isnan(terrain.z).sum() in (0, 16)
    slope = np.arange(9900, 10100, dtype="i2").reshape(1, -1) + np.zeros((60, 1), "i2")
    terrain = read(write(tmp_path / "slope.tif", slope, grid(5.0, -5.0, shape=slope.shape)))
    assert isinstance(terrain, rb.Terrain)
    assert not np.isnan(terrain.z).any(), "9999 is a height where 9998 and 10000 are"


def test_a_virtual_mosaic_with_a_gap(tmp_path: Path) -> None:
    z = plane(HALF).astype("f4")
    for name, cols in (("l", slice(0, 14)), ("r", slice(20, 44))):
        write(tmp_path / f"{name}.tif", z[:, cols], HALF * HALF.translation(cols.start, 0))
    source = (
        "<SimpleSource><SourceFilename relativeToVRT='1'>{}.tif</SourceFilename><SourceBand>1</SourceBand>"
        "<SrcRect xOff='0' yOff='0' xSize='{}' ySize='40'/><DstRect xOff='{}' yOff='0' xSize='{}' ySize='40'/></SimpleSource>"
    )
    place = ", ".join(repr(v) for v in HALF.to_gdal())
    path = tmp_path / "gap.vrt"
    path.write_text(
        f"<VRTDataset rasterXSize='44' rasterYSize='40'><SRS>EPSG:32633</SRS><GeoTransform>{place}</GeoTransform>"
        f"<VRTRasterBand dataType='Float32' band='1'>{source.format('l', 14, 0, 14)}{source.format('r', 24, 20, 24)}"
        "</VRTRasterBand></VRTDataset>"
    )
    terrain = warned(path, "gap.vrt stores 0, far from its other heights")
    assert np.isnan(terrain.z[:, 14:20]).all()
    maps = rb.traversability(rb.load_rover("curiosity"), terrain, 4, 1.0)
    assert not (maps["passable"].values[:, 7:10] > 0).any()


def test_zeros_beside_cliffs_cause_a_warning(tmp_path: Path) -> None:
    """Zeros near the other heights may be a floor: they are kept."""
    z = np.where(np.arange(44) < 20, 0.0, 3.0 + np.sqrt(np.arange(44))) + np.zeros((40, 1))
    path = write(tmp_path / "yard.tif", z.astype("f4"), HALF)
    terrain = warned(
        path, "yard.tif stores exactly 0 in 800 pixels, with cliffs around them: if 0 means missing data, declare it"
    )
    assert not np.isnan(terrain.z).any()


def test_pictures_are_refused(tmp_path: Path) -> None:
    grey = ((plane(HALF) - 90) * 10).astype("u1")
    opaque = np.full_like(grey, 255)
    path = write(tmp_path / "rgba.tif", np.stack([grey, grey, grey, opaque]), HALF, photometric="RGB", alpha="YES")
    for band, colour in ((1, "red"), (2, "green"), (3, "blue"), (4, "alpha")):
        refused(path, f"band {band} of rgba.tif is the {colour} of a picture", band=band)
    path = write(tmp_path / "palette.tif", grey, HALF)
    with rasterio.open(path, "r+") as file:
        file.write_colormap(1, {k: (k, 0, 255 - k, 255) for k in range(256)})
    refused(path, "palette of a picture")


def test_an_alpha_band_hides_missing_data(tmp_path: Path) -> None:
    z = plane(HALF).astype("f4")
    alpha = np.full_like(z, 255)
    z[GAP], alpha[GAP] = 97.0, 0  # a plausible height
    path = write(tmp_path / "alpha.tif", np.stack([z, alpha]), HALF, alpha="YES")
    terrain = warned(path)
    assert np.isnan(terrain.z[GAP]).all()
    assert np.isnan(terrain.z).sum() == z[GAP].size


def test_terraces_are_reported_in_degrees(tmp_path: Path) -> None:
    """Steps of 0.5 m over 5 m are 5.7 degrees; fine steps and even planes are not reported."""
    place = grid(5.0, -5.0, shape=(80, 80))
    z = 100 + 0.08 * plane(place, shape=(80, 80)) + 2 * np.sin(np.arange(80) / 9)
    for kind, scale in (("i2", 0.5), ("f4", 1.0)):
        stored = (np.rint(z / 0.5) * (1 if kind == "i2" else 0.5)).astype(kind)
        path = write(tmp_path / "steps.tif", stored, place, scales=(scale,))
        warned(path, "heights of steps.tif come in steps of 0.5 m, which is 5.7° from one cell to the next")
    warned(write(tmp_path / "fine.tif", np.rint(z / 0.002).astype("i4"), place, scales=(0.002,)))
    warned(write(tmp_path / "even.tif", plane(HALF).astype("f4"), HALF))


def test_files_without_georeference_need_a_cell(tmp_path: Path) -> None:
    """North is up, the south-west corner is (0, 0), and the cell is in metres."""
    z = plane(grid(0.05, -0.05, (0, 0)), (0, 0)) - Z0
    path = tmp_path / "m.pgm"
    levels = np.rint((z - z.min()) * 1000).astype(">u2")
    path.write_bytes(b"P5 44 40 65535\n" + levels.tobytes())
    refused(path, "m.pgm has no georeference", "give the side of a cell in metres (cell=, or --cell)")
    terrain = read(path, cell=0.05)
    assert isinstance(terrain, rb.Terrain)
    assert_close(terrain.bounds, (0.025, 0.025, 2.175, 1.975), 1e-12, "m", "centres of cells")
    assert_close(terrain.z, levels[::-1].astype(float), 0, "m", "grey values as heights")
    refused(write(tmp_path / "placed.tif", z.astype("f4"), HALF), "has a CRS and cells of 0.5", cell=0.05)
    for cell in (0, -1, math.nan, "a"):
        refused(path, "give the side of a cell, a finite number of metres above 0", cell=cell)


def test_degrees_without_a_crs_are_refused(tmp_path: Path) -> None:
    step = 1.6875e-5
    z = plane(grid(1, -1, (0, 0)), (0, 0)).astype("f4")
    path = write(tmp_path / "nocrs.tif", z, grid(step, -step, (137.37, -4.67)), None)
    refused(path, "no CRS and cells of 1.69e-05, as if it counted in degrees")
    terrain = read(path, cell=1.0)
    assert isinstance(terrain, rb.Terrain)
    assert_plane(terrain)


def two_variables(path: Path, **units: str) -> Path:
    """Write a CF file with two height variables, north first."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    x, y = HALF * (col + 0.5, row + 0.5)
    z = xr.DataArray(plane(HALF), dims=("y", "x"), coords={"x": x[0], "y": y[:, 0]}, attrs=units)
    made = xr.Dataset({"elevation": z, "error": z * 0 + 1}).rio.write_crs("EPSG:32633").rio.write_coordinate_system()
    made.to_netcdf(path, engine="h5netcdf")
    return path


def test_subdatasets_are_listed_and_read(tmp_path: Path) -> None:
    pytest.importorskip("rioxarray", reason="writes the CRS as CF has it")
    path = two_variables(tmp_path / "two.nc", units="m")
    said = refused(path, "two.nc holds several rasters: give one of them as the file")
    name = f"netcdf:{path}:elevation"
    assert name.lower() in said.lower()
    assert_plane(warned(name))
    kilometres = xr.open_dataset(path)
    kilometres["elevation"] = (kilometres["elevation"] / 1000).assign_attrs(units="km")
    kilometres.to_netcdf(tmp_path / "km.nc", engine="h5netcdf")
    assert_plane(warned(f"netcdf:{tmp_path / 'km.nc'}:elevation"))


def test_files_inside_an_archive(tmp_path: Path) -> None:
    import zipfile

    write(tmp_path / "dem.tif", plane(HALF).astype("f4"), HALF)
    with zipfile.ZipFile(tmp_path / "dem.zip", "w") as archive:
        archive.write(tmp_path / "dem.tif", "inner/dem.tif")
    assert_plane(warned(f"/vsizip/{tmp_path}/dem.zip/inner/dem.tif"))
    refused(f"/vsizip/{tmp_path}/dem.zip/other.tif", "is not a raster that GDAL can read")
    maps = rb.traversability(rb.load_rover("curiosity"), f"/vsizip/{tmp_path}/dem.zip/inner/dem.tif", 2, 2.0)
    assert np.isfinite(maps["tilt"]).any()


@pytest.mark.parametrize("order", [("y", "x"), ("x", "y")])
@pytest.mark.parametrize("north_first", [False, True])
@pytest.mark.parametrize("unit", ["m", "km"])
def test_labelled_arrays_are_read_by_their_coordinates(order: tuple[str, str], north_first: bool, unit: str) -> None:
    up = grid(0.5, -0.5 if north_first else 0.5)
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    x, y = up * (col + 0.5, row + 0.5)
    length = 1000.0 if unit == "km" else 1.0
    coordinates = {name: (name, v / length, {"units": unit}) for name, v in (("x", x[0]), ("y", y[:, 0]))}
    z = xr.DataArray(plane(up), dims=("y", "x"), coords=coordinates).transpose(*order)
    terrain = rb.Terrain.from_array(z)
    assert_plane(terrain)
    assert_close(terrain.origin, (x.min(), y.min()), 1e-6, "m", "the south-west node")
    assert_plane(rb.Terrain.from_array(z, 0.5, (float(x.min()), float(y.min()))))
    for wrong in ({"spacing": 0.4}, {"origin": (0.0, 0.0)}):
        with pytest.raises(rb.TerrainError, match="own coordinates give"):
            rb.Terrain.from_array(z, **wrong)  # type: ignore[arg-type]


def test_labelled_arrays_that_do_not_fit_are_refused() -> None:
    z, at = np.zeros((5, 6)), np.arange(6.0)
    for array, sentence in (
        (xr.DataArray(z, dims=("lat", "lon"), coords={"lat": at[:5], "lon": at}), "counts in degrees"),
        (xr.DataArray(z, dims=("y", "x"), coords={"y": at[:5] ** 2, "x": at}), "'y' of the DataArray is not evenly spaced"),
        (xr.DataArray(z, dims=("a", "b"), coords={"a": at[:5], "b": at}), "do not show which is x and which is y"),
        (xr.DataArray(np.zeros((2, 5, 6)), dims=("band", "y", "x")), "select one band"),
        (xr.DataArray(z, dims=("y", "x"), attrs={"units": "degree"}), "not a known length"),
    ):
        with pytest.raises(rb.TerrainError, match=sentence):
            rb.Terrain.from_array(array, 1.0)
    with pytest.raises(rb.TerrainError, match="give the spacing of the nodes"):
        rb.Terrain.from_array(xr.DataArray(z, dims=("y", "x")))
    assert rb.Terrain.from_array(xr.DataArray(z, dims=("y", "x")), 1.0).spacing == (1.0, 1.0)


def test_a_rioxarray_keeps_its_crs_and_its_fill_value(tmp_path: Path) -> None:
    rioxarray = pytest.importorskip("rioxarray", reason="reads the file as a user's notebook does")
    z = plane(HALF)
    z[GAP] = -9999
    path = write(tmp_path / "dem.tif", z.astype("f4"), HALF, nodata=-9999)
    terrain = rb.Terrain.from_array(rioxarray.open_rasterio(path))
    heights, spacing, origin, crs = read_raster(path)
    assert_close(terrain.z, heights, 0, "m", "as from the file itself")
    assert (terrain.spacing, terrain.origin) == (spacing, origin)
    assert rasterio.CRS.from_user_input(terrain.crs) == rasterio.CRS.from_user_input(crs)


def test_the_command_line_shows_each_kind_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    z = plane(HALF).astype("f4")
    spoilt = z.copy()
    spoilt[0, 0] = -9999
    settle = ("settle", "-r", "curiosity", "--json", "--yaw", "30", "-t")
    two = write(tmp_path / "two.tif", np.stack([z * 0, spoilt]), HALF, nodata=np.nan)
    assert main([*settle, str(two), "--band", "2"]) == 0
    said = capsys.readouterr()
    pose = json.loads(said.out)
    assert_close([pose["pitch"], pose["roll"]], attitude(), 1e-4, "rad", "the plane")
    assert said.err.count("\n") == 1
    assert said.err.startswith("rockerbogie: note: two.tif stores -9999, far from its other heights")
    window = ",".join(str(v) for v in (CENTRE[0] - 4, CENTRE[1] - 4, CENTRE[0] + 4, CENTRE[1] + 4))
    assert main([*settle, str(two), "--band", "2", "--window", window]) == 0
    assert capsys.readouterr().err == "", "the window holds no undeclared value"
    turned = write(tmp_path / "turned.tif", z, grid(0.5, -0.5, turn=0.5))
    plain = write(tmp_path / "plain.png", np.rint(z).astype("u1"), HALF, None, "PNG")
    for words, sentence in (
        ((*settle, str(turned)), "is a rotated grid"),
        ((*settle, str(two), "--band", "3"), "band 3 is not one of them"),
        ((*settle, str(two), "--window", "1,2,3"), "--window '1,2,3' is not xmin,ymin,xmax,ymax"),
        ((*settle, "surface:plane", "--cell", "1"), "--cell is for raster files"),
        (("map", str(turned), "-o", str(tmp_path / "map.tif")), "is a rotated grid"),
        (("map", str(two), "--layers", "tilt", "-o", str(tmp_path / "map.tif")), "only with --per-heading"),
        (("map", str(two), "--layers", "nothing", "-o", str(tmp_path / "map.nc")), "no layer named 'nothing'"),
        (("map", str(two), "--chunk", "100", "-o", str(tmp_path / "map.nc")), "multiple of 128"),
    ):
        assert main(list(words)) == 2, words
        said = capsys.readouterr()
        assert said.err.count("\n") == 1
        assert sentence in said.err
    (tmp_path / "plain.png.aux.xml").unlink(missing_ok=True)
    assert main([*settle, str(plain)]) == 2
    assert "--cell" in capsys.readouterr().err
    assert main([*settle, str(plain), "--cell", "0.5"]) == 0
    assert "come in steps of 1 m, which is 63°" in capsys.readouterr().err


def test_map_options_of_rasters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Band, cell, layers and chunk of `map`; the picture uses the same band."""
    z = plane(HALF).astype("f4")
    path = write(tmp_path / "two.tif", np.stack([z * 0, z]), HALF, None)
    out = tmp_path / "map.nc"
    options = ("--band", "2", "--cell", "0.5", "--layers", "tilt", "--chunk", "128", "--headings", "2", "--resolution", "2")
    assert main(["map", str(path), *options, "-o", str(out)]) == 0
    assert capsys.readouterr().err == ""
    with xr.open_dataset(out, engine="h5netcdf") as made:
        assert set(made.data_vars) - {"spatial_ref"} == {"tilt", "passable", "worst_exceeded"}
        tilt = made["tilt"].values
    assert_close(tilt[np.isfinite(tilt)], math.atan(math.hypot(0.1, 0.05)), 1e-4, "rad", "the plane's tilt")
