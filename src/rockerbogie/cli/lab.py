"""`rockerbogie lab`."""

from __future__ import annotations

import contextlib
import sys
import threading
import webbrowser
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import RockerbogieError
from .common import RoverName, TerrainName, Whole, parse_gravity
from .rasters import Raster, load_terrain

#: Packages of ROS that the listener imports.
ROS_MODULES = ("rclpy", "nav_msgs.msg", "sensor_msgs.msg")


def lab(
    *,
    rover: RoverName = "curiosity",
    terrain: TerrainName = "surface:mars?seed=1",
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    run: Path | None = None,
    gravity: str = "earth",
    host: str = "127.0.0.1",
    port: Whole | None = None,
    browser: Annotated[bool, Parameter(name="--browser", negative="--no-browser")] = True,
    light: Annotated[bool, Parameter(name="--light", negative="")] = False,
    ros: Annotated[bool, Parameter(name="--ros", negative="")] = False,
    namespace: str = "",
    name: Annotated[list[str] | None, Parameter(name="--name", negative="", allow_leading_hyphen=True)] = None,
    linear: Annotated[bool | None, Parameter(name="--linear", negative="--cubic")] = None,
    raster: Raster = None,
) -> int:
    """Open a page in the browser: move, drive and change a rover on terrain.

    The rover settles while you drag it. Stop the server with Ctrl-C. See docs/lab.md.

    Parameters
    ----------
    rover
        Preset, or a .toml, .urdf, .sdf or MJCF file.
    terrain
        Terrain file, or surface:NAME.
    map_
        Map of this terrain, from `rockerbogie map`, for colours by its layers and for routes.
    run
        Run of this rover on this terrain: run.nc from `drive` or `simulate`.
    gravity
        earth, mars, moon, or a number in m/s².
    host
        Address to listen at. Any address except 127.0.0.1 opens the page to the network, without a password.
    port
        Default: the first free one from 8080.
    browser
        Open the page in the default browser.
    light
        Draw no shadows and coarser terrain, for a browser without a graphics card.
    ros
        Track a robot by its ROS 2 topics odom and joint_states, such as those of `rockerbogie ros`.
    namespace
        With --ros: namespace of the topics.
    name
        With --ros: a joint's name and ours, as for `rockerbogie ros`. May be repeated.
    linear
        Bilinear instead of bicubic interpolation.
    raster
        Options of a raster file.
    """
    from ..lab.server import start_lab
    from ..rover.formats import load_rover

    machine, surface = load_rover(rover), load_terrain(terrain, linear, raster)
    if (namespace or name) and not ros:
        raise RockerbogieError("--namespace and --name belong to --ros: add it")
    with _live_poses(machine, namespace, name or []) if ros else contextlib.nullcontext() as live:
        page = start_lab(
            machine, surface, maps=_read_map(map_), run=_read_run(run), gravity=parse_gravity(gravity), host=host, port=port,
            light=light, live=live,
        )  # fmt: skip
        return _serve(page, host, browser)


def _serve(page: Any, host: str, browser: bool) -> int:
    """Print the address of a page, open it, and serve it until Ctrl-C; return exit code 0."""
    from ..lab.server import LOOPBACK

    if host not in LOOPBACK:
        print(
            f"rockerbogie: warning: --host {host} opens the page to everyone who reaches this machine: it has no password. "
            "Leave --host out to use it on this machine only.",
            file=sys.stderr,
        )
    print(f"The lab is at {page.url} (Ctrl-C stops it).", flush=True)
    if browser:
        webbrowser.open(page.url)
    try:
        threading.Event().wait()
    finally:
        page.stop()
    return 0


def _live_poses(rover: Any, namespace: str, names: list[str]) -> Any:
    """Return a listener to a robot's topics."""
    from ..errors import require
    from ..ros.joints import parse_names

    require("lab --ros", "ros2", *ROS_MODULES)
    from ..ros.poses import LivePoses

    return LivePoses(rover, namespace=namespace, names=parse_names(names))


def _read_map(file: Path | None) -> Any:
    """Return a map, or None without a file."""
    if file is None:
        return None
    from ..maps.files import read_map

    return read_map(file).load()


def _read_run(file: Path | None) -> Any:
    """Return a run, or None without a file."""
    if file is None:
        return None
    import xarray as xr

    if not file.is_file():
        raise RockerbogieError(f"no run at {str(file)!r}: give run.nc from drive or simulate")
    try:
        return xr.load_dataset(file, engine="h5netcdf")
    except (OSError, ValueError, KeyError):
        raise RockerbogieError(f"{str(file)!r} is not a run: give run.nc from drive or simulate") from None
