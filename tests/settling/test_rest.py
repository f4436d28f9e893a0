"""Equilibria against MuJoCo's; `tools/compare_equilibria.py` compares more of them."""

import numpy as np
import pytest

from support.rest_cases import compare, field, load, solids, stiff


@pytest.mark.parametrize(("name", "size"), [("rocky7", 6.0), ("perseverance", 16.0)])
def test_on_planes_boxes_and_ellipsoids(name: str, size: float) -> None:
    found = compare(load(name), solids(size, 1), 25, seed=5)
    rms = np.degrees(np.sqrt((found.angles**2).mean(axis=0)))
    assert rms.max() <= 0.02
    assert np.sqrt((found.z**2).mean()) <= 0.2e-3
    assert found.share_of_equilibria >= 0.96, found.unlike


@pytest.mark.parametrize("name", ["elhami-dashti", "rocky7", "perseverance"])
def test_on_a_field_of_rocks(name: str) -> None:
    rover = load(name)
    found = compare(rover, field(12 * rover.wheelbase, 1), 25, seed=5)
    rms = np.degrees(np.sqrt((found.angles**2).mean(axis=0)))
    assert rms.max() <= 0.05
    assert np.sqrt((found.z**2).mean()) <= 1e-3
    assert found.share >= 0.96, found.unlike


def test_with_joints_at_limits_and_wheels_off_the_ground() -> None:
    rover = stiff(load("perseverance"))
    found = compare(rover, field(16.0, 2), 25, seed=5)
    assert found.lifted >= 5  # the terrain lifts wheels
    assert found.stopped >= 5
    assert np.degrees(np.sqrt((found.angles**2).mean(axis=0))).max() <= 0.05
    assert found.share_of_equilibria >= 0.96, found.unlike
