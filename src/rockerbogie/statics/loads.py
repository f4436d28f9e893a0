"""Contact forces, required friction and axle torques of settled poses (docs/forces.md)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.jit.parallel import parallel_for
from .._kernels.statics import loads as kernel
from .._kernels.statics.lane_friction import GAP
from ..arrays import Array, flat, floats
from ..errors import RockerbogieError
from ..gravity import check_gravity
from ..settling.pose import Pose
from .contacts import PackedContacts, pack_contacts

#: Gravity less the acceleration below which a rover counts as weightless, m/s².
WEIGHTLESS = 1e-6

Law = Literal["least_friction", "equal_torque", "equal_slip", "frictionless_sides", "vertical"]
LAWS: tuple[str, ...] = get_args(Law)


class LoadStatus(IntEnum):
    """Outcome of a balance, one code a pose (uint8)."""

    BALANCED = kernel.BALANCED
    NO_POSE = kernel.NO_POSE  # the pose is NaN, or no wheel is on the ground
    NOT_HELD = kernel.NOT_HELD  # no friction coefficient holds the rover: it tips over
    PULLS = kernel.PULLS  # under this law a wheel would have to pull at the terrain
    UNDETERMINED = kernel.UNDETERMINED  # this law does not determine the forces: wheels off the ground, joints at limits, belly
    NOT_CONVERGED = kernel.NOT_CONVERGED


@dataclass(frozen=True, eq=False)
class WheelLoads:
    """Contact forces that balance settled poses; NaN where `status` is not BALANCED.

    Attributes:
        normal, traction, side: (..., 6) N in the contact frame: along the contact normal, along the wheel's heading, to its left.
        torque: (..., 6) motor torque at the axle, forward positive, N m.
        required_friction: (...) the largest friction coefficient in use; inf where none holds the rover.
        friction_bound: (...) coefficient proved too small, for law "least_friction"; NaN under other laws.
        belly: (...) normal force under the body, N.
        joint_torque: (..., 3) torque of the limits of rocker, left and right bogie, N m.
        status: (...) `LoadStatus`.
        law: the law that selected the forces.
    """

    normal: Array
    traction: Array
    side: Array
    torque: Array
    required_friction: Array
    friction_bound: Array
    belly: Array
    joint_torque: Array
    status: NDArray[np.uint8]
    law: str

    @property
    def friction_used(self) -> Array:
        """(..., 6) ratio of tangential to normal force; NaN for a wheel without load."""
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.hypot(self.traction, self.side) / self.normal
        return np.where(self.normal > 0.0, ratio, np.nan)

    def __repr__(self) -> str:
        held = int((self.status == LoadStatus.BALANCED).sum())
        return f"WheelLoads(law={self.law!r}, {held} of {self.status.size} poses balanced)"


def wheel_loads(
    pose: Pose,
    *,
    gravity: float | None = None,
    drawbar: ArrayLike = 0.0,
    acceleration: ArrayLike | None = None,
    law: Law = "least_friction",
) -> WheelLoads:
    """Compute the contact forces that balance the whole mechanism.

    The balance has nine equations: six of the whole rover, one of the rockers and the differential, one of each bogie.

    The forces are not determined by the balance alone; `law` selects them. "least_friction": those that need the smallest
    friction coefficient, a bound for every controller, with a proof (`friction_bound`). "equal_torque": all axles carry
    the same torque. "equal_slip": tangential forces in one proportion to the normal force. "frictionless_sides": no side
    forces, least tractions. "vertical": every contact force is parallel to gravity.

    Args:
        pose: settled poses (...), of either mode. Wheels off the ground carry no load; joints at their limits and, in
            equilibrium mode, the belly take part.
        gravity: m/s², from 0.001 to 100 (`GRAVITY`). Default: that of the pose.
        drawbar: (...) force that pulls the body backward along its x axis at its reference point, N.
        acceleration: (..., 3) of the rover as a whole, world axes, m/s². Default: none.
        law: one of `LAWS`.

    Returns:
        WheelLoads with the pose's batch axes.

    Raises:
        RockerbogieError: an unknown law, gravity not from 0.001 to 100, a rover without mass, an acceleration that cancels
            gravity, or shapes that do not broadcast.
    """
    return solve_loads(pose, gravity, drawbar, acceleration, law)


def solve_loads(
    pose: Pose,
    gravity: float | None = None,
    drawbar: ArrayLike = 0.0,
    acceleration: ArrayLike | None = None,
    law: Law = "least_friction",
    gap: float = GAP,
    packed: PackedContacts | None = None,
) -> WheelLoads:
    """Compute contact forces as `wheel_loads`, the least friction to a given accuracy.

    Args:
        pose, gravity, drawbar, acceleration, law: as for `wheel_loads`.
        gap: power of all forces, of the weight, at which the search for the least friction ends. The coefficient's error
            is about this, and certified to 100 times as much.
        packed: contacts of the poses. Default: those of `pack_contacts`.

    Returns:
        WheelLoads with the pose's batch axes.

    Raises:
        RockerbogieError: as `wheel_loads`.
    """
    packed = packed or pack_contacts(pose)
    if law not in LAWS:
        raise RockerbogieError(f"law {law!r} is not known; give one of {', '.join(LAWS)}")
    pull = _spread("drawbar", drawbar, pose.shape)
    field = np.zeros((1, 3))
    if acceleration is not None:
        field = -_spread("acceleration", acceleration, pose.shape, 3)
    field = field + [0.0, 0.0, -check_gravity(pose.gravity if gravity is None else gravity)]
    if (np.abs(field).max(axis=-1) < WEIGHTLESS).any():
        raise RockerbogieError("acceleration cancels gravity: a rover in free fall has no weight, and no wheel loads")
    n = pose.status.size
    force, torque, limit = np.empty((n, 6, 3)), np.empty((n, 6)), np.empty((n, 3))
    required, bound, belly, status = np.empty(n), np.empty(n), np.empty(n), np.empty(n, dtype=np.uint8)
    parallel_for(
        kernel.loads_batch, n, *packed, field, pull, LAWS.index(law), gap,
        force, torque, required, bound, limit, belly, status,
    )  # fmt: skip
    shape = pose.shape
    parts = force.reshape(*shape, 6, 3)
    return WheelLoads(
        normal=parts[..., 0],
        traction=parts[..., 1],
        side=parts[..., 2],
        torque=torque.reshape(*shape, 6),
        required_friction=required.reshape(shape),
        friction_bound=bound.reshape(shape),
        belly=belly.reshape(shape),
        joint_torque=limit.reshape(*shape, 3),
        status=status.reshape(shape),
        law=law,
    )


def _spread(name: str, value: ArrayLike, shape: tuple[int, ...], *last: int) -> Array:
    """Return a value (..., *last) as (n, *last), or (1, *last) if all poses share it."""
    try:
        array = floats(value)
    except (TypeError, ValueError, OverflowError):
        raise RockerbogieError(f"{name} must be numbers, not {value!r:.60}") from None
    if not np.isfinite(array).all():
        raise RockerbogieError(f"{name} holds {int((~np.isfinite(array)).sum())} values that are not finite")
    if array.shape[array.ndim - len(last) :] != last:
        raise RockerbogieError(f"{name} has shape {array.shape}; its last axis must be {last[0]}")
    if array.shape == last:
        return flat(array, *last)
    try:
        return flat(np.broadcast_to(array, (*shape, *last)), *last)  # writable: kernels are compiled for that alone
    except ValueError:
        raise RockerbogieError(f"{name} of shape {array.shape} does not broadcast to poses of shape {shape}") from None
