"""Tiles made in threads of this process, or by the workers of a Dask cluster."""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import threads
from ..errors import RockerbogieError, require
from .cells import Tile
from .layers import LAYERS, kind_of
from .store import NUMERICS, Store
from .tile import Job
from .windows import TerrainWindows

#: Most nodes of a file in one window: cells far apart are made in pieces.
LARGEST = 1 << 21
#: Fewer chunks per thread than this would leave some threads idle at the end.
FEW = 4
#: Greatest time in which a scheduler answers, its first worker appears, and all workers report their version, s.
PATIENCE = 8.0
#: Interval at which finished cells are reported, s.
REPORT = 0.1
#: Called with the number of cells done and of all cells.
Progress = Callable[[int, int], None]


class Memory:
    """Layers in memory, with the interface of a store."""

    def __init__(self, layers: dict[str, NDArray[Any]]) -> None:
        self.arrays = layers

    @classmethod
    def blank(cls, job: Job, tile: Tile) -> Memory:
        """Return memory for the layers of a tile, or of the whole map.

        Args:
            job: gives the layers.
            tile: the cells.

        Returns:
            Layers with their blank values.
        """
        return cls({name: np.full(job.shape(name, tile), LAYERS[name].blank, kind_of(name, job.limits)) for name in job.layers})

    def take(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Store a part of a layer.

        Args:
            name: of the layer.
            region: its indices.
            values: of that part.
        """
        self.arrays[name][region] = values

    def take_from(self, whole: Tile, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Store a part of a layer of the tile `whole`.

        Args:
            whole: the tile that this memory holds.
            name: of the layer.
            region: its indices on the map.
            values: of that part.
        """
        rows, cols = (
            slice(part.start - first, part.stop - first)
            for part, first in zip(region[-2:], (whole.rows[0], whole.cols[0]), strict=True)
        )
        self.arrays[name][(*region[:-2], rows, cols)] = values

    def is_done(self, tile: Tile) -> bool:
        """Return False: memory has no tiles of an earlier run.

        Args:
            tile: not used.

        Returns:
            False.
        """
        return False

    def finish(self, tile: Tile) -> None:
        """Do nothing: a run in memory cannot be resumed.

        Args:
            tile: not used.
        """


class _StoppedError(Exception):
    """Work was stopped between two batches."""


class _Meter:
    """Cells done by several threads; it stops them when `stop` is set."""

    def __init__(self) -> None:
        self.stop = False
        self._cells, self._reported, self._lock = 0.0, 0, threading.Lock()

    def tick(self, cells: float) -> None:
        """Add cells; raise if the work is to stop."""
        with self._lock:
            self._cells += cells
        if self.stop:
            raise _StoppedError

    def news(self) -> int:
        """Return how many whole cells were added since the last call."""
        with self._lock:
            new = int(self._cells + 1e-6) - self._reported
            self._reported += new
        return new


def make(
    job: Job, windows: TerrainWindows, tiles: list[Tile], store: Store | Memory, count: int = 1,
    tick: Callable[[float], None] = lambda cells: None,
) -> int:  # fmt: skip
    """Make the tiles of one chunk that are not done yet.

    Args:
        job: the work.
        windows: the terrain.
        tiles: of the chunk.
        store: where layers go.
        count: threads to use.
        tick: called after every batch of poses with its cells; it may raise to stop.

    Returns:
        The number of cells made.
    """
    tiles = [tile for tile in tiles if not store.is_done(tile)]
    with threads(count):
        together = bool(tiles) and windows.cost(tiles) <= LARGEST
        terrain = windows.terrain(tiles) if together else None
        for tile in tiles:
            if terrain is not None:
                job.settle(terrain, tile, store.take, tick)
            else:
                _piecewise(job, windows, tile, store, tick)
            store.finish(tile)
    return sum(tile.size for tile in tiles)


def _piecewise(job: Job, windows: TerrainWindows, tile: Tile, store: Store | Memory, tick: Callable[[float], None]) -> None:
    """Make a tile whose cells lie too far apart for one window, in pieces joined in memory."""
    pieces = [tile]
    while pieces[0].size > 1 and max(windows.cost([piece]) for piece in pieces) > LARGEST:
        pieces = [half for piece in pieces for half in piece.halves()]
    whole = Memory.blank(job, tile)
    for piece in pieces:
        job.settle(windows.terrain([piece]), piece, partial(whole.take_from, tile), tick)
    for name, values in whole.arrays.items():
        lead = (slice(None),) * (values.ndim - 2)
        store.take(name, (*lead, *tile.region), values)


def in_threads(
    job: Job, windows: TerrainWindows, chunks: list[list[Tile]], store: Store | Memory, tell: Callable[[int], None]
) -> None:
    """Make every chunk in this process, one thread per core.

    An interrupt (or an error of `tell`) stops all threads after their current batch of poses; finished tiles stay.

    Args:
        job: the work.
        windows: the terrain.
        chunks: tiles, chunk by chunk.
        store: where layers go.
        tell: called in the calling thread with the number of cells done since its last call.
    """
    meter = _Meter()
    with threads(None) as count:
        if len(chunks) < FEW * count:
            chunks = [[tile] for chunk in chunks for tile in chunk]
        if len(chunks) < FEW * count:  # one after the other, each on all threads

            def tick(cells: float) -> None:
                meter.tick(cells)
                if new := meter.news():
                    tell(new)

            for chunk in chunks:
                make(job, windows, chunk, store, count, tick)
            return
    with ThreadPoolExecutor(count) as pool:
        waiting = iter(chunks)
        running: set[Future[int]] = set()
        try:
            while True:
                for chunk in waiting:
                    running.add(pool.submit(make, job, windows, chunk, store, 1, meter.tick))
                    if len(running) > count:
                        break
                if not running:
                    return
                done, running = wait(running, timeout=REPORT, return_when=FIRST_COMPLETED)
                if new := meter.news():
                    tell(new)
                for future in done:
                    future.result()
        finally:
            meter.stop = True
            pool.shutdown(wait=True, cancel_futures=True)


def on_cluster(
    job: Job, windows: TerrainWindows, chunks: list[list[Tile]], store: Path, workers: int | None, scheduler: str | None,
    tell: Callable[[int], None],
) -> None:  # fmt: skip
    """Make every chunk by a Dask cluster: an existing one, or processes on this machine.

    Workers read the terrain's file and write the store themselves. Only a few chunks are submitted at once; chunks of a
    worker that dies are submitted again.

    Args:
        job: the work.
        windows: the terrain.
        chunks: tiles, chunk by chunk.
        store: folder of the store.
        workers: number of processes on this machine; None: one per core.
        scheduler: address of an existing cluster; None: start one.
        tell: called with the number of cells of each chunk that is done.

    Raises:
        RockerbogieError: dask missing; no scheduler or workers; workers of another version; workers that die or fail.
    """
    with _client(workers, scheduler) as client:
        from distributed import KilledWorker, as_completed

        waiting = iter(chunks)
        finished = as_completed()

        def submit(most: int) -> None:
            for _, chunk in zip(range(most), waiting, strict=False):
                finished.add(client.submit(_remote, job, windows.sent(chunk), chunk, store, NUMERICS, pure=False))

        submit(2 * max(sum(client.nthreads().values()), 1))
        try:
            for future in finished:
                if isinstance(cells := future.result(), Exception):
                    raise cells
                tell(cells)
                future.release()
                submit(1)
        except KilledWorker as error:
            raise RockerbogieError(
                f"workers die while they make this map, perhaps for lack of memory: give a smaller chunk ({error})"
            ) from None
        except CancelledError:
            raise RockerbogieError(
                "the connection to the Dask cluster was lost; finished tiles are kept, and the same call continues from there"
            ) from None
        except Exception:
            client.cancel(list(finished.futures))
            raise


def _remote(job: Job, windows: TerrainWindows, chunk: list[Tile], store: Path, expected: int) -> int | Exception:
    """Run `make` on a worker; return errors of files, because raised ones print a traceback."""
    try:
        if expected != NUMERICS:
            raise RockerbogieError("a worker runs another version of rockerbogie, whose numbers may differ: install one version")
        return make(job, windows, chunk, Store(store))
    except (OSError, RockerbogieError) as error:
        return error


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Yield a Dask client; without a scheduler, start a cluster on this machine."""
    require("making a map on several processes", "scale", "dask", "distributed")
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError) as error:
            raise RockerbogieError(f"no Dask scheduler answers at {scheduler!r}: {error}") from None
        try:
            _check_workers(client, scheduler)
            yield client
        finally:
            client.close(timeout=1)
        return
    # a chunk is tried again when its worker dies, up to 20 times
    settings = {"distributed.scheduler.allowed-failures": 20, "distributed.logging.distributed": "error"}
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=workers or os.cpu_count() or 1,
            threads_per_worker=1,
            processes=True,
            dashboard_address=":0",
            silence_logs=logging.ERROR,
        ) as cluster,
        Client(cluster) as client,
    ):
        try:
            yield client
        except KeyboardInterrupt:  # closing a busy worker takes seconds; a killed one leaves the store consistent
            for nanny in cluster.workers.values():
                nanny.auto_restart = False
                with suppress(OSError):
                    os.kill(nanny.pid, signal.SIGKILL)
            raise


def _check_workers(client: Any, scheduler: str) -> None:
    """Raise if a cluster has no workers, or a worker has no rockerbogie or another one.

    The probe is text: a worker without the package could not receive one of our functions, and would never answer.
    """
    try:
        client.wait_for_workers(1, timeout=PATIENCE / 2)
    except TimeoutError:
        raise RockerbogieError(
            f"the Dask cluster at {scheduler!r} has no workers: start some with dask worker {scheduler}"
        ) from None
    probe = "__import__('rockerbogie.maps.store', fromlist=['store']).NUMERICS"
    answers: dict[str, Any] = {}
    asking = threading.Thread(target=lambda: answers.update(client.run(eval, probe, on_error="return")), daemon=True)
    asking.start()
    asking.join(PATIENCE / 2)
    if asking.is_alive():
        raise RockerbogieError(f"the workers of the Dask cluster at {scheduler!r} do not answer: see their logs")
    for worker, answer in answers.items():
        if isinstance(answer, Exception):
            raise RockerbogieError(
                f"the Dask worker {worker} has no usable rockerbogie ({type(answer).__name__}: {answer}): "
                "start it in an environment where it is installed"
            )
        if answer != NUMERICS:
            raise RockerbogieError(
                f"the Dask worker {worker} runs another version of rockerbogie: install one version everywhere"
            )
