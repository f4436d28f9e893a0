"""The crossing as a moving picture (GIF)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from PIL import Image

from ..figures.render import Camera, Mesh
from ..figures.scene import grid_step, picture_height, stance_mesh, sunlit
from ..figures.style import COLOURS, LEFT, RIGHT, figure, look
from ..figures.terrain_mesh import ground_mesh
from ..outputs import SOURCE
from ..rover.model import Rover
from ..terrain.heightfield import Terrain
from .figures import VIEW, crossing_bounds, tracks

if TYPE_CHECKING:
    import xarray as xr

_WIDTH = 760
_CHART = 190  # px
_FRAME = 80  # ms
_NOW = (34, 34, 34)  # colour of the line that runs along
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
    page, column, rows = _page(run, height)
    pictures = []
    for done, k in enumerate(stops):
        scene = sunlit(Mesh.join([ground, stance_mesh(rover, run.isel(time=int(k)))]), camera, 0.0, grid_step(bounds))
        picture = page.copy()
        picture[:height] = 255 * (scene[..., :3] * scene[..., 3:] + 1 - scene[..., 3:])
        picture[rows, column[k] : column[k] + 2] = _NOW
        pictures.append(Image.fromarray(picture))
        progress((done + 1) / frames)
    colours = np.array(pictures[len(pictures) // 2].quantize(256, kmeans=2).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 248] = 255  # paper white, which averaging has greyed
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    still = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    still[0].save(
        file,
        save_all=True,
        append_images=still[1:],
        duration=[_FRAME] * (frames - 1) + [1200],
        loop=0,
        optimize=True,
        comment=SOURCE,
    )


def _page(run: xr.Dataset, height: int) -> tuple[NDArray[np.uint8], NDArray[np.int64], slice]:
    """What stands still: white over `height` pixels with the angles charted below; the column of every time, the chart's rows."""
    whole = height + _CHART
    with look():
        fig = figure(_WIDTH / 100, whole / 100)
        fig.set_dpi(100)
        fig.set_layout_engine("none")
        chart = fig.add_axes((0.075, 0.27 * _CHART / whole, 0.74, 0.66 * _CHART / whole))
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
        canvas = FigureCanvasAgg(fig)
        canvas.draw()  # type: ignore[no-untyped-call]
        page = np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
        x = run["x"].to_numpy()
        column = chart.transData.transform(np.stack([x, 0 * x], axis=1))[:, 0].astype(int)
        box = chart.get_window_extent()
    return page, column, slice(whole - int(box.y1), whole - int(box.y0))
