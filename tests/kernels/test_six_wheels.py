"""Six-wheel equilibrium: its formulas, and positions where the descent ends elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.model import linkage
from rockerbogie._kernels.model.ground import META_Z
from rockerbogie._kernels.solve import six_wheels
from rockerbogie._kernels.solve.six_wheels import box_is_clear, gap_over_plane, wheel_shares
from rockerbogie.settling.engines import use_engine
from rockerbogie.settling.pose import Pose
from support.helpers import assert_close, random_rover

RNG = np.random.default_rng


def test_gap_over_a_plane_is_that_of_the_lowest_tread_point() -> None:
    rng = RNG(1)
    phi, s = np.meshgrid(np.linspace(0, 2 * np.pi, 4001), [-1.0, 1.0])
    for _ in range(20):
        radius, half = rng.uniform(0.05, 0.5), rng.uniform(0, 0.3)
        axle = np.array([rng.uniform(-0.3, 0.3), 1.0, rng.uniform(-0.3, 0.3)])
        axle /= np.linalg.norm(axle)
        along = np.cross(axle, [0, 0, 1.0])
        along /= np.linalg.norm(along)
        up = np.cross(along, axle)
        wheel, plane = np.zeros(six_wheels.W_SIZE), np.zeros(six_wheels.W_SIZE)
        wheel[:6] = [*rng.normal(size=3), *axle]
        plane[six_wheels.W_PX : six_wheels.W_GAP] = [*rng.normal(size=3), *rng.uniform(-0.7, 0.7, 2)]
        rim = radius * (np.sin(phi)[..., None] * along - np.cos(phi)[..., None] * up) + half * s[..., None] * axle
        point = wheel[:3] + rim - plane[6:9]
        gaps = point[..., 2] - plane[9] * point[..., 0] - plane[10] * point[..., 1]
        assert_close(gap_over_plane(wheel, plane, radius, half), gaps.min(), 2e-6 * radius, "m", "sampled rims")


def test_shares_balance_the_weight() -> None:
    rng = RNG(2)
    for _ in range(50):
        rows, slope, share = rng.normal(size=(6, 6)), rng.normal(size=6), np.empty(6)
        least = wheel_shares(rows, slope, share)
        assert_close(share @ rows, slope, 1e-9, "–", "six equations of balance")
        assert least == share.min()
    rows[:] = 0.0
    assert not wheel_shares(rows, slope, share) > 0.0


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_a_clear_box_is_above_the_terrain(interpolation: str) -> None:
    """Compare with the exact clearance: no box in the terrain is clear, and some others are."""
    rng, clear, low = RNG(3), 0, 0
    for k in range(40):
        rover = random_rover(rng)
        size = rover.wheelbase
        terrain = rb.surfaces.rocks(0.2, k, size=6 * size, spacing=0.1 * size, smallest=0.2 * size, interpolation=interpolation)
        q = np.array([rng.uniform(0, 0.8) * size, *rng.uniform(-0.3, 0.3, 2), 0, 0, 0])
        axes = np.empty((3, 3))
        linkage.body_axes(q[1], q[2], 1.0, 0.0, axes)
        meta = terrain.packed.meta
        clearance = float(Pose(rover, terrain, *np.zeros((3, 1)), np.zeros((1, 6)), q[None], np.zeros(1, np.uint8)).clearance[0])
        found = box_is_clear(terrain.packed, rover.packed, axes, -terrain.bounds[0], -terrain.bounds[1], q[0] - meta[META_Z])
        assert not found or clearance > 0.0
        clear, low = clear + found, low + (clearance <= 0.0)
    assert clear >= 10
    assert low >= 5


#: Positions where the pose of contact mode is in balance too, but the descent ends with a wheel off the ground.
ELSEWHERE = ((-4.568, 13.434, -2.987), (6.218, 15.354, -2.274), (-8.565, -8.657, 2.382), (-5.368, 3.612, 2.446))


def test_the_descent_decides_between_two_equilibria() -> None:
    rover, terrain = rb.load_rover("curiosity"), rb.surfaces.rocks(0.1, 1, size=40.0, spacing=0.1, smallest=0.2)
    x, y, yaw = np.transpose(ELSEWHERE)
    contact = rb.settle(rover, terrain, x, y, yaw)
    assert (contact.status == rb.Status.CONVERGED).all()
    found = rb.settle(rover, terrain, x, y, yaw, mode="equilibrium")
    with use_engine("scalar"):
        descent = rb.settle(rover, terrain, x, y, yaw, mode="equilibrium")
    assert (found.status == rb.Status.WHEEL_LIFTED).all()
    assert np.array_equal(found.q, descent.q)


def test_planes_need_no_descent() -> None:
    """Compare both modes on planes of up to 20 deg: the poses are equal."""
    rng = RNG(5)
    for name in ("curiosity", "osr", "elhami-dashti"):
        rover = rb.load_rover(name)
        terrain = rb.surfaces.plane(rng.uniform(0, np.radians(20)), size=12 * rover.wheelbase, spacing=0.2 * rover.wheelbase)
        yaw = rng.uniform(-3, 3, 40)
        pose = rb.settle(rover, terrain, 0.0, 0.0, yaw, mode="equilibrium")
        contact = rb.settle(rover, terrain, 0.0, 0.0, yaw)
        assert (pose.status == rb.Status.CONVERGED).all()
        assert_close(pose.q, contact.q, 1e-9, "m, rad", "one pose by two modes")
        assert_close(pose.support.sum(axis=-1), rover.mass * rb.GRAVITY["earth"], 1e-6, "N", "supports hold the weight")
