"""Figures of the paper's section III: 6 (terrain, rover) and 7 to 9 (angles over distance)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...figures.render import Camera, Mesh
from ...figures.scene.terrain_mesh import block_base
from ...figures.scene_drawing import Bounds, draw, grid_step, picture_height, rule_block, stance_mesh, trail_mesh
from ...figures.style import COLOURS, LEFT, RIGHT, figure, look
from ...figures.terrain_block import ground_mesh, sample_ground
from ...rover.model import Rover
from ...terrain.heightfield import Terrain

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

VIEW = (np.radians(-62.0), np.radians(25.0))


@dataclass(frozen=True)
class Curve:
    """Curve of figures 7 to 9: variable of the run, index on its second axis, label and colour."""

    variable: str
    member: str | None
    label: str
    colour: str

    def degrees(self, run: xr.Dataset) -> Array:
        """Return the curve's angle.

        Args:
            run: with (n,) records.

        Returns:
            (n,) deg.
        """
        values = run[self.variable]
        if self.member is not None:
            values = values.sel({values.dims[-1]: self.member})
        return np.asarray(np.degrees(values.to_numpy()))


def figures_7_to_9(rover: Rover) -> Mapping[str, tuple[str, Sequence[Curve]]]:
    """Return title and curves of figures 7 to 9.

    Args:
        rover: names the wheels. The front wheels are those with the greatest x.

    Returns:
        File name without ending → (title, curves).
    """
    front = [rover.wheel_names[i] for i in (np.argmax(rover.hubs[::2, 0]) * 2 + s for s in (0, 1))]
    return {
        "figure7": (
            "Rover pitch and roll",
            [Curve("pitch", None, "pitch", COLOURS["pitch"]), Curve("roll", None, "roll", COLOURS["roll"])],
        ),
        "figure8": (
            "Rocker and bogie joint angles",
            [
                Curve("rocker", None, "rocker ρ", COLOURS["rocker"]),
                Curve("bogie", "left", "left bogie β1", LEFT),
                Curve("bogie", "right", "right bogie β2", RIGHT),
            ],
        ),
        "figure9": (
            "Contact angle of the front wheels",
            [
                Curve("contact_angle", front[0], f"left ({front[0]}) δ5", LEFT),
                Curve("contact_angle", front[1], f"right ({front[1]}) δ6", RIGHT),
            ],
        ),
    }


def crossing_bounds(run: xr.Dataset, rover: Rover, terrain: Terrain) -> Bounds:
    """Return the part of the map that a straight crossing along x needs.

    Args:
        run: of the crossing, with contact points.
        rover: its wheel radius sets the margin, 2.5 radii around the contacts.
        terrain: its bounds limit the result.

    Returns:
        xmin, ymin, xmax, ymax, m.
    """
    x, y = run["contact_point"].sel(axis="x"), run["contact_point"].sel(axis="y")
    room = 2.5 * float(rover.wheel_radius.max())
    low, high = terrain.bounds[:2], terrain.bounds[2:]
    half = max(abs(float(y.min())), abs(float(y.max()))) + 2 * room
    return (
        max(low[0], float(x.min()) - room),
        max(low[1], -half),
        min(high[0], float(x.max()) + room),
        min(high[1], half),
    )


def figure_6(rover: Rover, terrain: Terrain, run: xr.Dataset, at: float) -> Figure:
    """Draw the terrain in 3-D with the rover on it and the tracks of its outermost wheels.

    Args:
        rover: the rover of the run.
        terrain: the terrain of the run.
        run: of a straight crossing along x.
        at: distance at which the rover is drawn, m; the nearest record is used.

    Returns:
        The figure.
    """
    bounds = crossing_bounds(run, rover, terrain)
    base = block_base(sample_ground(terrain, bounds)[2])
    record = run.isel(time=int(np.abs(run["distance"].values - at).argmin()))
    mesh = Mesh.join([ground_mesh(terrain, bounds, base), *tracks(terrain, run), stance_mesh(rover, record)])
    size = (1800, picture_height(*VIEW, mesh, 1800, 0.03))
    with look():
        fig = figure(size[0] / 180, size[1] / 180)
        fig.set_layout_engine("none")
        ax = fig.add_axes((0, 0, 1, 1))
        camera = Camera.framing(mesh.corners, *VIEW, size, margin=(0.01, 0.03, 0.03, 0.03))
        draw(ax, mesh, camera, 0.0, grid_step(bounds))
        rule_block(ax, camera, bounds, base)
        ax.text(0.985, 0.955, f"grid {grid_step(bounds):g} m", transform=ax.transAxes, ha="right", fontsize=8.5, color="#666666")
    return fig


def tracks(terrain: Terrain, run: xr.Dataset) -> list[Mesh]:
    """Make ribbons of the contact points of the last two wheels, left and right.

    Args:
        terrain: the terrain of the run.
        run: of a straight crossing; at most about 500 of its records are used.

    Returns:
        Two meshes: left, right.
    """
    point = run["contact_point"].transpose("time", "wheel", "axis").values[:: 1 + run.sizes["time"] // 500, -2:]
    return [trail_mesh(terrain, point[:, s, 0], point[:, s, 1], to_rgb(c), 0.014) for s, c in ((0, LEFT), (1, RIGHT))]


def angles_figure(
    title: str, curves: Sequence[Curve], run: xr.Dataset, sim: xr.Dataset, beside: xr.Dataset, marks: Mapping[str, float]
) -> Figure:
    """Draw model and simulation side by side and their difference below: degrees over distance.

    Args:
        title: of the figure.
        curves: the angles to draw.
        run: of the kinematic model.
        sim: of the rigid-body simulation.
        beside: the model at the simulation's own x, y and yaw (`settle_along`); the difference is taken from it.
        marks: label → distance of a dashed line, m.

    Returns:
        The figure.
    """
    with look():
        fig = figure(9.6, 6.2)
        fig.set_layout_engine("constrained", h_pad=0.06)
        grid = fig.add_gridspec(2, 2, height_ratios=(1.55, 1))
        first = fig.add_subplot(grid[0, 0])
        second = fig.add_subplot(grid[0, 1], sharex=first, sharey=first)
        below = fig.add_subplot(grid[1, :], sharex=first)
        for ax, data, name in ((first, run, "(a) kinematic model"), (second, sim, "(b) rigid-body simulation (MuJoCo)")):
            for curve in curves:
                ax.plot(data["distance"], curve.degrees(data), color=curve.colour, label=curve.label)
            ax.set_title(name)
            _mark(ax, marks, labelled=True)
        first.set_ylabel("angle (deg)")
        second.tick_params(labelleft=False)
        for curve in curves:
            gap = curve.degrees(beside) - curve.degrees(sim)
            rms, worst = np.sqrt(np.nanmean(gap**2)), np.nanmax(np.abs(gap))
            label = f"{curve.label}: RMS {rms:.4f}°, worst {worst:.3f}°"
            below.plot(sim["distance"], gap, color=curve.colour, lw=1.0, label=label)
        below.set_title("(a) − (b) at equal position and yaw")
        below.set_ylabel("difference (deg)")
        _mark(below, marks, labelled=False)
        for ax in (first, second, below):
            ax.set_xlabel("distance along the path (m)")
            ax.axhline(0, color="#999999", lw=0.8, zorder=1)
        fig.suptitle(title, x=0.01, ha="left", fontsize=13, fontweight="bold")
        fig.legend(*first.get_legend_handles_labels(), loc="outside upper right", ncols=len(curves))
        fig.legend(*below.get_legend_handles_labels(), loc="outside lower center", ncols=len(curves), fontsize=8.5)
    return fig


def arrivals(rover: Rover, bump: float) -> dict[str, float]:
    """Return the x of the reference point at which each axle is above x = bump.

    Args:
        rover: gives the hubs.
        bump: x, m.

    Returns:
        "front", "middle", "rear" → x, m, for a rover with all joint angles 0 and yaw 0.
    """
    order = np.argsort(-rover.hubs[::2, 0])
    return {name: bump - float(rover.hubs[2 * i, 0]) for name, i in zip(("front", "middle", "rear"), order, strict=True)}


def _mark(ax: Axes, marks: Mapping[str, float], *, labelled: bool) -> None:
    """Draw a dashed vertical line at each position, m, with its label if `labelled`."""
    for label, x in marks.items():
        ax.axvline(x, color="#aaaaaa", lw=0.8, ls=(0, (4, 3)), zorder=1)
        if labelled:
            ax.annotate(
                label, (x, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -2), textcoords="offset points",
                rotation=90, va="top", fontsize=7.5, color="#777777",
            )  # fmt: skip
