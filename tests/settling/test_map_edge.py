"""Poses on bilinear terrain near the edge of the map: both engines agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.batch import contact_mode
from rockerbogie._kernels.model.linkage import reach
from rockerbogie.settling import engines
from rockerbogie.settling.engines import use_engine
from support import oracle
from support.helpers import assert_close

NAMES = ("elhami-dashti", "curiosity", "sawppy")
COUNT = 600


def ground(kind: str, unit: float, missing: bool) -> rb.Terrain:
    """Return bilinear terrain for a wheel radius of `unit`, m."""
    rng = np.random.default_rng(2)
    if kind == "rocks":
        terrain = rb.surfaces.rocks(0.1, 5, smallest=unit, largest=4 * unit, size=60 * unit, spacing=0.5 * unit)
        z, cell = terrain.z.copy(), (0.5 * unit, 0.5 * unit)
    elif kind == "stretched":
        z, cell = rng.normal(size=(80, 50)) * 0.15 * unit, (1.5 * unit, 0.6 * unit)
    else:
        z, cell = np.zeros((41, 41)), (unit, unit)
    if missing:
        z[rng.uniform(size=z.shape) < 0.002] = np.nan
        z[:2, 20:30] = np.nan  # at the edge too
    return rb.Terrain.from_array(z, cell, interpolation="linear")


def near_the_edge(terrain: rb.Terrain, rover: rb.Rover, count: int) -> tuple[np.ndarray, ...]:
    """Return x, y (m) and yaw (rad), each (count,), near the four edges.

    Of a third, treads may end at the edge.
    """
    rng = np.random.default_rng(4)
    x0, y0, x1, y1 = terrain.bounds
    far = reach(rover.packed)
    inward, along = rng.uniform(-0.3 * far, far, count), rng.uniform(0, 1, count)
    yaw = rng.uniform(-np.pi, np.pi, count)
    aligned = np.arange(count) < count // 3
    yaw[aligned] = rng.integers(0, 4, aligned.sum()) * np.pi / 2
    ends = (
        rover.hubs[:, :1] + rover.wheel_radius[:, None] * [1, -1],
        rover.hubs[:, 1:2] + rover.wheel_width[:, None] * [0.5, -0.5],
    )
    inward[aligned] = rng.choice(np.abs(np.concatenate(ends).ravel()), aligned.sum())
    side = rng.integers(0, 4, count)
    x = np.select([side == 0, side == 1], [x0 + inward, x1 - inward], x0 + along * (x1 - x0))
    y = np.select([side == 2, side == 3], [y0 + inward, y1 - inward], y0 + along * (y1 - y0))
    return x, y, yaw


def count_left(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that receives the numbers of poses that are left to the scalar engine."""
    left: list[int] = []
    alone = engines.parallel_for

    def counted(kernel: Callable[..., None], count: int, *arguments: Any, **options: Any) -> None:
        if kernel is contact_mode.settle_left:
            left.append(count)
        alone(kernel, count, *arguments, **options)

    monkeypatch.setattr(engines, "parallel_for", counted)
    return left


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("kind", ["rocks", "stretched", "level"])
@pytest.mark.parametrize("name", NAMES)
def test_statuses_and_poses_near_the_edge_are_the_scalar_engine_s(name: str, kind: str, missing: bool) -> None:
    """The scalar engine tries several starts before it refuses a pose.

    It ignores terrain beyond the edge.
    """
    rover = rb.load_rover(name)
    terrain = ground(kind, float(rover.wheel_radius[0]), missing)
    places = near_the_edge(terrain, rover, COUNT)
    steering = np.where(rover.steers, np.random.default_rng(6).uniform(-0.5, 0.5, (COUNT, 6)), 0.0)
    steering[::2] = 0.0
    simd = rb.settle(rover, terrain, *places, steering=steering)
    with use_engine("scalar"):
        scalar = rb.settle(rover, terrain, *places, steering=steering)
    assert np.array_equal(simd.status, scalar.status)
    assert_close(simd.q, scalar.q, 1e-9, "m, rad", "the same contacts, solved by two independent kernels")
    share = (simd.status == rb.Status.OFF_MAP).mean()
    assert 0.2 < share < 0.98
    assert ((simd.status == rb.Status.NO_DATA).any(), (simd.status == rb.Status.CONVERGED).any()) == (missing, True)


@pytest.mark.parametrize("name", NAMES)
def test_a_pose_is_refused_if_its_treads_reach_beyond_the_edge(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The map is continued by its outermost heights, as an array; a point of a tread decides."""
    rover = rb.load_rover(name)
    unit = float(rover.wheel_radius[0])
    terrain = ground("rocks", unit, False)
    more = int(2.5 * reach(rover.packed) / terrain.spacing[0])
    origin = [first - more * cell for first, cell in zip(terrain.origin, terrain.spacing, strict=True)]
    continued = rb.Terrain.from_array(np.pad(terrain.z, more, "edge"), terrain.spacing, origin, "linear")
    x, y, yaw = near_the_edge(terrain, rover, COUNT)
    left = count_left(monkeypatch)
    pose = rb.settle(rover, terrain, x, y, yaw)
    assert sum(left) < 0.1 * COUNT
    whole = rb.settle(rover, continued, x, y, yaw)
    known = np.isfinite(whole.z)
    assert known.mean() > 0.99
    wheels = oracle.stand(rover, x[known], y[known], yaw[known], whole.q[known])
    x0, y0, x1, y1 = terrain.bounds
    phi, room = np.linspace(-np.pi, np.pi, 2001), np.full(6 * known.sum(), np.inf)
    for side in (-1.0, 1.0):
        middle = wheels.hub + side * wheels.half[:, None] * wheels.Y
        for axis, (low, high) in enumerate(((x0, x1), (y0, y1))):
            around = np.outer(wheels.X[:, axis], np.sin(phi)) + np.outer(wheels.Z[:, axis], np.cos(phi))
            points = middle[:, axis, None] - wheels.radius[:, None] * around
            room = np.minimum(room, np.minimum(points - low, high - points).min(axis=1))
    room = room.reshape(-1, 6).min(axis=1)
    clear = np.abs(room) > 1e-5 * unit  # tread points are 2π / 2000 rad apart
    refused = (pose.status == rb.Status.OFF_MAP)[known]
    assert np.array_equal(refused[clear], room[clear] < 0.0)
    assert 0.05 < (room[clear] > 0.0).mean() < 0.95
    kept = known & (pose.status == rb.Status.CONVERGED)
    assert_close(pose.q[kept], whole.q[kept], 1e-9, "m, rad", "treads over the same terrain")
