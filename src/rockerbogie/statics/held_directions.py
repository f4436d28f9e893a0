"""Angles between gravity and the boundary of the directions in which forces hold a rover."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.statics.balance import EQUATIONS
from .._kernels.statics.mechanism import assemble, gravity_column, new_mechanism
from .._kernels.statics.tipping import STAYS
from ..arrays import Array
from .contacts import PackedContacts

#: Forces of each friction cone at the start, evenly spaced on its surface.
FIRST = 8
#: Most steps of a projection; angle that counts as 0, rad; and largest improvement by a unit force, of what remains, at its end.
STEPS, PRECISION, NORMAL = 60, 1e-10, 1e-6
#: Weight of the moments' balance against the direction of gravity: moments are balanced to about its inverse squared.
EXACT = 1e4
#: Azimuths in which the search for the margin starts, most projections from each, and turns of gravity that are projected, rad.
AZIMUTHS, PROJECTIONS, TURNS = 12, 6, (0.02, 0.2, 0.8, 1.4)
#: Least angle of a projection, rad, that counts as outside the cone.
OUTSIDE = 1e-7


class Margin(NamedTuple):
    """Least turn of gravity at which no forces hold a pose."""

    angle: float  # rad; π/2 if it is not less
    direction: float  # azimuth in which the centre of mass then starts to move, rad
    stays: NDArray[np.bool_]  # (6,) True for wheels that stay in place
    slides: bool  # no contact stays in place


class HeldDirections:
    """Convex cone of the gravity directions that friction holds at a pose (docs/stability.md).

    Attributes:
        empty: True without a contact.
    """

    def __init__(self, packed: PackedContacts, k: int, friction: float) -> None:
        """Compute the forces that span the cone.

        Args:
            packed: contacts of the poses.
            k: index of the pose.
            friction: friction coefficient.
        """
        m = new_mechanism()
        at = k if packed.belly_point.shape[0] > 1 else 0
        steering = packed.steering[k if packed.steering.shape[0] > 1 else 0]
        span, ends = packed.span[k if packed.span.shape[0] > 1 else 0], []
        for end in (-1.0, 1.0) if span.any() else (0.0,):  # both ends of contact lines
            count, more, reach = assemble(
                m, packed.rover, packed.yaw[k], steering, packed.q[k], packed.point[k] + end * span, packed.normal[k],
                packed.stops[k], packed.belly_point[at], packed.belly_normal[at],
            )  # fmt: skip
            self.empty = count == 0
            if self.empty:
                return
            ends.append(m.columns[:count].copy())
            ends[-1][..., 3:] *= reach
        columns = np.concatenate(ends)
        columns[..., 3:] /= reach
        self._friction, self._columns, self._wheel = friction, columns, np.tile(m.who[:count], len(ends))
        self._weight = np.empty((3, EQUATIONS))  # generalized force of a unit weight along x, y, z
        for axis, (gx, gy, gz) in enumerate(np.eye(3)):
            self._weight[axis] /= gravity_column(m, packed.rover, reach, gx, gy, gz, self._weight[axis])
        self._cones = np.array([self._rows(column) for column in columns])
        self._cones[:, 1:] *= friction
        turn = 2 * np.pi * np.arange(FIRST) / FIRST
        around = self._cones[:, 1, None] * np.cos(turn)[:, None] + self._cones[:, 2, None] * np.sin(turn)[:, None]
        plain = (self._cones[:, :1] + around).reshape(-1, EQUATIONS)
        self._rays = np.concatenate([plain, self._rows(m.extra[:more])])

    def _rows(self, force: Array) -> Array:
        """Return the weight that each force (n, 9) balances, and the weighted moments left, (n, 9)."""
        held = -force[:, :3]
        return np.concatenate([held, EXACT * (force[:, 3:] + held @ self._weight[:, 3:])], axis=1)

    def project(self, direction: Array) -> tuple[float, Array]:
        """Project a direction onto the cone.

        The projection is a problem of non-negative least squares in forces on the surfaces of the friction cones. After
        each solution, the force of each cone that improves it most is added.

        Args:
            direction: (3,) unit vector.

        Returns:
            The angle from the direction to its projection, rad, π/2 if no held direction is within a right angle; and what
            remains, (9,): its first three numbers are the direction less its projection.
        """
        from scipy.optimize import nnls

        target, angle = np.concatenate([direction, np.zeros(6)]), 0.5 * math.pi
        for _ in range(STEPS):
            share, _ = nnls(self._rays.T, target, maxiter=1000)
            held = self._rays.T @ share
            size = float(np.linalg.norm(held[:3]))
            aside = float(np.linalg.norm(np.cross(direction, held[:3])))
            angle = math.atan2(aside, float(direction @ held[:3])) if size > PRECISION else 0.5 * math.pi
            left = target - held
            gain = self._cones[:, 1:] @ left
            steep = np.maximum(np.hypot(gain[:, 0], gain[:, 1]), 1e-300)[:, None]
            if (self._cones[:, 0] @ left + steep[:, 0]).max() < NORMAL * np.linalg.norm(left[:3]) or angle < PRECISION:
                break
            most = self._cones[:, 0] + (gain[:, :1] * self._cones[:, 1] + gain[:, 1:] * self._cones[:, 2]) / steep
            self._rays = np.concatenate([self._rays, most])
        return angle, left

    def margin(self) -> Margin:
        """Compute the least turn of gravity that leaves the cone; gravity itself must be in it.

        What remains of a direction outside the cone is normal to a plane that bounds the cone. The nearest of these planes is
        searched: from evenly spaced azimuths, each time towards the plane that was found.

        Returns:
            The margin.
        """
        best = Margin(0.5 * math.pi, math.nan, np.zeros(6, dtype=bool), False)
        for turn in TURNS:
            for start in range(AZIMUTHS):
                azimuth, before = 2.0 * math.pi * start / AZIMUTHS, math.inf
                for _ in range(PROJECTIONS):
                    flat = np.array([math.cos(azimuth), math.sin(azimuth)])
                    aside, left = self.project(np.array([*(math.sin(turn) * flat), -math.cos(turn)]))
                    if aside < OUTSIDE:
                        break
                    angle = math.atan2(left[2], math.hypot(left[0], left[1]))
                    azimuth = math.atan2(left[1], left[0])
                    if angle < best.angle:
                        best = Margin(max(angle, 0.0), azimuth, *self._motion(left))
                    if not angle < before - PRECISION:
                        break
                    before = angle
            if best.angle < turn:
                break
        return best

    def _motion(self, left: Array) -> tuple[NDArray[np.bool_], bool]:
        """Return the wheels that stay in place in a motion, and True if no contact does.

        Args:
            left: (9,) remains of a projection.
        """
        moments = EXACT * left[3:]
        v = np.concatenate([left[:3] + self._weight[:, 3:] @ moments, -moments])
        still = np.linalg.norm(self._columns @ v, axis=1) < STAYS * np.linalg.norm(left[:3])
        stays = np.zeros(6, dtype=bool)
        np.logical_or.at(stays, self._wheel, still)
        return stays, not still.any()
