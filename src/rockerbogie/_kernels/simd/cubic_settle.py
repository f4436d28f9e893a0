"""Loading of poses into a lane array, and their settling on cubic terrain with verification."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined
from ..model import wheel
from ..model.ground import META_MAX_CURVATURE, META_X, META_Y, Ground
from ..model.linkage import P_HALF, P_RADIUS, set_hub_offsets
from ..model.sincos import FAR
from ..model.tolerances import CONVERGED_GAP
from ..model.wheel import gap_at
from ..search.tread import SMOOTH
from ..search.verify_minimum import LEAST, LOWER, UNKNOWN, is_least
from ..search.workspace import Work
from .cubic_newton import SMALL, check_converged, iterate, start
from .layout import CONTACT, CUBIC, HALF, LANES, POSE, WHEEL, WIDTH, in_use
from .linkage import place_body, place_wheels, set_heading

Array = NDArray[np.float64]

ROUNDS = 5  # verifications after which a lane may be iterated again


@inlined
def load(
    lanes: Array, rover: Array, meta: Array, x: Array, y: Array, yaw: Array, steering: Array, which: NDArray[np.int64],
    count: int,
    fresh: bool, work: Work,
) -> None:  # fmt: skip
    """Fill a block with poses.

    Spare lanes repeat the last pose. Steering that is common to all poses is set in a fresh block only, in all lanes.

    Args:
        lanes: the lane array (`layout`).
        rover: the packed rover.
        meta: the map header.
        x, y: (n,) positions in the terrain's frame, m.
        yaw: (n,) headings, rad.
        steering: (n, 6) or (1, 6) steering angles, rad.
        which: (LANES,) indices of the poses; the first `count` are used.
        count: number of poses, 1 to LANES.
        fresh: True for the first block of a lane array.
        work: scratch memory of this thread.

    Reads:  POSE.yaw
    Writes: POSE.x, POSE.y, POSE.yaw, POSE.cy, POSE.sy, WHEEL.fx, WHEEL.fy, WHEEL.fz, WHEEL.fc, WHEEL.fs
    """
    lanes[WIDTH] = HALF if count <= HALF else LANES
    for l in range(LANES if fresh else in_use(lanes)):
        k = which[min(l, count - 1)]
        lanes[POSE.x + l], lanes[POSE.y + l] = x[k] - meta[META_X], y[k] - meta[META_Y]
        lanes[POSE.yaw + l] = yaw[k] if abs(yaw[k]) < FAR else 0.0
        if steering.shape[0] > 1 or (fresh and l == 0):  # the same steering for all lanes: the first block holds it
            set_hub_offsets(rover, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
        if steering.shape[0] > 1 or fresh:
            for i in range(6):
                k = i * LANES + l
                lanes[WHEEL.fx + k], lanes[WHEEL.fy + k] = work.hub_offsets[i, 0], work.hub_offsets[i, 1]
                lanes[WHEEL.fz + k] = work.hub_offsets[i, 2]
                lanes[WHEEL.fc + k], lanes[WHEEL.fs + k] = work.hub_offsets[i, 3], work.hub_offsets[i, 4]
    set_heading(lanes)
    for l in range(in_use(lanes)):
        k = which[min(l, count - 1)]
        if abs(yaw[k]) >= FAR:
            lanes[POSE.cy + l], lanes[POSE.sy + l] = math.cos(yaw[k]), math.sin(yaw[k])


@inlined
def verify_lane(lanes: Array, ground: Ground, rover: Array, l: int, work: Work) -> int:
    """Verify a settled pose over all its treads.

    A tread whose gap is lower elsewhere has its contact moved there. Rims that are sharper than the whole map need no
    search.

    Args:
        lanes: the lane array (`layout`).
        ground: the packed terrain.
        rover: the packed rover.
        l: lane.
        work: scratch memory of this thread.

    Returns:
        LEAST: verified. LOWER: iterate again, as a gap is lower elsewhere or not yet within CONVERGED_GAP. UNKNOWN: not
        converged, or not decided.

    Reads:  POSE.x, POSE.y, POSE.q, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT.sine,
            CONTACT.cosine, CONTACT.offset, CUBIC.sound
    Writes: CONTACT.sine, CONTACT.cosine, CONTACT.offset
    """
    if lanes[CUBIC.sound + l] == 0.0:
        return UNKNOWN
    w, lowest = work.wheels[0], work.lowest
    verdict = LEAST
    for i in range(6):
        k = i * LANES + l
        if rover[P_HALF + i] == 0.0 and rover[P_RADIUS + i] * ground[2][META_MAX_CURVATURE] < SMOOTH:
            continue  # the whole map curves less than this rim
        vx, vy, az, level = lanes[WHEEL.vx + k], lanes[WHEEL.vy + k], lanes[WHEEL.az + k], lanes[WHEEL.uz + k]
        w[wheel.HX], w[wheel.HY] = lanes[POSE.x + l] + lanes[WHEEL.ox + k], lanes[POSE.y + l] + lanes[WHEEL.oy + k]
        w[wheel.HZ] = lanes[POSE.q + l] + lanes[WHEEL.oz + k]
        w[wheel.AX], w[wheel.AY], w[wheel.AZ], w[wheel.VX], w[wheel.VY] = level * vx, level * vy, az, vx, vy
        w[wheel.EX], w[wheel.EY], w[wheel.UX], w[wheel.UY], w[wheel.UZ] = vy, -vx, -az * vx, -az * vy, level
        w[wheel.COS], w[wheel.TAN], w[wheel.RADIUS], w[wheel.HALF] = level, az / level, rover[P_RADIUS + i], rover[P_HALF + i]
        sine, cosine, offset = lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k]
        if abs(gap_at(ground[0], ground[2], w, sine, cosine, offset)) > CONVERGED_GAP:
            verdict = LOWER  # take one more step
            continue
        of_wheel = is_least(ground, w, sine, cosine, offset, lowest, work.none)
        if of_wheel == UNKNOWN:
            return UNKNOWN
        if of_wheel == LOWER:
            lanes[CONTACT.sine + k], lanes[CONTACT.cosine + k], lanes[CONTACT.offset + k] = (
                lowest[wheel.SIN],
                lowest[wheel.COSINE],
                lowest[wheel.PLACE],
            )
            verdict = LOWER
    return verdict


@inlined
def settle_block(lanes: Array, ground: Ground, rover: Array, count: int, sure: float, work: Work) -> None:
    """Settle and verify a block on cubic terrain.

    Lanes whose verdict is not LEAST are left to the scalar solver.

    Args:
        lanes: the lane array (`layout`).
        ground: the packed terrain.
        rover: the packed rover.
        count: number of lanes in use, from the first.
        sure: `cubic_newton.guaranteed_step`.
        work: scratch memory of this thread.

    Reads:  POSE.x, POSE.y, POSE.cy, POSE.sy, POSE.q, POSE.step, POSE.active, POSE.worst, POSE.axes, POSE.right, POSE.rate,
            WHEEL (all), CONTACT (all), CUBIC.u, CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef, CUBIC.h, CUBIC.hxx, CUBIC.hxy,
            CUBIC.hyy, CUBIC.turn, CUBIC.rejected, CUBIC.sound, CUBIC.verdict, CELL.col, CELL.row, CELL.h00, CELL.h01,
            CELL.h10, CELL.h11, LOWEST (all), HOME (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected, SPOT (all)
    Writes: POSE.q, POSE.step, POSE.active, POSE.worst, POSE.axes, POSE.right, POSE.rate, WHEEL.lc, WHEEL.ls, WHEEL.bx,
            WHEEL.bz, WHEEL.br, WHEEL.ox, WHEEL.oy, WHEEL.oz, WHEEL.az, WHEEL.vx, WHEEL.vy, WHEEL.uz, CONTACT (all),
            CUBIC.u, CUBIC.v, CUBIC.col, CUBIC.row, CUBIC.coef, CUBIC.h, CUBIC.hxx, CUBIC.hxy, CUBIC.hyy, CUBIC.turn,
            CUBIC.rejected, CUBIC.sound, CUBIC.verdict, CELL.col, CELL.row, CELL.h00, CELL.h01, CELL.h10, CELL.h11, LOWEST
            (all), HOME (all), BILINEAR.col, BILINEAR.row, BILINEAR.rejected, SPOT (all)
    """
    grid, _, meta = ground
    for l in range(in_use(lanes)):
        lanes[POSE.active + l] = 1.0 if l < count else 0.0
    start(lanes, grid, meta, rover)
    if sure > 0.0:  # each wheel touches at one point only
        iterate(lanes, grid, meta, rover, sure)
        check_converged(lanes)
        for l in range(in_use(lanes)):
            lanes[CUBIC.verdict + l] = LEAST if lanes[CUBIC.sound + l] == 1.0 else UNKNOWN
        return
    for l in range(in_use(lanes)):
        lanes[CUBIC.verdict + l] = LOWER if l < count else UNKNOWN
    for _ in range(ROUNDS):
        iterate(lanes, grid, meta, rover, SMALL)
        check_converged(lanes)
        place_body(lanes, rover)  # move the wheels by the last step
        place_wheels(lanes, rover)
        again = False
        for l in range(count):
            if lanes[CUBIC.verdict + l] == LOWER:
                lanes[CUBIC.verdict + l] = verify_lane(lanes, ground, rover, l, work)
                lanes[POSE.active + l] = 1.0 if lanes[CUBIC.verdict + l] == LOWER else 0.0
                again |= lanes[CUBIC.verdict + l] == LOWER
        if not again:
            break
