"""Tiles made in threads of this process, or by a Dask cluster's workers."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import threads
from ..errors import RockerbogieError
from .cells import Tile
from .ground import Ground
from .layers import LAYERS
from .store import NEEDS, Store, numerics
from .tile import Job

#: Most nodes of a file in one window: cells far apart are made in pieces.
LARGEST = 1 << 21
#: Fewer chunks for each thread than this would leave some of them idle at the end.
FEW = 4
PATIENCE = 30.0  # s: how long a scheduler may take to answer, and its first worker to come
#: Called with how many cells are done, and how many there are.
Progress = Callable[[int, int], None]


class Memory:
    """Layers in memory, taken as a store takes them."""

    def __init__(self, layers: dict[str, NDArray[Any]]) -> None:
        self.arrays = layers

    @classmethod
    def blank(cls, job: Job, tile: Tile) -> Memory:
        """Room for a tile's layers, or for all of a map's."""
        return cls({name: np.full(job.shape(name, tile), LAYERS[name].blank, LAYERS[name].kind) for name in job.layers})

    def take(self, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Keep a part of a layer."""
        self.arrays[name][region] = values

    def take_from(self, whole: Tile, name: str, region: tuple[slice, ...], values: NDArray[Any]) -> None:
        """Keep a part of a layer of the tile `whole`, told by its place on the map."""
        rows, cols = (
            slice(part.start - first, part.stop - first)
            for part, first in zip(region[-2:], (whole.rows[0], whole.cols[0]), strict=True)
        )
        self.arrays[name][(*region[:-2], rows, cols)] = values

    def is_done(self, tile: Tile) -> bool:
        """Nothing is, to begin with."""
        return False

    def finish(self, tile: Tile) -> None:
        """Nothing is gone on with later."""


def make(job: Job, ground: Ground, tiles: list[Tile], store: Store | Memory, count: int = 1) -> int:
    """Make the tiles of one chunk that are not done yet, on `count` threads; how many cells that was."""
    tiles = [tile for tile in tiles if not store.is_done(tile)]
    with threads(count):
        if tiles and ground.cost(*job.window(ground, tiles)) <= LARGEST:
            terrain = ground.window(*job.window(ground, tiles))
            for tile in tiles:
                job.settle(terrain, tile, store.take)
                store.finish(tile)
        else:
            for tile in tiles:
                _piecewise(job, ground, tile, store)
                store.finish(tile)
    return sum(tile.size for tile in tiles)


def _piecewise(job: Job, ground: Ground, tile: Tile, store: Store | Memory) -> None:
    """Make a tile whose cells lie too far apart for one window, in pieces put together in memory."""
    pieces = [tile]
    while pieces[0].size > 1 and max(ground.cost(*job.window(ground, [piece])) for piece in pieces) > LARGEST:
        pieces = [half for piece in pieces for half in piece.halves()]
    whole = Memory.blank(job, tile)
    for piece in pieces:
        terrain = ground.window(*job.window(ground, [piece]))
        job.settle(terrain, piece, partial(whole.take_from, tile))
    for name, values in whole.arrays.items():
        lead = (slice(None),) * (values.ndim - 2)
        store.take(name, (*lead, *tile.region), values)


def in_threads(job: Job, ground: Ground, chunks: list[list[Tile]], store: Store | Memory, tell: Callable[[int], None]) -> None:
    """Make every chunk in this process, a thread a core; `tell` is called with the cells of each as it is done."""
    with threads(None) as count:
        if len(chunks) < FEW * count:
            chunks = [[tile] for chunk in chunks for tile in chunk]
        if len(chunks) < FEW * count:  # one after the other, each on all threads
            for chunk in chunks:
                tell(make(job, ground, chunk, store, count))
            return
    with ThreadPoolExecutor(count) as pool:
        waiting = iter(chunks)
        flying: set[Future[int]] = set()
        try:
            while True:
                for chunk in waiting:
                    flying.add(pool.submit(make, job, ground, chunk, store))
                    if len(flying) > count:
                        break
                if not flying:
                    return
                done, flying = wait(flying, return_when=FIRST_COMPLETED)
                for future in done:
                    tell(future.result())
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def on_cluster(
    job: Job, ground: Ground, chunks: list[list[Tile]], store: Path, workers: int | None, scheduler: str | None,
    tell: Callable[[int], None],
) -> None:  # fmt: skip
    """Make every chunk by a Dask cluster: an existing one, or one of `workers` processes on this machine.

    Workers read the ground's file and write the store by themselves. Only a few chunks are asked for at once, and those of
    a worker that dies are asked for again.
    """
    with _client(workers, scheduler) as client:
        from distributed import KilledWorker, as_completed

        waiting = iter(chunks)
        finished = as_completed()

        def submit(most: int) -> None:
            for _, chunk in zip(range(most), waiting, strict=False):
                part = ground.sent(*job.window(ground, chunk))
                finished.add(client.submit(_remote, job, part, chunk, store, numerics(), pure=False))

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
                f"workers die of this map, perhaps for want of memory; give a smaller chunk: {error}"
            ) from None
        except CancelledError:
            raise RockerbogieError("the Dask cluster went away; what is finished is kept, and the same call goes on") from None
        finally:
            client.cancel(list(finished.futures))


def _remote(job: Job, ground: Ground, chunk: list[Tile], store: Path, expected: str) -> int | Exception:
    """`make` on a worker. What goes wrong with files is given back, as what is raised fills the screen with its traceback."""
    try:
        if numerics() != expected:
            raise RockerbogieError("a worker runs another version of rockerbogie, whose numbers may differ: give all the same")
        return make(job, ground, chunk, Store(store))
    except (OSError, RockerbogieError) as error:
        return error


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A Dask client, and the cluster on this machine where there is none yet."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise RockerbogieError(f"making a map on several processes {NEEDS}") from None
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError) as error:
            raise RockerbogieError(f"no Dask scheduler answers at {scheduler!r}: {error}") from None
        with client:
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except TimeoutError:
                raise RockerbogieError(f"the Dask cluster at {scheduler!r} has no workers: start some") from None
            yield client
        return
    # a chunk is tried again as often as a worker dies under it, within reason
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
        yield client
