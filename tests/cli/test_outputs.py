"""Outputs: no command replaces inputs or files of other programs; all replace their own."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from test_cli import complaint

import rockerbogie as rb
from rockerbogie.cli import COMMANDS, main
from rockerbogie.files.outputs import check_outputs, is_ours, sidecars
from rockerbogie.motion.drive import to_csv

rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
pytest.importorskip("zarr", reason="needs the scale extra")

PRECIOUS = b"precious"
MAP_CALL = ("--rover", "osr", "--headings", "4", "--no-preview")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a folder with one of each input: terrain, rover, log, map, path, limits."""
    folder = tmp_path_factory.mktemp("inputs")
    x, y = np.meshgrid(np.arange(60) * 0.1, np.arange(50) * 0.1)
    profile = {"driver": "GTiff", "height": 50, "width": 60, "count": 1, "dtype": "float32", "crs": "EPSG:32633"}
    with rasterio.open(folder / "dem.tif", "w", **profile, transform=rasterio.Affine(0.1, 0, 0, 0, -0.1, 5)) as raster:
        raster.write((0.05 * np.sin(x) + 0.05 * y)[::-1].astype("float32"), 1)
    rover, ground = rb.load_rover("osr"), rb.Terrain.from_raster(folder / "dem.tif")
    (folder / "my.toml").write_text(rb.to_toml(rover))
    (folder / "robot.urdf").write_text(rb.to_urdf(rover))
    run = rb.drive(rover, ground, rb.Path.straight((2, 2.5), 0, 1), step=0.05)
    run.to_netcdf(folder / "log.nc", engine="h5netcdf")
    to_csv(run, folder / "log.csv")
    rb.write_map(rb.traversability(rover, ground, 4), folder / "chart.zarr")
    (folder / "path.csv").write_text("x [m],y [m]\n2,2.5\n3.5,2.5\n")
    (folder / "limits.toml").write_text("tilt_deg = 20\n")
    return folder


@pytest.fixture
def inputs(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the inputs, which is also the working directory."""
    shutil.copytree(made, tmp_path / "in")
    monkeypatch.chdir(tmp_path / "in")
    return tmp_path / "in"


def contents(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


#: Command line of every command that writes, with `out` for the folder of its outputs; and the files that it writes there.
WRITERS: dict[str, tuple[list[str], list[str]]] = {
    "settle": (["settle", "-t", "dem.tif", "-r", "my.toml", "-o", "out"], ["pose.nc", "pose.png"]),
    "settle page": (["settle", "-t", "dem.tif", "-r", "my.toml", "--html", "out/p.html"], ["p.html"]),
    "loads": (["loads", "-t", "dem.tif", "-r", "my.toml", "-o", "out"], ["loads.png"]),
    "drive": (
        ["drive", "-t", "dem.tif", "-r", "my.toml", "-p", "path.csv", "--step", "0.1", "-o", "out", "--mcap"],
        ["run.nc", "run.csv", "run.mcap", "map.png", "profile.png", "worst.png"],
    ),
    "climb": (
        ["climb", "my.toml", "--step", "0.03", "--plot", "out/c.png", "--chart", "out/steps.svg", "--film", "out/c.gif"],
        ["c.png", "steps.svg", "c.gif"],
    ),
    "simulate": (
        ["simulate", "-t", "dem.tif", "-r", "my.toml", "-p", "path.csv", "-o", "out"],
        ["simulation.nc", "simulation.csv", "map.png", "profile.png", "worst.png", "attitude.png", "joints.png"],
    ),
    "map": (["map", "dem.tif", "-r", "my.toml", "--headings", "4", "-o", "out/m.tif"], ["m.tif", "m.qml", "m.png"]),
    "map nc": (["map", "dem.tif", *MAP_CALL, "-o", "out/m.nc"], ["m.nc"]),
    "map zarr": (["map", "dem.tif", *MAP_CALL, "-o", "out/m.zarr"], ["m.zarr"]),
    "plan": (
        ["plan", "chart.zarr", "--start", "2", "2.5", "--goal", "3", "2.5", "-r", "my.toml", "-o", "out/r.csv"],
        ["r.csv", "r.png"],
    ),
    "plan geojson": (
        ["plan", "chart.zarr", "--start", "2", "2.5", "--goal", "3", "2.5", "-o", "out/r.geojson", "--no-preview"],
        ["r.geojson"],
    ),
    "odometry": (
        ["odometry", "log.nc", "-r", "my.toml", "-o", "out"],
        ["odometry.png", "odometry.nc", "odometry.csv", "odometry.mcap"],
    ),
    "validate": (
        ["validate", "-t", "dem.tif", "--log", "log.csv", "-r", "my.toml", "--draws", "0", "-o", "out"],
        ["validation.png", "validation.csv", "validation.nc"],
    ),
    "reproduce": (
        ["reproduce", "-o", "out"],
        ["figure6.png", "figure7.png", "figure8.png", "figure9.png", "crossing.gif", "report.html",
         "model.nc", "model.csv", "simulation.nc", "simulation.csv"],
    ),
    "rovers": (["rovers", "osr", "-o", "out/r.png"], ["r.png"]),
    "rovers svg": (["rovers", "osr", "-o", "out/r.svg"], ["r.svg"]),
    "rovers pdf": (["rovers", "osr", "-o", "out/r.pdf"], ["r.pdf"]),
    "rovers schema": (["rovers", "schema", "out/s.json"], ["s.json"]),
    "rovers new": (["rovers", "new", "out/n.toml"], ["n.toml"]),
    "rovers import": (["rovers", "import", "robot.urdf", "-o", "out/i.toml"], ["i.toml"]),
    "export": (["export", "osr", "-o", "out/e.urdf"], ["e.urdf"]),
    "export world": (
        ["export", "osr", "--to", "world", "-t", "dem.tif", "-o", "out"],
        ["world.sdf", "ground.obj", "rockerbogie_differential.py"],
    ),
    "predict": (
        ["predict", "-t", "dem.tif", "-r", "my.toml", "-p", "path.csv", "--friction", "0.8", "-o", "out", "--html", "out/p.html"],
        ["prediction.nc", "prediction.csv", "map.png", "prediction.png", "p.html"],
    ),
    "soils": (["soils", "dry-sand", "-o", "out/s.png"], ["s.png"]),
    "slip-table": (["slip-table", "dry-sand", "-r", "sawppy", "--slopes", "0", "-o", "out/slip.csv"], ["slip.csv"]),
    "bench": (["bench", "--save", "out/b.json"], ["b.json"]),
}  # fmt: skip
#: Files that people edit: these commands replace their own only with --force.
EDITED = ("rovers new", "rovers import", "export", "export world")
#: Commands that take long: tested up to their guard only.
SLOW = ("simulate", "reproduce", "bench")


def test_every_command_that_writes_is_here() -> None:
    none = {"compile", "lab"}
    own_tests = {"benchmark", "fit-soil", "ros"}  # their inputs are logs from Mars, or their output is a folder
    assert {argv[0] for argv, _ in WRITERS.values()} == set(COMMANDS) - none - own_tests


@pytest.mark.parametrize("case", WRITERS)
def test_a_file_of_another_program_is_kept(case: str, inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv, files = WRITERS[case]
    (inputs / "out").mkdir()
    for name in files:
        file = inputs / "out" / name
        file.write_bytes(PRECIOUS)
        before = contents(inputs)
        said = complaint(capsys, *argv)
        assert name in said
        assert "--force" in said or "folder" in said or "Zarr" in said
        assert contents(inputs) == before, "nothing is written, not even beside it"
        file.unlink()


@pytest.mark.parametrize("case", [case for case in WRITERS if case not in SLOW])
def test_own_files_are_replaced(case: str, inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv, files = WRITERS[case]
    assert main(argv) == 0
    assert {item.name for item in (inputs / "out").iterdir()} >= set(files)
    capsys.readouterr()
    if case in EDITED:
        before = contents(inputs)
        assert "may have been edited" in complaint(capsys, *argv)
        assert contents(inputs) == before
        assert main([*argv, "--force"]) == 0
    else:
        assert all(is_ours(inputs / "out" / name) for name in files)
        assert main(argv) == 0


def test_force_replaces_a_file_of_another_program(inputs: Path) -> None:
    (inputs / "out").mkdir()
    (inputs / "out" / "pose.png").write_bytes(PRECIOUS)
    argv, _ = WRITERS["settle"]
    assert main([*argv, "--force"]) == 0
    assert is_ours(inputs / "out" / "pose.png")


#: Calls whose output is an input, under one name or another.
INPUT_AS_OUTPUT = {
    "map": ["map", "dem.tif", *MAP_CALL, "-o", "dem.tif"],
    "map, other spelling": ["map", "dem.tif", *MAP_CALL, "-o", "../in/./dem.tif"],
    "map, other case": ["map", "dem.tif", *MAP_CALL, "-o", "DEM.tif"],
    "map, symbolic link": ["map", "dem.tif", *MAP_CALL, "-o", "soft.tif"],
    "map, hard link": ["map", "dem.tif", *MAP_CALL, "-o", "hard.tif"],
    "map, link as input": ["map", "soft.tif", *MAP_CALL, "-o", "dem.tif"],
    "map, source of a mosaic": ["map", "mosaic.vrt", *MAP_CALL, "-o", "dem.tif"],
    "map, preview": ["map", "dem.png", "-o", "dem.nc"],
    "plan, map": ["plan", "chart.nc", "--start", "2", "2.5", "--goal", "3", "2.5", "-o", "chart.csv", "-t", "chart.png"],
    "drive, path": ["drive", "-t", "surface:mars", "-p", "out/run.csv", "-o", "out"],
    "odometry, log": ["odometry", "out/odometry.csv", "-o", "out"],
    "odometry, bag": ["odometry", "bag", "-o", "bag"],
    "validate, log": ["validate", "-t", "dem.tif", "--log", "out/validation.csv", "-o", "out"],
    "settle, terrain": ["settle", "-t", "out/pose.png", "-o", "out"],
    "export": ["export", "robot.urdf", "-o", "robot.urdf"],
    "export, included": ["export", "outer.xml", "-o", "part.xml"],
    "rovers import": ["rovers", "import", "my.toml", "-o", "my.toml"],
    "rovers new": ["rovers", "new", "my.toml", "--like", "my.toml"],
    "climb, profile": ["climb", "osr", "--profile", "dem.png", "--plot", "dem.png"],
    "bench": ["bench", "--compare", "b.json", "--save", "b.json"],
}


@pytest.mark.parametrize("case", INPUT_AS_OUTPUT)
def test_an_input_is_never_an_output(case: str, inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (inputs / "soft.tif").symlink_to("dem.tif")
    os.link(inputs / "dem.tif", inputs / "hard.tif")
    shutil.copy(inputs / "dem.tif", inputs / "dem.png")
    shutil.copy(inputs / "log.nc", inputs / "chart.nc")
    shutil.copy(inputs / "dem.tif", inputs / "chart.png")
    (inputs / "mosaic.vrt").write_text(
        '<VRTDataset rasterXSize="60" rasterYSize="50"><GeoTransform>0, 0.1, 0, 5, 0, -0.1</GeoTransform>'
        '<VRTRasterBand dataType="Float32" band="1"><SimpleSource><SourceFilename relativeToVRT="1">dem.tif</SourceFilename>'
        "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    (inputs / "outer.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    (inputs / "part.xml").write_text("<mujoco/>")
    (inputs / "b.json").write_text("{}")
    for folder in ("out", "bag"):
        (inputs / folder).mkdir()
    for name in ("run.csv", "odometry.csv", "validation.csv"):
        shutil.copy(inputs / "log.csv", inputs / "out" / name)
    shutil.copy(inputs / "dem.tif", inputs / "out" / "pose.png")
    (inputs / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    before = contents(inputs)
    for force in ([], ["--force"]):
        said = complaint(capsys, *INPUT_AS_OUTPUT[case], *force)
        assert "the input " in said
        assert contents(inputs) == before


@pytest.mark.parametrize("case", ["settle", "map", "plan", "odometry", "export", "rovers", "bench"])
def test_an_unwritable_path_is_reported_before_the_work(case: str, inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (inputs / "out").write_bytes(PRECIOUS)  # a file where a folder is needed
    before = contents(inputs)
    assert "not a folder" in complaint(capsys, *WRITERS[case][0])
    assert contents(inputs) == before
    (inputs / "out").unlink()
    if Path("/proc/1").exists():
        (inputs / "out").symlink_to("/proc/1")
        assert "cannot write" in complaint(capsys, *WRITERS[case][0])


def test_an_output_that_is_a_folder(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("m.tif", "m.nc", "m.zarr", "m.png", "m.qml"):
        (inputs / "out" / name).mkdir(parents=True)
        (inputs / "out" / name / "mine").write_bytes(PRECIOUS)
        output = name if name[2:] in ("tif", "nc", "zarr") else "m.tif"
        assert "folder" in complaint(capsys, "map", "dem.tif", "-r", "osr", "-o", f"out/{output}", "--force")
        assert (inputs / "out" / name / "mine").read_bytes() == PRECIOUS
        shutil.rmtree(inputs / "out")


def test_folders_are_made(inputs: Path) -> None:
    for case, argv in {"map": WRITERS["map nc"][0], "rovers": WRITERS["rovers"][0], "export": WRITERS["export"][0]}.items():
        deep = [part.replace("out", f"{case}/a/b") for part in argv]
        assert main(deep) == 0


def test_a_store_with_other_files_is_kept(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (inputs / "m.nc.parts").mkdir()
    (inputs / "m.nc.parts" / "mine").write_bytes(PRECIOUS)
    assert "not an unfinished map" in complaint(capsys, "map", "dem.tif", *MAP_CALL, "-o", "m.nc", "--force")
    assert (inputs / "m.nc.parts" / "mine").read_bytes() == PRECIOUS


def test_a_zarr_group_of_another_program_is_kept(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("zarr")
    xr.Dataset({"mine": ("x", np.arange(3.0))}).to_zarr(inputs / "m.zarr", zarr_format=3, consolidated=False)
    before = contents(inputs)
    assert "--force" in complaint(capsys, "map", "dem.tif", *MAP_CALL, "-o", "m.zarr")
    assert contents(inputs) == before
    assert main(["map", "dem.tif", *MAP_CALL, "-o", "m.zarr", "--force"]) == 0
    assert "mine" not in rb.read_map(inputs / "m.zarr")
    (inputs / "m.zarr" / "notes.txt").write_text("mine")
    capsys.readouterr()
    assert "--force" in complaint(capsys, "map", "dem.tif", *MAP_CALL, "-o", "m.zarr")


def test_stale_statistics_are_removed(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Remove the statistics of the map before: GDAL would trust them for the new one."""
    argv = ["map", "dem.tif", "-r", "osr", "--headings", "4", "--no-preview", "-o", "m.tif"]
    assert main(argv) == 0
    with rasterio.open(inputs / "m.tif") as raster, pytest.warns(rasterio.errors.RasterioDeprecationWarning):
        raster.statistics(2, approx=False)
    aux = inputs / "m.tif.aux.xml"
    assert "STATISTICS_MAXIMUM" in aux.read_text()
    assert main([*argv, "--resolution", "0.2"]) == 0
    assert not aux.exists()
    capsys.readouterr()
    aux.write_text("<PAMDataset><SRS>EPSG:32633</SRS></PAMDataset>")  # somebody's own coordinate system
    assert "m.tif.aux.xml" in complaint(capsys, *argv)
    assert aux.exists()
    (inputs / "m.tif.ovr").write_bytes(PRECIOUS)
    assert sidecars(inputs / "m.tif") == [aux, inputs / "m.tif.ovr"]
    assert main([*argv, "--force"]) == 0
    assert sidecars(inputs / "m.tif") == []


PUBLIC_WRITERS: dict[str, Callable[[Path], object]] = {
    "map.tif": lambda file: rb.write_map(rb.traversability(rb.load_rover("osr"), rb.surfaces.plane(), 4, 0.5), file),
    "map.nc": lambda file: rb.write_map(rb.traversability(rb.load_rover("osr"), rb.surfaces.plane(), 4, 0.5), file),
    "run.mcap": lambda file: rb.write_mcap(
        rb.drive(rb.load_rover("osr"), rb.surfaces.plane(), rb.Path.straight((0, 0), 0, 0.2)), rb.load_rover("osr"), file
    ),
    "route.csv": lambda file: route().to_csv(file),
    "route.geojson": lambda file: route().to_geojson(file),
}


def route() -> rb.Route:
    return rb.plan(rb.traversability(rb.load_rover("osr"), rb.surfaces.plane(), 4, 0.5), (0, 0), (1, 0))


@pytest.mark.parametrize("name", PUBLIC_WRITERS)
def test_public_functions_keep_files_of_other_programs(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(PRECIOUS)
    with pytest.raises(rb.RockerbogieError, match="not written by rockerbogie"):
        PUBLIC_WRITERS[name](file)
    assert [item.read_bytes() for item in tmp_path.iterdir()] == [PRECIOUS]
    file.unlink()
    PUBLIC_WRITERS[name](file)
    PUBLIC_WRITERS[name](file)


def test_two_outputs_of_one_name(tmp_path: Path) -> None:
    with pytest.raises(rb.RockerbogieError, match="written twice"):
        check_outputs([tmp_path / "a.png", tmp_path / "b" / ".." / "a.png"])


def test_a_file_inside_a_gdal_name_is_an_input(tmp_path: Path) -> None:
    file = tmp_path / "heights.nc"
    file.write_bytes(b"CDF")
    for name in (f"netcdf:{file}:z", f'NETCDF:"{file}":z', f"/vsigzip/{file}", f"/vsizip/{file}/inner/dem.tif"):
        with pytest.raises(rb.RockerbogieError, match="input"):
            check_outputs([file], [name], force=True)
