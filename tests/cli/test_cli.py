"""The command line: answers, files, and one sentence with exit 2 for every bad input."""

from __future__ import annotations

import inspect
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

import rockerbogie as rb
from rockerbogie.cli import COMMANDS, main
from support.helpers import assert_close
from support.patience import PATIENCE
from support.pictures import count_colours

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def complaint(capsys: pytest.CaptureFixture[str], *argv: str | Path) -> str:
    """Return the sentence on stderr of a bad call: exit code 2, nothing on stdout."""
    assert main([str(a) for a in argv]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("rockerbogie: ")
    assert said.err.count("\n") == 1
    assert "Traceback" not in said.err
    return said.err


def answer(capsys: pytest.CaptureFixture[str], *argv: str | Path) -> str:
    """Return the output of a good call."""
    assert main([str(a) for a in argv]) == 0
    said = capsys.readouterr()
    notes = [line for line in said.err.splitlines() if line.startswith("rockerbogie: note: a metre on the ground is")]
    assert said.err.splitlines() == notes, "nothing but the note on the projections of the real terrain models"
    return said.out


@pytest.fixture
def raster(tmp_path: Path) -> Callable[..., Path]:
    """A GeoTIFF of given heights (row 0 in the north), 0.1 m cells."""
    rasterio = pytest.importorskip("rasterio")

    def write(z: np.ndarray, nodata: float | None = None) -> Path:
        path = tmp_path / "ground.tif"
        place = rasterio.transform.from_origin(0, z.shape[0] * 0.1, 0.1, 0.1)
        shape = {"height": z.shape[0], "width": z.shape[1], "count": 1}
        with rasterio.open(path, "w", driver="GTiff", dtype="float32", transform=place, nodata=nodata, **shape) as file:
            file.write(z.astype("float32"), 1)
        return path

    return write


BAD_CALLS = {
    "unknown command": (["setle"], "settle"),
    "unknown option": (["settle", "-t", "surface:paper", "--yaww", "3"], "--yaw"),
    "no terrain given": (["settle"], "--terrain"),
    "not a number": (["settle", "-t", "surface:paper", "--yaw", "north"], "north"),
    "nan yaw": (["settle", "-t", "surface:paper", "--yaw", "nan"], "yaw is not finite"),
    "nan place": (["settle", "-t", "surface:paper", "--at", "nan,0"], "not finite"),
    "infinite place": (["settle", "-t", "surface:paper", "--at", "0,inf"], "not finite"),
    "place of three": (["settle", "-t", "surface:paper", "--at", "1,2,3"], "x,y"),
    "place of words": (["settle", "-t", "surface:paper", "--at", "here"], "x,y"),
    "place off the map": (["settle", "-t", "surface:paper", "--at", "90,0"], "off the map"),
    "mode": (["settle", "-t", "surface:paper", "--mode", "contct"], "contact"),
    "no such preset": (["settle", "-r", "curiousity", "-t", "surface:paper"], "did you mean 'curiosity'"),
    "no such rover file": (["settle", "-r", "my/rover.toml", "-t", "surface:paper"], "rover.toml"),
    "no such surface": (["settle", "-t", "surface:papr"], "did you mean 'paper'"),
    "surface without its prefix": (["settle", "-t", "paper"], "'surface:paper'"),
    "no such file": (["settle", "-t", "nowhere.tif"], "nowhere.tif"),
    "no such wheel": (["settle", "-t", "surface:paper", "--steering", "LX=3"], "wheel"),
    "steering not a number": (["settle", "-t", "surface:paper", "--steering", "LR=left"], "NAME=DEGREES"),
    "wheel that does not steer": (["settle", "-t", "surface:paper", "--steering", "LM=5"], "does not steer"),
    "steering nan": (["settle", "-t", "surface:paper", "--steering", "LR=nan"], "not finite"),
    "one waypoint": (["drive", "-t", "surface:paper", "-p", "0,0"], "at least two"),
    "waypoint twice": (["drive", "-t", "surface:paper", "-p", "0,0 0,0"], "leave one out"),
    "nan waypoint": (["drive", "-t", "surface:paper", "-p", "0,0 nan,1"], "not finite"),
    "no path": (["drive", "-t", "surface:paper", "-p", ""], "at least two"),
    "path partly off the map": (["drive", "-t", "surface:paper", "-p", "0,0 9,0"], "off the map at 4.4"),
    "path wholly off the map": (["drive", "-t", "surface:paper", "-p", "50,0 60,0"], "off the map"),
    "speed of zero": (["drive", "-t", "surface:paper", "--speed", "0"], "speed"),
    "step below zero": (["drive", "-t", "surface:paper", "--step", "-1"], "step"),
    "radius too wide": (["drive", "-t", "surface:paper", "-p", "0,0 1,0 1,0.5", "--radius", "3"], "radius of at most"),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_a_bad_call_is_refused_in_one_sentence(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    argv, hint = BAD_CALLS[case]
    assert hint in complaint(capsys, *argv)


def test_not_a_raster(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tmp_path / "words.tif"
    text.write_text("no heights here")
    assert "words.tif" in complaint(capsys, "settle", "-t", text)
    assert str(tmp_path) in complaint(capsys, "settle", "-t", tmp_path)


def test_raster_of_the_wrong_shape(raster: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert "shape (3, 3)" in complaint(capsys, "settle", "-t", raster(np.zeros((3, 3))))


def test_raster_of_nothing(raster: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    complaint(capsys, "settle", "-t", raster(np.full((30, 30), np.nan)))


def test_missing_data_is_reported(raster: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    z = np.zeros((60, 60))
    z[:, 25:35] = np.nan
    file = raster(z)
    assert "missing data" in complaint(capsys, "settle", "-t", file, "--at", "3,3")
    record = json.loads(answer(capsys, "drive", "-t", file, "--json"))
    assert record["status"]["NO_DATA"] > 0  # missing data on the way is an answer, not a mistake
    assert record["status"]["CONVERGED"] > 0


def test_map_shorter_than_the_rover(raster: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert "too short" in complaint(capsys, "drive", "-t", raster(np.zeros((8, 8))))


def test_output_that_is_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    taken = tmp_path / "taken"
    taken.write_text("")
    assert "taken" in complaint(capsys, "settle", "-t", "surface:plane", "-o", taken)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_has_its_whole_description(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    shown = " ".join(answer(capsys, command, "--help").split())
    assert f"rockerbogie {command}" in shown
    module, _, name = COMMANDS[command][0].partition(":")
    function = getattr(import_module(module), name)
    if inspect.isfunction(function):  # an app of sub-commands has its summary only
        described, _, parameters = (inspect.getdoc(function) or "").partition("\n\nParameters\n")
        assert parameters
        assert " ".join(described.replace("`", "").split()) in shown


def test_settle_agrees_with_the_library(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ("settle", "-t", "surface:paper", "--at", "1.3,0.1", "--yaw", "20", "--steering", "LR=10,RR=12")
    record = json.loads(answer(capsys, *argv, "--json"))
    steering = np.radians([10, 12, 0, 0, 0, 0])
    pose = rb.settle(rb.load_rover("elhami-dashti"), rb.surfaces.paper(), 1.3, 0.1, np.radians(20), steering=steering)
    for name in ("z", "roll", "pitch", "yaw", "rocker", "bogie", "steering", "contact_angle", "gap"):
        assert_close(record[name], getattr(pose, name), 1e-15, "SI", f"{name}: the same call")
    assert record["status"] == "CONVERGED"
    table = answer(capsys, *argv)
    assert f"{np.degrees(float(pose.pitch)):.3f}°" in table
    assert f"{float(pose.z):.4f} m" in table


def test_settle_without_a_pose_exits_1(capsys: pytest.CaptureFixture[str], raster: Callable[..., Path]) -> None:
    z = np.zeros((60, 60))
    z[:, 30:] = 50.0  # a wall
    assert main(["settle", "-t", str(raster(z)), "--linear", "--at", "2.65,3", "--json"]) == 1
    record = json.loads(capsys.readouterr().out)
    assert record["status"] != "CONVERGED"
    assert record["z"] is None


def test_settle_writes_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = answer(capsys, "settle", "-t", "surface:sine", "-o", tmp_path / "deep" / "er")
    assert "pose.png" in out
    assert_drawn(tmp_path / "deep" / "er" / "pose.png")
    with xr.open_dataset(tmp_path / "deep" / "er" / "pose.nc", engine="h5netcdf") as data:
        assert data["z"].attrs["units"] == "m"


def test_drive_writes_the_files_it_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ("drive", "-t", "surface:paper", "-p", "0,0 2,0 3,0.2", "--step", "0.02", "--linear", "-o", tmp_path)
    record = json.loads(answer(capsys, *argv, "--json"))
    assert {Path(f).name for f in record["files"]} == {f.name for f in tmp_path.iterdir()}
    for name in ("map.png", "profile.png", "worst.png"):
        assert_drawn(tmp_path / name)
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as run:
        assert run.sizes["time"] == record["stations"] == len((tmp_path / "run.csv").read_text().splitlines()) - 1
        assert_close(record["extremes"]["pitch"]["max"], float(run["pitch"].max()), 1e-12, "rad", "the summary is of this run")
    again = rb.drive(
        rb.load_rover("elhami-dashti"),
        rb.surfaces.paper(interpolation="linear"),
        rb.Path.waypoints([(0, 0), (2, 0), (3, 0.2)]),
        step=0.02,
    )
    assert_close(record["extremes"]["pitch"]["max"], float(again["pitch"].max()), 1e-12, "rad", "--linear is linear ground")
    assert "pitch" in answer(capsys, *argv[:-2])


def test_drive_without_a_path_crosses_the_middle(capsys: pytest.CaptureFixture[str]) -> None:
    record = json.loads(answer(capsys, "drive", "-t", "surface:paper", "--json"))
    assert 4.5 < record["length"] < 6.0  # of the map's 6 m
    assert record["status"] == {"CONVERGED": record["stations"]}


@pytest.mark.parametrize(
    ("file", "path"),
    [
        ("marsyard2021/marsyard_terrain_hm.tif", "-12,-10 -2,-4 10,-8 12,6"),
        ("gale/missionDEM.tif", "8142500,-276700 8142560,-276620"),
    ],
)
def test_drive_over_a_real_terrain_model(
    file: str, path: str, data: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rasterio")
    record = json.loads(answer(capsys, "drive", "-t", data(file), "-p", path, "--step", "0.05", "-o", tmp_path, "--json"))
    assert record["status"]["CONVERGED"] > 0.98 * record["stations"]
    for name in ("map.png", "profile.png", "worst.png"):
        assert_drawn(tmp_path / name)


def assert_drawn(file: Path) -> None:
    """A picture of some size with something on it."""
    with Image.open(file) as image:
        assert min(image.size) > 300
    assert count_colours(file) > 200


def run(*argv: str, **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", *argv], capture_output=True, text=True, timeout=PATIENCE, check=False, **more)  # type: ignore[call-overload,no-any-return]


def test_help_and_version_load_nothing_heavy() -> None:
    heavy = "('numpy', 'numba', 'scipy', 'xarray', 'matplotlib', 'mujoco', 'rasterio')"
    for argument in ("--help", "--version"):
        loaded = f"print([m for m in {heavy} if m in sys.modules])"
        code = f"import sys; from rockerbogie.cli import main; c = main(['{argument}']); {loaded}; sys.exit(c)"
        done = run(code)
        assert done.returncode == 0
        assert done.stdout.splitlines()[-1] == "[]"
    assert rb.__version__ in done.stdout


def check_interrupt(work: str) -> None:
    """Check that an interrupt ends a command.

    `work` defines the command, which prints "on" when it can be interrupted.
    """
    code = f"import sys, time\nfrom rockerbogie import cli\n{work}\nsys.exit(cli.main([]))"
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "on\n"
        child.send_signal(signal.SIGINT)
        _, said = child.communicate(timeout=PATIENCE)
    assert child.returncode == 130
    assert said.strip() == "interrupted"


def test_interrupted_without_a_traceback() -> None:
    check_interrupt("cli._run = lambda argv: (print('on', flush=True), time.sleep(300))")


def test_an_interrupt_in_a_callback_is_not_lost() -> None:
    """Python drops an error raised while an object is freed; Ctrl-C stops the command anyway."""
    check_interrupt(
        "class Freed:\n def __del__(self): print('on', flush=True); time.sleep(300)\n"
        "def work(argv):\n Freed(); time.sleep(300)\n"
        "cli._run = work"
    )


def test_a_closed_pipe_is_no_error() -> None:
    code = (
        "import sys; from rockerbogie import cli; from rockerbogie.cli.common import print_json; "
        "cli._run = lambda argv: print_json(list(range(100000))) or 0; sys.exit(cli.main([]))"
    )
    for size in ("100000", "10"):  # more than a pipe holds, and so little that it is written only at the end
        read, write = os.pipe()
        os.close(read)
        done = subprocess.run(
            [sys.executable, "-c", code.replace("100000", size)],
            stdout=write,
            stderr=subprocess.PIPE,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        os.close(write)
        assert (done.returncode, done.stderr) == (0, "")
