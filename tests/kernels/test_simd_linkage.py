"""Linkage of many poses at once, against the scalar kernels and numpy's solver."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie._kernels.model import linkage, wheel
from rockerbogie._kernels.model.tolerances import MAX_STEP_ANGLE
from rockerbogie._kernels.simd import linkage as simd
from rockerbogie._kernels.simd.layout import CONTACT, CUBIC_SIZE, LANES, POSE, WHEEL
from rockerbogie._kernels.solve.newton import solve_linkage
from support.helpers import assert_close, random_rover

pytestmark = pytest.mark.nojit
ROVERS = {
    "curiosity": rb.load_rover("curiosity"),
    "random": random_rover(np.random.default_rng(8)),
    "curved differential": rb.load_rover("sawppy").replace(differential=(0.0, -0.9, 0.1, -0.05)),
}


def row(lanes: np.ndarray, start: int, count: int = 1) -> np.ndarray:
    """Return a view (count, LANES) of rows of the lane array."""
    return lanes[start : start + count * LANES].reshape(count, LANES)


class Block:
    """Lane array with random poses and steering, and the scalar kernels' numbers of them."""

    def __init__(self, rover: rb.Rover, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.lanes, self.q = np.zeros(CUBIC_SIZE), rng.normal(size=(LANES, 6)) * 0.3
        self.yaw = rng.uniform(-9, 9, LANES)
        self.contacts = rng.normal(size=(5, 6, LANES)) * 0.1  # tx, ty, tz, gx, gy
        self.wheels, self.axes, self.pivots = (np.empty((LANES, *shape)) for shape in ((6, wheel.WHEEL_SIZE), (3, 3), (4, 3)))
        self.jacobian = np.empty((LANES, 6, 6))
        row(self.lanes, POSE.yaw)[0], row(self.lanes, POSE.q, 6)[:] = self.yaw, self.q.T
        offsets = np.empty((6, 5))
        for lane in range(LANES):
            linkage.set_hub_offsets(rover.packed, rng.uniform(-1, 1, 6) * rover.steers, offsets)
            for n, start in enumerate((WHEEL.fx, WHEEL.fy, WHEEL.fz, WHEEL.fc, WHEEL.fs)):
                row(self.lanes, start, 6)[:, lane] = offsets[:, n]
            cy, sy, axes, pivots = math.cos(self.yaw[lane]), math.sin(self.yaw[lane]), self.axes[lane], self.pivots[lane]
            assert linkage.forward_kinematics(
                rover.packed, offsets, 0.0, 0.0, cy, sy, self.q[lane], axes, pivots, self.wheels[lane]
            )
            for i in range(6):
                at = self.wheels[lane, i, [wheel.HX, wheel.HY, wheel.HZ]] - [0, 0, self.q[lane, 0]] + self.contacts[:3, i, lane]
                slopes = self.contacts[3:, i, lane]
                linkage.gap_jacobian_row(
                    rover.packed, self.q[lane], cy, sy, axes, pivots, i, *at, *slopes, self.jacobian[lane, i]
                )
        for start, values in zip((CONTACT.tx, CONTACT.ty, CONTACT.tz, CONTACT.gx, CONTACT.gy), self.contacts, strict=True):
            row(self.lanes, start, 6)[:] = values
        simd.set_heading(self.lanes)
        simd.place_body(self.lanes, rover.packed)
        simd.place_wheels(self.lanes, rover.packed)
        simd.gap_jacobian(self.lanes, rover.packed)


@pytest.mark.parametrize("name", ROVERS)
def test_hubs_axles_and_gap_derivatives_are_those_of_the_scalar_kernels(name: str) -> None:
    block = Block(ROVERS[name], 3)
    reason = "the same formulas, rounded in another order"
    assert_close(row(block.lanes, POSE.axes, 9).T.reshape(-1, 3, 3), block.axes, 1e-14, "", reason)
    for start, column in ((WHEEL.ox, wheel.HX), (WHEEL.oy, wheel.HY), (WHEEL.az, wheel.AZ), (WHEEL.vx, wheel.VX)):
        assert_close(row(block.lanes, start, 6).T, block.wheels[:, :, column], 1e-13, "m", reason)
    assert_close(row(block.lanes, WHEEL.oz, 6).T, block.wheels[:, :, wheel.HZ] - block.q[:, :1], 1e-13, "m", reason)
    for start, unknown in (
        (CONTACT.by_roll, linkage.ROLL),
        (CONTACT.by_pitch, linkage.PITCH),
        (CONTACT.by_rocker, linkage.ROCKER),
    ):
        assert_close(row(block.lanes, start, 6).T, block.jacobian[:, :, unknown], 1e-13, "m/rad", reason)
    bogies = row(block.lanes, CONTACT.by_bogie, 6)[2:].T
    for i in range(2, 6):
        assert_close(bogies[:, i - 2], block.jacobian[:, i, linkage.BOGIE_L + i % 2], 1e-13, "m/rad", reason)


@pytest.mark.parametrize("name", ROVERS)
def test_newton_step_is_that_of_the_scalar_kernel_and_of_numpy(name: str) -> None:
    block, rng = Block(ROVERS[name], 4), np.random.default_rng(5)
    gaps = rng.normal(size=(LANES, 6)) * 0.05
    row(block.lanes, CONTACT.gap, 6)[:] = gaps.T
    simd.solve_step(block.lanes)
    steps = row(block.lanes, POSE.step, 6).T
    for lane in range(LANES):
        expected = np.linalg.solve(block.jacobian[lane], -gaps[lane])
        scalar = -gaps[lane]
        assert solve_linkage(block.jacobian[lane].copy(), scalar)
        tolerance = 1e-14 * np.linalg.cond(block.jacobian[lane]) * (1 + np.abs(expected).max())
        assert_close(steps[lane], expected, tolerance, "m, rad", "rounding times the condition number")
        assert_close(scalar, expected, tolerance, "m, rad", "rounding times the condition number")


def test_singular_lane_is_nan_and_leaves_the_others_alone() -> None:
    block = Block(ROVERS["curiosity"], 6)
    row(block.lanes, CONTACT.gap, 6)[:] = 0.01
    simd.solve_step(block.lanes)
    before = row(block.lanes, POSE.step, 6).copy()
    for start in (CONTACT.by_roll, CONTACT.by_pitch, CONTACT.by_rocker, CONTACT.by_bogie):
        row(block.lanes, start, 6)[:, 5] = 0.0
    simd.solve_step(block.lanes)
    after = row(block.lanes, POSE.step, 6)
    assert not np.isfinite(after[:, 5]).all()
    assert np.array_equal(np.delete(after, 5, axis=1), np.delete(before, 5, axis=1))
    singular = np.zeros((6, 6))
    singular[:, 0] = 1.0
    assert not solve_linkage(singular, np.full(6, -0.01))


def test_step_is_scaled_to_the_largest_angle_and_left_out_if_not_finite() -> None:
    block = Block(ROVERS["curiosity"], 7)
    step = np.random.default_rng(8).normal(size=(6, LANES))
    step[:, 0], step[3, 1], step[:, 2] = 0.01, np.nan, 0.0
    row(block.lanes, POSE.step, 6)[:], row(block.lanes, POSE.active)[:] = step, 1.0
    row(block.lanes, POSE.active)[0, 3] = 0.0
    simd.take_step(block.lanes)
    moved = row(block.lanes, POSE.q, 6) - block.q.T
    scale = np.minimum(1.0, MAX_STEP_ANGLE / np.maximum(np.abs(step[1:]).max(axis=0), 1e-300))
    scale[3] = 0.0
    expected = np.where(np.isnan(step).any(axis=0), 0.0, scale * np.nan_to_num(step))
    assert_close(moved, expected, 1e-15, "m, rad", "the same product, added to q")
    worst = row(block.lanes, POSE.worst)[0]
    assert worst[1] == np.inf
    assert np.array_equal(np.delete(worst, 1), np.delete(np.abs(step).max(axis=0), 1))
