"""Poses into the lanes; and a block of them on cubic ground: settled there, and proved one by one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined
from ..model import wheel
from ..model.ground import META_MAX_CURVATURE, META_X, META_Y, Ground
from ..model.linkage import P_HALF, P_RADIUS, set_hub_offsets
from ..model.sincos import FAR
from ..model.wheel import gap_at
from ..search.tread import SMOOTH
from ..search.verify_minimum import LEAST, LOWER, UNKNOWN, is_least
from ..search.workspace import Work
from ..solve.newton import TOLERANCE
from . import cubic_newton, linkage

Array = NDArray[np.float64]

VERDICT = cubic_newton.SMOOTH_ROWS  # what is proved of a lane: a verdict of search.verify_minimum
BLOCK_SIZE = VERDICT + linkage.LANES
ROUNDS = 5  # proofs that may send a lane on from a lower place


@inlined
def load(
    lanes: Array, rover: Array, meta: Array, x: Array, y: Array, yaw: Array, steering: Array, which: NDArray[np.int64],
    count: int,
    fresh: bool, work: Work,
) -> None:  # fmt: skip
    """Fill a block with the first `count` poses of `which`, the last one again where there is room. Steering that serves all
    poses is set in a fresh block only."""
    for l in range(linkage.LANES):
        k = which[min(l, count - 1)]
        lanes[linkage.X + l], lanes[linkage.Y + l] = x[k] - meta[META_X], y[k] - meta[META_Y]
        lanes[linkage.CY + l] = yaw[k] if abs(yaw[k]) < FAR else 0.0
        if fresh or steering.shape[0] > 1:
            set_hub_offsets(rover, steering[k if steering.shape[0] > 1 else 0], work.hub_offsets)
            for i in range(6):
                for n in range(5):
                    lanes[linkage.FX + n * linkage.ALL + i * linkage.LANES + l] = work.hub_offsets[i, n]
    linkage.head(lanes)
    for l in range(linkage.LANES):
        k = which[min(l, count - 1)]
        if abs(yaw[k]) >= FAR:
            lanes[linkage.CY + l], lanes[linkage.SY + l] = math.cos(yaw[k]), math.sin(yaw[k])


@inlined
def prove(lanes: Array, ground: Ground, rover: Array, l: int, work: Work) -> int:
    """Whether lane l has settled upright, and that over all treads: LEAST. LOWER where it is to go on: a tread is deeper in
    the ground elsewhere, which its contact is moved to, or not near enough. UNKNOWN where it is to be settled otherwise."""
    if lanes[cubic_newton.SOUND + l] == 0.0:
        return UNKNOWN
    w, lowest = work.wheels[0], work.lowest
    verdict = LEAST
    for i in range(6):
        k = i * linkage.LANES + l
        if rover[P_HALF + i] == 0.0 and rover[P_RADIUS + i] * ground[2][META_MAX_CURVATURE] < SMOOTH:
            continue  # all of the map bends less than this rim
        vx, vy, az, level = lanes[linkage.VX + k], lanes[linkage.VY + k], lanes[linkage.AZ + k], lanes[linkage.UZ + k]
        w[wheel.HX], w[wheel.HY] = lanes[linkage.X + l] + lanes[linkage.OX + k], lanes[linkage.Y + l] + lanes[linkage.OY + k]
        w[wheel.HZ] = lanes[linkage.Q + l] + lanes[linkage.OZ + k]
        w[wheel.AX], w[wheel.AY], w[wheel.AZ], w[wheel.VX], w[wheel.VY] = level * vx, level * vy, az, vx, vy
        w[wheel.EX], w[wheel.EY], w[wheel.UX], w[wheel.UY], w[wheel.UZ] = vy, -vx, -az * vx, -az * vy, level
        w[wheel.COS], w[wheel.TAN], w[wheel.RADIUS], w[wheel.HALF] = level, az / level, rover[P_RADIUS + i], rover[P_HALF + i]
        sine, cosine, place = lanes[linkage.SINE + k], lanes[linkage.COSINE + k], lanes[linkage.PLACE + k]
        if abs(gap_at(ground[0], ground[2], w, sine, cosine, place)) > TOLERANCE:
            verdict = LOWER  # one step more
            continue
        of_wheel = is_least(ground, w, sine, cosine, place, lowest, work.none)
        if of_wheel == UNKNOWN:
            return UNKNOWN
        if of_wheel == LOWER:
            lanes[linkage.SINE + k], lanes[linkage.COSINE + k], lanes[linkage.PLACE + k] = (
                lowest[wheel.SIN],
                lowest[wheel.COSINE],
                lowest[wheel.PLACE],
            )
            verdict = LOWER
    return verdict


@inlined
def settle_block(lanes: Array, ground: Ground, rover: Array, count: int, sure: float, work: Work) -> None:
    """Settle the first `count` lanes on cubic ground; sure: `cubic_newton.sure_step`. VERDICT is LEAST for those that are proved;
    others are to be settled otherwise."""
    grid, _, meta = ground
    for l in range(linkage.LANES):
        lanes[linkage.ACTIVE + l] = 1.0 if l < count else 0.0
    cubic_newton.start(lanes, grid, meta, rover)
    if sure > 0.0:  # wherever a rim touches, that is its only place
        cubic_newton.settle(lanes, grid, meta, rover, sure)
        cubic_newton.standing(lanes)
        for l in range(linkage.LANES):
            lanes[VERDICT + l] = LEAST if lanes[cubic_newton.SOUND + l] == 1.0 else UNKNOWN
        return
    for l in range(linkage.LANES):
        lanes[VERDICT + l] = LOWER if l < count else UNKNOWN
    for _ in range(ROUNDS):
        cubic_newton.settle(lanes, grid, meta, rover, cubic_newton.SMALL)
        cubic_newton.standing(lanes)
        linkage.place_body(lanes, rover)  # where the last step has left the wheels
        linkage.place_wheels(lanes, rover)
        again = False
        for l in range(count):
            if lanes[VERDICT + l] == LOWER:
                lanes[VERDICT + l] = prove(lanes, ground, rover, l, work)
                lanes[linkage.ACTIVE + l] = 1.0 if lanes[VERDICT + l] == LOWER else 0.0
                again |= lanes[VERDICT + l] == LOWER
        if not again:
            break
