"""Installs from an sdist and from a built wheel, in a clean environment without extras.

The tests need the network for the package's dependencies; without it they are skipped. Compiled kernels are read from the
checkout's own cache: its key is the contents of the kernel sources, so that this also checks that they are installed unchanged.
"""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.jit.cache import cache_folders
from support import probe
from support.patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
PLACE = (1.0, 2.0, 0.3)
SETTLE = f"""
import rockerbogie as rb
pose = rb.settle(rb.load_rover("curiosity"), rb.surfaces.mars(seed=1), *{PLACE})
print(rb.__file__, pose.z.item().hex(), pose.pitch.item().hex())
"""
#: Extra -> commands that need it; `{film}` and so on are files of the test. Each must end at once, before any work.
NEEDED = {
    "geo": (
        "settle -t dem.tif",
        "drive -t surface:plane --path route.gpkg",
        "map surface:mars -o map.tif",
        "plan map.tif --start 0 0 --goal 1 1",
        "plan map.nc --start 0 0 --reach reach.tif",
        "plan map.nc --start 0 0 --goal 1 1 --keep-out area.geojson",
        "plan map.nc --start 0 0 --goal 1 1 -o route.gpkg",
    ),
    "film": ("drive -t surface:plane --film drive.mp4", "simulate -t surface:plane --film drive.mp4"),
    "ros": ("odometry log.mcap -r curiosity", "odometry log.db3 -r curiosity", "drive -t surface:plane -o out --mcap"),
    "scale": ("map surface:mars -o map.zarr", "map surface:mars -o map.nc --workers 2", "plan map.zarr --start 0 0 --goal 1 1"),
    "robots": ("settle -t surface:plane -r mesh.urdf",),
    "ros2": ("ros --rover osr", "ros"),
}
#: Wait for a message of the node: the first state of the rover.
WATCH = f"""
import rclpy, sys, time
from diagnostic_msgs.msg import DiagnosticArray
rclpy.init()
node, found, end = rclpy.create_node("watcher"), [], time.monotonic() + {PATIENCE:g}
node.create_subscription(DiagnosticArray, "rover/state", found.append, 10)
while not found and time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
print(*(status.name for message in found[:1] for status in message.status), sep=", ")
"""
#: Run command lines in one process, each as the command does; print code, stdout and stderr of each as JSON.
LINES = """
import contextlib, io, json, sys
from rockerbogie.cli import main
done = []
for line in sys.argv[1:]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(line.split())
    done.append((code, out.getvalue(), err.getvalue()))
print(json.dumps(done))
"""
STL = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"


def run(
    *command: str | Path, check: bool = True, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a command without the checkout on its path, and with caches of bytecode."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "NUMBA", "VIRTUAL_ENV"))}
    done = subprocess.run(
        [str(part) for part in command],
        check=False,
        cwd=cwd,
        capture_output=True,
        text=True,
        env=clean | environment,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE,
    )
    assert done.returncode == 0 or not check, f"{command}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done


def make_environment(folder: Path) -> Path:
    """Return the Python of a new virtual environment; `pip` installs into it."""
    run(sys.executable, "-m", "venv", "--without-pip", folder)
    return folder / ("Scripts" if os.name == "nt" else "bin") / "python"


def pip(python: Path, *command: str | Path) -> None:
    """Run a command of pip for an environment."""
    run(sys.executable, "-m", "pip", "--python", python, *command)


def skip_without_network(folder: Path) -> None:
    """Skip the test if pip finds no package index."""
    found = run(sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", folder, "mdurl", check=False)
    if found.returncode:
        pytest.skip(f"pip finds no packages here: {' '.join(found.stderr.split())[-200:]}")


def build(python: Path, kind: str, folder: Path) -> Path:
    """Build a distribution of the checkout, "wheel" or "sdist"; return its file."""
    requires = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    pip(python, "install", "-q", *requires)
    target = folder / "dist"
    subprocess.run([python, "-m", "hatchling", "build", "-t", kind, "-d", target], cwd=ROOT, check=True, timeout=PATIENCE)
    (file,) = target.iterdir()
    return file


def run_node(python: Path, work: Path, cache: str) -> None:
    """Start the ROS 2 node of an environment with the extra ros2; check its state, and end it."""
    clean = {k: v for k, v in os.environ.items() if k not in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "PYTHONPATH")}
    ros = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "91", "NUMBA_CACHE_DIR": cache}
    environment = clean | ros
    options = {"cwd": work, "env": environment, "capture_output": True, "text": True, "timeout": PATIENCE + 60}
    command = python.with_name("rockerbogie")
    told = subprocess.run([command, "ros", "--help"], check=False, **options)
    assert told.returncode == 0, told.stderr
    assert "cmd_vel" in told.stdout
    node = subprocess.Popen(
        [command, "ros", "--rover", "osr"], cwd=work, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        watch = [python, "-c", WATCH]
        seen = subprocess.run(watch, check=False, **options)
        node.send_signal(signal.SIGINT)
        said, _ = node.communicate(timeout=PATIENCE)
    finally:
        node.kill()
    assert "rockerbogie: sensors, rockerbogie: pose" in seen.stdout, seen.stdout + seen.stderr + said
    assert node.returncode == 0, said


def files_of(package: Path) -> set[str]:
    """Return the relative paths of a package's files, without caches."""
    return {str(file.relative_to(package)) for file in package.rglob("*") if file.is_file() and "__pycache__" not in file.parts}


def test_installed_package_settles_and_names_missing_extras(tmp_path: Path) -> None:
    tools, python = (make_environment(tmp_path / name) for name in ("tools", "clean"))
    skip_without_network(tmp_path / "downloaded")
    same = [f"{name}=={version(name)}" for name in ("numba", "llvmlite")]  # of the kernels in the cache
    cache, work = str(cache_folders()[-1].parent), tmp_path / "work"
    work.mkdir()
    here = rb.settle(rb.load_rover("curiosity"), rb.surfaces.mars(seed=1), *PLACE)

    def cli(line: str) -> subprocess.CompletedProcess[str]:
        return run(python.with_name("rockerbogie"), *line.split(), check=False, cwd=work, NUMBA_CACHE_DIR=cache)

    for kind in ("sdist", "wheel"):  # one after the other: installing the dependencies takes longest
        built = build(tools, kind, tmp_path / kind)
        pip(python, "uninstall", "-q", "-y", "rockerbogie")
        assert not list((tmp_path / "clean").rglob("rockerbogie")), "nothing is left of the install before"
        pip(python, "install", "-q", "--no-compile", built, *same)
        done = run(python, "-c", SETTLE, NUMBA_CACHE_DIR=cache)
        file, z, pitch = done.stdout.split()
        package = Path(file).parent
        assert package.is_relative_to(tmp_path / "clean"), "the installed package is imported, not the checkout"
        assert files_of(package) == files_of(ROOT / "src" / "rockerbogie"), "every file of the package is installed"
        np.testing.assert_array_equal([float.fromhex(z), float.fromhex(pitch)], [here.z, here.pitch])
        told = cli("--help")
        assert told.returncode == 0
        assert "settle" in told.stdout
        assert cli("--version").stdout.strip() == version("rockerbogie")
        settled = cli("settle -t surface:mars --at 1,2")
        assert settled.returncode == 0, settled.stderr
        assert "pitch" in settled.stdout

    for name in ("dem.tif", "route.gpkg", "map.tif", "area.geojson", "log.mcap", "log.db3"):
        (work / name).write_bytes(b"x")
    (work / "part.stl").write_text(STL)
    (work / "mesh.urdf").write_text(probe.urdf(body='<collision><geometry><mesh filename="part.stl"/></geometry></collision>'))
    (work / "map.zarr").mkdir()
    (work / "map.zarr" / "zarr.json").write_text("{}")
    assert cli("map surface:plane -o map.nc --headings 1 --resolution 2").returncode == 0, "NetCDF needs no extra"
    before = files_of(work)
    cases = [(extra, line) for extra, lines in NEEDED.items() for line in lines]
    done = run(python, "-c", LINES, *(line for _, line in cases), cwd=work, NUMBA_CACHE_DIR=cache)
    for (extra, line), (code, out, err) in zip(cases, json.loads(done.stdout), strict=True):
        sentence = [text for text in err.splitlines() if "pip install" in text]
        assert len(sentence) == 1, f"{line}: {err}{out}"
        assert f"pip install 'rockerbogie[{extra}]'" in sentence[0], line
        assert "Traceback" not in err, line
        if extra != "robots":  # without the mesh there is still a rover
            assert code == 2, f"{line}: {code}"
            assert len(err.splitlines()) == 1, f"{line}: {err}"
    assert files_of(work) == before, "no output was begun"

    if sys.platform == "linux" and platform.machine() == "x86_64" and sys.version_info < (3, 14):  # wheels of ROS 2
        pip(python, "install", "-q", "--no-compile", f"{built}[ros2]")
        run_node(python, work, cache)
