"""Poses on terrain: the solved variables, and the quantities derived from them on demand."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._kernels.batch.contacts import clearance_batch, contacts_batch
from .._kernels.jit.parallel import parallel_for
from .._kernels.odometry.frames import contact_planes_batch
from .._kernels.solve.forces import R_LIFTED
from ..arrays import Array, flat, flat_steering
from ..errors import RockerbogieError
from ..gravity import GRAVITY
from ..rover.frames import contact_frames, wheel_frames
from ..rover.model import Rover
from ..rover.rotations import body_transform
from ..terrain.heightfield import Terrain
from .status import MEANING, Status

if TYPE_CHECKING:
    import xarray as xr

#: A tread point within this height of the terrain is in contact, m.
TOUCHING = 1e-6
#: A joint within this angle of its limit is at the limit, rad.
STOPPED = 1e-9
JOINTS = ("rocker", "bogie_left", "bogie_right")


class Contacts(NamedTuple):
    """Contacts of the wheels: gap, angle (..., 6), point, normal (..., 6, 3), patches (..., 6)."""

    gap: Array  # (..., 6) m
    angle: Array  # (..., 6) rad
    point: Array  # (..., 6, 3) world, m
    normal: Array  # (..., 6, 3) unit vectors, world
    patches: NDArray[np.int64]  # (..., 6) number of separate contacts of each tread


def planes_of(rover: Rover, x: Array, y: Array, yaw: Array, q: Array, steering: Array, normal: Array, point: Array) -> Array:
    """Return contact normals in the body frame, and places of the contacts along the axles.

    Args:
        rover: the rover.
        x, y, yaw: (...) m, rad.
        q: (..., 6) z, m, and roll, pitch, rocker, bogies, rad.
        steering: (..., 6) rad.
        normal: (..., 6, 3) contact normals in the world.
        point: (..., 6, 3) contact points in the world, m.

    Returns:
        (..., 6, 4): normal, and distance from the rim's middle, m.
    """
    planes = np.empty((*q.shape[:-1], 6, 4))
    parallel_for(
        contact_planes_batch, planes.size // 24, rover.packed, rover.steers.copy(), flat(x), flat(y), flat(yaw), flat(q, 6),
        flat_steering(steering), flat(normal, 6, 3), flat(point, 6, 3), flat(planes, 6, 4),
    )  # fmt: skip
    return planes


@dataclass(frozen=True, eq=False, repr=False)
class Pose:
    """Poses of a rover on terrain, with batch axes (...) in front of every field.

    A pose that cannot be computed is NaN; `status` gives the reason. Frames, contacts and clearance are computed at first use
    and cached.
    """

    rover: Rover
    terrain: Terrain
    x: Array  # (...) m
    y: Array  # (...) m
    yaw: Array  # (...) rad
    steering: Array  # (..., 6) rad
    q: Array  # (..., 6) z, roll, pitch, rocker, bogie left, bogie right
    status: NDArray[np.uint8]  # (...) rockerbogie.Status
    report: Array | None = None  # (..., R_SIZE) forces and flags; equilibrium mode only
    gravity: float = GRAVITY["earth"]  # m/s², scales forces

    def __repr__(self) -> str:
        where = f"{self.rover.name} on {self.terrain.name or 'terrain'}"
        if self.shape:
            codes, counts = np.unique(self.status, return_counts=True)
            parts = ", ".join(f"{count} {Status(code).name}" for code, count in zip(codes, counts, strict=True))
            return f"<Pose {self.shape} of {where}: {parts or 'empty'}>"
        degrees = ", ".join(f"{name} {np.degrees(getattr(self, name)):.2f}" for name in ("roll", "pitch", "yaw"))
        return (
            f"<Pose of {where}: {Status(int(self.status)).name},"
            f" x {float(self.x):.6g}, y {float(self.y):.6g}, z {float(self.z):.6g} m, {degrees} deg>"
        )

    def _repr_html_(self) -> str:
        """Return the table that a notebook shows."""
        title = f"<b>Pose</b> {self.shape or ''} of {escape(self.rover.name)} on {escape(self.terrain.name or 'terrain')}"
        if self.shape:
            codes, counts = np.unique(self.status, return_counts=True)
            rows = [(Status(code).name, f"{count}", MEANING[Status(code)][0]) for code, count in zip(codes, counts, strict=True)]
        else:
            status = Status(int(self.status))
            rows = [("status", status.name, MEANING[status][0])]
            rows += [(name, f"{float(getattr(self, name)):.6g}", "m") for name in ("x", "y", "z")]
            angles = {name: float(getattr(self, name)) for name in ("roll", "pitch", "yaw", "rocker")}
            angles |= dict(zip(JOINTS[1:], map(float, self.bogie), strict=True))
            rows += [(name.replace("_", " "), f"{np.degrees(angle):.3f}", "deg") for name, angle in angles.items()]
        cells = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        return f"<div>{title}<table>{cells}</table></div>"

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape."""
        return self.status.shape

    @property
    def z(self) -> Array:
        """(...) height of the body's reference point, m."""
        return self.q[..., 0]

    @property
    def roll(self) -> Array:
        """(...) roll of the body, left side up positive, rad."""
        return self.q[..., 1]

    @property
    def pitch(self) -> Array:
        """(...) pitch of the body, nose down positive, rad."""
        return self.q[..., 2]

    @property
    def rocker(self) -> Array:
        """(...) left rocker angle, nose down positive, rad.

        The right one is `rover.right_rocker(rocker)`.
        """
        return self.q[..., 3]

    @property
    def bogie(self) -> Array:
        """(..., 2) angle of the left and right bogie to its rocker, rad."""
        return self.q[..., 4:]

    @property
    def tilt(self) -> Array:
        """(...) angle between the body's z axis and the vertical, rad."""
        return np.asarray(np.arccos(np.clip(np.cos(self.roll) * np.cos(self.pitch), -1, 1)))

    @property
    def T_world_body(self) -> Array:
        """(..., 4, 4) transform from body to world (eq. 10)."""
        return body_transform(self.x, self.y, self.z, self.roll, self.pitch, self.yaw)

    @cached_property
    def axle_frames(self) -> Array:
        """(..., 6, 4, 4) T_body_axle of each wheel (eqs 2-4), read-only."""
        frames = wheel_frames(self.rover, self.rocker, self.bogie, self.steering)
        frames.setflags(write=False)
        return frames

    @cached_property
    def contact_planes(self) -> Array:
        """(..., 6, 4) contact normals in the body frame, and places along the axles, m; read-only."""
        at, found = (self.x, self.y, self.yaw, self.q, self.steering), self.contacts
        planes = planes_of(self.rover, *at, found.normal, found.point)
        planes.setflags(write=False)
        return planes

    @cached_property
    def contact_frames(self) -> Array:
        """(..., 6, 4, 4) T_body_contact of each wheel (eq. 5), on the rim's middle plane; read-only."""
        frames = contact_frames(self.rover, self.axle_frames, self.contact_angle)
        frames.setflags(write=False)
        return frames

    @cached_property
    def contacts(self) -> Contacts:
        """Contacts of all wheels, over the whole tread."""
        n = self.status.size
        gap, angle, point, normal = (np.empty((n, 6, *tail)) for tail in ((), (), (3,), (3,)))
        count = np.empty((n, 6), dtype=np.int64)
        parallel_for(
            contacts_batch,
            n,
            self.terrain.packed, self.rover.packed, *self._flat_position(), flat_steering(self.steering),
            np.ascontiguousarray(self.q.reshape(n, 6)), TOUCHING, gap, angle, point, normal, count,
        )  # fmt: skip
        return Contacts(*(a.reshape(*self.shape, *a.shape[1:]) for a in (gap, angle, point, normal, count)))  # type: ignore[arg-type]

    @property
    def gap(self) -> Array:
        """(..., 6) least height of each tread above the terrain, m."""
        return self.contacts.gap

    @property
    def contact_angle(self) -> Array:
        """(..., 6) δ of eq. 5, the angle of the contact on the rim: negative ahead of the axle, rad.

        For a wheel off the ground it is the angle of the tread point with the least gap.
        """
        return self.contacts.angle

    @property
    def contact_point(self) -> Array:
        """(..., 6, 3) contact point in the world, m.

        If the contact spans the tread's width, this is its middle. For a wheel off the ground, see `contact_angle`.
        """
        return self.contacts.point

    @property
    def contact_normal(self) -> Array:
        """(..., 6, 3) unit normal at the contact, from the terrain into the wheel.

        At an edge or a peak of the terrain it is the tread's normal.
        """
        return self.contacts.normal

    @property
    def contact_count(self) -> NDArray[np.int64]:
        """(..., 6) number of separate contacts of each tread: 2 between two rocks, 0 off the ground."""
        return self.contacts.patches

    @property
    def support(self) -> Array:
        """(..., 6) vertical part of each wheel's frictionless force, N; equilibrium mode only.

        The parts of wheels and body add up to the weight. If the contact spans the tread's width, the force acts at its middle.
        """
        return np.asarray(self._frictionless[0] * self.rover.mass * self.gravity)

    @property
    def belly_support(self) -> Array:
        """(...) vertical part of the body's frictionless contact force, N; equilibrium mode only."""
        return np.asarray(self._frictionless[1] * self.rover.mass * self.gravity)

    @cached_property
    def _frictionless(self) -> tuple[Array, Array]:
        """Frictionless contact forces of the wheels (..., 6) and the body (...), of the weight."""
        from .line_support import frictionless_forces

        self._report(0, 1)
        return frictionless_forces(self)

    @property
    def wheel_lifted(self) -> NDArray[np.bool_]:
        """(..., 6) True if the wheel is off the ground. False everywhere in contact mode."""
        if self.report is None:
            return np.zeros((*self.shape, 6), dtype=bool)
        return np.asarray(self._report(R_LIFTED, 6) == 1.0)

    @property
    def joint_stop(self) -> NDArray[np.int8]:
        """(..., 3) rocker, bogie left, bogie right: -1 or +1 at the low or high limit, else 0.

        In contact mode a joint may be beyond its limit.
        """
        low = np.array([self.rover.rocker_limits[0], *[self.rover.bogie_limits[0]] * 2]) + STOPPED
        high = np.array([self.rover.rocker_limits[1], *[self.rover.bogie_limits[1]] * 2]) - STOPPED
        return ((self.q[..., 3:] >= high).astype(np.int8) - (self.q[..., 3:] <= low)).astype(np.int8)

    def _report(self, start: int, size: int) -> Array:
        """Return columns (..., size) of the report, or raise if there is none."""
        if self.report is None:
            raise RockerbogieError("contact forces exist in equilibrium only: settle with mode='equilibrium'")
        return self.report[..., start : start + size]

    @cached_property
    def clearance(self) -> Array:
        """(...) least height of the body's box above the terrain, m.

        NaN if the box reaches over the edge of the map.
        """
        n = self.status.size
        out = np.empty(n)
        parallel_for(
            clearance_batch,
            n,
            self.terrain.packed,
            self.rover.packed,
            *self._flat_position(),
            np.ascontiguousarray(self.q.reshape(n, 6)),
            out,
        )
        return out.reshape(self.shape)

    def _flat_position(self) -> tuple[Array, Array, Array]:
        """Return x, y and yaw (n,) as the kernels take them."""
        return flat(self.x), flat(self.y), flat(self.yaw)

    def to_xarray(self) -> xr.Dataset:
        """Return a Dataset with units and long names in the attributes of its variables.

        Returns:
            Dataset; the batch axes are the dims `pose` (one axis) or `pose_0`, `pose_1`, … In equilibrium mode it also holds
            `support`, `belly_support`, `wheel_lifted` and `joint_stop`.
        """
        from .dataset import pose_dataset

        return pose_dataset(self)
