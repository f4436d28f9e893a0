"""Planes over the terrain decide most clearances, and never change a map."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.maps.belly import UpperPlanes, clearance_at


@pytest.fixture(scope="module", params=["linear", "cubic"])
def terrain(request: pytest.FixtureRequest) -> rb.Terrain:
    """Return slopes and rocks, with missing data, far from the origin."""
    at = 0.1 * np.arange(50) - 2.5
    z = rb.surfaces.mars(seed=4, k=0.1).height(at, at[:, None]) + 1000.0
    z[10:13, 20:24] = np.nan
    return rb.Terrain.from_array(z, (0.1, 0.1), (700.03, -300.0), interpolation=request.param)


@pytest.mark.parametrize("name", ["osr", "elhami-dashti"])
@pytest.mark.parametrize("limit", [0.0, 0.06])
def test_a_clearance_that_planes_decide_is_above_its_limit(terrain: rb.Terrain, name: str, limit: float) -> None:
    rover = rb.load_rover(name)
    x, y = terrain.origin[0] + np.arange(0.5, 4.5, 0.17), terrain.origin[1] + np.arange(0.4, 4.6, 0.23)
    yaw = np.array([0.3, 2.0, -2.6])
    planes = UpperPlanes.of(rover, terrain, x, y, 16)
    assert planes is not None
    pose = rb.settle(rover, terrain, x, y[:, None], yaw[:, None, None])
    every = (slice(None), slice(None))
    clear = planes.clear(pose, yaw, every, limit)
    assert (pose.clearance[clear] > limit).all()
    if (limit, name) == (0.0, "osr"):
        assert np.mean(clear[pose.clearance > limit]) > 0.5, "fewer than half of the poses are left to search"
    np.testing.assert_array_equal(clearance_at(pose, ~clear), pose.clearance[~clear])


def test_a_body_over_many_nodes_is_searched(terrain: rb.Terrain) -> None:
    x, y = terrain.origin[0] + np.array([2.0]), terrain.origin[1] + np.array([2.0])
    assert UpperPlanes.of(rb.load_rover("curiosity"), terrain, x, y, 1) is None


@pytest.mark.parametrize("limits", ["curiosity", rb.Limits(clearance=0.06)])
def test_maps_are_those_of_computed_clearances(terrain: rb.Terrain, limits: Any) -> None:
    rover, layers = rb.load_rover("osr"), ("passable", "best_heading", "worst_tilt")
    found = rb.traversability(rover, terrain, 8, 0.2, limits, layers=layers)
    whole = rb.traversability(rover, terrain, 8, 0.2, limits, layers=(*layers, "worst_clearance", "worst_exceeded"))
    assert (whole["worst_clearance"] < (0.06 if limits != "curiosity" else 0.0)).any()
    for name in layers:
        assert found[name].values.tobytes() == whole[name].values.tobytes(), name
