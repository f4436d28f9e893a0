"""How wheels and joints move the body: the paper's eqs 6-9, derived in docs/jacobians.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.jit.decorators import parallel_for
from .._kernels.model import jacobians as kernel
from ..arrays import flat, flat_steering, spanned
from ..errors import RockerbogieError
from ..rover.frames import contact_frames, joint_angles, wheel_frames
from ..rover.model import Rover

Array = NDArray[np.float64]

#: Columns of eq. 9's Jacobian, each a rate: rad/s, and m/s for the two slips along the ground.
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

#: What `contact_rows` tells of each wheel: slip of the tread along and across its way, m/s; how fast it leaves the ground,
#: m/s; the turn slip and how fast the link that carries the wheel pitches about the axle, rad/s.
ROW_NAMES = ("roll_slip", "side_slip", "lift", "turn_slip", "pitch")
#: And of what: the body's twist, and the rates of the suspension and of the wheel's steering.
ROW_COLUMNS = ("vx", "vy", "vz", "wx", "wy", "wz", "rocker", "bogie_left", "bogie_right", "steering")


class ContactState(Protocol):
    """What motion needs to know of a pose. `rockerbogie.Pose` is one."""

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
    """Angles of a rover whose ground is not known: rocker (...), bogie (..., 2), contact and steering (..., 6), rad."""

    rocker: Array
    bogie: Array
    contact_angle: Array
    steering: Array
    roll: Array | float = 0.0
    pitch: Array | float = 0.0
    normal: Array | None = None  # (..., 6, 3) of the ground in the body frame, where it is thought to be other than the rim's


def stance_angles(rover: Rover, pose: ContactState, steering: ArrayLike | None) -> tuple[Array, Array, Array, Array]:
    """Rocker (...), bogie (..., 2), steering and contact angles (..., 6), broadcast together, rad.

    Steering that is not given is the pose's own, or straight ahead where it has none.
    """
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
    """J (..., 6, 6, 9) of eq. 9: body twist = J[i] · rates, for each wheel i.

    Rows are the twist (vx, vy, vz, ωx, ωy, ωz) of the body against the ground, in the body frame, m/s and rad/s.
    Columns are `JACOBIAN_COLUMNS`. `wheel` is eq. 6's θ̇: how fast the wheel rolls off its rim, forward positive; a motor
    that turns at ω to its link rolls ω − contact_angle's rate. A wheel that does not steer has zeros under `steering`;
    through the differential, `rocker` (the left one's rate) moves the right wheels by its derivative.

    A pose's Jacobians are 2.6 kB: in a loop over batches, fresh memory for them costs more than working them out. Give
    `out`, and take batches of some thousand poses, which stay near the processor.

    Args:
        pose: rocker (...), bogie (..., 2), contact_angle (..., 6), rad: a `Pose`, or anything that has them.
        steering: (..., 6) rad; default the pose's own.
        out: (..., 6, 6, 9) contiguous, to fill and return instead of a new array; what was in it is no matter.
        frames: (..., 6, 4, 4) contiguous, filled too if given: T_body_axle as `wheel_frames` has it, for next to nothing.

    Raises:
        RockerbogieError: a shape that does not fit, or steering on a wheel that does not steer.
    """
    q, b, s, delta = stance_angles(rover, pose, steering)
    J = np.empty((*q.shape, 6, 6, 9)) if out is None else _given("out", out, (*q.shape, 6, 6, 9))
    T = np.empty((0, 6, 4, 4)) if frames is None else _given("frames", frames, (*q.shape, 6, 4, 4))
    angles = (flat(q), flat(b, 2), flat_steering(s), flat(delta, 6))
    parallel_for(kernel.wheel_jacobians_batch, q.size, rover.packed, rover.steers, *angles, flat(J, 6, 6, 9), flat(T, 6, 4, 4))
    return J


def _given(name: str, array: Array, shape: tuple[int, ...]) -> Array:
    """The caller's own array, if it can be filled."""
    if not isinstance(array, np.ndarray) or array.shape != shape or array.dtype != float or not array.flags.carray:
        found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else f"{array!r:.60}"
        raise RockerbogieError(f"{name} is {found}; give a contiguous, writable array: numpy.empty({shape})")
    return array


def system_jacobian(rover: Rover, pose: ContactState, steering: ArrayLike | None = None) -> Array:
    """S (..., 36, 39): the six of eq. 9 stacked, (I, I, I, I, I, I)ᵀ · twist = S · rates.

    Columns are `SYSTEM_COLUMNS`; the suspension's three rates are shared, the other six belong to one wheel each.
    """
    J = wheel_jacobians(rover, pose, steering)
    S = np.zeros((*J.shape[:-3], 36, 39))
    for i in range(6):
        rows = slice(6 * i, 6 * i + 6)
        S[..., rows, :3] = J[..., i, :, :3]
        S[..., rows, 3 + i :: 6] = J[..., i, :, 3:]
    return S


def contact_rows(rover: Rover, pose: ContactState, steering: ArrayLike | None = None) -> Array:
    """Rows (..., 6, 5, 10) of each wheel's contact as a point of a rigid wheel whose motor holds still.

    Rows are `ROW_NAMES`, columns `ROW_COLUMNS`. A motor at rate ω takes rω from the roll slip; the rest stands. Unlike
    eq. 9 to the letter, these hold on curved ground and while wheels lean (docs/jacobians.md).

    Args:
        pose: as for `wheel_jacobians`. If it knows the ground (a settled `Pose`), lift is off its contact points along
            their normals; else off the rim's middle, along the wheel's plane. Slip is that of the rim's middle always: a
            broad tread that lies flush touches everywhere, and slips on the whole as its middle does.
        steering: (..., 6) rad. Where it is not the pose's own, the wheel is turned on the plane it stands on.
    """
    q, b, turn, delta = stance_angles(rover, pose, None)
    axle = wheel_frames(rover, q, b, turn)
    contact = contact_frames(rover, axle, delta)
    normal, aside = contact[..., :3, 2], np.zeros((*q.shape, 6, 1))
    if isinstance(pose, SimpleStance):
        normal = normal if pose.normal is None else pose.normal
    elif hasattr(pose, "contact_normal"):
        R, p = pose.T_world_body[..., None, :3, :3], pose.T_world_body[..., None, :3, 3]  # type: ignore[attr-defined]
        normal = np.einsum("...ji,...j->...i", R, pose.contact_normal)
        point = np.einsum("...ji,...j->...i", R, pose.contact_point - p)  # type: ignore[attr-defined]
        aside = ((point - axle[..., :3, 3]) * axle[..., :3, 1]).sum(axis=-1, keepdims=True)
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
    """What a sensor or a caller says, as an array whose last axes are `last`; nan is no reading.

    Raises:
        RockerbogieError: no numbers, another shape, or infinite values.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise RockerbogieError(f"{name} must be numbers, not {value!r:.60}") from None
    if array.shape[array.ndim - len(last) :] != last:
        wanted = f"its last axis must be {last[0]}" if len(last) == 1 else f"its last axes must be {last}"
        raise RockerbogieError(f"{name} has shape {array.shape}; {wanted}")
    if np.isinf(array).any():
        raise RockerbogieError(f"{name} holds {int(np.isinf(array).sum())} infinite values; mark a missing reading with nan")
    return array


def batch_shape(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """The batch axes that all of these broadcast to.

    Raises:
        RockerbogieError: they do not.
    """
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        told = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise RockerbogieError(f"batch axes do not broadcast together: {told}") from None


def ground_rates(rows: Array, twist: ArrayLike, steering_rates: ArrayLike = 0.0) -> Array:
    """Rates (..., 3) of rocker and bogies that best keep six wheels on the ground while the body moves at twist (..., 6)."""
    given = np.asarray(twist, dtype=float)
    lift = rows[..., 2, :]
    missing = np.einsum("...ij,...j->...i", lift[..., :6], given) + lift[..., 9] * np.asarray(steering_rates, dtype=float)
    A = lift[..., 6:9]
    At = np.swapaxes(A, -1, -2)
    return np.asarray(np.linalg.solve(At @ A, -(At @ missing[..., None]))[..., 0])
