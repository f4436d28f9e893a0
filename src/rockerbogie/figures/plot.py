"""Public drawing functions, `rockerbogie.plot`: they return figures and write files.

All take `file` (.png, .svg or .pdf by its ending), `size` (width, height in inches), `dpi` (of a .png) and `theme` (light or
dark).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RockerbogieError, expect
from ..files.outputs import check_outputs
from ..rover.model import LOAD_ROVER, Rover
from ..terrain.heightfield import Terrain
from .scene.subject import scene_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ..motion.path_files import Route
    from ..settling.pose import Pose
    from ..statics.climb import Climb
    from .theme import Theme

__all__ = ["climb", "film", "map", "odometry", "pose", "rover", "run", "steps", "terrain", "track", "validation"]

#: Width and height, inches.
Size = tuple[float, float]
#: Azimuth (from +x, counter-clockwise) and elevation of the camera, rad.
View = tuple[float, float]
#: Size of the numbers on an axis in a figure of the usual size, points.
TICKS = 9.5
_ENDINGS = (".png", ".svg", ".pdf")


def pose(
    pose: Pose | xr.Dataset, file: str | Path | None = None, *, rover: Rover | None = None, terrain: Terrain | None = None,
    title: str | None = None, view: View | None = None, size: Size | None = None, dpi: float | None = None,
    theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw the rover in one pose on its terrain, with its contacts and its numbers.

    Args:
        pose: one pose from `settle`, or one record of a run, as in `run.isel(time=10)`.
        file: the picture to write.
        rover: of a record; default: the rover of the run, while that is in memory.
        terrain: of a record; default: the terrain of the run, while that is in memory.
        title: text above; default: the names of rover and terrain.
        view: azimuth (from +x, counter-clockwise) and elevation of the camera, rad; default: from the downhill side.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.

    Raises:
        RockerbogieError: several poses, a pose that is NaN, no rover or terrain, a file that cannot be written.
    """
    from ..settling.pose import Pose
    from .closeup import pose_figure

    if isinstance(pose, Pose):
        rover, terrain, data = pose.rover, pose.terrain, pose.to_xarray()
    else:
        rover, terrain = scene_of(pose, rover, terrain)
        data = pose
    if data["z"].ndim:
        raise RockerbogieError(
            f"one pose can be drawn, and this has {data['z'].size}: select one, as in pose[3] or run.isel(time=3)"
        )
    if not np.isfinite(float(data["z"])):
        raise RockerbogieError("the pose is NaN and cannot be drawn: see its status")
    text = f"{rover.name} on {terrain.name}" if title is None else title
    return _finish(lambda: pose_figure(rover, terrain, data, text, view=_view(view)), file, size, dpi, theme, force)


def run(
    run: xr.Dataset, file: str | Path | None = None, *, rover: Rover | None = None, terrain: Terrain | None = None,
    size: Size | None = None, dpi: float | None = None, theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw heights, attitude, joints, clearance and status of a run over the distance driven.

    Args:
        run: from `drive`, `simulate` or `predict`.
        file: the picture to write.
        rover: default: the rover of the run, while that is in memory.
        terrain: default: the terrain of the run, while that is in memory.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .charts import run_profile

    return _finish_run(run_profile, run, rover, terrain, file, size, dpi, theme, force)


def track(
    run: xr.Dataset, file: str | Path | None = None, *, rover: Rover | None = None, terrain: Terrain | None = None,
    size: Size | None = None, dpi: float | None = None, theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw the path of a run on the terrain from above, coloured by tilt.

    Args:
        run: from `drive`, `simulate` or `predict`.
        file: the picture to write.
        rover: default: the rover of the run, while that is in memory.
        terrain: default: the terrain of the run, while that is in memory.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .charts import run_map

    return _finish_run(run_map, run, rover, terrain, file, size, dpi, theme, force)


def map(
    maps: xr.Dataset, file: str | Path | None = None, *, terrain: Terrain | str | Path | None = None, route: Route | None = None,
    size: Size | None = None, dpi: float | None = None, theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw a map: cells coloured by the share of headings passable, over shaded terrain.

    Args:
        maps: from `traversability` or `read_map`.
        file: the picture to write.
        terrain: the terrain or its raster file, to shade the map with.
        route: from `plan`, to draw over it.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from ..maps.preview import overview
    from .terrain_map import terrain_map

    return _finish(lambda: terrain_map(overview(maps, terrain), route), file, size, dpi, theme, force)


def terrain(
    terrain: Terrain, file: str | Path | None = None, *, bounds: tuple[float, float, float, float] | None = None,
    view: View | None = None, size: Size | None = None, dpi: float | None = None, theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw a terrain in three dimensions.

    Args:
        terrain: the terrain.
        file: the picture to write.
        bounds: (xmin, ymin, xmax, ymax) of the part to draw, m; default: all of it.
        view: azimuth (from +x, counter-clockwise) and elevation of the camera, rad.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .scene_drawing import terrain_figure

    expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_array, from_raster or rockerbogie.surfaces")
    part = terrain.bounds if bounds is None else _bounds(terrain, bounds)
    return _finish(lambda: terrain_figure(terrain, part, _view(view)), file, size, dpi, theme, force)


def odometry(
    track: xr.Dataset, flat: xr.Dataset, log: xr.Dataset, file: str | Path | None = None, *, size: Size | None = None,
    dpi: float | None = None, theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw 3-D and flat odometry from above and from the side, and the slip of the wheels.

    Args:
        track: from `odometry`.
        flat: from `flat_odometry`.
        log: from `read_log`; its own positions are drawn if it has them.
        file: the picture to write.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .odometry import odometry_figure

    return _finish(lambda: odometry_figure(track, flat, log), file, size, dpi, theme, force)


def validation(
    found: xr.Dataset,
    file: str | Path | None = None,
    *,
    size: Size | None = None,
    dpi: float | None = None,
    theme: Theme = "light",
    force: bool = False,
) -> Figure:
    """Draw predicted and logged attitude, with the uncertainty band of each place.

    Args:
        found: from `validate`.
        file: the picture to write.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .validation import validation_figure

    return _finish(lambda: validation_figure(found), file, size, dpi, theme, force)


def rover(
    rover: Rover, file: str | Path | None = None, *, title: str = "", size: Size | None = None, dpi: float | None = None,
    theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw a rover from the left and from above, with its dimensions.

    Args:
        rover: the rover.
        file: the picture to write.
        title: text above; default: the rover's name.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .blueprint import blueprint

    expect(rover, Rover, "rover", LOAD_ROVER)
    return _finish(lambda: blueprint(rover, title), file, size, dpi, theme, force)


def climb(
    run: Climb, file: str | Path | None = None, *, title: str = "", size: Size | None = None, dpi: float | None = None,
    theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw the rover at its hardest station, and friction and torque along the way.

    Args:
        run: from `rockerbogie.climb`.
        file: the picture to write.
        title: text above; default: rover, obstacle and verdict.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from ..statics.climb import Climb
    from .climbing import climb_figure

    expect(run, Climb, "run", "give what rockerbogie.climb returns")
    return _finish(lambda: climb_figure(run, title), file, size, dpi, theme, force)


def steps(
    rover: Rover, file: str | Path | None = None, *, friction: float | None = None, size: Size | None = None,
    dpi: float | None = None, theme: Theme = "light", force: bool = False,
) -> Figure:  # fmt: skip
    """Draw the friction that a rover needs against the height of a step.

    Args:
        rover: the rover.
        file: the picture to write.
        friction: coefficient to mark.
        size: width and height, inches.
        dpi: pixels per inch of a .png.
        theme: light or dark page.
        force: replace a file that this package did not write.

    Returns:
        The figure.
    """
    from .climbing import step_chart

    expect(rover, Rover, "rover", LOAD_ROVER)
    return _finish(lambda: step_chart(rover, friction), file, size, dpi, theme, force)


def film(
    run: xr.Dataset, file: str | Path, *, rover: Rover | None = None, terrain: Terrain | None = None, frames: int = 64,
    rate: float = 12.5, view: View | None = None, theme: Theme = "light", force: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:  # fmt: skip
    """Write a run as a film.

    Args:
        run: from `drive`, `simulate` or `predict`.
        file: the film; its ending is .gif, or .mp4 (needs the film extra).
        rover: default: the rover of the run, while that is in memory.
        terrain: default: the terrain of the run, while that is in memory.
        frames: number of pictures, evenly over the run.
        rate: pictures per second.
        view: azimuth (from +x, counter-clockwise) and elevation of the camera, rad.
        theme: light or dark page.
        force: replace a file that this package did not write.
        progress: called with pictures done and pictures in all.

    Returns:
        The file.
    """
    from .film import VIEW, write_film

    rover, terrain = scene_of(run, rover, terrain)
    check_outputs([file], force=force)
    seen = _view(view) or VIEW
    return write_film(file, rover, terrain, run, frames=frames, rate=rate, view=seen, theme=theme, progress=progress)


def _view(view: View | None) -> View | None:
    """Return azimuth and elevation as floats, or None; raise if they are out of range."""
    if view is None:
        return None
    try:
        azimuth, elevation = (float(v) for v in view)
    except (TypeError, ValueError):
        azimuth = elevation = np.nan
    if not (np.isfinite(azimuth) and 0 < elevation <= np.pi / 2):
        raise RockerbogieError(f"view is {view!r}: give (azimuth, elevation) in rad, the elevation above 0 and at most pi/2")
    return azimuth, elevation


def _bounds(terrain: Terrain, bounds: Any) -> tuple[float, float, float, float]:
    """Return the part of some bounds that lies on the terrain; raise if there is none."""
    box, whole = np.asarray(bounds, dtype=float), np.asarray(terrain.bounds)
    if box.shape != (4,) or not np.isfinite(box).all() or not (box[:2] < box[2:]).all():
        raise RockerbogieError(f"bounds are {bounds!r}: give (xmin, ymin, xmax, ymax), min below max, in metres")
    low, high = np.maximum(box[:2], whole[:2]), np.minimum(box[2:], whole[2:])
    if not (low < high).all():
        raise RockerbogieError(f"bounds {tuple(bounds)} lie outside the terrain, which spans {terrain.bounds}")
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _resize(figure: Figure, size: Size) -> None:
    """Set a figure's size, and scale its text with it."""
    from matplotlib.text import Text

    width, height = figure.get_size_inches()
    factor = min(size[0] / width, size[1] / height)
    figure.set_size_inches(*size)
    for text in figure.findobj(Text):
        text.set_fontsize(factor * text.get_fontsize())
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_tick_params(labelsize=factor * TICKS)


def _finish_run(
    draw: Callable[[Rover, Terrain, xr.Dataset], Figure], run: xr.Dataset, rover: Rover | None, terrain: Terrain | None,
    file: str | Path | None, size: Size | None, dpi: float | None, theme: Theme, force: bool,
) -> Figure:  # fmt: skip
    """Return the figure of a run with its rover and terrain; write it if `file` is given."""
    rover, terrain = scene_of(run, rover, terrain)
    return _finish(lambda: draw(rover, terrain, run), file, size, dpi, theme, force)


def _finish(
    draw: Callable[[], Figure], file: str | Path | None, size: Size | None, dpi: float | None, theme: Theme, force: bool
) -> Figure:
    """Return a figure of the given size and theme, and write it if `file` is given."""
    from .style import save
    from .theme import check_theme, darken

    if size is not None and not (len(size) == 2 and np.isfinite(size).all() and min(size) > 0):
        raise RockerbogieError(f"size is {size!r}: give (width, height) in inches")
    if dpi is not None and not (np.isfinite(dpi) and dpi > 0):
        raise RockerbogieError(f"dpi is {dpi!r}: give pixels per inch, above 0")
    if file is not None:
        if Path(file).suffix.lower() not in _ENDINGS:
            raise RockerbogieError(f"{str(file)!r} is not the name of a picture: end it in {', '.join(_ENDINGS)}")
        check_outputs([file], force=force)
    check_theme(theme)
    figure = draw()
    if size is not None:
        _resize(figure, size)
    if theme == "dark":
        darken(figure)
    if file is not None:
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        save(figure, file, dpi)
    return figure
