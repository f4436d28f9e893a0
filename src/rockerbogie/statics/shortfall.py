"""Least turn of gravity after which forces hold a rover that tips over as it stands."""

from __future__ import annotations

import math

import numpy as np

from .._kernels.statics.balance import EQUATIONS
from .._kernels.statics.mechanism import assemble, gravity_column, new_mechanism
from ..arrays import Array
from .contacts import PackedContacts

#: Forces of each friction cone at the start, evenly spaced on its surface.
FIRST = 8
#: Most steps, and change of the angle at which the search ends, rad.
STEPS, PRECISION = 30, 1e-10
#: Weight of the moments' balance against the direction of gravity: moments are balanced to about its inverse squared.
EXACT = 1e4


def shortfall(packed: PackedContacts, k: int, friction: float) -> float:
    """Compute the angle from gravity to the nearest direction in which forces hold a pose.

    The directions that forces within the friction cones can hold are a convex cone (docs/stability.md), and the nearest
    one is the projection onto it. The projection is a problem of non-negative least squares in forces on the surfaces of
    the friction cones. After each solution, the force of each cone that improves it most is added.

    Args:
        packed: contacts of the poses.
        k: index of the pose.
        friction: friction coefficient.

    Returns:
        The angle, rad: 0 if gravity itself is held, π/2 if no direction within a right angle is; NaN without a pose.
    """
    from scipy.optimize import nnls

    m = new_mechanism()
    at = k if packed.belly_point.shape[0] > 1 else 0
    steering = packed.steering[k if packed.steering.shape[0] > 1 else 0]
    span, ends = packed.span[k if packed.span.shape[0] > 1 else 0], []
    for end in (-1.0, 1.0) if span.any() else (0.0,):  # both ends of contact lines
        count, more, reach = assemble(
            m, packed.rover, packed.yaw[k], steering, packed.q[k], packed.point[k] + end * span, packed.normal[k],
            packed.stops[k],
            packed.belly_point[at], packed.belly_normal[at],
        )  # fmt: skip
        if count == 0:
            return math.nan
        ends.append(m.columns[:count].copy())
        ends[-1][..., 3:] *= reach
    columns = np.concatenate(ends)
    columns[..., 3:] /= reach
    weight = np.empty((3, EQUATIONS))  # generalized force of a unit weight along x, y, z
    for axis, (gx, gy, gz) in enumerate(np.eye(3)):
        weight[axis] /= gravity_column(m, packed.rover, reach, gx, gy, gz, weight[axis])

    def rows(force: Array) -> Array:
        """Return the weight that each force (n, 9) balances, and the weighted moments left, (n, 9)."""
        held = -force[:, :3]
        return np.concatenate([held, EXACT * (force[:, 3:] + held @ weight[:, 3:])], axis=1)

    cones = np.array([rows(column) for column in columns])
    cones[:, 1:] *= friction
    turn = 2 * np.pi * np.arange(FIRST) / FIRST
    around = cones[:, 1, None] * np.cos(turn)[:, None] + cones[:, 2, None] * np.sin(turn)[:, None]
    rays = np.concatenate([(cones[:, :1] + around).reshape(-1, EQUATIONS), rows(m.extra[:more])])
    target = np.array([0.0, 0.0, -1.0] + 6 * [0.0])
    angle = math.inf
    for _ in range(STEPS):
        share, _ = nnls(rays.T, target, maxiter=1000)
        held = rays.T @ share
        size = math.sqrt(held[0] ** 2 + held[1] ** 2 + held[2] ** 2)
        before, angle = angle, (math.atan2(math.hypot(held[0], held[1]), -held[2]) if size > PRECISION else 0.5 * math.pi)
        if before - angle < PRECISION:
            break
        gain = cones[:, 1:] @ (target - held)
        steep = np.maximum(np.hypot(gain[:, 0], gain[:, 1]), 1e-300)[:, None]
        rays = np.concatenate([rays, cones[:, 0] + (gain[:, :1] * cones[:, 1] + gain[:, 1:] * cones[:, 2]) / steep])
    return angle
