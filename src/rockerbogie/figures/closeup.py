"""One pose in detail: the rover on its terrain with its contacts and numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ..rover.model import Rover
from ..settling.status import MEANING, Status
from ..terrain.heightfield import Terrain
from .charts import tilt_of
from .render import Camera, Mesh, hidden_by
from .scene.terrain_mesh import block_base
from .scene_drawing import Bounds, draw, grid_step, rule_block, stance_mesh
from .style import ALARM, INK, LEFT, RIGHT, figure, look
from .terrain_block import ground_mesh, sample_ground

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_SIZE = (1230, 930)
_LIFTED = 5e-4  # m: a smaller gap of a simulated wheel counts as contact
_HALO = [withStroke(linewidth=3, foreground="white")]


def pose_figure(
    rover: Rover, terrain: Terrain, record: xr.Dataset, title: str, *, view: tuple[float, float] | None = None
) -> Figure:
    """Draw the rover in one pose, with its contacts and its numbers.

    Args:
        rover: the rover.
        terrain: the terrain it is on.
        record: one pose, a Dataset without a time axis.
        title: text above.
        view: azimuth and elevation of the camera, rad; default: from the side to which the terrain falls.

    Returns:
        The figure.
    """
    with look():
        fig = figure(11.4, 6.6)
        draw_pose(fig, rover, terrain, record, title, view=view)
        _write_numbers(numbers_beside(fig), rover, record)
    return fig


def draw_pose(
    fig: Figure, rover: Rover, terrain: Terrain, record: xr.Dataset, title: str, *, note: str = "",
    view: tuple[float, float] | None = None,
) -> tuple[Axes, Camera]:  # fmt: skip
    """Draw the rover in one pose with its contacts, beside the place for numbers.

    Args:
        fig: a figure of 11.4 × 6.6 inches.
        rover, terrain, record, title, view: as for `pose_figure`.
        note: what else the picture shows.

    Returns:
        Axes in pixels, and the camera.
    """
    bounds = patch_around(rover, record, terrain)
    base = block_base(sample_ground(terrain, bounds)[2])
    mesh = Mesh.join([ground_mesh(terrain, bounds, base), stance_mesh(rover, record)])
    azimuth, elevation = view or (_seen_from(terrain, record, bounds), np.radians(21))
    camera = Camera.framing(mesh.corners, azimuth, elevation, _SIZE, margin=(0.06, 0.04, 0.03, 0.10))
    origin = (float(np.floor(bounds[0])), float(np.floor(bounds[1]))) if max(map(abs, bounds)) > 1e4 else (0.0, 0.0)
    fig.set_layout_engine("none")
    ax = fig.add_axes((0, 0, 0.72, 0.94))
    draw(ax, mesh, camera, float(record["yaw"]), grid_step(bounds))
    rule_block(ax, camera, bounds, base, origin)
    point = record["contact_point"].values
    place = camera.project(point)[:, :2]
    behind = hidden_by(mesh, camera, point) > 1.2 * (rover.wheel_radius + rover.wheel_width)  # by more than its own wheel
    lifted = record["gap"].values > _LIFTED
    for i, name in enumerate(rover.wheel_names):
        if np.isfinite(place[i]).all():
            fill, shown = ("none", 0.5) if behind[i] else ("white" if lifted[i] else "#F0E442", 1.0)
            ax.plot(*place[i], "o", ms=6, mfc=fill, mec=ALARM if lifted[i] else INK, mew=1.5 if lifted[i] else 1.0, alpha=shown)
            ax.annotate(
                name, place[i], xytext=(0, -15), textcoords="offset points", ha="center", fontsize=9.5, fontweight="bold",
                color=(LEFT, RIGHT)[i % 2], path_effects=_HALO, alpha=0.6 if behind[i] else 1.0,
            )  # fmt: skip
    fig.text(0.02, 0.955, title, fontsize=13, fontweight="bold")
    air = ", red ring: wheel off the ground" if lifted.any() else ""
    told = f"contact points in yellow (outlined: hidden){air}{note} · grid {grid_step(bounds):g} m"
    if origin != (0.0, 0.0):
        told += f" · axes from ({origin[0]:.0f}, {origin[1]:.0f})"
    fig.text(0.02, 0.92, told, fontsize=8.5, color="#666666")
    return ax, camera


def numbers_beside(fig: Figure) -> Axes:
    """Add axes for the numbers beside a pose.

    Args:
        fig: figure of `draw_pose`.

    Returns:
        Axes from 0 to 1, without lines.
    """
    ax = fig.add_axes((0.72, 0.02, 0.27, 0.9))
    ax.set_axis_off()
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    return ax


def _write_numbers(ax: Axes, rover: Rover, record: xr.Dataset) -> None:
    """Write the angles, gaps and status of a pose beside the picture."""

    def degrees(value: float) -> str:
        return f"{round(float(np.degrees(value)), 2) + 0.0:+.2f}°"  # adding 0 makes -0 a plain 0

    def stops(limits: Array) -> str:
        return "" if np.isinf(limits).all() else f"limits {np.degrees(limits[0]):+.3g}°, {np.degrees(limits[1]):+.3g}°"

    status = Status(int(record["status"]))
    left, right = (float(b) for b in record["bogie"].values)
    rows: list[tuple[str, str, str]] = [
        ("x", f"{float(record['x']):.3f} m", ""),
        ("y", f"{float(record['y']):.3f} m", ""),
        ("z", f"{float(record['z']):.4f} m", ""),
        ("tilt", f"{np.degrees(float(tilt_of(record))):.2f}°", ""),
        ("roll", degrees(float(record["roll"])), "left side up is +"),
        ("pitch", degrees(float(record["pitch"])), "nose down is +"),
        ("yaw", degrees(float(record["yaw"])), "left of +x is +"),
        ("rocker ρ", degrees(float(record["rocker"])), stops(rover.rocker_limits)),
        ("bogie left", degrees(left), stops(rover.bogie_limits)),
        ("bogie right", degrees(right), ""),
        ("clearance", f"{float(record['clearance']):.3f} m", "body above terrain"),
    ]
    y, line = 0.985, 0.039
    for name, value, note in rows:
        ax.text(0.0, y, name, color="#555555")
        ax.text(0.56, y, value, ha="right", fontweight="bold" if name == "tilt" else "normal")
        ax.text(0.60, y, note, fontsize=8, color="#777777")
        y -= line
    y -= 0.5 * line
    heads = (
        ("wheel", 0.0, "left"),
        ("contact δ", 0.40, "right"),
        ("gap (mm)", 0.66, "right"),
        ("contact z (m)", 1.0, "right"),
    )
    for head, x, side in heads:
        ax.text(x, y, head, ha=side, color="#555555", fontsize=8.5)
    ax.plot([0, 1], [y - 0.35 * line] * 2, color="#bbbbbb", lw=0.8)
    for i, name in enumerate(rover.wheel_names):
        y -= line
        gap = float(record["gap"][i])
        cells = (
            name,
            degrees(float(record["contact_angle"][i])),
            _millimetres(gap),
            f"{float(record['contact_point'][i, 2]):.3f}",
        )
        for cell, (head, x, side) in zip(cells, heads, strict=True):
            colour = (LEFT, RIGHT)[i % 2] if x == 0 else INK
            ax.text(x, y, cell, ha=side, color=ALARM if head == "gap (mm)" and gap > _LIFTED else colour)
    y -= 1.6 * line
    ax.text(0.0, y, status.name, fontweight="bold", color="#00704f" if status == Status.CONVERGED else ALARM)
    ax.text(0.0, y - line, MEANING[status][0], fontsize=8.5, color="#555555", wrap=True, va="top")


def _millimetres(gap: float) -> str:
    """Return a gap in millimetres as text."""
    if not np.isfinite(gap):
        return "–"
    return "0" if abs(gap) < 5e-7 else f"{1e3 * gap:.3f}"


def patch_around(rover: Rover, record: xr.Dataset, terrain: Terrain) -> Bounds:
    """Return the part of the terrain under the rover, with a margin.

    Args:
        rover: the rover.
        record: one pose with its contact points.
        terrain: the terrain it is on.

    Returns:
        xmin, ymin, xmax, ymax, m.
    """
    point = record["contact_point"].values[:, :2]
    room = 0.3 * rover.wheelbase + float(rover.wheel_radius.max())
    low = np.maximum(np.nanmin(point, axis=0) - room, terrain.bounds[:2])
    high = np.minimum(np.nanmax(point, axis=0) + room, terrain.bounds[2:])
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _seen_from(terrain: Terrain, record: xr.Dataset, bounds: Bounds) -> float:
    """Return the azimuth (rad) of the corner view from which the terrain rises away."""
    x, y, z = sample_ground(terrain, bounds)
    known = np.isfinite(z)
    px, py = np.meshgrid(x - x.mean(), y - y.mean())
    plane, *_ = np.linalg.lstsq(np.stack([px[known], py[known], np.ones(known.sum())], axis=1), z[known], rcond=None)
    downhill = float(np.arctan2(-plane[1], -plane[0]))
    corners = float(record["yaw"]) + np.radians([-55.0, 55.0, -125.0, 125.0])
    best = float(corners[np.argmax(np.cos(corners - downhill) + 1e-6 * np.array([3, 2, 1, 0]))])
    quarter, past = divmod(best, np.pi / 2)  # and never along a side of the block, whose axis could not be read
    return float(quarter * np.pi / 2 + np.clip(past, np.radians(25), np.radians(65)))
