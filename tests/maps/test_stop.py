"""Maps that are stopped, clusters that cannot work, and the version of a map's numbers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.maps import store
from rockerbogie.maps.cells import Tile, cells_over
from rockerbogie.maps.ground import hold_ground, reach
from rockerbogie.maps.limits import Limits
from rockerbogie.maps.run import Memory, in_threads
from rockerbogie.maps.tile import Job, _Pace
from rockerbogie.maps.windows import TerrainWindows
from support.helpers import assert_close
from support.patience import PATIENCE

COMMAND = [sys.executable, "-m", "rockerbogie"]


def start(*argv: str) -> subprocess.Popen[str]:
    """The command line in a process group of its own that takes SIGINT, as a terminal starts it."""
    return subprocess.Popen(
        [*COMMAND, *argv],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
    )


@pytest.mark.parametrize("mode", ["contact", "equilibrium"])
def test_one_interrupt_stops_a_map_and_keeps_its_tiles(mode: str, tmp_path: Path) -> None:
    pytest.importorskip("zarr", reason="needs the scale extra")
    size = "surface:plane?size=200&spacing=0.2" if mode == "contact" else "surface:plane?size=300,10&spacing=2"
    argv = ["map", size, "-r", "elhami-dashti", "--mode", mode, "--headings", "16", "--no-preview", "-o", str(tmp_path / "m.nc")]
    if mode == "equilibrium":
        argv += ["--resolution", "0.5"]
    process = start(*argv)
    done = tmp_path / "m.nc.parts" / "done"
    end = time.monotonic() + PATIENCE
    while not (done.is_dir() and any(done.iterdir())) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    assert process.poll() is None, process.communicate()
    kept = {file.name for file in done.iterdir()}
    assert kept
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 130
    assert not (tmp_path / "m.nc").exists(), "it stops before the map is complete"
    assert "finished parts are in" in said
    assert "Traceback" not in said
    assert kept <= {file.name for file in done.iterdir()}


def test_an_interrupt_comes_between_batches() -> None:
    """Progress is reported within a tile; an error raised there stops all threads."""
    rover, ground = rb.load_rover("elhami-dashti"), rb.surfaces.plane(size=(30.0, 30.0))
    cells = cells_over(hold_ground(ground).whole, None, None)
    job = Job(rover, cells, np.array([0.0, 1.0]), Limits(), "contact", ("status",))
    told: list[int] = []

    def tell(new: int) -> None:
        told.append(new)
        raise KeyboardInterrupt

    memory = Memory.blank(job, cells.all)
    with pytest.raises(KeyboardInterrupt):
        in_threads(job, TerrainWindows(hold_ground(ground), cells, reach(rover)), list(cells.chunks(128)), memory, tell)
    assert len(told) == 1
    assert 0 < told[0] < cells.all.size


@pytest.mark.parametrize("shape", [(1, 1), (128, 128), (3, 128), (128, 1)])
def test_batches_cover_every_cell_once(shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    seen = np.zeros(shape, dtype=int)
    pace = _Pace()
    rng = np.random.default_rng(5)
    for rows, cols in pace.blocks(shape, 3):
        seen[rows, cols] += 1
        pace.poses = int(rng.integers(1, 2000))
    assert (seen == 1).all()


def test_layers_do_not_depend_on_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    rover, ground = rb.load_rover("osr"), rb.surfaces.rocks(seed=2, size=(3.0, 3.0))
    call = {"headings": 5, "resolution": 0.1, "layers": "all"}
    whole = rb.traversability(rover, ground, **call)
    monkeypatch.setattr("rockerbogie.maps.tile.FIRST_BATCH", 7)
    monkeypatch.setattr("rockerbogie.maps.tile.MOST_BATCH", 9)
    assert whole.identical(rb.traversability(rover, ground, **call))
    assert set(whole.data_vars) == set(store.LAYERS)


def test_stored_numbers_equal_those_of_this_version() -> None:
    """If better numbers of maps fail here: raise `store.NUMERICS` by 1 and write them here."""
    rover = rb.load_rover("osr")
    assert store.NUMERICS == 1
    values = []
    for ground in (rb.surfaces.rocks(seed=3, size=(3.0, 3.0)), rb.surfaces.rough(seed=3, size=4.0)):
        maps = rb.traversability(rover, ground, 3, 0.5, layers=["tilt", "worst_clearance", "exceeded"])
        values.append([float(np.degrees(np.nanmean(maps["tilt"]))), float(np.nanmin(maps["worst_clearance"])),
                       int((maps["exceeded"] > 0).sum())])  # fmt: skip
    assert_close(np.array(values), KNOWN, 1e-9, "deg, m, poses", "known numbers of version 1")


#: Mean tilt (deg), least clearance (m), poses beyond a limit.
KNOWN = np.array([[1.6174280314533458, 0.009517131447274119, 78], [3.436188570790665, 0.12583630550884473, 96]])


@pytest.fixture
def scheduler() -> object:
    """A Dask scheduler in a process of its own, without workers; gives its address."""
    pytest.importorskip("distributed", reason="needs the scale extra")
    code = (
        "import asyncio\nfrom distributed import Scheduler\n"
        "async def main():\n async with Scheduler(host='127.0.0.1', port=0, dashboard=False) as s:\n"
        "  print(s.address, flush=True)\n  await s.finished()\n"
        "asyncio.run(main())"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    yield process.stdout.readline().strip()
    process.kill()
    process.wait()


def map_on(scheduler: str, tmp_path: Path) -> tuple[int, str]:
    """Return exit code and stderr of a map on a cluster."""
    argv = ["map", "surface:plane?size=4", "-r", "osr", "--no-preview", "-o", str(tmp_path / "m.nc"), "--scheduler", scheduler]
    done = subprocess.run([*COMMAND, *argv], capture_output=True, text=True, timeout=PATIENCE, check=False)
    return done.returncode, done.stderr


def test_a_cluster_without_workers_is_reported(scheduler: str, tmp_path: Path) -> None:
    code, said = map_on(scheduler, tmp_path)
    assert code == 2
    assert "has no workers: start some" in said


def test_a_worker_without_the_package_is_reported(scheduler: str, tmp_path: Path) -> None:
    hidden = tmp_path / "hidden" / "rockerbogie"
    hidden.mkdir(parents=True)
    (hidden / "__init__.py").write_text("raise ImportError('no rockerbogie')")
    argv = [sys.executable, "-m", "distributed.cli.dask_worker", scheduler, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    worker = subprocess.Popen(
        [*argv, "--local-directory", str(tmp_path / "w")], env=os.environ | {"PYTHONPATH": str(hidden.parent)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        from distributed import Client

        with Client(scheduler) as client:
            client.wait_for_workers(1, timeout=PATIENCE)
        code, said = map_on(scheduler, tmp_path)
    finally:
        worker.kill()
        worker.wait()
    assert code == 2
    assert "has no usable rockerbogie (ImportError: no rockerbogie)" in said


def test_tiles_of_one_cell_are_not_split() -> None:
    assert Tile((0, 1), (0, 1)).halves() == (Tile((0, 1), (0, 1)),)
