"""Parts of a batch cover it once, in order; broadcast positions take no memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.arrays import flat, flat_steering, floats, is_number, pieces

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


@pytest.mark.parametrize("wrong", ["3", b"3", True, np.True_, ["1", "2"], [1.0, "2"], np.array([True]), [True, None], 1j, "nan"])
def test_text_and_bools_are_no_numbers(wrong: object) -> None:
    assert not is_number(wrong)
    with pytest.raises(TypeError, match="not a number"):
        floats(wrong)


def test_masked_values_are_nan() -> None:
    hidden = np.ma.array([1.0, 2.0], mask=[False, True])
    assert np.array_equal(floats(hidden), [1.0, np.nan], equal_nan=True)
    rover, terrain = rb.load_rover("osr"), rb.surfaces.fractal(3)
    with pytest.raises(rb.RockerbogieError, match="x is not finite in 1 of 2 poses"):
        rb.settle(rover, terrain, hidden, 0.0)


def test_numbers_in_any_form_become_floats() -> None:
    for given in (3, 3.0, np.float32(3), np.uint8(3), [3], (3.0,), np.array([3], dtype=object)):
        assert floats(given).dtype == float
        assert (floats(given) == 3.0).all()
    same = np.ones(4)
    assert floats(same) is same
    with pytest.raises(OverflowError):
        floats(10**400)
    with pytest.raises(ValueError, match="inhomogeneous"):
        floats([[1.0], [1.0, 2.0]])


ROVER, FLAT = rb.load_rover("sawppy"), rb.surfaces.plane()
CALLS = {
    "x": lambda wrong: rb.settle(ROVER, FLAT, wrong, 0.0),
    "yaw": lambda wrong: rb.settle(ROVER, FLAT, 0.0, 0.0, [wrong, wrong]),
    "settle steering": lambda wrong: rb.settle(ROVER, FLAT, 0.0, 0.0, steering=[wrong] * 6),
    "height": lambda wrong: FLAT.height(wrong, 0.0),
    "spacing": lambda wrong: rb.Terrain.from_array(np.zeros((5, 5)), wrong),
    "size": lambda wrong: rb.surfaces.plane(size=wrong),
    "slope": lambda wrong: rb.surfaces.plane(slope=wrong),
    "step": rb.obstacles.step,
    "profile": lambda wrong: rb.obstacles.profile([0.0, 1.0], [wrong, wrong]),
    "friction": lambda wrong: rb.climb(ROVER, rb.obstacles.step(0.1), friction=wrong),
    "path": lambda wrong: rb.Path.waypoints([[wrong, wrong], [wrong, wrong]]),
    "speed": lambda wrong: rb.drive(ROVER, FLAT, rb.Path.straight((0.0, 0.0), 0.0, 1.0), speed=wrong),
    "wheel frames": lambda wrong: rb.wheel_frames(ROVER, wrong, [0.0, 0.0]),
    "wheel radius": lambda wrong: ROVER.replace(wheel_radius=wrong),
    "limits": lambda wrong: rb.Limits(tilt=wrong),
}


@pytest.mark.parametrize("wrong", ["0.5", True], ids=["text", "bool"])
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_public_functions_refuse_text_and_bools(call, wrong: object) -> None:
    with pytest.raises(rb.RockerbogieError, match=r"0\.5|True"):
        call(wrong)
