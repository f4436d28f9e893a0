"""Commands `map` and `plan`: files, resumed maps, one sentence for every bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from test_cli import answer, complaint

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.maps.files import read_map
from support.helpers import assert_close

rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
pytest.importorskip("zarr", reason="needs the scale extra")


@pytest.fixture(scope="module")
def dem(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a raster of hills, 15 m by 4 m, with missing data and a bump too steep to climb."""
    path = tmp_path_factory.mktemp("ground") / "hills.tif"
    x, y = np.meshgrid(np.arange(150) * 0.1, np.arange(40) * 0.1)
    z = 0.25 * np.sin(x / 1.5) * np.cos(y / 2) + 0.5 * np.exp(-((x - 7) ** 2 + (y - 2.5) ** 2) / 0.15)
    z[4:7, 100:104] = np.nan
    place = rasterio.Affine(0.1, 0, 4e5 - 0.05, 0, -0.1, 5e6 + 3.95)
    profile = {"driver": "GTiff", "height": 40, "width": 150, "count": 1, "dtype": "float32", "nodata": np.nan}
    with rasterio.open(path, "w", **profile, transform=place, crs="EPSG:32633") as raster:
        raster.write(z[::-1].astype(np.float32), 1)
    return path


@pytest.fixture(scope="module")
def whole(dem: Path) -> xr.Dataset:
    """The map that the commands below should write."""
    return rb.traversability(rb.load_rover("osr"), dem, 4, limits=rb.Limits(tilt=np.radians(12), pitch=np.radians(15)))


CALL = ("--rover", "osr", "--headings", "4", "--limits", "none", "--tilt", "12", "--pitch", "15")


def test_an_undeclared_fill_value_is_missing_data(
    dem: Path, whole: xr.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In commands that read files whole or by windows, with one line on stderr."""
    spoilt = tmp_path / "spoilt.tif"
    with rasterio.open(dem) as raster:
        z, profile = raster.read(1), raster.profile
    z[20, 60] = 9.969209968386869e36
    with rasterio.open(spoilt, "w", **profile) as raster:
        raster.write(z, 1)
    for command in (
        ("map", spoilt, *CALL, "-o", tmp_path / "map.tif"),
        ("settle", "-r", "osr", "-t", spoilt, "--at", "400007,5000002"),
    ):
        assert main([str(a) for a in command]) == 0
        err = capsys.readouterr().err.splitlines()
        assert len(err) == 1
        assert err[0].startswith("rockerbogie: note: spoilt.tif stores 9.969209968e+36, far from its other heights")
    with rasterio.open(tmp_path / "map.tif") as made:
        assert np.nansum(made.read(1)) < float(whole.passable.sum()), "wheels on the missing node cannot be settled"


def test_map_to_geotiff(dem: Path, whole: xr.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "map.tif"
    told = json.loads(answer(capsys, "map", dem, *CALL, "-o", file, "--json"))
    assert told["files"] == [str(tmp_path / f"map.{ending}") for ending in ("tif", "qml", "png")]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.png", "map.qml", "map.tif"], "no parts are left"
    with rasterio.open(file) as raster:
        assert raster.crs.to_epsg() == 32633
        assert tuple(raster.bounds) == pytest.approx(tuple(rasterio.open(dem).bounds), abs=1e-6)
        band = 1 + raster.descriptions.index("worst_tilt_deg")
        expected = np.degrees(whole["worst_tilt"].values[::-1]).astype(np.float32)
        assert_close(raster.read(band), expected, 0, "deg", "the same map")
    share = whole["passable"].values
    known = np.isfinite(share)
    assert told["cells"] == [150, 40]
    assert_close(told["known_area"], known.sum() * 0.01, 1e-9, "m2", "cells of a square decimetre")
    assert_close(told["passable_share"]["every_heading"], (share[known] == 1).mean(), 1e-12, "1", "counted")
    assert 0.1 < told["passable_share"]["every_heading"] < 0.95
    assert told["passable_share"]["no_heading"] > 0
    assert told["poses"] == 150 * 40 * 4
    text = answer(capsys, "map", dem, *CALL, "-o", file, "--no-preview")
    assert "150 x 40 cells of 0.1 m" in text
    assert f"{100 * told['passable_share']['every_heading']:.1f} %" in text


@pytest.mark.parametrize("ending", ["zarr", "nc"])
def test_map_to_zarr_and_netcdf(dem: Path, whole: xr.Dataset, tmp_path: Path, ending: str) -> None:
    assert main(["map", str(dem), *CALL, "-o", str(tmp_path / f"map.{ending}"), "--no-preview"]) == 0
    with read_map(tmp_path / f"map.{ending}") as back:
        xr.testing.assert_identical(back.load(), whole)
    assert [p.name for p in tmp_path.iterdir()] == [f"map.{ending}"]


def test_map_of_every_heading_and_a_part_of_the_terrain(dem: Path, whole: xr.Dataset, tmp_path: Path) -> None:
    file = tmp_path / "map.tif"
    bounds = "400002,5000001,400003,5000002"
    assert main(["map", str(dem), *CALL, "-o", str(file), "--per-heading", "--no-preview", "--bounds", bounds]) == 0
    back = read_map(file)
    assert back.sizes == {"heading": 4, "y": 11, "x": 11}
    same = whole.sel(x=back["x"], y=back["y"], method="nearest")
    assert_close(back["exceeded"], same["exceeded"], 0, "bits", "the same cells of the map")
    assert_close(back["roll"], same["roll"], 1e-7, "rad", "the same cells of the map")


def test_limits_by_file_and_by_option(dem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    some = ("map", dem, "--rover", "osr", "--headings", "2", "--bounds", "400001,5000001,400002,5000002", "--no-preview")
    kept = tmp_path / "limits.toml"
    kept.write_text("tilt_deg = 12\nclearance_m = 0.05\n")
    for argv, expected in (
        ([], rb.Limits.named("curiosity")),
        (["--limits", kept], rb.Limits(tilt=np.radians(12), clearance=0.05)),
        (["--limits", kept, "--tilt", "9"], rb.Limits(tilt=np.radians(9), clearance=0.05)),
        (["--limits", "none", "--bogie", "20"], rb.Limits(bogie=np.radians(20))),
    ):
        answer(capsys, *some, "-o", tmp_path / "map.nc", *argv)
        with read_map(tmp_path / "map.nc") as back:
            assert json.loads(back.attrs["limits"]) == json.loads(expected.to_json())
    kept.write_text("tlit_deg = 12\n")
    assert "did you mean 'tilt_deg'" in complaint(capsys, *some, "-o", tmp_path / "map.nc", "--limits", kept)
    kept.write_text("tilt_deg = '12'\n")
    assert "tilt_deg is '12'; give a number" in complaint(capsys, *some, "-o", tmp_path / "map.nc", "--limits", kept)
    kept.write_text("tilt_deg: 12\n")
    assert "is not TOML" in complaint(capsys, *some, "-o", tmp_path / "map.nc", "--limits", kept)
    assert "no file of limits at" in complaint(capsys, *some, "-o", tmp_path / "map.nc", "--limits", tmp_path / "none.toml")


def test_an_interrupted_map_continues_to_the_same_bytes(
    dem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, stopped = tmp_path / "whole.tif", tmp_path / "stopped.tif"
    argv = ["map", str(dem), *CALL, "--no-preview", "-o"]
    assert main([*argv, str(whole)]) == 0
    capsys.readouterr()
    real = rb.maps.traversability.traversability  # type: ignore[attr-defined]

    def interrupted(*args: object, **kwargs: object) -> xr.Dataset:
        def stop(done: int, total: int) -> None:
            kwargs["progress"](done, total)  # type: ignore[operator]
            if 128 * 40 < done < total:  # the first tile is finished, the second begun
                raise KeyboardInterrupt

        return real(*args, **(kwargs | {"progress": stop, "chunk": 128}))

    monkeypatch.setattr("rockerbogie.cli.map.traversability", interrupted)
    assert main([*argv, str(stopped)]) == 130
    said = capsys.readouterr().err
    assert "finished parts are in" in said
    assert "continues from there" in said
    assert not stopped.exists()
    monkeypatch.setattr("rockerbogie.cli.map.traversability", real)
    other = argv.copy()
    other[other.index("osr")] = "sawppy"
    assert "another rover" in complaint(capsys, *other, stopped)
    assert main([*argv, str(stopped)]) == 0
    said = capsys.readouterr().err
    assert "continuing with" in said
    assert stopped.read_bytes() == whole.read_bytes()
    assert not (tmp_path / "stopped.tif.parts").exists()


def test_a_map_that_cannot_be_written_is_not_computed_again(
    dem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    argv = ("map", dem, *CALL, "--no-preview", "-o", tmp_path / "made" / "map.tif")
    with monkeypatch.context() as patched:
        patched.setattr("rockerbogie.maps.geotiff._copy_piece", full)
        said = complaint(capsys, *argv)
    assert "No space left on device; finished parts are kept in" in said
    assert main([str(a) for a in argv]) == 0
    assert "100 % is done" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "made").iterdir() if p.suffix == ".tif"] == ["map.tif"]


BAD_MAPS = {
    "no output": (["surface:mars"], "--output"),
    "unknown ending": (["surface:mars", "-o", "map.shp"], "is not the name of a map: end it in .tif"),
    "no such file": (["nowhere.tif", "-o", "map.tif"], "no file"),
    "surface without its prefix": (["mars", "-o", "map.tif"], "surface:mars"),
    "no such rover": (["surface:mars", "-o", "map.tif", "-r", "curiousity"], "did you mean 'curiosity'"),
    "no such limits": (["surface:mars", "-o", "map.tif", "--limits", "curiousity"], "did you mean 'curiosity'"),
    "limit below zero": (["surface:mars", "-o", "map.tif", "--tilt", "-3"], "limit tilt"),
    "bounds of three": (["surface:mars", "-o", "map.tif", "--bounds", "0,0,1"], "xmin,ymin,xmax,ymax"),
    "bounds off the map": (["surface:mars", "-o", "map.tif", "--bounds", "900,900,901,901"], "bounds"),
    "no headings": (["surface:mars", "-o", "map.tif", "--headings", "0"], "headings is 0"),
    "resolution of zero": (["surface:mars", "-o", "map.tif", "--resolution", "0"], "resolution is 0"),
    "mode": (["surface:mars", "-o", "map.tif", "--mode", "contct"], "contact"),
    "no workers": (["surface:mars", "-o", "map.tif", "--workers", "0"], "workers is 0"),
}


@pytest.mark.parametrize("case", BAD_MAPS)
def test_a_bad_map_is_refused_in_one_sentence(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    argv, hint = BAD_MAPS[case]
    assert hint in complaint(capsys, "map", *argv)
    assert not (tmp_path / "map.tif").exists()


def test_plan_feeds_drive(dem: Path, whole: xr.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maps, route = tmp_path / "map.zarr", tmp_path / "route.csv"
    rb.maps.files.write_map(whole, maps)  # type: ignore[attr-defined]
    free = np.argwhere((whole["exceeded"].values == 0).all(axis=0))
    west, east = free[free[:, 1].argmin()], free[free[:, 1].argmax()]
    places = [str(float(whole[axis][k])) for place in (west, east) for axis, k in (("x", place[1]), ("y", place[0]))]
    argv = ("plan", maps, "--start", *places[:2], "--goal", *places[2:], "--start-heading", "-90")
    told = json.loads(answer(capsys, *argv, "-o", route, "-t", dem, "--json"))
    assert told["files"] == [str(route), str(tmp_path / "route.png")]
    assert_close(told["yaw"][0], 3 * np.pi / 2, 1e-9, "rad", "faced as asked, as the map counts it")
    plan = rb.plan(whole, (float(places[0]), float(places[1]), -np.pi / 2), (float(places[2]), float(places[3])))
    assert_close(told["cost"], plan.cost, 1e-9, "m", "the same plan")
    assert str(route) in answer(capsys, *argv, "-o", route, "--no-preview")
    driven = json.loads(answer(capsys, "drive", "-t", dem, "-r", "osr", "-p", route, "--step", "0.05", "--json"))
    assert_close(driven["length"], plan.distance[-1], 1e-6, "m", "the way planned")
    assert driven["status"] == {"CONVERGED": driven["stations"]}
    limits = np.radians([12, 15])
    over = 1.15  # between cells nothing is promised; here it stays within this
    assert driven["extremes"]["tilt"]["max"] < over * limits[0]
    line = tmp_path / "route.geojson"
    assert main([str(a) for a in (*argv, "-o", line, "--no-preview")]) == 0
    assert "a GeoPackage (.gpkg) keeps it" in capsys.readouterr().err
    assert json.loads(line.read_text())["features"][0]["geometry"]["type"] == "LineString"


def test_a_bad_plan_is_refused_in_one_sentence(
    whole: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    maps = tmp_path / "map.nc"
    rb.maps.files.write_map(whole, maps)  # type: ignore[attr-defined]
    free = np.argwhere((whole["exceeded"].values == 0).all(axis=0))[0]
    here = [str(float(whole["x"][free[1]])), str(float(whole["y"][free[0]]))]
    for argv, hint in (
        (["none.zarr", "--start", "0", "0", "--goal", "1", "1"], "no map at"),
        (["route.csv", "--start", "0", "0", "--goal", "1", "1"], "is not the name of a map"),
        ([maps, "--start", "0", "0", "--goal", *here], "the start (0, 0) m is off the map"),
        ([maps, "--start", *here, "--goal", "400010.15", "5000000.5"], "m is not passable at any heading"),
        ([maps, "--start", *here], "--goal"),
        ([maps, "--start", *here, "--goal", *here, "-o", "route.shp"], "end it in .gpkg, .csv or .geojson"),
        ([maps, "--start", *here, "--goal", *here, "--tilt-weight", "-1"], "tilt_weight is -1"),
        ([maps, "--start", *here, "--goal", *here, "--rover", "currosity"], "did you mean 'curiosity'"),
    ):
        assert hint in complaint(capsys, "plan", *argv)
    bare = tmp_path / "bare.csv"
    bare.write_text("x,y\n1,1\n")
    assert "at least two" in complaint(capsys, "drive", "-t", "surface:mars", "-p", bare)
    assert "no path at" in complaint(capsys, "drive", "-t", "surface:mars", "-p", "none.csv")
