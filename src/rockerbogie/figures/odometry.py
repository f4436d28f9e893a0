"""Charts of odometry: the path from above and from the side, and the slip along it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .style import INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

TRACK, FLAT, TRUTH = "#0072B2", "#E69F00", INK


def odometry_figure(track: xr.Dataset, flat: xr.Dataset, log: xr.Dataset) -> Figure:
    """Draw 3-D and flat odometry from above and from the side, and the slip of the wheels.

    Args:
        track: from `odometry`.
        flat: from `flat_odometry`.
        log: from `read_log`; its positions are drawn if it has them.

    Returns:
        The figure.
    """
    ways = [("3-D odometry", track, TRACK, "-", 2.0), ("flat 2-D odometry", flat, FLAT, "--", 1.6)]
    if all(axis in log for axis in "xyz"):
        ways.insert(0, ("position in the log", log, TRUTH, "-", 3.5))
    with look():
        fig = figure(9.0, 8.5)
        plan, side, slip = fig.subplots(3, 1, height_ratios=(1.5, 0.8, 1.0))
        for label, way, colour, style, width in ways:
            faint = 0.35 if way is log else 1.0
            plan.plot(way["x"], way["y"], color=colour, ls=style, lw=width, alpha=faint, label=label)
            along = _distance(way)
            side.plot(along, way["z"], color=colour, ls=style, lw=width, alpha=faint, label=label)
        plan.plot(track["x"][0], track["y"][0], "o", color=INK, ms=5)
        plan.set_aspect("equal", adjustable="datalim")
        plan.set(xlabel="x (m)", ylabel="y (m)", title="From above; dot: start")
        plan.legend(loc="best")
        side.set(xlabel="distance along each path (m)", ylabel="height (m)", title="From the side")
        for k, name in enumerate(track["wheel"].values):
            colour, style = (LEFT, RIGHT)[k % 2], ("-", "--", ":")[k // 2]
            slip.plot(track["distance"], 1e3 * track["roll_slip"].isel(wheel=k), color=colour, ls=style, lw=1.0, label=str(name))
        slip.set(xlabel="distance (m)", ylabel="slip (mm/s)", title="Rolling slip of each wheel, from the residuals")
        slip.legend(ncols=6, loc="lower left", bbox_to_anchor=(0, -0.5), fontsize=8.5)
    return fig


def _distance(way: xr.Dataset) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the horizontal distance along a track, m."""
    if "distance" in way.coords:
        return np.asarray(way["distance"], dtype=float)
    steps = np.sqrt(sum(np.diff(way[axis].values) ** 2 for axis in "xyz"))
    return np.concatenate([[0.0], np.cumsum(steps)])
