"""Clearance of the body box, compared with brute force over its three lower faces."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from support import oracle
from support.helpers import assert_close

SLACK = 1e-8  # the oracle's bracket, m


def bumps(interpolation: str, spacing: float, seed: int) -> rb.Terrain:
    """Return white noise of one cell's height; the box is several cells long or a part of one."""
    z = spacing * np.random.default_rng(seed).normal(size=(60, 60))
    return rb.Terrain.from_array(z, spacing, (-29.5 * spacing, -29.5 * spacing), interpolation)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("spacing", [0.1, 0.4, 3.0])
def test_clearance_is_the_minimum_over_the_whole_box(interpolation: str, spacing: float) -> None:
    rover, terrain = rb.load_rover("perseverance"), bumps(interpolation, spacing, 4)
    rng = np.random.default_rng(5)
    n = 60
    x, y = rng.uniform(-8 * spacing, 8 * spacing, (2, n))
    yaw = rng.uniform(-np.pi, np.pi, n)
    q = np.zeros((n, 6))
    q[:, 1:3] = rng.uniform(-0.5, 0.5, (n, 2))
    pose = rb.Pose(rover, terrain, x, y, yaw, np.zeros((n, 6)), q, np.zeros(n, dtype=np.uint8))
    faces = oracle.box(rover, x, y, yaw, q)
    brute = oracle.least_gap(oracle.Ground.of(terrain), faces, SLACK).gap.reshape(n, 3).min(axis=1)
    assert_close(pose.clearance, brute, 2 * SLACK, "m", "both are the minimum height of the box over the terrain")
