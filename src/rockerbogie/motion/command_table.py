"""Recorded commands of wheels and steering over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..rover.frames import check_steering
from ..rover.model import Rover

if TYPE_CHECKING:
    import xarray as xr


def read_commands(rover: Rover, commands: xr.Dataset) -> tuple[Array, Array, Array]:
    """Return recorded commands in the rover's order of wheels.

    Args:
        rover: the rover.
        commands: `wheel_rate`, rad/s, and `steering`, rad, over (time, wheel).

    Returns:
        Time since the first command (n,), s; wheel rates (n, 6), rad/s; steering angles (n, 6), rad.

    Raises:
        RockerbogieError: commands of another rover, missing variables, wrong shapes or units, or times that do not increase.
    """
    commanded = commands.attrs.get("rover", rover.name)
    if commanded != rover.name:
        raise RockerbogieError(f"the commands are for rover {commanded!r}, not {rover.name!r}: its wheels are others")
    missing = {"wheel_rate", "steering", "time"} - set(map(str, commands.variables))
    if missing:
        raise RockerbogieError(f"commands hold no {', '.join(sorted(missing))}; give wheel_rate and steering over (time, wheel)")
    if commands["time"].dtype.kind not in "fiu":
        raise RockerbogieError(f"the time of the commands is of type {commands['time'].dtype}; give seconds")
    time = np.asarray(commands["time"], dtype=float)
    if len(time) < 2 or not (np.isfinite(time).all() and (np.diff(time) > 0).all()):
        raise RockerbogieError(
            f"commands hold {len(time)} times; give two or more, each later than the last and finite, in seconds"
        )
    rate, angle = (_by_wheel(rover, commands[name], unit) for name, unit in (("wheel_rate", "rad/s"), ("steering", "rad")))
    check_steering(rover, angle)
    return time - time[0], rate, angle


def _by_wheel(rover: Rover, values: xr.DataArray, unit: str) -> Array:
    """Return commands in the rover's order of wheels.

    Args:
        rover: gives the names of the wheels.
        values: commands over time and wheel; wheels in the rover's order, or named by a coordinate.
        unit: required unit, where the commands state one.

    Returns:
        (n, 6), in `unit`.

    Raises:
        RockerbogieError: other dimensions, wheels or units; values that are not finite.
    """
    if set(values.dims) != {"time", "wheel"}:
        raise RockerbogieError(f"commands {values.name} have dims {values.dims}; give (time, wheel)")
    if values.attrs.get("units", unit) != unit:
        raise RockerbogieError(f"commands {values.name} are in {values.attrs['units']!r}; give {unit}")
    if "wheel" in values.coords:
        names = [str(name) for name in values["wheel"].to_numpy()]
        if sorted(names) != sorted(rover.wheel_names):
            raise RockerbogieError(
                f"commands {values.name} are for wheels {', '.join(names)}; the rover's are {', '.join(rover.wheel_names)}"
            )
        values = values.sel(wheel=list(rover.wheel_names))
    table = values.transpose("time", "wheel").to_numpy()
    if table.shape[1] != 6 or not np.isfinite(table).all():
        raise RockerbogieError(f"commands {values.name} have shape {table.shape}; give six finite numbers a time")
    return np.asarray(table, dtype=float)
