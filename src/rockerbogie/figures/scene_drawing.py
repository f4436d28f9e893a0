"""Scenes in three dimensions: rovers, terrain and paths with light and grid lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from ..rover.model import Rover
from ..rover.rotations import body_transform, wrap_angle
from ..terrain.heightfield import Terrain
from .render import Camera, Mesh, render
from .scene.mesh import vertex_normals
from .scene.rover_mesh import LINKS, link_transforms, rover_parts
from .scene.terrain_mesh import block_base
from .style import INK, figure, look
from .terrain_block import ground_mesh, sample_ground

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Bounds = tuple[float, float, float, float]

_SUN_HEIGHT = np.radians(48.0)
_SUN_BESIDE = np.radians(42.0)  # greatest angle between the sun and the viewer's direction


def rover_mesh(
    rover: Rover,
    T_world_body: ArrayLike,
    rocker: float,
    bogie: ArrayLike,
    steering: ArrayLike | None = None,
    wheel_turn: ArrayLike = 0.0,
) -> Mesh:
    """Return the rover in the world frame as triangles for the renderer.

    Args:
        rover: the rover.
        T_world_body: (4, 4) pose of the body.
        rocker: angle of the left rocker, rad.
        bogie: (2,) angles of the bogies, rad.
        steering: (6,) rad; None: 0.
        wheel_turn: (6,) or one angle by which the wheels have turned, rad.

    Returns:
        The mesh, m.
    """
    frames = link_transforms(rover, T_world_body, rocker, bogie, steering, wheel_turn)
    drawn = []
    for part in rover_parts(rover):
        T = frames[LINKS.index(part.link)]
        corners = part.vertices @ T[:3, :3].T + T[:3, 3]
        normals = vertex_normals(part.vertices, part.faces) @ T[:3, :3].T
        drawn.append(Mesh.smooth(corners[part.faces], normals[part.faces], part.colour))
    return Mesh.join(drawn)


def stance_mesh(rover: Rover, record: xr.Dataset) -> Mesh:
    """Return the rover in one pose (a Dataset without a time axis) as triangles.

    Args:
        rover: the rover.
        record: one pose of a run or of `Pose.to_xarray`.

    Returns:
        The triangles.
    """
    value = {name: np.asarray(record[name]) for name in ("x", "y", "z", "roll", "pitch", "yaw", "rocker", "bogie", "steering")}
    T = body_transform(*(value[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")))
    rolled = float(record["distance"]) / rover.wheel_radius if "distance" in record.coords else 0.0
    return rover_mesh(rover, T, float(value["rocker"]), value["bogie"], value["steering"], rolled)


def trail_mesh(terrain: Terrain, x: ArrayLike, y: ArrayLike, colour: ArrayLike, width: float) -> Mesh:
    """Return a ribbon along a track on the terrain.

    Args:
        terrain: the terrain.
        x: (n,) m.
        y: (n,) m.
        colour: (3,), 0 to 1.
        width: of the ribbon, m.

    Returns:
        The triangles.
    """
    px, py = (np.asarray(a, dtype=float) for a in (x, y))
    dx, dy = np.gradient(px), np.gradient(py)
    norm = np.maximum(np.hypot(dx, dy), 1e-12)
    sides = []
    for sign in (-0.5, 0.5):
        sx, sy = px - sign * width * dy / norm, py + sign * width * dx / norm
        sides.append(np.stack([sx, sy, terrain.height(sx, sy) + 0.25 * width], axis=1))
    a, b = sides
    corners = np.concatenate([np.stack([a[:-1], a[1:], b[1:]], axis=1), np.stack([a[:-1], b[1:], b[:-1]], axis=1)])
    return Mesh.flat(corners[np.isfinite(corners).all(axis=(1, 2))], colour)


def terrain_figure(terrain: Terrain, bounds: Bounds, view: tuple[float, float] | None = None) -> Figure:
    """Draw a part of a terrain in three dimensions.

    Args:
        terrain: the terrain.
        bounds: (xmin, ymin, xmax, ymax) of the part, m.
        view: azimuth and elevation of the camera, rad.

    Returns:
        The figure.
    """
    view = view or (np.radians(-62.0), np.radians(28.0))
    base = block_base(sample_ground(terrain, bounds)[2])
    mesh = ground_mesh(terrain, bounds, base, 400)
    size = (1500, max(picture_height(*view, mesh, 1500, 0.12), 500))
    camera = Camera.framing(mesh.corners, *view, size, margin=(0.07, 0.05, 0.04, 0.12))
    far = max(map(abs, bounds)) > 1e4
    origin = (float(np.floor(bounds[0])), float(np.floor(bounds[1]))) if far else (0.0, 0.0)
    with look():
        fig = figure(size[0] / 150, size[1] / 150 + 0.6)
        fig.set_layout_engine("none")
        ax = fig.add_axes((0, 0, 1, 1 - 0.6 / (size[1] / 150 + 0.6)))
        draw(ax, mesh, camera, 0.0, grid_step(bounds))
        rule_block(ax, camera, bounds, base, origin)
        low, high = (float(f(mesh.corners[mesh.ruled][..., 2])) for f in (np.min, np.max))
        fig.text(0.02, 1 - 0.25 / (size[1] / 150 + 0.6), terrain.name, fontsize=13, fontweight="bold", va="center")
        note = f"heights {low:.4g} m to {high:.4g} m · grid {grid_step(bounds):g} m"
        note += f" · axes from ({origin[0]:.0f}, {origin[1]:.0f})" if far else ""
        fig.text(0.02, 1 - 0.48 / (size[1] / 150 + 0.6), note, fontsize=8.5, color="#666666", va="center")
    return fig


def picture_height(azimuth: float, elevation: float, mesh: Mesh, width: int, room: float) -> int:
    """Return the height in pixels of a picture `width` pixels wide, with `room` above and below.

    Args:
        azimuth: of the camera, rad.
        elevation: of the camera, rad.
        mesh: the scene.
        width: of the picture, px.
        room: share of the width left free above and below.

    Returns:
        The height, px.
    """
    seen = Camera.framing(mesh.corners, azimuth, elevation, (width, width), margin=(0, 0, 0, 0)).project(mesh.corners)[..., 1]
    return round((np.ptp(seen) + room * width) / 20) * 20


def sunlit(mesh: Mesh, camera: Camera, yaw: float, grid: float) -> Array:
    """Render (height, width, 4), lit from the side that shows a rover with this yaw best.

    Args:
        mesh: the scene.
        camera: the camera.
        yaw: of the rover, rad.
        grid: spacing of the lines on the terrain, m.

    Returns:
        (height, width, 4), 0 to 1.
    """
    azimuth = float(np.arctan2(-camera.axes[2, 1], -camera.axes[2, 0]))
    to_left, to_right = (wrap_angle(yaw + side - azimuth) for side in (np.pi / 2, -np.pi / 2))
    beside = to_left if abs(to_left) < abs(to_right) else to_right
    sun = azimuth + float(np.clip(beside, -_SUN_BESIDE, _SUN_BESIDE))
    return render(mesh, camera, sun=(sun, _SUN_HEIGHT), grid=grid)


def draw(ax: Axes, mesh: Mesh, camera: Camera, yaw: float, grid: float) -> None:
    """Show a mesh on axes measured in the camera's pixels.

    Args:
        ax: axes that will measure pixels.
        mesh: the scene.
        camera: the camera.
        yaw: of the rover, rad.
        grid: spacing of the lines on the terrain, m.
    """
    ax.imshow(sunlit(mesh, camera, yaw, grid), extent=(0, camera.size[0], camera.size[1], 0), interpolation="antialiased")
    ax.set_xlim(0, camera.size[0])
    ax.set_ylim(camera.size[1], 0)
    ax.set_axis_off()


def rule_block(ax: Axes, camera: Camera, bounds: Bounds, base: float, origin: tuple[float, float] = (0.0, 0.0)) -> None:
    """Write metres along the two near lower edges of the block, counted from `origin`.

    Args:
        ax: axes in pixels.
        camera: the camera.
        bounds: xmin, ymin, xmax, ymax of the block, m.
        base: height of its lower face, m.
        origin: x and y that numbers count from, m.
    """
    xmin, ymin, xmax, ymax = bounds
    nearest_y = max((ymin, ymax), key=lambda y: camera.project([(xmin + xmax) / 2, y, base])[1])
    nearest_x = max((xmin, xmax), key=lambda x: camera.project([x, (ymin + ymax) / 2, base])[1])
    centre = np.array([(xmin + xmax) / 2, (ymin + ymax) / 2, base])
    for axis, name in ((0, "x"), (1, "y")):
        low, high = bounds[axis] - origin[axis], bounds[axis + 2] - origin[axis]
        ticks = np.asarray(MaxNLocator(nbins=6 if axis == 0 else 4, steps=[1, 2, 5, 10]).tick_values(low, high))
        ticks = ticks[(ticks >= low - 1e-9) & (ticks <= high + 1e-9)]
        points = np.tile([nearest_x, nearest_y, base], (len(ticks) + 1, 1))
        points[:, axis] = np.append(ticks, (low + high) / 2) + origin[axis]
        outward = np.zeros(3)
        outward[1 - axis] = np.sign((points[-1] - centre)[1 - axis])
        start = camera.project(points)[:, :2]
        way = camera.project(points + 1e-3 * outward)[:, :2] - start
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        unit = camera.size[0] / 100
        for tick, p, w in zip(ticks, start, way, strict=False):
            ax.plot(*np.stack([p, p + 0.8 * unit * w]).T, color="#777777", lw=0.8, clip_on=False)
            x, y = p + 2.1 * unit * w
            ax.text(x, y, f"{tick:g}", ha="center", va="center", fontsize=8.5, color=INK)
        x, y = start[-1] + 6.0 * unit * way[-1]
        ax.text(x, y, f"{name} (m)", ha="center", va="center", fontsize=9.5, color=INK)


def grid_step(bounds: Bounds) -> float:
    """Return a round spacing that gives about 20 grid lines along the longer side.

    Args:
        bounds: xmin, ymin, xmax, ymax, m.

    Returns:
        m.
    """
    rough = max(bounds[2] - bounds[0], bounds[3] - bounds[1]) / 20
    power = 10.0 ** np.floor(np.log10(rough))
    return min((float(m * power) for m in (1, 2, 5, 10)), key=lambda step: abs(float(np.log(step / rough))))
