"""Contact mode on bilinear terrain with missing data: poses of the filled map, or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.settling.engines import use_engine
from rockerbogie.terrain.spline import bridge
from support.certified import some, tread_known

STEP = 0.1


def holed(seed: int, side: int, count: int) -> tuple[rb.Terrain, rb.Terrain]:
    """Return rough terrain with square gaps, and the same terrain with these filled."""
    rng = np.random.default_rng(seed)
    z = 0.03 * rng.normal(size=(60, 70)).cumsum(axis=1)
    for row, col in rng.integers(0, 60 - side, (count, 2)):
        z[row : row + side, col : col + side] = np.nan
    filled = bridge(z)
    return tuple(rb.Terrain.from_array(heights, STEP, (3.0, -2.0), "linear") for heights in (z, filled))  # type: ignore[return-value]


@pytest.mark.parametrize("engine", ["simd", "scalar"])
@pytest.mark.parametrize(("side", "count"), [(1, 60), (3, 15), (12, 3)])
def test_poses_are_those_of_the_filled_map_or_refused(engine: str, side: int, count: int) -> None:
    """A pose is refused exactly if a tread lies over missing data."""
    rover, (gappy, filled) = rb.load_rover("osr"), holed(side, side, count)
    rng = np.random.default_rng(7)
    x, y, yaw = rng.uniform(3.5, 9.5, 100), rng.uniform(-1.5, 3.4, 100), rng.uniform(-np.pi, np.pi, 100)
    with use_engine(engine):  # type: ignore[arg-type]
        found, whole = rb.settle(rover, gappy, x, y, yaw), rb.settle(rover, filled, x, y, yaw)
    at = np.flatnonzero(np.isin(whole.status, (rb.Status.CONVERGED, rb.Status.JOINT_STOP)))
    there = replace(some(whole, at), terrain=gappy)
    inside, outside = tread_known(there, -1e-6).all(axis=1), tread_known(there, 1e-6).all(axis=1)
    kept, refused = at[outside], at[~inside]
    assert min(kept.size, refused.size) > 5
    assert (found.status[kept] == whole.status[kept]).all()
    np.testing.assert_allclose(found.q[kept], whole.q[kept], rtol=0.0, atol=1e-8)
    assert (found.status[refused] == rb.Status.NO_DATA).all()
    assert np.isnan(found.q[refused]).all()


def test_terrain_far_inside_a_gap_has_no_data() -> None:
    """A pose more than the bridged distance from data is refused."""
    z = np.zeros((160, 40))
    z[10:] = np.nan
    pose = rb.settle(rb.load_rover("osr"), rb.Terrain.from_array(z, STEP, interpolation="linear"), 2.0, [2.0, 8.0, 12.0], 0.0)
    assert (pose.status == rb.Status.NO_DATA).all()
    assert np.isnan(pose.q).all()
