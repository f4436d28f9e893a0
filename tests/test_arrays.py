"""Parts of a batch cover it once, in order; broadcast positions take no memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.arrays import flat, flat_steering, pieces

SHAPES = [(), (1,), (4,), (3, 1, 2), (2, 3, 4), (0, 3), (5, 0)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("most", [1, 2, 3, 7, 100])
def test_parts_cover_a_batch_once_in_order(shape: tuple[int, ...], most: int) -> None:
    numbers = np.arange(np.prod(shape), dtype=float).reshape(shape)
    runs = [flat(numbers[at]) for at in pieces(shape, most)]
    assert all(run.size <= most for run in runs)
    assert np.array_equal(np.concatenate([np.empty(0), *runs]), numbers.ravel())
    out = np.zeros(shape)
    for at in pieces(shape, most):
        out[at].reshape(-1)[:] = flat(numbers[at])
    assert np.array_equal(out, numbers), "a part of an array is a view that a kernel can fill"


def test_shared_steering_stays_one_row() -> None:
    one = np.arange(6.0)
    assert flat_steering(np.broadcast_to(one, (3, 4, 6))).shape == (1, 6)
    many = np.arange(24.0).reshape(4, 6)
    assert np.array_equal(flat_steering(np.broadcast_to(many, (3, 4, 6))), np.tile(many, (3, 1)))


def test_a_broadcast_grid_is_never_copied_whole() -> None:
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
    assert peak <= 75 * count + 500_000, "one part of the positions at a time: at most 24 bytes a pose"
