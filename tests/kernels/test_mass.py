"""Centre of mass of a packed rover, against the sum over its links and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.model import linkage
from rockerbogie._kernels.model.mass import centre_of_mass
from rockerbogie._kernels.model.wheel import WHEEL_SIZE
from support import oracle
from support.helpers import assert_close, random_rover

pytestmark = pytest.mark.nojit
ROVERS = {
    "perseverance": rb.load_rover("perseverance"),
    "random": random_rover(np.random.default_rng(8)),
    "curved differential": rb.load_rover("sawppy").replace(differential=(0.0, -0.9, 0.1, -0.05)),
}


def height_and_slope(rover: rb.Rover, q: np.ndarray, yaw: float, steering: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the height of the centre of mass over the body, m, and its derivatives (6,)."""
    hub_offsets, axes, pivots, wheels = np.empty((6, 5)), np.empty((3, 3)), np.empty((4, 3)), np.empty((6, WHEEL_SIZE))
    slope, cy, sy = np.empty(6), math.cos(yaw), math.sin(yaw)
    linkage.set_hub_offsets(rover.packed, steering, hub_offsets)
    assert linkage.forward_kinematics(rover.packed, hub_offsets, 0.0, 0.0, cy, sy, q, axes, pivots, wheels)
    return float(centre_of_mass(rover.packed, hub_offsets, q, cy, sy, axes, pivots, slope)), slope


@pytest.mark.parametrize("name", ROVERS)
def test_height_is_the_mean_of_the_links(name: str) -> None:
    rover, rng = ROVERS[name], np.random.default_rng(1)
    for _ in range(20):
        q, yaw = rng.normal(size=6) * 0.3, rng.uniform(-3, 3)
        steering = rng.uniform(-1, 1, 6) * rover.steers
        height, _ = height_and_slope(rover, q, yaw, steering)
        expected = oracle.mass_height(rover, oracle.link_poses(rover, 0.0, 0.0, yaw, q, steering))[0] - q[0]
        assert_close(height, expected, 1e-12, "m", "the same sum over nine links, by rotation matrices")


@pytest.mark.parametrize("name", ROVERS)
def test_slope_is_the_derivative_of_the_height(name: str) -> None:
    rover, rng, step = ROVERS[name], np.random.default_rng(2), 1e-5
    for _ in range(10):
        q, yaw = rng.normal(size=6) * 0.3, rng.uniform(-3, 3)
        steering = rng.uniform(-1, 1, 6) * rover.steers
        _, slope = height_and_slope(rover, q, yaw, steering)
        ends = [[height_and_slope(rover, q + s * step * e, yaw, steering)[0] for s in (1, -1)] for e in np.eye(6)[1:]]
        differences = [(high - low) / (2 * step) for high, low in ends]
        assert slope[0] == pytest.approx(1.0, abs=1e-14)
        assert_close(slope[1:], differences, 1e-8, "m/rad", "central differences: 1e-10 of truncation, 1e-11 of rounding")
