"""`rockerbogie lab`."""

from __future__ import annotations

import sys
import threading
import webbrowser
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import RockerbogieError
from .common import RoverName, TerrainName, parse_gravity
from .rasters import Raster, load_terrain


def lab(
    *,
    rover: RoverName = "curiosity",
    terrain: TerrainName = "surface:mars?seed=1",
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    run: Path | None = None,
    gravity: str = "earth",
    host: str = "127.0.0.1",
    port: int | None = None,
    browser: Annotated[bool, Parameter(name="--browser", negative="--no-browser")] = True,
    light: Annotated[bool, Parameter(name="--light", negative="")] = False,
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
    linear
        Bilinear instead of bicubic interpolation.
    raster
        Options of a raster file.
    """
    from ..lab.server import LOOPBACK, start_lab
    from ..rover.formats import load_rover

    machine, surface = load_rover(rover), load_terrain(terrain, linear, raster)
    page = start_lab(
        machine, surface, maps=_read_map(map_), run=_read_run(run), gravity=parse_gravity(gravity), host=host, port=port,
        light=light,
    )  # fmt: skip
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
