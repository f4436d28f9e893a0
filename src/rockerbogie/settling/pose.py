"""A settled pose, or a million of them: what was solved for, and what follows from it when asked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels import batch
from .._kernels.jit.decorators import parallel_for
from .._kernels.solve import equilibrium
from ..arrays import flat, flat_steering
from ..errors import RockerbogieError
from ..rotations import body_transform
from ..rover.model import Rover
from ..terrain.heightfield import Terrain

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

#: A tread point within this of the ground touches it, m.
TOUCHING = 1e-6
#: A joint within this of its stop lies on it, rad.
STOPPED = 1e-9
GRAVITY = 9.80665  # m/s²


class Contacts(NamedTuple):
    """How the wheels touch: gap, angle (..., 6), point, normal (..., 6, 3), patches (..., 6)."""

    gap: Array
    angle: Array
    point: Array
    normal: Array
    patches: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the rover came to stand; every field has the batch axes (...) in front. Failed poses are nan, status says why.

    Contacts are worked out when first asked for, not carried along.
    """

    rover: Rover
    terrain: Terrain
    x: Array  # (...) m
    y: Array  # (...) m
    yaw: Array  # (...) rad
    steering: Array  # (..., 6) rad
    q: Array  # (..., 6) z, roll, pitch, rocker, bogie left, bogie right
    status: NDArray[np.uint8]  # (...) rockerbogie.Status
    report: Array | None = None  # (..., R_SIZE) what a pose at rest tells of its forces and flags

    @property
    def shape(self) -> tuple[int, ...]:
        """The batch axes."""
        return self.status.shape

    @property
    def z(self) -> Array:
        """(...) height of the body's reference point, m."""
        return self.q[..., 0]

    @property
    def roll(self) -> Array:
        """(...) rad."""
        return self.q[..., 1]

    @property
    def pitch(self) -> Array:
        """(...) nose down positive, rad."""
        return self.q[..., 2]

    @property
    def rocker(self) -> Array:
        """(...) left rocker angle, nose down positive, rad; the right one is `rover.right_rocker(rocker)`."""
        return self.q[..., 3]

    @property
    def bogie(self) -> Array:
        """(..., 2) left, right bogie angle to its rocker, rad."""
        return self.q[..., 4:]

    @property
    def tilt(self) -> Array:
        """(...) angle between the body's z and the vertical, rad."""
        return np.asarray(np.arccos(np.clip(np.cos(self.roll) * np.cos(self.pitch), -1, 1)))

    @property
    def T_world_body(self) -> Array:
        """(..., 4, 4) body to world (eq. 10)."""
        return body_transform(self.x, self.y, self.z, self.roll, self.pitch, self.yaw)

    @cached_property
    def contacts(self) -> Contacts:
        """How every wheel touches, over its whole tread."""
        n = self.status.size
        gap, angle, point, normal = (np.empty((n, 6, *tail)) for tail in ((), (), (3,), (3,)))
        count = np.empty((n, 6), dtype=np.int64)
        parallel_for(
            batch.touch_batch,
            n,
            self.terrain.packed, self.rover.packed, *self._flat_places(), flat_steering(self.steering),
            np.ascontiguousarray(self.q.reshape(n, 6)), TOUCHING, gap, angle, point, normal, count,
        )  # fmt: skip
        return Contacts(*(a.reshape(*self.shape, *a.shape[1:]) for a in (gap, angle, point, normal, count)))  # type: ignore[arg-type]

    @property
    def gap(self) -> Array:
        """(..., 6) least height of each tread over the ground, m."""
        return self.contacts.gap

    @property
    def contact_angle(self) -> Array:
        """(..., 6) δ of eq. 5: where on its rim each wheel touches, ahead of the axle negative, rad."""
        return self.contacts.angle

    @property
    def contact_point(self) -> Array:
        """(..., 6, 3) in the world, m. Where a whole width touches, its middle."""
        return self.contacts.point

    @property
    def contact_normal(self) -> Array:
        """(..., 6, 3) unit normal at the contact, from the ground into the wheel: on an edge or a peak, the tread's own."""
        return self.contacts.normal

    @property
    def contact_count(self) -> NDArray[np.int64]:
        """(..., 6) how many separate places of each tread touch (two when it bridges a gap between rocks)."""
        return self.contacts.patches

    @property
    def support(self) -> Array:
        """(..., 6) frictionless support force of each wheel at rest, N (Earth's gravity: scale by g/9.80665 elsewhere)."""
        return np.asarray(self._report(equilibrium.R_FORCE, 6) * self.rover.mass * GRAVITY)

    @property
    def belly_support(self) -> Array:
        """(...) support force under the body at rest, N."""
        return self._report(equilibrium.R_BELLY, 1)[..., 0] * self.rover.mass * GRAVITY

    @property
    def wheel_lifted(self) -> NDArray[np.bool_]:
        """(..., 6) whether the wheel hangs in the air. In contact mode none does."""
        if self.report is None:
            return np.zeros((*self.shape, 6), dtype=bool)
        return np.asarray(self._report(equilibrium.R_LIFTED, 6) == 1.0)

    @property
    def joint_stop(self) -> NDArray[np.int8]:
        """(..., 3) rocker, bogie left, bogie right: -1 or +1 on (contact mode: beyond) its low or high stop, else 0."""
        low = np.array([self.rover.rocker_limits[0], *[self.rover.bogie_limits[0]] * 2]) + STOPPED
        high = np.array([self.rover.rocker_limits[1], *[self.rover.bogie_limits[1]] * 2]) - STOPPED
        return ((self.q[..., 3:] >= high).astype(np.int8) - (self.q[..., 3:] <= low)).astype(np.int8)

    def _report(self, start: int, size: int) -> Array:
        if self.report is None:
            raise RockerbogieError("forces belong to a pose at rest: settle with mode='equilibrium'")
        return self.report[..., start : start + size]

    @cached_property
    def clearance(self) -> Array:
        """(...) least height of the body's box over the ground, m; nan past the map's rim."""
        n = self.status.size
        out = np.empty(n)
        parallel_for(
            batch.clearance_batch,
            n,
            self.terrain.packed,
            self.rover.packed,
            *self._flat_places(),
            np.ascontiguousarray(self.q.reshape(n, 6)),
            out,
        )
        return out.reshape(self.shape)

    def _flat_places(self) -> tuple[Array, Array, Array]:
        return flat(self.x), flat(self.y), flat(self.yaw)

    def to_xarray(self) -> xr.Dataset:
        """A Dataset with the batch axes as dims `pose` (one axis) or `pose_0`, `pose_1`, …, units and long names in attrs."""
        from .dataset import pose_dataset

        return pose_dataset(self)
