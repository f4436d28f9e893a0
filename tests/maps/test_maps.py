"""Maps are bit-identical to `settle`, in any pieces, processes and interrupted runs."""

from __future__ import annotations

import dataclasses
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.maps import run, store
from rockerbogie.maps.layers import LAYERS
from rockerbogie.maps.limits import BITS, FORCES
from support.patience import PATIENCE

STEP, ORIGIN = 0.1, (-3_000_000.25, 4_141_909.5)
MARS = "+proj=eqc +lat_ts=69.8768 +lon_0=0 +R=3396190"  # true to scale at ORIGIN
HEADINGS = [0.3, 1.7]  # rad


def heights(shape: tuple[int, int] = (300, 140)) -> np.ndarray:
    """A dune with rough patches, a steep bank, blocks and missing data; far below datum."""
    rng = np.random.default_rng(11)
    y, x = np.indices(shape)
    z = 0.4 * np.sin(x / 30) + 0.004 * rng.normal(size=shape) * (y > 100) + 0.6 / (1 + np.exp((90 - y) / 2.0))
    z[200:] += 0.12 * np.kron(rng.random((shape[0] // 4 - 50, shape[1] // 4)) < 0.03, np.ones((4, 4)))
    z[x + y < 60] = np.nan
    z[150:170, 60:78] = np.nan
    return (z - 4450.0).astype(np.float32).astype(float)


@pytest.fixture(scope="module")
def terrain() -> rb.Terrain:
    return rb.Terrain.from_array(heights(), STEP, ORIGIN, "linear", name="dune")


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    return rb.load_rover("elhami-dashti")


@pytest.fixture(scope="module")
def plain(rover: rb.Rover, terrain: rb.Terrain) -> Any:
    """The map made in memory."""
    return rb.traversability(rover, terrain, HEADINGS)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same ground as a GeoTIFF."""
    rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
    path = tmp_path_factory.mktemp("dem") / "dune.tif"
    z = np.nan_to_num(heights()[::-1], nan=-9999.0).astype(np.float32)
    rows, cols = z.shape
    place = rasterio.transform.from_origin(ORIGIN[0] - STEP / 2, ORIGIN[1] + (rows - 0.5) * STEP, STEP, STEP)
    profile = {"driver": "GTiff", "height": rows, "width": cols, "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(path, "w", **profile, crs=MARS, transform=place) as raster:
        raster.write(z, 1)
    return path


def assert_same(a: Any, b: Any) -> None:
    """The same bytes in every layer and coordinate, and the same words about them."""
    for name in (*a.coords, *a.data_vars):
        if name != "spatial_ref":
            assert a[name].dtype == b[name].dtype, name
            assert a[name].values.tobytes() == b[name].values.tobytes(), name
    assert set(a.data_vars) == set(b.data_vars)
    assert {k: v for k, v in a.attrs.items() if k != "crs"} == {k: v for k, v in b.attrs.items() if k != "crs"}


@pytest.fixture
def cluster() -> Iterator[Any]:
    """A Dask cluster of one worker, as if somebody else had started it."""
    distributed = pytest.importorskip("distributed", reason="needs the scale extra")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as running:
        yield running


def bytes_of(folder: Path) -> dict[str, bytes]:
    """Every file of a store."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_a_map_equals_settle_at_every_cell(rover: rb.Rover, mode: Any, kind: Any) -> None:
    ground = rb.Terrain.from_array(heights()[60:190], STEP, ORIGIN, kind)
    headings = [0.1, 2.0] if mode == "contact" else [0.7]
    step = 0.1 if (mode, kind) == ("contact", "linear") else 0.37
    maps = rb.traversability(rover, ground, headings, step, mode=mode)
    assert maps.sizes["y"] == int(12.9 / step + 1e-6) + 1
    # in another order than a map is made, as the answer must not depend on it
    x, y, yaw = maps.x.values[:, None, None], maps.y.values[:, None], np.array(headings)
    if step == 0.1:
        assert maps.x.values.tobytes() == ground.x.tobytes()
    pose = rb.settle(rover, ground, x, y, yaw, mode=mode)
    expected = {
        "status": pose.status, "tilt": pose.tilt, "roll": pose.roll, "pitch": pose.pitch, "rocker": pose.rocker,
        "bogie_left": pose.bogie[..., 0], "bogie_right": pose.bogie[..., 1], "clearance": pose.clearance,
    }  # fmt: skip
    for name, values in expected.items():
        assert np.array_equal(maps[name].values, values.T, equal_nan=name != "status"), name
    assert {rb.Status.CONVERGED, rb.Status.OFF_MAP, rb.Status.NO_DATA} <= set(np.unique(maps.status).tolist()) | (
        {rb.Status.CONVERGED} if mode == "equilibrium" else set()
    )


def test_limits_exceeded_and_layers_over_headings(rover: rb.Rover, terrain: rb.Terrain, plain: Any) -> None:
    """Every bit and summary, from the layers alone."""
    limit = json.loads(plain.attrs["limits"])
    lost = np.isnan(plain.tilt.values)
    bits = np.zeros(plain.exceeded.shape, dtype=np.uint8)
    for name in ("pitch", "roll", "rocker", "tilt"):
        bits |= np.where(np.abs(plain[name].values) > limit[name], BITS[name], 0).astype(np.uint8)
    for name in ("bogie_left", "bogie_right"):
        bits |= np.where(np.abs(plain[name].values) > limit["bogie"], BITS["bogie"], 0).astype(np.uint8)
    bits |= np.where(~(plain.clearance.values > limit["clearance"]), BITS["clearance"], 0).astype(np.uint8)
    bits[lost] = BITS["unsettled"]
    stopped = plain.status.values == rb.Status.JOINT_STOP
    assert (plain.exceeded.values == bits)[~stopped].all()
    assert (plain.exceeded.values[stopped] & (BITS["rocker"] | BITS["bogie"])).all()
    seen = np.bitwise_or.reduce(plain.exceeded.values.ravel())
    assert all(seen & BITS[name] for name in ("pitch", "roll", "rocker", "unsettled"))

    over, tilt = plain.exceeded.values, plain.tilt.values
    unknown = np.isin(plain.status.values, (rb.Status.NO_DATA, rb.Status.OFF_MAP)).all(axis=0)
    share = (over == 0).mean(axis=0)
    assert unknown.any()
    assert np.isnan(plain.passable.values[unknown]).all()
    assert (plain.passable.values[~unknown] == share[~unknown].astype(np.float32)).all()
    assert 0.05 < share.mean() < 0.95
    settled = ~lost.all(axis=0)
    for name, worst in (("worst_tilt", tilt), ("worst_clearance", -plain.clearance.values)):
        known = ~np.isnan(worst).all(axis=0)
        assert known.any()
        sign = -1 if name == "worst_clearance" else 1
        assert (plain[name].values[known] == sign * np.nanmax(worst[:, known], axis=0)).all()
        assert np.isnan(plain[name].values[~known]).all()
    assert (plain.best_tilt.values[settled] == np.where(lost, np.inf, tilt).min(axis=0)[settled]).all()
    tilts = np.where(over == 0, tilt, np.inf)
    best = np.where(np.isinf(tilts.min(axis=0)), np.nan, plain.heading.values[tilts.argmin(axis=0)])
    assert np.array_equal(plain.best_heading.values, best, equal_nan=True)
    assert (plain.worst_exceeded.values == np.bitwise_or.reduce(over, axis=0)).all()


def test_joint_limits_are_exceeded_for_any_limits_and_clearance_has_its_own(rover: rb.Rover, terrain: rb.Terrain) -> None:
    box = (ORIGIN[0] + 4, ORIGIN[1] + 20, ORIGIN[0] + 10, ORIGIN[1] + 28)
    stiff = dataclasses.replace(rover, bogie_limits=np.radians([-3.0, 3.0]))
    free = rb.traversability(stiff, terrain, HEADINGS, limits="none", bounds=box)
    stopped = free.status.values == rb.Status.JOINT_STOP
    assert 0.01 < stopped.mean() < 0.99
    assert (free.exceeded.values == np.where(stopped, BITS["bogie"], 0)).all()
    middling = float(np.median(free.clearance))
    high = rb.traversability(stiff, terrain, HEADINGS, limits=rb.Limits(clearance=middling), bounds=box)
    assert ((high.exceeded.values & BITS["clearance"] > 0) == (high.clearance.values <= middling)).all()
    blind = rb.traversability(stiff, terrain, HEADINGS, limits=rb.Limits(tilt=0.1), bounds=box, layers=["passable"])
    assert list(blind.data_vars) == ["passable"]
    assert (blind.passable.values == ((free.tilt <= 0.1) & ~stopped).mean("heading").values.astype(np.float32)).all()


def test_many_headings_equal_single_headings(rover: rb.Rover, terrain: rb.Terrain) -> None:
    """More than are settled at once."""
    box = (ORIGIN[0] + 12, ORIGIN[1] + 11, ORIGIN[0] + 13, ORIGIN[1] + 12)
    maps = rb.traversability(rover, terrain, 37, bounds=box)
    assert maps.sizes == {"heading": 37, "y": 11, "x": 11}
    assert np.array_equal(maps.heading, 2 * np.pi * np.arange(37) / 37)
    for k in (0, 15, 16, 36):
        one = rb.traversability(rover, terrain, maps.heading.values[k : k + 1], bounds=box)
        assert one.tilt.values.tobytes() == maps.tilt.values[k : k + 1].tobytes()
    assert np.array_equal(maps.worst_tilt, maps.tilt.max("heading"), equal_nan=True)
    assert np.array_equal(maps.passable, (maps.exceeded == 0).mean("heading").astype(np.float32), equal_nan=True)


def test_bounds_and_resolution_are_on_the_lattice(rover: rb.Rover, terrain: rb.Terrain, plain: Any) -> None:
    """A part of a map is that part of the whole map."""
    box = (ORIGIN[0] + 10.0, ORIGIN[1] + 7.96, ORIGIN[0] + 12.0, ORIGIN[1] + 9.04)
    part = rb.traversability(rover, terrain, HEADINGS, bounds=box)
    inside = plain.sel(x=part.x, y=part.y)
    assert (part.sizes["x"], part.sizes["y"]) == (21, 11)
    assert_same(part, inside)
    coarse = rb.traversability(rover, terrain, HEADINGS, 0.5, bounds=box)
    assert np.allclose((coarse.x - ORIGIN[0]) / 0.5 % 1, 0, atol=1e-6)
    assert coarse.sizes == {"heading": 2, "y": 3, "x": 5}


def test_variables_have_descriptions(plain: Any, file: Path, rover: rb.Rover) -> None:
    for name in plain.data_vars:
        assert plain[name].attrs["long_name"]
        assert plain[name].attrs["units"] == LAYERS[name].units
    assert plain.status.attrs["flag_meanings"].split()[int(plain.status.attrs["flag_values"][2])] == "NO_DATA"
    bits = {name: bit for name, bit in BITS.items() if name not in FORCES}
    assert plain.exceeded.attrs["flag_meanings"].split() == list(bits)
    assert list(plain.exceeded.attrs["flag_masks"]) == list(bits.values())
    assert plain.attrs["rover"] == "elhami-dashti"
    assert "crs" not in plain.attrs
    box = (ORIGIN[0] + 10.0, ORIGIN[1] + 8.0, ORIGIN[0] + 11.0, ORIGIN[1] + 9.0)
    placed = rb.traversability(rover, file, 1, bounds=box, interpolation="linear")
    same_crs = pytest.importorskip("rasterio").CRS.from_user_input
    assert same_crs(placed.attrs["crs"]) == same_crs(MARS)
    assert "3396190" in placed.spatial_ref.attrs["crs_wkt"]
    assert placed.tilt.attrs["grid_mapping"] == "spatial_ref"


@pytest.mark.parametrize(("largest", "few"), [(1 << 21, 4), (2500, 1)])  # tiles one by one, and chunks on threads of their own
def test_a_file_in_windows_equals_the_terrain_in_memory(
    rover: rb.Rover, file: Path, plain: Any, largest: int, few: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "LARGEST", largest)
    monkeypatch.setattr(run, "FEW", few)
    filed = rb.traversability(rover, file, HEADINGS, interpolation="linear", chunk=128)
    assert_same(filed, plain)
    coarse = {"headings": 1, "resolution": 0.7}
    whole = rb.Terrain.from_raster(file)
    assert_same(rb.traversability(rover, file, **coarse), rb.traversability(rover, whole, **coarse))


def test_any_chunks_and_workers_give_the_same_bytes(
    cluster: Any, rover: rb.Rover, terrain: rb.Terrain, file: Path, plain: Any, tmp_path: Path
) -> None:
    pytest.importorskip("zarr", reason="needs the scale extra")
    pytest.importorskip("distributed", reason="needs the scale extra")
    ways: dict[str, tuple[Any, dict[str, Any]]] = {
        "one": (terrain, {"chunk": 1024}),
        "many": (file, {"chunk": 128}),
        "one worker": (terrain, {"scheduler": cluster.scheduler_address, "chunk": 256}),
        "two workers": (file, {"workers": 2, "chunk": 128}),
    }
    stores = {}
    for name, (ground, how) in ways.items():
        kept = tmp_path / name
        told: list[tuple[int, int]] = []
        made = rb.traversability(
            rover, ground, HEADINGS, interpolation="linear", store=kept, progress=lambda *at, told=told: told.append(at), **how
        )
        assert_same(made, plain)
        total = plain.sizes["x"] * plain.sizes["y"]
        assert told[0] == (0, total)
        assert told[-1] == (total, total)
        assert all(a[0] < b[0] for a, b in itertools.pairwise(told))
        stores[name] = {k: v for k, v in bytes_of(kept).items() if k != "made_from.json"}
    first = stores.pop("one")
    assert len([name for name in first if name.startswith("done/")]) == 6
    for name, files in stores.items():
        assert files == first, name


def test_a_finished_store_is_only_read(
    rover: rb.Rover, terrain: rb.Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("zarr", reason="needs the scale extra")
    call = {"headings": 1, "resolution": 0.5, "store": tmp_path / "s", "layers": ["passable", "worst_tilt"]}
    before = rb.traversability(rover, terrain, **call)
    assert set(before.data_vars) == {"passable", "worst_tilt"}
    monkeypatch.setattr(run, "make", lambda *_: pytest.fail("nothing is left to make"))
    assert_same(rb.traversability(rover, terrain, **call), before)
    monkeypatch.setattr("rockerbogie.maps.traversability.IN_MEMORY", 0)
    lazy = rb.traversability(rover, terrain, **call)
    assert lazy.passable.chunks is not None
    assert_same(lazy, before)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"headings": 2}, r"another headings \(\[0.0\], now \[0.0, 3.14"),
        ({"limits": "none"}, "another limits"),
        ({"resolution": 1.0}, r"another cells \(resolution, bounds\)"),
        ({"layers": ["passable", "best_tilt"]}, "another layers"),
        ({"mode": "equilibrium"}, r"another mode \(contact, now equilibrium\)"),
        ({"rover": "rocky7"}, r"another rover \(elhami-dashti, now rocky7\)"),
        ({"terrain": 1e-9}, "another heights of the terrain"),
        ({"interpolation": "cubic"}, r"another .*interpolation \(linear, now cubic\)"),
    ],
)
def test_a_store_of_another_map_is_refused(
    rover: rb.Rover, terrain: rb.Terrain, tmp_path_factory: pytest.TempPathFactory, change: dict[str, Any], sentence: str
) -> None:
    pytest.importorskip("zarr", reason="needs the scale extra")
    kept = tmp_path_factory.getbasetemp() / "refusing"
    call = {"headings": 1, "resolution": 2.0, "layers": ["passable"]}
    rb.traversability(rover, terrain, **call, store=kept)
    before = bytes_of(kept)
    other = rb.load_rover(change.pop("rover")) if "rover" in change else rover
    ground = terrain
    if "terrain" in change:
        ground = rb.Terrain.from_array(terrain.z + change.pop("terrain"), STEP, ORIGIN, "linear", name="dune")
    if "interpolation" in change:
        ground = rb.Terrain.from_array(terrain.z, STEP, ORIGIN, change.pop("interpolation"), name="dune")
    with pytest.raises(rb.RockerbogieError, match=f"refusing' holds a map made from {sentence}.*give another name"):
        rb.traversability(other, ground, **call | change, store=kept)
    assert bytes_of(kept) == before


def test_a_folder_that_is_no_map_is_not_changed(rover: rb.Rover, terrain: rb.Terrain, tmp_path: Path) -> None:
    pytest.importorskip("zarr", reason="needs the scale extra")
    (tmp_path / "thesis.txt").write_text("years of work")
    (tmp_path / "file").touch()
    for place in (tmp_path, tmp_path / "file"):
        with pytest.raises(rb.RockerbogieError, match="exists and is not an unfinished map"):
            rb.traversability(rover, terrain, 1, 2.0, store=place)
    with pytest.raises(rb.RockerbogieError, match="cannot make a map in .*file/deeper': Not a directory"):
        rb.traversability(rover, terrain, 1, 2.0, store=tmp_path / "file" / "deeper")
    assert (tmp_path / "thesis.txt").read_text() == "years of work"


def test_a_full_disk_is_reported_and_a_second_run_continues(
    rover: rb.Rover, terrain: rb.Terrain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("zarr", reason="needs the scale extra")
    call = {"headings": 1, "resolution": 0.1, "layers": ["tilt", "passable"], "chunk": 128}
    straight = rb.traversability(rover, terrain, **call, store=tmp_path / "straight")
    write, left = store.Store.take, iter(range(7))

    def take(self: store.Store, *what: Any) -> None:
        if next(left, None) is None:
            raise OSError(28, "No space left on device")
        write(self, *what)

    with monkeypatch.context() as disk:
        disk.setattr(store.Store, "take", take)
        disk.setattr(run, "FEW", 1)
        with pytest.raises(
            rb.RockerbogieError, match="No space left on device; finished tiles are kept, and the same call continues"
        ):
            rb.traversability(rover, terrain, **call, store=tmp_path / "broken")
    done = len(list((tmp_path / "broken" / "done").iterdir()))
    assert 0 < done < 6
    told: list[int] = []
    resumed = rb.traversability(rover, terrain, **call, store=tmp_path / "broken", progress=lambda n, _: told.append(n))
    assert told[0] > 0
    assert_same(resumed, straight)
    assert bytes_of(tmp_path / "broken") == bytes_of(tmp_path / "straight")


SCRIPT = """
import sys
from pathlib import Path
import rockerbogie as rb
sys.path[:0] = [sys.argv[1], str(Path(sys.argv[1]).parent)]
from test_maps import HEADINGS, ORIGIN, STEP, heights

if __name__ == "__main__":
    ground = rb.Terrain.from_array(heights(), STEP, ORIGIN, "linear", name="dune")
    rb.traversability(
        rb.load_rover("elhami-dashti"), ground, HEADINGS, chunk=128, store=sys.argv[2],
        workers=int(sys.argv[3]) or None, progress=lambda done, total: print(done, total, flush=True),
    )
"""


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[[Path, int], subprocess.Popen[str]]]:
    """Start making the map in a process of its own."""
    script = tmp_path / "make.py"
    script.write_text(SCRIPT)
    begun: list[subprocess.Popen[str]] = []

    def start(kept: Path, workers: int) -> subprocess.Popen[str]:
        command = [sys.executable, str(script), str(Path(__file__).parent), str(kept), str(workers)]
        begun.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        return begun[-1]

    yield start
    for process in begun:
        process.kill()
        process.wait()


def workers_of(process: subprocess.Popen[str]) -> list[Any]:
    """A process's own processes, as psutil has them."""
    psutil = pytest.importorskip("psutil", reason="comes with the scale extra")
    return [p for p in psutil.Process(process.pid).children(recursive=True) if "spawn_main" in " ".join(p.cmdline())]


@pytest.mark.parametrize("workers", [0, 2])
def test_killed_at_any_moment_a_rerun_ends_with_the_same_bytes(
    rover: rb.Rover, terrain: rb.Terrain, plain: Any, tmp_path: Path, started: Any, workers: int
) -> None:
    pytest.importorskip("distributed", reason="needs the scale extra")
    straight = tmp_path / "straight"
    rb.traversability(rover, terrain, HEADINGS, store=straight)
    rng = np.random.default_rng(workers)
    kept, seen = tmp_path / "broken", [0]
    for _ in range(3 if workers == 0 else 2):
        process = started(kept, workers)
        seen.append(int(process.stdout.readline().split()[0]))  # it has begun: this much was done before
        time.sleep(rng.uniform(0.0, 0.6))
        process.send_signal(signal.SIGKILL)
        process.wait()
    again = rb.traversability(rover, terrain, HEADINGS, store=kept)
    assert_same(again, plain)
    assert seen == sorted(seen)
    assert bytes_of(kept) == bytes_of(straight)


def test_tiles_of_a_killed_worker_are_computed_again(rover: rb.Rover, terrain: rb.Terrain, tmp_path: Path, started: Any) -> None:
    pytest.importorskip("distributed", reason="needs the scale extra")
    straight, kept = tmp_path / "straight", tmp_path / "kept"
    rb.traversability(rover, terrain, HEADINGS, store=straight)
    process = started(kept, 2)
    process.stdout.readline()
    process.stdout.readline()  # a first chunk is done
    killed = workers_of(process)
    assert len(killed) == 2
    os.kill(killed[0].pid, signal.SIGKILL)
    assert process.wait(PATIENCE) == 0
    assert bytes_of(kept) == bytes_of(straight)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"headings": 0}, "headings is 0: give their number"),
        ({"headings": []}, r"headings is \[\]: give their number"),
        ({"headings": [0.0, np.nan]}, "give their number, 1 or more, or a list of angles in rad"),
        ({"headings": 2.5}, "headings is 2.5"),
        ({"resolution": 0}, "resolution is 0: give the side of a cell"),
        ({"resolution": "fine"}, "resolution is 'fine'"),
        ({"limits": "curiousity"}, "no limits named 'curiousity'; did you mean 'curiosity'"),
        ({"limits": 30}, "limits is 30: give a rockerbogie.Limits"),
        ({"bounds": (0, 0, 1, 1)}, r"bounds \(0, 0, 1, 1\) hold no cell of dune, which spans \(-3000000.25, 4141909.5"),
        ({"bounds": (1, 0, 0, 1)}, "min not above max"),
        ({"mode": "float"}, "mode 'float' is not known"),
        ({"layers": ["tilts"]}, "no layer named 'tilts'; did you mean 'tilt'"),
        ({"layers": []}, "layers is empty"),
        ({"chunk": 100}, "chunk is 100: give a multiple of 128"),
        ({"workers": 0}, "workers is 0: give the number of processes"),
        ({"headings": 100_000}, "the map would be .* GB: give store='a folder'"),
        ({"scheduler": "tcp://127.0.0.1:9"}, "no Dask scheduler answers at 'tcp://127.0.0.1:9'"),
    ],
)
def test_wrong_calls_are_refused_in_one_sentence(
    rover: rb.Rover, terrain: rb.Terrain, wrong: dict[str, Any], sentence: str, monkeypatch: Any
) -> None:
    monkeypatch.setattr(run, "PATIENCE", 0.5)
    with pytest.raises(rb.RockerbogieError, match=sentence):
        rb.traversability(rover, terrain, **wrong)
    with pytest.raises(rb.RockerbogieError, match="terrain is 3: give a Terrain, or the path"):
        rb.traversability(rover, 3)  # type: ignore[arg-type]


@pytest.mark.parametrize("missing", ["zarr", "dask", "distributed"])
def test_a_missing_extra_is_named(rover: rb.Rover, terrain: rb.Terrain, tmp_path: Path, monkeypatch: Any, missing: str) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(rb.RockerbogieError, match=rf"needs {missing}: pip install 'rockerbogie\[scale\]'"):
        rb.traversability(rover, terrain, 1, 2.0, store=tmp_path / "s", workers=1)
    assert rb.traversability(rover, terrain, 1, 2.0).passable.notnull().any()


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"tilt": 0}, "limit tilt is 0: give a number"),
        ({"pitch": 15}, r"limit pitch is 15: give a number \(rad, above 0 and at most pi\)"),
        ({"clearance": np.nan}, "limit clearance is nan"),
        ({"bogie": "17 deg"}, "limit bogie is '17 deg'"),
    ],
)
def test_limits_of_none_do_not_apply(wrong: dict[str, Any], sentence: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=sentence):
        rb.Limits(**wrong)


def test_memory_is_bounded_by_the_chunk_and_not_by_the_map(tmp_path: Path) -> None:
    """A raster of 288 MB of heights takes less than half of that in memory."""
    rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
    pytest.importorskip("zarr", reason="needs the scale extra")
    n, path = 6000, tmp_path / "wide.tif"
    profile = {"driver": "GTiff", "height": n, "width": n, "count": 1, "dtype": "float32", "tiled": True, "compress": "deflate"}
    with rasterio.open(path, "w", **profile, transform=rasterio.transform.from_origin(7, 0, 1, 1), crs="EPSG:32633") as raster:
        row = np.sin(np.arange(n, dtype=np.float32) / 50)
        for start in range(0, n, 500):
            raster.write(np.tile(row, (500, 1)), 1, window=rasterio.windows.Window(0, start, n, 500))
    script = tmp_path / "measure.py"
    script.write_text(
        "import resource, sys\nimport rockerbogie as rb\n"
        "def used(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3\n"
        "rover, kept = rb.load_rover('curiosity'), sys.argv[2]\n"
        "call = dict(headings=1, resolution=50.0, layers=['passable'], interpolation='linear')\n"
        "rb.traversability(rover, sys.argv[1], bounds=(7, -500, 507, 0), store=kept + '1', **call)\n"
        "before = used()\n"
        "maps = rb.traversability(rover, sys.argv[1], store=kept + '2', **call)\n"
        "print(used() - before, maps.passable.size)\n"
    )
    command = [sys.executable, str(script), str(path), str(tmp_path / "kept")]
    megabytes, cells = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert int(cells) == 120 * 120
    assert float(megabytes) < 144
