"""Verification of poses: certified brackets of gaps and clearance."""

from __future__ import annotations

from dataclasses import dataclass
from types import EllipsisType

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import parallel_for
from .._kernels.model.ground import META_X, META_Y, META_Z
from .._kernels.verify import gap, patch
from ..arrays import Array, pieces
from ..errors import RockerbogieError, expect
from ..rover.frames import wheel_frames
from ..rover.rotations import body_transform
from .pose import Pose

CHUNK = 1 << 14  # poses verified at once: bounds the memory for their frames
LIMIT = 200_000  # boxes for each tread, and for the body


@dataclass(frozen=True, eq=False)
class Verification:
    """Certified brackets of a pose's gaps and clearance, with its batch axes (...) in front.

    The bounds are valid even where `complete` is False. A bracket is NaN if part of the tread (or of the body's box) lies
    off the map or over missing data, and if the pose is NaN.
    """

    pose: Pose
    gap_low: Array  # (..., 6) lower bound of each gap, m
    gap_high: Array  # (..., 6) upper bound, m
    clearance_low: Array  # (...) lower bound of the clearance, m
    clearance_high: Array  # (...) upper bound, m
    on_map: NDArray[np.bool_]  # (..., 6) True if the whole tread lies over the map
    known: NDArray[np.bool_]  # (..., 6) True if the whole tread lies over cells without missing data
    complete: NDArray[np.bool_]  # (...) True if every bracket is as narrow as `tolerance`
    boxes: NDArray[np.int64]  # (..., 7) boxes bounded for each tread and the body: the work done

    def passes(self, depth: float = 1e-6) -> NDArray[np.bool_]:
        """Return True for poses whose contacts are proved.

        A contact pose passes if all six gaps lie within ±depth. A pose at rest passes if no gap and no clearance is under
        -depth, and if every wheel with a support force, and the body if it has one, is within depth of the ground. A pose
        whose brackets are NaN, or too wide to decide, does not pass.

        Args:
            depth: allowed penetration and allowed gap of a contact, m.

        Returns:
            (...) flags.
        """
        above, touches = self.gap_low >= -depth, self.gap_high <= depth
        if self.pose.report is None:
            return np.asarray((above & touches).all(axis=-1))
        rests = touches | ~(self.pose.support > 0.0)
        belly = (self.clearance_low >= -depth) & ((self.clearance_high <= depth) | ~(self.pose.belly_support > 0.0))
        return np.asarray((above & rests).all(axis=-1) & belly)


def verify(pose: Pose, *, tolerance: float = 1e-8, limit: int = LIMIT) -> Verification:
    """Bracket the gap of every tread and the body's clearance, over the whole of each surface.

    The method is branch and bound with certified bounds (docs/verification.md).

    This shares no code with `settle`, `Pose.gap` and `Pose.clearance`; the terrain is evaluated from its grid again.

    Args:
        pose: (...) any poses, settled or made by hand.
        tolerance: width of the brackets, m, at least 1e-12.
        limit: boxes that may be bounded for each tread and for the body; beyond it, the bracket stays wider.

    Returns:
        Verification with the pose's batch axes.

    Raises:
        RockerbogieError: not a pose; tolerance or limit out of range.
    """
    expect(pose, Pose, "pose", "settle one with rockerbogie.settle")
    if not 1e-12 <= tolerance < np.inf:
        raise RockerbogieError(f"tolerance is {tolerance}; give a finite width of at least 1e-12, in metres")
    if not 100 <= limit <= 10**8:
        raise RockerbogieError(f"limit is {limit}; give a number of boxes from 100 to 1e8")
    shape = pose.shape
    bracket, flags = np.empty((*shape, 7, 2)), np.empty((*shape, 7), dtype=np.uint8)
    boxes = np.empty((*shape, 7), dtype=np.int64)
    for at in pieces(shape, CHUNK):
        patches = _patches(pose, at)
        parallel_for(
            gap.verify_batch,
            len(patches),
            pose.terrain.grid, pose.terrain.meta, patches, float(tolerance), int(limit),
            bracket[at].reshape(-1, 7, 2), flags[at].reshape(-1, 7), boxes[at].reshape(-1, 7),
        )  # fmt: skip
    on_map, known, closed = (flags & bit != 0 for bit in (gap.ON_MAP, gap.KNOWN, gap.CLOSED))
    complete = closed.all(axis=-1) & known[..., :6].all(axis=-1)
    low, high = bracket[..., 0], bracket[..., 1]
    return Verification(
        pose, low[..., :6], high[..., :6], low[..., 6], high[..., 6], on_map[..., :6], known[..., :6], complete, boxes
    )


def _patches(pose: Pose, at: tuple[int | slice | EllipsisType, ...]) -> Array:
    """Return the treads and the body's lower faces (n, 9, PATCH_SIZE).

    Coordinates are in metres from the map's first node.
    """
    rover, meta, shape = pose.rover, pose.terrain.meta, pose.shape
    x, y, yaw = (np.broadcast_to(value, shape)[at].reshape(-1) for value in (pose.x, pose.y, pose.yaw))
    q = pose.q[at].reshape(-1, 6)
    steering = np.broadcast_to(pose.steering, (*shape, 6))[at].reshape(-1, 6)
    body = body_transform(x - meta[META_X], y - meta[META_Y], q[:, 0] - meta[META_Z], q[:, 1], q[:, 2], yaw)
    axle = body[:, None] @ wheel_frames(rover, q[:, 3], q[:, 4:], steering)
    patches = np.zeros((len(q), gap.PATCHES, patch.PATCH_SIZE))
    treads, faces = patches[:, :6], patches[:, 6:]
    treads[..., _at(patch.C)] = axle[..., :3, 3]
    treads[..., _at(patch.A)] = axle[..., :3, 1]
    treads[..., _at(patch.U)] = axle[..., :3, 0] * rover.wheel_radius[:, None]
    treads[..., _at(patch.V)] = axle[..., :3, 2] * rover.wheel_radius[:, None]
    treads[..., patch.HALF_A] = np.pi
    treads[..., patch.HALF_B] = rover.wheel_width / 2
    treads[..., patch.ROUND] = 1.0
    # Over each point of the box's lower faces there are only more points of the box.
    low, high = rover.body_box
    half, turn = (high - low) / 2, body[:, :3, :3]
    middle = body[:, :3, 3] + turn @ ((low + high) / 2)
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        side = np.where(turn[:, 2, axis] > 0.0, -half[axis], half[axis])
        faces[:, axis, _at(patch.C)] = middle + side[:, None] * turn[:, :, axis]
        faces[:, axis, _at(patch.U)] = half[one] * turn[:, :, one]
        faces[:, axis, _at(patch.A)] = half[two] * turn[:, :, two]
    faces[..., patch.HALF_A] = faces[..., patch.HALF_B] = 1.0
    return patches


def _at(first: int) -> slice:
    """Return the slice of a vector of 3 that begins at `first`."""
    return slice(first, first + 3)
