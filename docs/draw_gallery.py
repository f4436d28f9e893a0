"""Draw docs/img/gallery_*.png, the poses of examples/gallery.py.

python docs/draw_gallery.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

import rockerbogie as rb
from rockerbogie.figures.render import Camera, Mesh, hidden_by
from rockerbogie.figures.scene_drawing import draw, grid_step, picture_height, stance_mesh
from rockerbogie.figures.style import DPI, INK, LEFT, RIGHT, figure, look
from rockerbogie.figures.terrain_block import ground_mesh

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from gallery import poses

OUT = Path(__file__).parent / "img"
WIDTH, TITLE = 1040, 46  # width and height of the title, px


class View(NamedTuple):
    """Direction of view, and the part of the scene that is shown."""

    azimuth: float  # left of the rover's heading, deg
    elevation: float  # above the horizon, deg
    reach: float  # terrain shown to each side, m
    wheel: int | None = None  # wheel shown alone


VIEWS = {
    "step": View(60, 14, 1.9),
    "astride": View(140, 16, 1.9),
    "limit": View(50, 14, 0.5),
    "edge": View(40, 14, 2.0),
    "body": View(-60, 12, 1.9),
    "bridge": View(84, 12, 0.7, 0),
}


def picture(title: str, pose: rb.Pose, view: View, file: Path) -> None:
    """Write a picture of a pose; contacts are yellow, the lowest points of lifted wheels white."""
    rover, points = pose.rover, pose.contact_point
    middle = (points[:, :2].max(axis=0) + points[:, :2].min(axis=0)) / 2
    west, south, east, north = (float(v) for v in (*(middle - view.reach), *(middle + view.reach)))
    bounds = (west, south, east, north)
    cells = round(2 * view.reach / min(pose.terrain.spacing))  # as fine as the terrain: a step is as steep as one cell
    mesh = Mesh.join([ground_mesh(pose.terrain, bounds, cells=cells), stance_mesh(rover, pose.to_xarray())])
    shown = mesh
    if view.wheel is not None:
        near = np.abs(mesh.corners - points[view.wheel]).max(axis=(1, 2)) < 2.2 * rover.wheel_radius[view.wheel]
        shown = Mesh(mesh.corners[near], mesh.normals[near], mesh.colours[near], mesh.ruled[near])
    azimuth, elevation = float(pose.yaw) + np.radians(view.azimuth), np.radians(view.elevation)
    size = (WIDTH, picture_height(azimuth, elevation, shown, WIDTH, 0.02))
    camera = Camera.framing(shown.corners, azimuth, elevation, size, margin=(0.01, 0.01, 0.01, 0.01))
    behind = hidden_by(mesh, camera, points) > 1.2 * (rover.wheel_radius + rover.wheel_width)
    with look():
        fig = figure(size[0] / DPI, (size[1] + TITLE) / DPI)
        fig.set_layout_engine("none")
        ax = fig.add_axes((0, 0, 1, size[1] / (size[1] + TITLE)))
        draw(ax, mesh, camera, float(pose.yaw), grid_step(bounds))
        for i, pixel in enumerate(camera.project(points)[:, :2]):
            if not behind[i] and (pixel >= 0).all() and (pixel < size).all():
                up = pose.wheel_lifted[i]
                ax.plot(*pixel, "o", ms=6, mfc="white" if up else "#F0E442", mec="#b00000" if up else INK)
                ax.annotate(
                    rover.wheel_names[i], pixel, xytext=(0, -15), textcoords="offset points", ha="center",
                    color=(LEFT, RIGHT)[i % 2], fontsize=9, fontweight="bold",
                    bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none"},
                )  # fmt: skip
        fig.text(0.01, 0.99, f"{title} ({rover.name})", va="top", fontsize=10.5, fontweight="bold")
        fig.text(0.99, 0.985, f"grid {grid_step(bounds):g} m", va="top", ha="right", fontsize=8, color="#666666")
    fig.savefig(file)
    Image.open(file).convert("RGB").quantize(255, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE).save(
        file, optimize=True
    )


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    for name, (title, pose) in poses().items():
        picture(title, pose, VIEWS[name], folder / f"gallery_{name}.png")
