"""Map files read by other libraries: rasterio, rio-cogeo, rioxarray, xarray, XML."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.figures.terrain_map import terrain_map
from rockerbogie.maps import files, geotiff, grid
from rockerbogie.maps.files import read_map, write_map
from rockerbogie.maps.preview import overview, tally
from rockerbogie.maps.style import CLASSES, write_style
from support.helpers import assert_close
from support.map_cases import drawn_map

rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")

SUMMARIES = ["passable_share", "worst_tilt_deg", "best_tilt_deg", "best_heading_deg", "worst_clearance_m", "worst_exceeded"]


@pytest.fixture(scope="module")
def drawn() -> xr.Dataset:
    """Two tiles either way."""
    return drawn_map(np.random.default_rng(5), 4, 260, 300)


def far_apart(maps: xr.Dataset) -> tuple[tuple[float, float], tuple[float, float]]:
    """Two places, passable at every heading, with a way between them."""
    free = np.argwhere((maps["exceeded"].values == 0).all(axis=0))
    first, last = free[len(free) // 10], free[-len(free) // 10]
    return (float(maps["x"][first[1]]), float(maps["y"][first[0]])), (float(maps["x"][last[1]]), float(maps["y"][last[0]]))


def content(path: Path) -> str:
    """A digest of a file, or of a folder's files and their names."""
    digest = hashlib.sha256()
    for part in [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file()):
        digest.update(str(part.relative_to(path)).encode() + part.read_bytes())
    return digest.hexdigest()


def band_of(raster: object, name: str) -> int:
    return 1 + list(raster.descriptions).index(name)  # type: ignore[attr-defined]


def test_geotiff_is_georeferenced(drawn: xr.Dataset, tmp_path: Path) -> None:
    file = write_map(drawn, tmp_path / "map.tif")
    with rasterio.open(file) as raster:
        assert raster.crs.to_epsg() == 32633
        assert raster.driver == "GTiff"
        assert list(raster.descriptions) == SUMMARIES
        assert raster.units == ("1", "deg", "deg", "deg", "m", "1")
        assert np.isnan(raster.nodata)
        assert set(raster.dtypes) == {"float32"}
        assert raster.overviews(1)
        assert raster.tags()["rover"] == "curiosity"
        assert tuple(raster.transform)[:6] == (0.5, 0, 1000.0, 0, -0.5, 2130.0)
        rng = np.random.default_rng(0)
        rows, cols = rng.integers(0, 260, 200), rng.integers(0, 300, 200)
        places = [(float(drawn["x"][c]), float(drawn["y"][r])) for r, c in zip(rows, cols, strict=True)]
        seen = np.array(list(raster.sample(places)))
        for name, variable, scale in (
            ("worst_tilt_deg", "worst_tilt", 180 / np.pi), ("best_heading_deg", "best_heading", 180 / np.pi),
            ("passable_share", "passable", 1), ("worst_clearance_m", "worst_clearance", 1),
            ("worst_exceeded", "worst_exceeded", 1),
        ):  # fmt: skip
            expected = (drawn[variable].values[rows, cols] * scale).astype(np.float32)
            assert_close(seen[:, band_of(raster, name) - 1], expected, 0, name, "a pixel is the cell it is centred on")
        unknown = np.isnan(drawn["passable"].values)
        assert (raster.read_masks(1)[::-1] == 0).sum() == unknown.sum() > 0


def test_geotiff_is_cloud_optimised(drawn: xr.Dataset, tmp_path: Path) -> None:
    validate = pytest.importorskip("rio_cogeo").cog_validate
    for per_heading in (False, True):
        file = write_map(drawn, tmp_path / "map.tif", per_heading=per_heading)
        assert validate(str(file), strict=True) == (True, [], [])


def test_geotiff_holds_every_heading_on_request(drawn: xr.Dataset, tmp_path: Path) -> None:
    file = write_map(drawn, tmp_path / "map.tif", per_heading=True)
    with rasterio.open(file) as raster:
        assert list(raster.descriptions[:6]) == SUMMARIES
        assert raster.count == 6 + 4 * 9
        roll = raster.read(band_of(raster, "roll_deg_h090.0"))[::-1]
        assert_close(roll, np.degrees(drawn["roll"].values[1]).astype(np.float32), 0, "deg", "heading 90 degrees")
        flags = raster.read(band_of(raster, "exceeded_h270.0"))[::-1]
        assert_close(flags, drawn["exceeded"].values[3], 0, "bits", "heading 270 degrees")
    back = read_map(file)
    assert set(back.data_vars) == set(drawn.data_vars)
    for name in back.data_vars:
        assert back[name].dtype == drawn[name].dtype
        assert back[name].dims == drawn[name].dims
        exact = drawn[name].dtype.kind == "u"
        assert_close(back[name], drawn[name], 0 if exact else 5e-7, "rad", "single precision, at most 2 pi")
    assert back["exceeded"].attrs["flag_meanings"] == drawn["exceeded"].attrs["flag_meanings"]
    assert_close(back["y"], drawn["y"], 1e-9, "m", "the same cells")
    start, goal = far_apart(drawn)
    assert_close(
        rb.plan(file, start, goal).cost, rb.plan(drawn, start, goal).cost, 1e-4, "m", "as good to plan on, in single precision"
    )


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_netcdf_and_zarr_hold_the_whole_map(drawn: xr.Dataset, tmp_path: Path, ending: str) -> None:
    if ending == ".zarr":
        pytest.importorskip("zarr", reason="needs the scale extra")
    file = write_map(drawn, tmp_path / f"map{ending}")
    with read_map(file) as back:
        xr.testing.assert_identical(back.load(), drawn)
    engine = {"engine": "h5netcdf"} if ending == ".nc" else {"engine": "zarr", "consolidated": False}
    pytest.importorskip("rioxarray")
    with xr.open_dataset(file, decode_coords="all", **engine) as plain:
        assert plain.rio.crs.to_epsg() == 32633
        assert plain["worst_tilt"].rio.crs.to_epsg() == 32633
        assert plain["worst_tilt"].rio.bounds() == (1000.0, 2000.0, 1150.0, 2130.0)


@pytest.mark.parametrize("ending", [".tif", ".nc", ".zarr"])
def test_the_same_map_gives_the_same_bytes_in_memory_and_chunked(
    drawn: xr.Dataset, tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("dask", reason="needs the scale extra")
    monkeypatch.setattr(grid, "PIECE", (256, 256))  # several pieces
    first = content(write_map(drawn, tmp_path / f"a{ending}"))
    assert content(write_map(drawn, tmp_path / f"b{ending}")) == first
    lazy = drawn.chunk(heading=2, y=128, x=128)
    assert content(write_map(lazy, tmp_path / f"c{ending}")) == first
    shuffled = drawn[list(drawn.data_vars)[::-1]]
    assert content(write_map(shuffled, tmp_path / f"d{ending}")) == first
    assert sorted(p.name for p in tmp_path.iterdir() if p.name.startswith(".")) == [], "nothing half made is left"


def test_a_map_without_crs_has_none(drawn: xr.Dataset, tmp_path: Path) -> None:
    local = drawn.drop_vars("spatial_ref")
    del local.attrs["crs"]
    for name in local.data_vars:
        local[name].attrs.pop("grid_mapping")
    with rasterio.open(write_map(local, tmp_path / "map.tif")) as raster:
        assert raster.crs is None
        assert raster.transform.c == 1000.0
    assert "crs" not in read_map(tmp_path / "map.tif").attrs


def test_style_has_the_documented_colours(drawn: xr.Dataset, tmp_path: Path) -> None:
    for per_heading in (False, True):
        raster_file = write_map(drawn, tmp_path / "map.tif", per_heading=per_heading)
        style = write_style(drawn, tmp_path / "map.qml", per_heading=per_heading)
        root = ElementTree.fromstring(style.read_text().split("\n", 1)[1])
        renderer = root.find("./pipe/rasterrenderer")
        assert renderer is not None
        with rasterio.open(raster_file) as raster:
            assert raster.descriptions[int(renderer.attrib["band"]) - 1] == "passable_share"
        shader = renderer.find("./rastershader/colorrampshader")
        assert shader is not None
        assert shader.attrib["colorRampType"] == "DISCRETE"
        items = [(float(i.attrib["value"]), i.attrib["label"], i.attrib["color"]) for i in shader.findall("item")]
        assert [bound for bound, *_ in items] == sorted(bound for bound, *_ in items)

        def label(share: float, items: list[tuple[float, str, str]] = items) -> str:
            """As QGIS chooses: the first item that is not below the value."""
            return next(text for bound, text, _ in items if np.float32(share) <= bound)

        assert label(0) == "no heading passable"
        assert label(1) == "every heading passable"
        for n in (4, 16, 360):
            assert {label(k / n) for k in range(1, n // 2 + 1)} == {"up to half of the headings passable"}
            assert {label(k / n) for k in range(n // 2 + 1, n)} == {"more than half of the headings passable"}


def test_counts_include_every_cell_once(drawn: xr.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid, "PIECE", (100, 77))
    counts = tally(drawn)
    share = drawn["passable"].values
    assert counts.cells == 260 * 300
    assert counts.known == np.isfinite(share).sum()
    assert counts.every == (share == 1).sum()
    assert counts.some == ((share > 0) & (share < 1)).sum()
    mask = drawn["worst_exceeded"].values[np.isfinite(share)]
    assert counts.exceeded["tilt"] == (mask & 4 > 0).sum()


def test_overview_is_the_map_at_lower_resolution(drawn: xr.Dataset, tmp_path: Path) -> None:
    small = overview(drawn, most=100)
    assert max(small.sizes["x"], small.sizes["y"]) <= 100
    assert_close(small["passable"], drawn["passable"].sel(x=small["x"], y=small["y"]), 0, "1", "cells of the map")
    z = np.random.default_rng(0).normal(size=(160, 270)).astype(np.float32)
    terrain = rb.Terrain.from_array(z, 1.0, (1000.25, 2000.25))
    file = tmp_path / "ground.tif"
    place = rasterio.Affine(1.0, 0, 999.75, 0, -1.0, 2000.25 + 159.5)
    profile = {"driver": "GTiff", "height": 160, "width": 270, "count": 1, "dtype": "float32", "transform": place}
    with rasterio.open(file, "w", **profile) as raster:
        raster.write(z[::-1], 1)
    in_memory, on_file = overview(drawn, terrain)["ground"], overview(drawn, file)["ground"]
    at_nodes = {"x": slice(0, None, 2), "y": slice(0, None, 2)}
    assert_close(on_file.isel(at_nodes), z[:130, :150], 0, "m", "cells on nodes take theirs")
    assert_close(in_memory.isel(at_nodes), z[:130, :150], 1e-9, "m", "cells on nodes take theirs")


def test_picture_states_the_passable_share(drawn: xr.Dataset, tmp_path: Path) -> None:
    small = overview(drawn, rb.Terrain.from_array(np.zeros((160, 270)), 1.0, (1000.25, 2000.25)))
    fig = terrain_map(small)
    legend = fig.axes[1].get_legend()
    assert legend is not None
    counts = tally(drawn)
    texts = [t.get_text() for t in legend.get_texts()]
    assert texts[0] == f"every heading passable\n{100 * counts.every / counts.known:.1f} % of the terrain with data"
    assert len(texts) == len(CLASSES) + 1
    said = [t.get_text() for t in fig.axes[1].texts]
    assert "tilt up to 28.6°" in said[0]
    assert "rocker" not in said[0], "it has no limit here"
    image = fig.axes[0].get_images()[0].get_array()
    assert image is not None
    every, none = small["passable"].values == 1, small["passable"].values == 0
    assert every.any()
    assert none.any()
    colours = np.asarray(image)
    assert (colours[every][:, 1] > colours[every][:, 0]).all(), "green"
    assert (colours[none][:, 1] < colours[none][:, 0]).all(), "wine"
    fig.savefig(tmp_path / "map.png")


def test_datasets_that_are_no_map_are_refused(drawn: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(rb.RockerbogieError, match=r"map.png' is not the name of a map: end it in .tif"):
        write_map(drawn, tmp_path / "map.png")
    with pytest.raises(rb.RockerbogieError, match="no map at"):
        read_map(tmp_path / "none.tif")
    (tmp_path / "words.tif").write_text("no raster")
    with pytest.raises(rb.RockerbogieError, match=r"words.tif' is not a raster that GDAL can read"):
        read_map(tmp_path / "words.tif")
    (tmp_path / "words.nc").write_text("no data")
    with pytest.raises(rb.RockerbogieError, match=r"words.nc' cannot be read as .nc"):
        read_map(tmp_path / "words.nc")
    profile = {"driver": "GTiff", "height": 2, "width": 2, "count": 1, "dtype": "uint8"}
    with rasterio.open(tmp_path / "other.tif", "w", **profile, transform=rasterio.Affine(1, 0, 0, 0, -1, 2)) as raster:
        raster.write(np.zeros((1, 2, 2), np.uint8))
    with pytest.raises(rb.RockerbogieError, match="not a map that rockerbogie wrote"):
        read_map(tmp_path / "other.tif")
    xr.Dataset({"z": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(rb.RockerbogieError, match="it has no layer 'passable'"):
        read_map(tmp_path / "other.nc")
    (tmp_path / "photos.zarr").mkdir()
    (tmp_path / "photos.zarr" / "mine.jpg").touch()
    with pytest.raises(rb.RockerbogieError, match="is a folder but not a map"):
        write_map(drawn, tmp_path / "photos.zarr")
    assert (tmp_path / "photos.zarr" / "mine.jpg").exists()
    with pytest.raises(rb.RockerbogieError, match="cannot write"):
        write_map(drawn, tmp_path / "nowhere" / "map.tif")


@pytest.mark.parametrize("ending", [".tif", ".nc"])
def test_a_failed_write_keeps_the_old_map(
    drawn: xr.Dataset, tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write_map(drawn, tmp_path / f"map{ending}")
    before = content(file)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(*((geotiff, "_copy_piece") if ending == ".tif" else (files, "_write_netcdf")), full)
    with pytest.raises(rb.RockerbogieError, match="cannot write .*No space left on device"):
        write_map(drawn, file)
    assert content(file) == before
    assert [p.name for p in tmp_path.iterdir()] == [file.name]


def test_a_map_with_selected_layers(drawn: xr.Dataset, tmp_path: Path) -> None:
    some = drawn[["tilt", "exceeded"]]
    back = read_map(write_map(some, tmp_path / "map.nc"))
    assert (rb.plan(back, *far_apart(drawn)).cost == rb.plan(drawn, *far_apart(drawn)).cost).all()
    with pytest.raises(rb.RockerbogieError, match="the map has no layer 'passable'"):
        overview(back)
    with pytest.raises(rb.RockerbogieError, match="no layer|this map has no .*give one from rockerbogie.traversability"):
        rb.plan(drawn[["roll"]], *far_apart(drawn))
    with pytest.raises(rb.RockerbogieError, match="maps is .*traversability"):
        write_map(tmp_path, tmp_path / "map.nc")  # type: ignore[arg-type]


def test_netcdf_is_not_started_if_it_may_not_fit(drawn: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda path: shutil._ntuple_diskusage(10**9, 10**9 - 1000, 1000))
    with pytest.raises(rb.RockerbogieError, match=r"it may take 0\.0\d+ GB, and only 1e-06 GB are free"):
        write_map(drawn, tmp_path / "map.nc")
    assert not list(tmp_path.iterdir())


def test_route_as_geojson_is_in_the_map_s_crs(drawn: xr.Dataset, tmp_path: Path) -> None:
    plan = rb.plan(drawn, *far_apart(drawn))
    plan.to_geojson(tmp_path / "route.geojson")
    layer = json.loads((tmp_path / "route.geojson").read_text())
    assert layer["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32633"
    line = np.array(layer["features"][0]["geometry"]["coordinates"])
    assert (line[0] == (plan.x[0], plan.y[0])).all()
    assert (line[-1] == (plan.x[-1], plan.y[-1])).all()
    length = np.hypot(*np.diff(line, axis=0).T)
    assert (length > 0).all()
    assert_close(length.sum(), plan.distance[-1], 1e-9, "m", "the same way")
    assert layer["features"][0]["properties"]["length_m"] == round(float(plan.distance[-1]), 3)


@pytest.mark.parametrize("name", ["map.tif", "map.nc"])
def test_progress_counts_parts(drawn: xr.Dataset, tmp_path: Path, name: str) -> None:
    heard: list[tuple[int, int]] = []
    write_map(drawn, tmp_path / name, progress=lambda *at: heard.append(at))
    share = [done / total for done, total in heard]
    assert share == sorted(share)
    assert share[-1] == 1
    assert len(share) > 1
