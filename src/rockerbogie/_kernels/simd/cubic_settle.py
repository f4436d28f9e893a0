"""Poses into the lanes; and a block of them on cubic ground: settled there, and proved one by one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined
from ..model import wheel
from ..model.ground import META_BEND, META_X, META_Y, Ground
from ..model.linkage import P_HALF, P_RADIUS, stand_feet
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
    S: Array, rover: Array, meta: Array, x: Array, y: Array, yaw: Array, steering: Array, which: NDArray[np.int64], count: int,
    fresh: bool, work: Work,
) -> None:  # fmt: skip
    """Fill a block with the first `count` poses of `which`, the last one again where there is room. Steering that serves all
    poses is set in a fresh block only."""
    for l in range(linkage.LANES):
        k = which[min(l, count - 1)]
        S[linkage.X + l], S[linkage.Y + l] = x[k] - meta[META_X], y[k] - meta[META_Y]
        S[linkage.CY + l] = yaw[k] if abs(yaw[k]) < FAR else 0.0
        if fresh or steering.shape[0] > 1:
            stand_feet(rover, steering[k if steering.shape[0] > 1 else 0], work.feet)
            for i in range(6):
                for n in range(5):
                    S[linkage.FX + n * linkage.ALL + i * linkage.LANES + l] = work.feet[i, n]
    linkage.head(S)
    for l in range(linkage.LANES):
        k = which[min(l, count - 1)]
        if abs(yaw[k]) >= FAR:
            S[linkage.CY + l], S[linkage.SY + l] = math.cos(yaw[k]), math.sin(yaw[k])


@inlined
def prove(S: Array, ground: Ground, rover: Array, l: int, work: Work) -> int:
    """Whether lane l has settled upright, and that over all treads: LEAST. LOWER where it is to go on: a tread is deeper in
    the ground elsewhere, which its contact is moved to, or not near enough. UNKNOWN where it is to be settled otherwise."""
    if S[cubic_newton.SOUND + l] == 0.0:
        return UNKNOWN
    w, best = work.wheels[0], work.best
    verdict = LEAST
    for i in range(6):
        k = i * linkage.LANES + l
        if rover[P_HALF + i] == 0.0 and rover[P_RADIUS + i] * ground[2][META_BEND] < SMOOTH:
            continue  # all of the map bends less than this rim
        vx, vy, az, level = S[linkage.VX + k], S[linkage.VY + k], S[linkage.AZ + k], S[linkage.UZ + k]
        w[wheel.HX], w[wheel.HY] = S[linkage.X + l] + S[linkage.OX + k], S[linkage.Y + l] + S[linkage.OY + k]
        w[wheel.HZ] = S[linkage.Q + l] + S[linkage.OZ + k]
        w[wheel.AX], w[wheel.AY], w[wheel.AZ], w[wheel.VX], w[wheel.VY] = level * vx, level * vy, az, vx, vy
        w[wheel.EX], w[wheel.EY], w[wheel.UX], w[wheel.UY], w[wheel.UZ] = vy, -vx, -az * vx, -az * vy, level
        w[wheel.COS], w[wheel.TAN], w[wheel.RADIUS], w[wheel.HALF] = level, az / level, rover[P_RADIUS + i], rover[P_HALF + i]
        sine, cosine, place = S[linkage.SINE + k], S[linkage.COSINE + k], S[linkage.PLACE + k]
        if abs(gap_at(ground[0], ground[2], w, sine, cosine, place)) > TOLERANCE:
            verdict = LOWER  # one step more
            continue
        of_wheel = is_least(ground, w, sine, cosine, place, best, work.none)
        if of_wheel == UNKNOWN:
            return UNKNOWN
        if of_wheel == LOWER:
            S[linkage.SINE + k], S[linkage.COSINE + k], S[linkage.PLACE + k] = (
                best[wheel.SIN],
                best[wheel.COSINE],
                best[wheel.PLACE],
            )
            verdict = LOWER
    return verdict


@inlined
def settle_block(S: Array, ground: Ground, rover: Array, count: int, sure: float, work: Work) -> None:
    """Settle the first `count` lanes on cubic ground; sure: `cubic_newton.sure_step`. VERDICT is LEAST for those that are proved;
    others are to be settled otherwise."""
    grid, _, meta = ground
    for l in range(linkage.LANES):
        S[linkage.LIVE + l] = 1.0 if l < count else 0.0
    cubic_newton.start(S, grid, meta, rover)
    if sure > 0.0:  # wherever a rim touches, that is its only place
        cubic_newton.settle(S, grid, meta, rover, sure)
        cubic_newton.standing(S)
        for l in range(linkage.LANES):
            S[VERDICT + l] = LEAST if S[cubic_newton.SOUND + l] == 1.0 else UNKNOWN
        return
    for l in range(linkage.LANES):
        S[VERDICT + l] = LOWER if l < count else UNKNOWN
    for _ in range(ROUNDS):
        cubic_newton.settle(S, grid, meta, rover, cubic_newton.SMALL)
        cubic_newton.standing(S)
        linkage.place_body(S, rover)  # where the last step has left the wheels
        linkage.place_wheels(S, rover)
        again = False
        for l in range(count):
            if S[VERDICT + l] == LOWER:
                S[VERDICT + l] = prove(S, ground, rover, l, work)
                S[linkage.LIVE + l] = 1.0 if S[VERDICT + l] == LOWER else 0.0
                again |= S[VERDICT + l] == LOWER
        if not again:
            break
