"""Tests of the pages: data, size, and behaviour in a browser without network."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.figures.scene import show as show_module
from rockerbogie.figures.scene.climb_run import climb_run
from rockerbogie.figures.scene.replay import page, quaternions
from rockerbogie.figures.scene.rover_mesh import LINKS
from rockerbogie.figures.scene.subject import records_of
from rockerbogie.rover.rotations import euler_angles
from support.browser import wait_for
from support.helpers import assert_close

CHROMIUM = shutil.which("chromium")
FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND"),
]


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    return rb.load_rover("osr")


@pytest.fixture(scope="module")
def terrain() -> rb.Terrain:
    return rb.surfaces.rocks(seed=3)


@pytest.fixture(scope="module")
def run(rover: rb.Rover, terrain: rb.Terrain) -> xr.Dataset:
    return rb.drive(rover, terrain, rb.Path.waypoints([(-1.5, 0.2), (0.2, 0.2), (1.2, 1.0)], 0.6), step=0.05)


@pytest.fixture(scope="module")
def maps(rover: rb.Rover, terrain: rb.Terrain) -> xr.Dataset:
    return rb.traversability(rover, terrain, headings=2, resolution=0.25)


def data_of(html: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


def numbers(text: str, kind: str) -> np.ndarray[Any, Any]:
    return np.frombuffer(base64.b64decode(text), kind)


def test_page_holds_the_poses_of_the_run(rover: rb.Rover, terrain: rb.Terrain, run: xr.Dataset) -> None:
    data = data_of(page(run))
    n, links = data["run"]["n"], [link["name"] for link in data["links"]]
    assert n == run.sizes["time"]
    place = numbers(data["run"]["place"], "<f4").reshape(n, len(links), 3).astype(float)
    pose = rb.settle(rover, terrain, run["x"].values, run["y"].values, run["yaw"].values, steering=run["steering"].values)
    hubs = (pose.T_world_body[:, None] @ pose.axle_frames)[..., :3, 3]
    wheels = [links.index(f"wheel_{i}") for i in range(6)]
    shift = hubs[0, 0] - place[0, wheels[0]]
    assert_close(shift, np.round(shift), 1e-6, "m", "positions count from whole metres")
    assert_close(place[:, wheels] + np.round(shift), hubs, 1e-5, "m", "single precision near the origin")
    assert_close(numbers(data["run"]["at"], "<f4"), run["distance"], 1e-5, "m", "axis of the plots")
    assert_close(numbers(data["plots"][0]["lines"][1]["values"], "<f4"), np.degrees(run["pitch"]), 1e-5, "deg", "pitch")
    grid = data["terrain"]
    level = numbers(grid["z"], "<u2").astype(float)
    x, y = numbers(grid["x"], "<f4") + np.round(shift[0]), numbers(grid["y"], "<f4") + np.round(shift[1])
    z = grid["low"] + (grid["high"] - grid["low"]) * level / 65534 + np.round(shift[2])
    assert_close(z.reshape(len(y), len(x)), terrain.height(*np.meshgrid(x, y)), 1e-4, "m", "heights in 65,535 steps")


def test_quaternions_are_those_of_the_rotations() -> None:
    rng = np.random.default_rng(0)
    R = rb.body_transform(0, 0, 0, *rng.uniform(-3.1, 3.1, (3, 200)))[:, :3, :3]
    w, x, y, z = quaternions(R).T
    back = np.stack([1 - 2 * (y**2 + z**2), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x**2 + z**2)])
    assert_close(back, R.reshape(-1, 9)[:, :5].T, 1e-12, "1", "same rotation")


def test_long_run_stays_below_ten_megabytes(rover: rb.Rover) -> None:
    """A 20 m run at the default step on a terrain finer than the page draws."""
    ground = rb.Terrain.from_array(np.zeros((300, 1200)), 0.02, interpolation="linear")
    run = rb.drive(rover, ground, rb.Path.straight((1.0, 3.0), 0.0, 20.0))
    text = page(run)
    assert len(text) < 3e6, f"{len(text) / 1e6:.2f} MB"
    data = data_of(text)
    assert data["run"]["n"] == 1001, "every second of 2,001 records"
    assert "1 in 2 shown" in data["about"]
    assert "1 in " in data["about"].split("grid")[1], "decimation of the terrain is stated"


def test_page_refers_to_nothing_outside(run: xr.Dataset) -> None:
    html = page(run)
    code = html.replace(re.search(r'id="data">(.*?)</script>', html, re.S)[1], "")  # type: ignore[index]
    assert not re.search(r"(https?:|\bsrc=|\bhref=|@import|url\(|fetch\(|XMLHttpRequest|import\()", code)
    assert "default-src 'none'" in code


def test_missing_poses_are_marked(rover: rb.Rover) -> None:
    z = np.zeros((60, 200))
    z[25:35, 100:104] = np.nan
    ground = rb.Terrain.from_array(z, 0.05, interpolation="linear")
    run = rb.drive(rover, ground, rb.Path.straight((1.0, 1.5), 0.0, 8.0), step=0.1)
    data = data_of(page(run))
    known = numbers(data["run"]["known"], "u1").astype(bool)
    assert (known == np.isfinite(run["z"].values)).all()
    assert 0 < known.sum() < len(known)
    codes = data["run"]["codes"]
    assert codes[str(int(rb.Status.NO_DATA))][0] == "NO_DATA"
    assert not codes[str(int(rb.Status.NO_DATA))][2]
    assert (numbers(data["terrain"]["z"], "<u2") == 65535).any()


def test_pose_map_and_batch_have_pages(rover: rb.Rover, terrain: rb.Terrain, maps: xr.Dataset) -> None:
    pose = rb.settle(rover, terrain, 0.3, -0.2, 0.7, mode="equilibrium")
    data = data_of(page(pose))
    assert ["z", f"{float(pose.z):.4f} m"] in data["numbers"]
    assert data["run"]["n"] == 1
    batch = rb.settle(rover, terrain, np.linspace(-1, 1, 6).reshape(2, 3), 0.0, 0.5)
    assert data_of(page(batch))["run"]["n"] == 6
    layers = [layer["name"] for layer in data_of(page(maps, terrain=terrain))["terrain"]["layers"]]
    assert layers[0] == "passable"
    assert {"worst tilt", "height", "slope"} <= set(layers)
    flat = data_of(page(maps))
    assert "no terrain was given" in flat["about"]
    assert flat["terrain"]["high"] - flat["terrain"]["low"] < 1e-5


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_climb_is_replayed_with_its_own_hubs(rover: rb.Rover, direction: Any) -> None:
    climb = rb.climb(rover, rb.obstacles.step(0.06), friction=1.0, direction=direction)
    run = climb_run(climb)
    records = records_of(run)
    hubs = records.frames[:, [LINKS.index(f"wheel_{i}") for i in range(6)]][..., :3, 3]
    assert_close(hubs[..., [0, 2]], climb.hub, 1e-9, "m", "the climb's own linkage")
    assert_close(records.contact[..., 1], hubs[..., 1], 1e-9, "m", "contacts below their wheels")
    data = data_of(page(climb))
    assert "suffices" in data["about"]
    assert "Required friction" in [plot["title"] for plot in data["plots"]]
    assert data["run"]["unit"] == "m"


def test_text_from_names_cannot_leave_its_place(rover: rb.Rover, run: xr.Dataset) -> None:
    bad = "</script><script>alert(1)</script>"
    html = page(run.assign_attrs(source=f"{bad} {bad}"), title=bad)
    assert bad not in html
    assert html.count("<script") == 2


def test_wrong_subjects_and_files_are_refused(tmp_path: Path, rover: rb.Rover, run: xr.Dataset) -> None:
    with pytest.raises(rb.RockerbogieError, match="end it in .html"):
        rb.to_html(run, tmp_path / "run.txt")
    theirs = tmp_path / "run.html"
    theirs.write_text("<p>my own notes")
    with pytest.raises(rb.RockerbogieError, match="--force"):
        rb.to_html(run, theirs)
    assert theirs.read_text() == "<p>my own notes"
    rb.to_html(run, theirs, force=True)
    assert rb.to_html(run, theirs) == theirs, "a page of this package may be replaced"
    with pytest.raises(rb.RockerbogieError, match="cannot be shown"):
        page(3.0)  # type: ignore[arg-type]
    with pytest.raises(rb.RockerbogieError, match="no x, y, z"):
        page(xr.Dataset({"height": ("n", [1.0])}), rover=rover, terrain=rb.surfaces.plane())
    read = run.copy()
    read.encoding = {}
    with pytest.raises(rb.RockerbogieError, match="give rover="):
        page(read)
    with pytest.raises(rb.RockerbogieError, match="select one run"):
        page(xr.concat([run, run], "start"), rover=rover, terrain=rb.surfaces.plane())
    with pytest.raises(rb.RockerbogieError, match="no record"):
        page(run.isel(time=slice(0)), rover=rover, terrain=rb.surfaces.plane())


def test_show_opens_the_browser_or_fills_the_notebook(run: xr.Dataset, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    opened: list[str] = []
    monkeypatch.setattr(show_module.webbrowser, "open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    view = rb.show(run)
    assert view.file is not None
    assert opened == [view.file.as_uri()]
    assert view.file.read_text(encoding="utf-8") == view.html
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=1)))
    view = rb.show(run)
    assert view.file is None
    assert len(opened) == 1
    frame = view._repr_html_()
    assert frame.startswith("<iframe srcdoc=")
    assert frame.count('"') == 8, "quotes of the page are escaped"
    assert run.rockerbogie._repr_html_() == frame
    assert run.rockerbogie.to_html(tmp_path / "by_accessor.html").exists()


@pytest.mark.parametrize("order", ["import rockerbogie; import xarray", "import xarray; import rockerbogie"])
def test_datasets_have_the_accessor_and_the_import_stays_light(order: str) -> None:
    first, _, second = order.partition("; ")
    code = (
        f"import sys, importlib.util; {first}; importlib.util.find_spec('xarray'); {second}; "
        "print(hasattr(xarray.Dataset, 'rockerbogie'), 'rockerbogie.figures.scene.show' in sys.modules, 'numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False", "False"]
    code = "import sys, rockerbogie; print('xarray' in sys.modules, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_commands_write_pages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page_file, pose_file = tmp_path / "new" / "run.html", tmp_path / "pose.html"
    assert main(["drive", "-t", "surface:plane", "--path", "0,0 0.3,0", "--html", str(page_file)]) == 0
    assert str(page_file) in capsys.readouterr().out.split("\n")
    assert data_of(page_file.read_text(encoding="utf-8"))["run"]["n"] == 31
    assert main(["settle", "-t", "surface:plane", "--html", str(pose_file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == [str(pose_file)]
    assert main(["drive", "-t", "surface:plane", "--html", str(tmp_path / "run.pdf")]) == 2
    assert "end it in .html" in capsys.readouterr().err
    pose_file.write_text("mine")
    assert main(["settle", "-t", "surface:plane", "--html", str(pose_file)]) == 2
    assert pose_file.read_text() == "mine"


# -- in a browser ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if CHROMIUM is None or importlib.util.find_spec("playwright") is None:
        pytest.skip("needs Chromium and playwright")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


def opened(browser: Any, file: Path, width: int = 900, height: int = 640, scheme: str = "light") -> tuple[Any, list[str]]:
    """Return the open page, offline, and the list of its errors and requests beyond the file."""
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme, offline=True)
    tab, faults = context.new_page(), []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.on("request", lambda request: faults.append(request.url) if request.url != file.as_uri() else None)
    tab.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    tab.goto(file.as_uri())
    wait_until(tab, "!!window.replay && replay.drawn()")
    return tab, faults


def test_replay_plays_and_scrubs_without_network(browser: Any, rover: rb.Rover, run: xr.Dataset, tmp_path: Path) -> None:
    tab, faults = opened(browser, rb.to_html(run, tmp_path / "run.html"))
    last = run.sizes["time"] - 1
    tab.evaluate("replay.go(10)")
    record = run.isel(time=10)
    matrix = np.array(tab.evaluate("replay.linkFrame(0, 10)")).reshape(4, 4).T
    angles = np.array(euler_angles(matrix[:3, :3]))
    assert_close(angles, [float(record[name]) for name in ("roll", "pitch", "yaw")], 1e-4, "rad", "int16 quaternions")
    assert f"{float(run['distance'][10]):.2f} m" in tab.inner_text("#now")
    assert f"pitch {np.degrees(float(record['pitch'])):.2f}".replace("-", "−") in tab.inner_text("#plots")
    tab.focus("#scene")
    tab.keyboard.press("End")
    assert tab.evaluate("replay.frame()") == last
    tab.keyboard.press("ArrowLeft")
    assert tab.evaluate("replay.frame()") == last - 1
    tab.keyboard.press("Home")
    tab.keyboard.press(" ")
    assert tab.evaluate("replay.playing()")
    wait_until(tab, "replay.frame() > 0.5")
    tab.keyboard.press(" ")
    assert not tab.evaluate("replay.playing()")
    middle = float(run["time"][-1]) / 2
    tab.evaluate(f"(e => {{ e.value = {middle}; e.dispatchEvent(new Event('input')); }})(document.getElementById('scrub'))")
    assert_close(tab.evaluate("replay.frame()"), last / 2, 1.0, "records", "the middle of the run")
    box = tab.locator("#plots canvas").first.bounding_box()
    tab.mouse.click(box["x"] + box["width"] - 8, box["y"] + 40)
    assert tab.evaluate("replay.frame()") == last
    before = tab.evaluate("[replay.camera.azimuth, replay.camera.distance]")
    view = tab.locator("#scene").bounding_box()
    tab.mouse.move(view["x"] + 200, view["y"] + 200)
    tab.mouse.down()
    tab.mouse.move(view["x"] + 300, view["y"] + 200)
    tab.mouse.up()
    tab.mouse.wheel(0, -300)
    azimuth, distance = tab.evaluate("[replay.camera.azimuth, replay.camera.distance]")
    assert_close(azimuth, before[0] - 0.8, 1e-9, "rad", "a drag of 100 px turns")
    assert distance < before[1]
    picture = colours_in(tab)
    assert picture.std(axis=(0, 1)).max() > 20, "the view is not blank"
    assert blueish(picture) > 200, "the left side of the rover is seen"
    assert not faults
    tab.context.close()


def test_page_fits_a_phone_in_the_dark(browser: Any, run: xr.Dataset, tmp_path: Path) -> None:
    tab, faults = opened(browser, rb.to_html(run, tmp_path / "phone.html"), 390, 844, "dark")
    assert tab.evaluate("document.documentElement.scrollWidth") == 390
    light = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert max(tab.evaluate(light)) < 60
    for element in tab.locator("button:visible, select:visible").all():
        box = element.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 390
    tab.keyboard.press("t")
    assert min(tab.evaluate(light)) > 200
    assert not faults
    tab.context.close()


def test_pages_of_a_pose_and_a_map_open(
    browser: Any, rover: rb.Rover, terrain: rb.Terrain, maps: xr.Dataset, tmp_path: Path
) -> None:
    pose = rb.settle(rover, terrain, 0.3, -0.2, 0.7)
    tab, faults = opened(browser, rb.to_html(pose, tmp_path / "pose.html"))
    assert f"{float(pose.z):.4f} m" in tab.inner_text("#numbers")
    assert not tab.locator("#play").is_visible()
    assert blueish(colours_in(tab)) > 200
    tab.context.close()
    tab, more = opened(browser, rb.to_html(maps, tmp_path / "map.html", terrain=terrain))
    assert "every heading passable" in tab.inner_text("#legend")
    tab.select_option("#tools select", label="worst tilt")
    assert "°" in tab.inner_text("#legend")
    assert not faults + more
    tab.context.close()


def wait_until(tab: Any, condition: str) -> None:
    """Wait until a condition holds.

    The policy of the page forbids the code that playwright's own waiting runs in it.
    """
    wait_for(lambda: tab.evaluate(condition), condition)


def colours_in(tab: Any) -> np.ndarray[Any, Any]:
    """Return the picture of the view (height, width, 3)."""
    import io

    from PIL import Image

    tab.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")  # drawn with all changes
    shot = tab.locator("#scene").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(float)


def blueish(picture: np.ndarray[Any, Any]) -> int:
    """Return the number of pixels with much more blue than red."""
    return int((picture[..., 2] > picture[..., 0] + 60).sum())
