"""The crossing as a moving picture (GIF)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from ..rover import Rover
from ..terrain import Terrain
from .landscape import ground_mesh
from .paper import VIEW, crossing_bounds, tracks
from .render import Camera, Mesh
from .scene import draw, grid_step, picture_height, stance_mesh
from .style import COLOURS, INK, LEFT, RIGHT, figure, look

if TYPE_CHECKING:
    import xarray as xr

_WIDTH = 760
_CHART = 190  # px
_FRAME = 80  # ms
_CELLS = 130


def crossing_gif(
    file: Path,
    rover: Rover,
    terrain: Terrain,
    run: xr.Dataset,
    *,
    frames: int = 64,
    progress: Callable[[float], None] = lambda share: None,
) -> None:
    """Write the rover's way over the ground as a GIF, its angles running along below."""
    bounds = crossing_bounds(run, rover, terrain)
    ground = Mesh.join([ground_mesh(terrain, bounds, cells=_CELLS), *tracks(terrain, run)])
    height = picture_height(*VIEW, ground, _WIDTH, 0.06)
    camera = Camera.framing(ground.corners, *VIEW, (_WIDTH, height), margin=(0.01, 0.01, 0.08, 0.02))
    stops = np.linspace(0, run.sizes["time"] - 1, frames).round().astype(int)
    with look():
        fig = figure(_WIDTH / 100, (height + _CHART) / 100)
        fig.set_layout_engine("none")
        scene = fig.add_axes((0, _CHART / (height + _CHART), 1, height / (height + _CHART)))
        chart = fig.add_axes((0.075, 0.27 * _CHART / (height + _CHART), 0.74, 0.66 * _CHART / (height + _CHART)))
        lines = (
            ("pitch", run["pitch"], COLOURS["pitch"]),
            ("roll", run["roll"], COLOURS["roll"]),
            ("left bogie", run["bogie"].sel(side="left"), LEFT),
            ("right bogie", run["bogie"].sel(side="right"), RIGHT),
        )
        for label, angle, colour in lines:
            chart.plot(run["x"], np.degrees(angle), color=colour, lw=1.3, label=label)
        chart.set_xlabel("X (m)")
        chart.set_ylabel("deg")
        chart.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8.5)
        now = chart.axvline(0, color=INK, lw=1.2)
        pictures = []
        canvas = FigureCanvasAgg(fig)
        fig.set_dpi(100)
        for done, k in enumerate(stops):
            scene.clear()
            draw(scene, Mesh.join([ground, stance_mesh(rover, run.isel(time=int(k)))]), camera, 0.0, grid_step(bounds))
            now.set_xdata([float(run["x"][k])] * 2)
            canvas.draw()  # type: ignore[no-untyped-call]
            pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))  # type: ignore[no-untyped-call]
            progress((done + 1) / frames)
    colours = np.array(pictures[len(pictures) // 2].quantize(256, kmeans=2).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 248] = 255  # paper white, which averaging has greyed
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    still = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    still[0].save(file, save_all=True, append_images=still[1:], duration=[_FRAME] * (frames - 1) + [1200], loop=0, optimize=True)
