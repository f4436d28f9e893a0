"""Rotations and Euler angles against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rockerbogie as rb
from rockerbogie.rover.rotations import euler_angles, quaternion_angles, rotation_x, rotation_y, rotation_z, wrap_angle
from support.helpers import assert_close

RNG = np.random.default_rng(11)
YAW, ROLL = RNG.uniform(-np.pi, np.pi, (2, 4, 25))
PITCH = RNG.uniform(-1.5, 1.5, (4, 25))
SCIPY = Rotation.from_euler("ZYX", np.stack([YAW, PITCH, ROLL], axis=-1).reshape(-1, 3))


def test_body_transform_equals_scipy() -> None:
    T = rb.body_transform(1.0, 2.0, 3.0, ROLL, PITCH, YAW)
    assert_close(T[..., :3, :3], SCIPY.as_matrix().reshape(4, 25, 3, 3), 1e-14, "", "intrinsic ZYX is Rz Ry Rx")
    assert_close(T[..., 3], [1, 2, 3, 1], 0, "m", "the position is copied")


@pytest.mark.parametrize(("rotation", "axis"), [(rotation_x, "x"), (rotation_y, "y"), (rotation_z, "z")])
def test_axis_rotation_equals_scipy(rotation, axis: str) -> None:
    expected = Rotation.from_euler(axis, YAW.reshape(-1, 1)).as_matrix().reshape(4, 25, 3, 3)
    assert_close(rotation(YAW), expected, 1e-15, "", "the same rotation")


def test_euler_angles_invert_body_transform() -> None:
    found = euler_angles(rb.body_transform(0, 0, 0, ROLL, PITCH, YAW)[..., :3, :3])
    for angle, expected in zip(found, (ROLL, PITCH, YAW), strict=True):
        assert_close(angle, expected, 1e-13, "rad", "one set of angles below 90 deg of pitch")


def test_quaternion_angles_equal_those_of_the_matrix() -> None:
    for (x, y, z, w), yaw, pitch, roll in zip(SCIPY.as_quat(), YAW.ravel(), PITCH.ravel(), ROLL.ravel(), strict=True):
        assert_close(quaternion_angles(w, x, y, z), [roll, pitch, yaw], 1e-13, "rad", "the same rotation")


def test_wrap_angle() -> None:
    turns = RNG.integers(-5, 6, YAW.shape)
    assert_close(wrap_angle(YAW + 2 * np.pi * turns), YAW, 1e-13, "rad", "whole turns are removed")
    assert wrap_angle(np.pi) == -np.pi
    assert wrap_angle(-np.pi) == -np.pi
