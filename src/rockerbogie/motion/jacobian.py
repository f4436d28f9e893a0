"""Wheel Jacobians and contact rows: the paper's eqs 6-9, derived in docs/jacobians.md."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._kernels.jit.parallel import parallel_for
from .._kernels.model import jacobians as kernel
from .._kernels.odometry import layout as at
from ..arrays import Array, flat, flat_steering, floats, spanned
from ..errors import RockerbogieError
from ..rover.frames import contact_frames, joint_angles, wheel_frames
from ..rover.model import Rover
from ..settling.pose import Pose

#: Columns of eq. 9's Jacobian, each a rate: rad/s, and m/s for the roll and side slip.
JACOBIAN_COLUMNS = (
    "rocker",
    "bogie_left",
    "bogie_right",
    "steering",
    "wheel",
    "roll_slip",
    "side_slip",
    "turn_slip",
    "contact_angle",
)
#: Columns of the whole rover's system: the suspension's rates, then each other rate wheel by wheel.
SYSTEM_COLUMNS = JACOBIAN_COLUMNS[:3] + tuple(f"{name}_{i}" for name in JACOBIAN_COLUMNS[3:] for i in range(6))

#: Rows of `contact_rows` for each wheel: slip of the tread along and across its rolling direction and the rate at which it
#: leaves the terrain, m/s; turn slip and pitch rate about the axle of the link that carries the wheel, rad/s.
ROW_NAMES = ("roll_slip", "side_slip", "lift", "turn_slip", "pitch")
#: Columns of `contact_rows`: the body's twist, and the rates of the suspension and of the wheel's steering.
ROW_COLUMNS = ("vx", "vy", "vz", "wx", "wy", "wz", "rocker", "bogie_left", "bogie_right", "steering")

#: Readings of an interval without any.
NO_READINGS = np.full(at.R_SIZE, np.nan)
NO_READINGS[at.R_STEERING_RATE : at.R_STEERING_RATE + 6] = 0.0


class ContactState(Protocol):
    """Joint and contact angles of a rover, such as a `rockerbogie.Pose`."""

    @property
    def rocker(self) -> Array:
        """(...) left rocker angle, rad."""

    @property
    def bogie(self) -> Array:
        """(..., 2) bogie angles, left and right, rad."""

    @property
    def contact_angle(self) -> Array:
        """(..., 6) δ, rad."""


#: Old name of `ContactState`.
Stance = ContactState


@dataclass(frozen=True, eq=False)
class SimpleStance:
    """Joint and contact angles of a rover on unknown terrain."""

    rocker: Array  # (...) rad
    bogie: Array  # (..., 2) rad
    contact_angle: Array  # (..., 6) rad
    steering: Array  # (..., 6) rad
    roll: Array | float = 0.0  # (...) rad
    pitch: Array | float = 0.0  # (...) rad
    normal: Array | None = None  # (..., 6, 3) terrain normals in the body frame; None: normals of the rims


def check_rover(rover: Rover, pose: ContactState) -> None:
    """Check that a pose belongs to the rover given.

    A pose without `rover` passes. A copy of the rover with equal parameters passes. A Dataset is compared by name.

    Args:
        rover: the rover given.
        pose: any contact state.

    Raises:
        RockerbogieError: the pose belongs to another rover.
    """
    owner = getattr(pose, "rover", None)
    if owner is None or owner is rover or (isinstance(owner, str) and owner == rover.name):
        return
    if isinstance(owner, Rover) and np.array_equal(owner.packed, rover.packed) and np.array_equal(owner.steers, rover.steers):
        return
    name = owner.name if isinstance(owner, Rover) else owner
    other = f"of rover {name!r}, not of {rover.name!r}" if name != rover.name else f"of another rover named {name!r}"
    raise RockerbogieError(f"the pose is {other}: give the rover it was settled with (pose.rover), or settle again")


def stance_angles(rover: Rover, pose: ContactState, steering: ArrayLike | None) -> tuple[Array, Array, Array, Array]:
    """Return the joint and contact angles of a pose, broadcast together.

    Args:
        rover: the pose's rover.
        pose: rocker (...), bogie (..., 2), contact_angle (..., 6), rad.
        steering: (..., 6) rad; None: the pose's own, or 0 if it has none.

    Returns:
        Rocker (...), bogie (..., 2), steering and contact angles (..., 6), rad.

    Raises:
        RockerbogieError: a pose of another rover, a shape that does not fit, or steering on a wheel that does not steer.
    """
    check_rover(rover, pose)
    if steering is None:
        steering = getattr(pose, "steering", None)
    q, b, s = joint_angles(rover, pose.rocker, pose.bogie, steering)
    delta = np.asarray(pose.contact_angle, dtype=float)
    if delta.shape[-1:] != (6,):
        raise RockerbogieError(f"contact_angle has shape {delta.shape}; its last axis must be 6, one angle a wheel")
    shape = np.broadcast(q, delta[..., 0]).shape
    return spanned(q, shape), spanned(b, (*shape, 2)), spanned(s, (*shape, 6)), spanned(delta, (*shape, 6))


def wheel_jacobians(
    rover: Rover,
    pose: ContactState,
    steering: ArrayLike | None = None,
    *,
    out: Array | None = None,
    frames: Array | None = None,
) -> Array:
    """Return J of eq. 9 for each wheel i: body twist = J[i] · rates.

    Rows are the twist (vx, vy, vz, ωx, ωy, ωz) of the body relative to the terrain, in the body frame, m/s and rad/s.
    Columns are `JACOBIAN_COLUMNS`. `wheel` is eq. 6's θ̇: the rate at which the wheel rolls over the terrain, forward positive;
    a motor at rate ω relative to its link rolls ω minus the rate of the contact angle. A wheel that does not steer has zeros
    under `steering`. Through the differential, `rocker` (rate of the left one) moves the right wheels by its derivative.

    The Jacobians of a pose take 2.6 kB. In a loop over batches, allocating them takes longer than computing them: give `out`,
    and use batches of some 1,000 poses, which stay in the processor's cache.

    Args:
        rover: the pose's rover.
        pose: rocker (...), bogie (..., 2), contact_angle (..., 6), rad: a `Pose`, or any object that has them.
        steering: (..., 6) rad; default: the pose's own.
        out: (..., 6, 6, 9) contiguous array to fill and return instead of a new one.
        frames: (..., 6, 4, 4) contiguous array, also filled if given: T_body_axle as from `wheel_frames`, at little cost.

    Returns:
        (..., 6, 6, 9).

    Raises:
        RockerbogieError: a pose of another rover, a shape that does not fit, or steering on a wheel that does not steer.
    """
    q, b, s, delta = stance_angles(rover, pose, steering)
    J = np.empty((*q.shape, 6, 6, 9)) if out is None else _given("out", out, (*q.shape, 6, 6, 9))
    T = np.empty((0, 6, 4, 4)) if frames is None else _given("frames", frames, (*q.shape, 6, 4, 4))
    angles = (flat(q), flat(b, 2), flat_steering(s), flat(delta, 6))
    steers = rover.steers.copy()  # writable, as the compiled kernels take it
    parallel_for(kernel.wheel_jacobians_batch, q.size, rover.packed, steers, *angles, flat(J, 6, 6, 9), flat(T, 6, 4, 4))
    return J


def _given(name: str, array: Array, shape: tuple[int, ...]) -> Array:
    """Return the caller's array if it can be filled, or raise."""
    if not isinstance(array, np.ndarray) or array.shape != shape or array.dtype != float or not array.flags.carray:
        found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else f"{array!r:.60}"
        raise RockerbogieError(f"{name} is {found}; give a contiguous, writable array: numpy.empty({shape})")
    return array


def system_jacobian(rover: Rover, pose: ContactState, steering: ArrayLike | None = None) -> Array:
    """Return the six Jacobians of eq. 9 stacked: (I, I, I, I, I, I)ᵀ · twist = S · rates.

    Columns are `SYSTEM_COLUMNS`: the suspension's three rates are shared, each of the other six belongs to one wheel.

    Args:
        rover: the pose's rover.
        pose, steering: as for `wheel_jacobians`.

    Returns:
        S (..., 36, 39).

    Raises:
        RockerbogieError: as `wheel_jacobians`.
    """
    J = wheel_jacobians(rover, pose, steering)
    S = np.zeros((*J.shape[:-3], 36, 39))
    for i in range(6):
        rows = slice(6 * i, 6 * i + 6)
        S[..., rows, :3] = J[..., i, :, :3]
        S[..., rows, 3 + i :: 6] = J[..., i, :, 3:]
    return S


class ContactPlanes(NamedTuple):
    """Joint angles of a pose, and the planes that its wheels stand on, as kernels take them."""

    rocker: Array  # (...) rad
    bogie: Array  # (..., 2) rad
    steering: Array  # (..., 6) rad
    contact_angle: Array  # (..., 6) rad
    planes: (
        Array | None
    )  # (..., 6, 4) terrain normal in the body and place of the contact along the axle, m; None: upright wheels

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape."""
        return self.rocker.shape

    def readings(self, shape: tuple[int, ...], steering: Array) -> Array:
        """Return readings of an interval with these joints and other steering angles.

        Args:
            shape: batch shape to broadcast to.
            steering: (..., 6) rad.

        Returns:
            (*shape, R_SIZE), with steering rates 0 and the others NaN.
        """
        found = np.empty((*shape, at.R_SIZE))
        found[...] = NO_READINGS
        found[..., at.R_ROCKER] = self.rocker
        found[..., at.R_BOGIE : at.R_BOGIE + 2] = self.bogie
        found[..., at.R_STEERING : at.R_STEERING + 6] = steering
        return found

    def flat(self, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Return steering angles, contact angles and planes as flat arrays.

        Args:
            shape: batch shape to broadcast to.

        Returns:
            Steering and contact angles (n, 6), rad, and planes (n, 6, 4), or (0, 6, 4) for upright wheels.
        """
        planes = np.empty((0, 6, 4)) if self.planes is None else flat(spanned(self.planes, (*shape, 6, 4)), 6, 4)
        return flat(spanned(self.steering, (*shape, 6)), 6), flat(spanned(self.contact_angle, (*shape, 6)), 6), planes


def contact_planes(rover: Rover, pose: ContactState) -> ContactPlanes:
    """Return the planes that the wheels of a pose stand on.

    Args:
        rover: the pose's rover.
        pose: as for `contact_rows`.

    Returns:
        The planes: those of the terrain for a settled `Pose` or a stance with normals.

    Raises:
        RockerbogieError: as `wheel_jacobians`.
    """
    if isinstance(pose, Pose):  # its angles are checked and broadcast already
        check_rover(rover, pose)
        return ContactPlanes(pose.rocker, pose.bogie, pose.steering, pose.contact_angle, pose.contact_planes)
    q, b, turn, delta = stance_angles(rover, pose, None)
    planes = None
    if isinstance(pose, SimpleStance) and pose.normal is not None:
        planes = np.zeros((*np.shape(pose.normal)[:-1], 4))
        planes[..., :3] = pose.normal
    return ContactPlanes(q, b, turn, delta, planes)


def contact_rows(rover: Rover, pose: ContactState, steering: ArrayLike | None = None) -> Array:
    """Return each wheel's contact velocity as rows of a rigid wheel whose motor holds still.

    Rows are `ROW_NAMES`, columns `ROW_COLUMNS`. A motor at rate ω subtracts rω from the roll slip; the other rows do not change.
    In contrast to the literal eq. 9, these rows are valid on curved terrain and for inclined wheels (docs/jacobians.md).

    Args:
        rover: the pose's rover.
        pose: as for `wheel_jacobians`. For a settled `Pose`, `lift` is the velocity of the contact point along the terrain
            normal. For other poses it is that of the rim's middle along the normal of the rim. Slip is always that of the
            rim's middle: a wide tread in contact over its whole width slips on average as its middle does.
        steering: (..., 6) rad. If it is not the pose's own, the wheel is turned on its own contact plane.

    Returns:
        (..., 6, 5, 10); NaN for poses that are NaN.

    Raises:
        RockerbogieError: as `wheel_jacobians`.
    """
    stood = contact_planes(rover, pose)
    q, b, turn, delta, planes = stood.rocker, stood.bogie, stood.steering, stood.contact_angle, stood.planes
    if isinstance(pose, Pose):
        axle, contact = pose.axle_frames, pose.contact_frames
    else:
        axle = wheel_frames(rover, q, b, turn)
        contact = contact_frames(rover, axle, delta)
    normal = contact[..., :3, 2] if planes is None else planes[..., :3]
    aside = np.zeros((*q.shape, 6, 1)) if planes is None else planes[..., 3:]
    if steering is not None:
        q, b, turn, _ = stance_angles(rover, pose, steering)
        axle = wheel_frames(rover, q, b, turn)
        delta = np.arctan2((normal * axle[..., :3, 0]).sum(axis=-1), (normal * axle[..., :3, 2]).sum(axis=-1))
        contact = contact_frames(rover, axle, delta)
    x, y = contact[..., :3, 0], axle[..., :3, 1]
    middle = contact[..., :3, 3]
    side = np.cross(normal, x)
    side = side / np.linalg.norm(side, axis=-1, keepdims=True)
    rows = np.zeros((*delta.shape, 5, 10))
    for row, (point, along) in enumerate(((middle, x), (middle, side), (middle + aside * y, normal))):
        rows[..., row, :3] = along
        rows[..., row, 3:6] = np.cross(point, along)
    rows[..., 3, 3:6] = contact[..., :3, 2]
    rows[..., 4, 3:6] = y
    J = wheel_jacobians(rover, SimpleStance(q, b, delta, turn))
    rows[..., 6:] = -rows[..., :6] @ J[..., :4]
    return rows


def reading(name: str, value: ArrayLike, *last: int) -> Array:
    """Return a reading or an argument as an array whose last axes are `last`.

    NaN marks a missing reading.

    Args:
        name: the argument's name, for messages.
        value: the reading.
        last: lengths of the last axes.

    Returns:
        (..., *last) floats.

    Raises:
        RockerbogieError: no numbers, another shape, or infinite values.
    """
    try:
        array = floats(value)
    except (TypeError, ValueError, OverflowError):
        raise RockerbogieError(f"{name} must be numbers, not {value!r:.60}") from None
    if array.shape[array.ndim - len(last) :] != last:
        wanted = f"its last axis must be {last[0]}" if len(last) == 1 else f"its last axes must be {last}"
        raise RockerbogieError(f"{name} has shape {array.shape}; {wanted}")
    if np.isinf(array).any() if array.size > 8 else math.inf in map(abs, array.ravel().tolist()):
        raise RockerbogieError(f"{name} holds {int(np.isinf(array).sum())} infinite values; mark a missing reading with nan")
    return array


def batch_shape(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the batch shape that all arguments broadcast to.

    Args:
        shapes: batch shape of each argument, by its name.

    Returns:
        The common shape.

    Raises:
        RockerbogieError: they do not broadcast together.
    """
    if not any(shapes.values()):
        return ()
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise RockerbogieError(f"batch axes do not broadcast together: {listed}") from None


def solve_each(A: Array, b: Array) -> Array:
    """Solve A x = b for each matrix of a batch; a singular or NaN matrix gives NaN.

    Args:
        A: (..., n, n).
        b: (..., n).

    Returns:
        x (..., n).
    """
    out = np.full(np.broadcast_shapes(A.shape[:-1], b.shape), np.nan)
    A, b = np.broadcast_to(A, (*out.shape, A.shape[-1])), np.broadcast_to(b, out.shape)
    with np.errstate(invalid="ignore"):
        regular = np.isfinite(A).all(axis=(-2, -1)) & (np.linalg.det(np.nan_to_num(A)) != 0)
    out[regular] = np.linalg.solve(A[regular], b[regular][..., None])[..., 0]
    return out


def ground_rates(rows: Array, twist: ArrayLike, steering_rates: ArrayLike = 0.0) -> Array:
    """Return the rocker and bogie rates that best keep six wheels on the terrain.

    Best means least squares of the six lift rates at the given twist.

    Args:
        rows: (..., 6, 5, 10) from `contact_rows`.
        twist: (..., 6) of the body in its own frame, m/s and rad/s.
        steering_rates: (..., 6) rad/s.

    Returns:
        (..., 3) rad/s: rocker, bogie left, bogie right; NaN for poses that are NaN.
    """
    given = np.asarray(twist, dtype=float)
    lift = rows[..., 2, :]
    missing = np.einsum("...ij,...j->...i", lift[..., :6], given) + lift[..., 9] * np.asarray(steering_rates, dtype=float)
    A = lift[..., 6:9]
    At = np.swapaxes(A, -1, -2)
    return solve_each(At @ A, -(At @ missing[..., None])[..., 0])
