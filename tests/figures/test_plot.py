"""Drawing functions: files of every kind, sizes, views, films, and refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.image import imread
from PIL import Image

import rockerbogie as rb
from rockerbogie.files.outputs import is_ours
from support.pictures import count_colours


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    return rb.load_rover("osr")


@pytest.fixture(scope="module")
def ground() -> rb.Terrain:
    return rb.surfaces.sine(size=(6.0, 4.0))


@pytest.fixture(scope="module")
def run(rover: rb.Rover, ground: rb.Terrain) -> xr.Dataset:
    return rb.drive(rover, ground, rb.Path.straight((-1, 0), 0, 2), step=0.05)


Draw = Callable[[rb.Rover, rb.Terrain, xr.Dataset, Path | None], Figure]
DRAWINGS: dict[str, Draw] = {
    "pose": lambda rover, ground, run, file: rb.plot.pose(rb.settle(rover, ground, 0, 0), file),
    "record": lambda rover, ground, run, file: rb.plot.pose(run.isel(time=3), file, rover=rover, terrain=ground),
    "run": lambda rover, ground, run, file: rb.plot.run(run, file),
    "track": lambda rover, ground, run, file: rb.plot.track(run, file),
    "terrain": lambda rover, ground, run, file: rb.plot.terrain(ground, file, bounds=(-1, -1, 2, 1)),
    "map": lambda rover, ground, run, file: rb.plot.map(rb.traversability(rover, ground, 4, 0.4), file, terrain=ground),
    "rover": lambda rover, ground, run, file: rb.plot.rover(rover, file),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawings(name: str, rover: rb.Rover, ground: rb.Terrain, run: xr.Dataset, tmp_path: Path) -> None:
    assert isinstance(DRAWINGS[name](rover, ground, run, None), Figure)
    DRAWINGS[name](rover, ground, run, tmp_path / "made" / "a.png")
    assert count_colours(tmp_path / "made" / "a.png") > 100
    assert is_ours(tmp_path / "made" / "a.png")
    for ending, start in ((".svg", b"<?xml"), (".pdf", b"%PDF")):
        file = tmp_path / f"a{ending}"
        DRAWINGS[name](rover, ground, run, file)
        first = file.read_bytes()
        assert first.startswith(start)
        assert is_ours(file)
        DRAWINGS[name](rover, ground, run, file)
        assert file.read_bytes() == first, "the same figure gives the same bytes"


def test_size_and_dpi(run: xr.Dataset, tmp_path: Path) -> None:
    rb.plot.run(run, tmp_path / "a.png", size=(6, 5), dpi=80)
    assert Image.open(tmp_path / "a.png").size == (480, 400)


def test_view_turns_the_picture(rover: rb.Rover, ground: rb.Terrain, tmp_path: Path) -> None:
    """Turn the camera: the picture from the front is not that from the side."""
    pose = rb.settle(rover, ground, 0, 0)
    for name, view in (("a", (-np.pi / 2, 0.3)), ("b", (0.0, 0.3))):
        rb.plot.pose(pose, tmp_path / f"{name}.png", view=view, dpi=60)
    assert (imread(tmp_path / "a.png") != imread(tmp_path / "b.png")).any(axis=-1).mean() > 0.05


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
def test_film(ending: str, run: xr.Dataset, tmp_path: Path) -> None:
    if ending == ".mp4":
        pytest.importorskip("av", reason="needs the film extra")
    seen: list[tuple[int, int]] = []
    file = rb.plot.film(run, tmp_path / f"a{ending}", frames=6, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(k, 6) for k in range(1, 7)]
    assert is_ours(file)
    if ending == ".gif":
        images = []
        with Image.open(file) as film:
            for k in range(film.n_frames):
                film.seek(k)
                images.append(np.asarray(film.convert("RGB")))
    else:
        import av

        with av.open(str(file)) as container:
            images = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(images) == 6
    assert (np.abs(images[0].astype(int) - images[-1]) > 60).any(axis=-1).mean() > 0.01, "the rover moves"


def test_a_long_drive_is_filmed_from_nearby(rover: rb.Rover, tmp_path: Path) -> None:
    ground = rb.surfaces.mars(size=(20.0, 6.0))
    long = rb.drive(rover, ground, rb.Path.straight((-9, 0), 0, 18), step=0.5)
    assert rb.plot.film(long, tmp_path / "a.gif", frames=3).stat().st_size > 20_000


BAD: dict[str, tuple[Callable[[rb.Rover, rb.Terrain, xr.Dataset], Any], str]] = {
    "two poses": (lambda rover, ground, run: rb.plot.pose(rb.settle(rover, ground, [0, 1], 0)), "has 2: select one"),
    "no pose": (lambda rover, ground, run: rb.plot.pose(rb.settle(rover, ground, 99, 0)), "is NaN"),
    "ending": (lambda rover, ground, run: rb.plot.run(run, "a.bmp"), "end it in .png"),
    "film": (lambda rover, ground, run: rb.plot.film(run, "a.avi"), "end it in .gif or .mp4"),
    "frames": (lambda rover, ground, run: rb.plot.film(run, "a.gif", frames=1), "at least 2"),
    "size": (lambda rover, ground, run: rb.plot.run(run, size=(0, 3)), "inches"),
    "degrees": (lambda rover, ground, run: rb.plot.pose(rb.settle(rover, ground, 0, 0), view=(30, 20)), "in rad"),
    "bounds": (lambda rover, ground, run: rb.plot.terrain(ground, bounds=(50, 50, 60, 60)), "outside the terrain"),
    "rover": (lambda rover, ground, run: rb.plot.rover("osr"), "rover"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("case", BAD)
def test_invalid_input_of_plots_is_refused(
    case: str, rover: rb.Rover, ground: rb.Terrain, run: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    call, text = BAD[case]
    with pytest.raises(rb.RockerbogieError, match=text):
        call(rover, ground, run)
    assert not list(tmp_path.iterdir())


def test_a_run_from_a_file_needs_its_rover(run: xr.Dataset, rover: rb.Rover, ground: rb.Terrain, tmp_path: Path) -> None:
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as back:
        with pytest.raises(rb.RockerbogieError, match="give rover="):
            rb.plot.run(back)
        assert isinstance(rb.plot.run(back, rover=rover, terrain=ground), Figure)


def test_flat_terrain_has_no_contours(rover: rb.Rover) -> None:
    flat = rb.surfaces.plane()
    figure = rb.plot.track(rb.drive(rover, flat, rb.Path.straight((0, 0), 0, 1)))
    assert not [text for ax in figure.axes for text in ax.texts if text.get_text() == "0 m"]


def test_legends_fit_on_the_page(rover: rb.Rover, run: xr.Dataset) -> None:
    """With every status, whose meanings are long."""
    codes = np.resize([int(code) for code in rb.Status], run.sizes["time"]).astype(np.uint8)
    figure = rb.plot.run(run.assign(status=("time", codes)))
    figure.draw_without_rendering()
    page = figure.bbox
    for ax in figure.axes:
        legend = ax.get_legend()
        if legend is not None:
            box = legend.get_window_extent()
            assert box.x1 <= page.x1
            assert box.y0 >= page.y0
