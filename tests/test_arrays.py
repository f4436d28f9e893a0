"""Runs of a batch: they cover it once, in order, and broadcast places cost no memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.arrays import flat, flat_steering, pieces

SHAPES = [(), (1,), (4,), (3, 1, 2), (2, 3, 4), (0, 3), (5, 0)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("most", [1, 2, 3, 7, 100])
def test_runs_cover_a_batch_once_in_order(shape: tuple[int, ...], most: int) -> None:
    numbers = np.arange(np.prod(shape), dtype=float).reshape(shape)
    runs = [flat(numbers[at]) for at in pieces(shape, most)]
    assert all(run.size <= most for run in runs)
    assert np.array_equal(np.concatenate([np.empty(0), *runs]), numbers.ravel())
    out = np.zeros(shape)
    for at in pieces(shape, most):
        out[at].reshape(-1)[:] = flat(numbers[at])
    assert np.array_equal(out, numbers), "a run of a whole array is a view, which a kernel can fill"


def test_one_steering_for_all_stays_one() -> None:
    one = np.arange(6.0)
    assert flat_steering(np.broadcast_to(one, (3, 4, 6))).shape == (1, 6)
    many = np.arange(24.0).reshape(4, 6)
    assert np.array_equal(flat_steering(np.broadcast_to(many, (3, 4, 6))), np.tile(many, (3, 1)))


def test_a_grid_of_places_is_never_laid_out_whole() -> None:
    rover, ground = rb.load_rover("elhami-dashti"), rb.surfaces.plane()
    lines = np.linspace(-1, 1, 300)
    rb.settle(rover, ground, 0.0, 0.0)  # loads the kernels
    tracemalloc.start()
    pose = rb.settle(rover, ground, lines[:, None, None], lines[:, None], np.zeros(2))
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    count = pose.status.size
    assert (pose.status == 0).all()
    assert kept <= 49 * count + 500_000, "z, roll, pitch, three joint angles and the status: 49 bytes a pose"
    assert peak <= 75 * count + 500_000, "and one run of places at a time: at most 24 bytes a pose of it"
