"""Film of a drive: the rover on its terrain, its angles below."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image

from ..errors import RockerbogieError, require
from ..files.outputs import SOURCE
from ..rover.model import Rover
from ..settling.pose import Pose
from ..terrain.heightfield import Terrain
from .closeup import patch_around
from .render import Camera, Mesh, render
from .scene.terrain_mesh import block_base
from .scene_drawing import Bounds, grid_step, picture_height, stance_mesh, sunlit, trail_mesh
from .style import COLOURS, LEFT, RIGHT, figure, look
from .terrain_block import ground_mesh, sample_ground
from .theme import Theme, check_theme, darken, on_dark

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
Progress = Callable[[int, int], None]

ENDINGS = (".gif", ".mp4")
#: Camera's direction from the terrain, azimuth and elevation, rad.
VIEW = (np.radians(-62.0), np.radians(25.0))
WIDTH, CHART = 760, 190  # px
NOW = "#222222"  # colour of the line at the present distance
CELLS = 130
#: Width of the view in wheelbases: on a longer path the camera moves with the rover.
WHOLE, ALONG = 7.0, 4.5


def write_film(
    file: str | Path,
    rover: Rover,
    terrain: Terrain,
    run: xr.Dataset,
    *,
    frames: int = 64,
    rate: float = 12.5,
    view: tuple[float, float] = VIEW,
    bounds: Bounds | None = None,
    tracks: list[Mesh] | None = None,
    theme: Theme = "light",
    progress: Progress = lambda done, total: None,
) -> Path:
    """Write a run as a film, GIF or MP4 by the ending of the file name.

    Args:
        file: ends in .gif or .mp4 (the latter needs the film extra).
        rover: the rover that drove.
        terrain: the terrain it drove on.
        run: from `drive`, `simulate` or `predict`.
        frames: number of pictures, evenly over the run's records.
        rate: pictures per second.
        view: azimuth (from +x, counter-clockwise) and elevation of the camera, rad.
        bounds: part of the terrain to show, m; default: around the path, or around the rover where the path is long.
        tracks: ribbons on the terrain; default: the path.
        theme: light or dark page.
        progress: called with pictures done and pictures in all.

    Returns:
        The file.

    Raises:
        RockerbogieError: another ending, no pose in the run, PyAV not installed.
    """
    path = Path(file)
    check_film(path)
    check_theme(theme)
    if not (frames >= 2 and rate > 0):
        raise RockerbogieError(f"frames is {frames} and rate {rate}: give at least 2 pictures, and a rate above 0 per second")
    known = np.flatnonzero(np.isfinite(run["z"].values))
    if not known.size:
        raise RockerbogieError("the run has no pose to film: see its status")
    at = known[np.unique(np.linspace(0, known.size - 1, frames).round().astype(int))]
    pictures = _pictures(rover, terrain, run, at, view, bounds, tracks, theme, progress)
    return write_pictures(path, pictures, rate)


def write_turn(
    file: str | Path, pose: Pose, *, frames: int = 48, rate: float = 12.5, theme: Theme = "light",
    progress: Progress = lambda done, total: None,
) -> Path:  # fmt: skip
    """Write a film that goes once around a pose, GIF or MP4 by the ending of the file name.

    Args:
        file: ends in .gif or .mp4 (the latter needs the film extra).
        pose: one pose that is not NaN.
        frames: number of pictures.
        rate: pictures per second.
        theme: light or dark page.
        progress: called with pictures done and pictures in all.

    Returns:
        The file.

    Raises:
        RockerbogieError: another ending, several poses, a NaN pose, PyAV not installed.
    """
    check_film(Path(file))
    check_theme(theme)
    if pose.shape or not np.isfinite(pose.z):
        raise RockerbogieError("a film around a pose needs one pose that is not NaN: select one, and see its status")
    return write_pictures(Path(file), _turn(pose, frames, theme, progress), rate)


def _turn(pose: Pose, frames: int, theme: Theme, progress: Progress) -> Iterator[Picture]:
    """Yield pictures (height, width, 3) from all around a pose, at one scale and under one sun."""
    record, terrain = pose.to_xarray(), pose.terrain
    bounds = patch_around(pose.rover, record, terrain)
    ground = ground_mesh(terrain, bounds, block_base(sample_ground(terrain, bounds, 40)[2]), CELLS)
    mesh = Mesh.join([ground, stance_mesh(pose.rover, record)])
    low, high = mesh.corners.min(axis=(0, 1)), mesh.corners.max(axis=(0, 1))
    around = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = 0.5 * float(np.hypot(*(high - low)[:2])) * np.stack([np.cos(around), np.sin(around)], axis=1) + (low + high)[:2] / 2
    hull = np.concatenate([np.insert(ring, 2, z, axis=1) for z in (low[2], high[2])])  # a cylinder: the same from all sides
    for k in range(frames):
        azimuth = VIEW[0] + 2 * np.pi * k / frames
        camera = Camera.framing(hull, azimuth, VIEW[1], (WIDTH, round(0.62 * WIDTH)))
        scene = render(mesh, camera, sun=(VIEW[0] + 0.7, np.radians(48.0)), grid=grid_step(bounds))
        progress(k + 1, frames)
        yield _on_page(scene, theme)


def _on_page(scene: Array, theme: Theme) -> Picture:
    """Return a picture of a scene (height, width, 4) before the page of a theme."""
    page = np.array(to_rgb(_of_theme("white", theme)))
    return np.asarray(255 * (scene[..., :3] * scene[..., 3:] + page - page * scene[..., 3:]), dtype=np.uint8)


def _of_theme(colour: str, theme: Theme) -> Any:
    """Return the colour that stands for another one on the page of a theme."""
    return on_dark(colour) if theme == "dark" else colour


def write_pictures(path: Path, pictures: Iterator[Picture], rate: float) -> Path:
    """Write pictures as a film, GIF or MP4 by the ending of the file name.

    Args:
        path: ends in .gif or .mp4 (the latter needs the film extra).
        pictures: (height, width, 3) each, of equal size.
        rate: pictures per second.

    Returns:
        The file.

    Raises:
        RockerbogieError: PyAV is not installed.
    """
    (_write_gif if path.suffix.lower() == ".gif" else _write_mp4)(path, pictures, rate)
    return path


def check_film(file: Path) -> None:
    """Check that a film can be written.

    Args:
        file: its name.

    Raises:
        RockerbogieError: an unknown ending; PyAV not installed (.mp4).
    """
    if file.suffix.lower() not in ENDINGS:
        raise RockerbogieError(f"{str(file)!r} is not the name of a film: end it in {' or '.join(ENDINGS)}")
    if file.suffix.lower() == ".mp4":
        require("an .mp4 film (.gif needs nothing more)", "film", "av")


def _pictures(
    rover: Rover, terrain: Terrain, run: xr.Dataset, at: NDArray[np.intp], view: tuple[float, float], bounds: Bounds | None,
    tracks: list[Mesh] | None, theme: Theme, progress: Progress,
) -> Iterator[Picture]:  # fmt: skip
    """Yield the film's pictures (height, width, 3)."""
    windows = [bounds] * len(at) if bounds is not None else _windows(rover, terrain, run, at)
    ribbons = [_path_ribbon(rover, terrain, run)] if tracks is None else tracks
    lows = [np.nanmin(sample_ground(terrain, window, 40)[2]) for window in set(windows)]
    base = float(np.nanmin(lows)) - 0.05
    first = _ground(terrain, windows[0], base, ribbons)
    height = picture_height(*view, first, WIDTH, 0.06)
    page, column, rows = _page(run, height, theme)
    now = np.round(255 * np.array(to_rgb(_of_theme(NOW, theme))))
    for done, (k, window) in enumerate(zip(at, windows, strict=True)):
        if not done or window != windows[done - 1]:
            ground = _ground(terrain, window, base, ribbons) if done else first
            camera = Camera.framing(ground.corners, *view, (WIDTH, height), margin=(0.01, 0.01, 0.08, 0.02))
        scene = sunlit(Mesh.join([ground, stance_mesh(rover, run.isel(time=int(k)))]), camera, 0.0, grid_step(window))
        picture = page.copy()
        picture[:height] = _on_page(scene, theme)
        picture[rows, column[k] : column[k] + 2] = now
        progress(done + 1, len(at))
        yield picture


def _ground(terrain: Terrain, window: Bounds, base: float, ribbons: list[Mesh]) -> Mesh:
    """Return a part of the terrain with the ribbons on it."""
    return Mesh.join([ground_mesh(terrain, window, base, CELLS), *(_within(ribbon, window) for ribbon in ribbons)])


def _windows(rover: Rover, terrain: Terrain, run: xr.Dataset, at: NDArray[np.intp]) -> list[Bounds]:
    """Return the part of the terrain in each picture: one for all, or one that moves along."""
    low, high = np.array(terrain.bounds[:2]), np.array(terrain.bounds[2:])
    places = np.stack([run["x"].values, run["y"].values], axis=1)[at]
    room = 0.5 * rover.wheelbase + 3 * float(rover.wheel_radius.max())
    first, last = places.min(axis=0) - room, places.max(axis=0) + room
    if (last - first).max() <= WHOLE * rover.wheelbase + 2 * room:
        return [_clipped(first, last, low, high)] * len(at)
    half = 0.5 * ALONG * rover.wheelbase
    return [_clipped(place - half, place + half, low, high) for place in places]


def _clipped(
    first: NDArray[np.float64], last: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> Bounds:
    """Return the bounds of two corners, limited to those of the terrain."""
    a, b = np.maximum(first, low), np.minimum(last, high)
    return float(a[0]), float(a[1]), float(b[0]), float(b[1])


def _path_ribbon(rover: Rover, terrain: Terrain, run: xr.Dataset) -> Mesh:
    """Return a mesh of the path on the terrain."""
    every = max(1, run.sizes["time"] // 2000)
    x, y = run["x"].values[::every], run["y"].values[::every]
    return trail_mesh(terrain, x, y, to_rgb(COLOURS["tilt"]), 0.02 * rover.wheelbase)


def _within(ribbon: Mesh, bounds: Bounds) -> Mesh:
    """Return the part of a ribbon that lies within bounds."""
    x, y = ribbon.corners[..., 0], ribbon.corners[..., 1]
    inside = ((x > bounds[0]) & (x < bounds[2]) & (y > bounds[1]) & (y < bounds[3])).all(axis=1)
    return Mesh(ribbon.corners[inside], ribbon.normals[inside], ribbon.colours[inside], ribbon.ruled[inside])


def _write_gif(path: Path, pictures: Iterator[Picture], rate: float) -> None:
    """Write the pictures as an animated GIF."""
    images = [Image.fromarray(picture) for picture in pictures]
    colours = np.array(images[len(images) // 2].quantize(256, kmeans=2).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 248] = 255  # averaging has turned white paper grey
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    still = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    duration = [round(1000 / rate)] * (len(still) - 1) + [1200]
    still[0].save(path, save_all=True, append_images=still[1:], duration=duration, loop=0, optimize=True, comment=SOURCE)


def _write_mp4(path: Path, pictures: Iterator[Picture], rate: float) -> None:
    """Write the pictures as a film, encoded by PyAV."""
    from fractions import Fraction

    import av

    with av.open(str(path), "w") as container:
        container.metadata["comment"] = SOURCE
        stream = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1000))
        stream.pix_fmt = "yuv420p"  # the format that all players support
        stream.options = {"crf": "20"}
        for n, picture in enumerate(pictures):
            height, width = (side - side % 2 for side in picture.shape[:2])
            if n == 0:
                stream.width, stream.height = width, height
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _page(run: xr.Dataset, height: int, theme: Theme) -> tuple[Picture, NDArray[np.int64], slice]:
    """Return the constant page with the chart, the column of each record, the chart's rows."""
    whole = height + CHART
    with look():
        fig = figure(WIDTH / 100, whole / 100)
        fig.set_dpi(100)
        fig.set_layout_engine("none")
        chart = fig.add_axes((0.075, 0.27 * CHART / whole, 0.74, 0.66 * CHART / whole))
        lines = (
            ("pitch", run["pitch"], COLOURS["pitch"]),
            ("roll", run["roll"], COLOURS["roll"]),
            ("left bogie", run["bogie"].sel(side="left"), LEFT),
            ("right bogie", run["bogie"].sel(side="right"), RIGHT),
        )
        for label, angle, colour in lines:
            chart.plot(run["distance"], np.degrees(angle), color=colour, lw=1.3, label=label)
        chart.set_xlabel("distance (m)")
        chart.set_ylabel("deg")
        chart.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=8.5)
        if theme == "dark":
            darken(fig)
        canvas = FigureCanvasAgg(fig)
        canvas.draw()  # type: ignore[no-untyped-call]
        page = np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
        s = run["distance"].to_numpy()
        column = chart.transData.transform(np.stack([s, 0 * s], axis=1))[:, 0].astype(int)
        box = chart.get_window_extent()
    return page, column, slice(whole - int(box.y1), whole - int(box.y0))
