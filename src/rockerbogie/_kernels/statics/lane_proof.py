"""Proofs, from virtual motions, that friction coefficients are too small (docs/forces.md)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..jit.vectors import LANES
from .balance import EQUATIONS as BALANCE_EQUATIONS
from .lane_problem import CAPACITY, Block
from .lane_rows import BALANCE, CONTACTS, LIMITS, PROBLEM, RESULT, STATE, WHEEL, WHEELS
from .least_norm import factor, solve_factored

Array = NDArray[np.float64]

PROOF = 1.5  # of the power v·b: work that the proof takes from the motion
PROVED = 100.0  # of the gap: largest difference of the least friction found, or 1, and its bound
SMALLER = 0.5  # of that difference: by which the coefficient of `wide_bound` is smaller


@inlined
def shifted_motion(t: Block, l: int, v: Array) -> None:
    """Fill v with the motion of the last step, shifted so that gravity works in it.

    The shift costs the contacts least of what they can spare.

    Args:
        t: work arrays.
        l: lane.
        v: (9,) filled.
    """
    lanes = t.lanes
    work, size = 0.0, 0.0
    for n in range(BALANCE_EQUATIONS):
        b = lanes[(PROBLEM.b + n) * LANES + l]
        work += b * lanes[(STATE.v + n) * LANES + l]
        size += b * lanes[(RESULT.proof + n) * LANES + l]
    shift = PROOF * max(work, 0.0) / size
    for n in range(BALANCE_EQUATIONS):
        v[n] = lanes[(STATE.v + n) * LANES + l] - shift * lanes[(RESULT.proof + n) * LANES + l]


@inlined
def is_long(t: Block, l: int, i: int) -> bool:
    """Return True if a wheel touches along a line that counts at its middle.

    Args:
        t: work arrays.
        l: lane.
        i: contact.
    """
    half = t.line[l, 0, i % WHEELS]
    return t.queue[CAPACITY] == WHEELS and (half[0] != 0.0 or half[1] != 0.0)


@inlined
def contact_velocity(t: Block, l: int, v: Array, i: int, s: float, u: Array) -> float:
    """Fill the velocity of a contact in a motion.

    Args:
        t: work arrays.
        l: lane.
        v: (9,) virtual motion.
        i: contact.
        s: point of its line, -1 to 1.
        u: (3,) filled.

    Returns:
        Its component along the contact normal.
    """
    lanes, half, along = t.lanes, t.line[l, :, i % WHEELS], 0.0
    bogie = v[i % 2] if i % WHEELS > 1 else 0.0
    for c in range(3):
        a, b = (c + 1) % 3, (c + 2) % 3
        pa = lanes[(WHEEL.point + CONTACTS * a + i) * LANES + l] + s * half[0, a]
        pb = lanes[(WHEEL.point + CONTACTS * b + i) * LANES + l] + s * half[0, b]
        u[c] = v[BALANCE[c]]
        u[c] += v[BALANCE[6]] * (lanes[(WHEEL.rocker + CONTACTS * c + i) * LANES + l] + s * half[1, c])
        u[c] += bogie * (lanes[(WHEEL.bogie + CONTACTS * c + i) * LANES + l] + s * half[2, c])
        u[c] += v[BALANCE[3 + a]] * pb - v[BALANCE[3 + b]] * pa
        along += u[c] * lanes[(WHEEL.normal + CONTACTS * c + i) * LANES + l]
    return along


@owning_njit
def proved(t: Block, l: int, v: Array) -> float:
    """Return the friction coefficient that a motion proves too small, or 0 (docs/forces.md).

    Args:
        t: work arrays.
        l: lane.
        v: (9,) virtual motion.
    """
    lanes, work = t.lanes, 0.0
    for n in range(BALANCE_EQUATIONS):
        work += v[n] * lanes[(PROBLEM.b + n) * LANES + l]
    good = work < 0.0
    for j in range(3):
        if lanes[(PROBLEM.limit + j) * LANES + l] > 0.0:
            good &= lanes[(PROBLEM.sign + j) * LANES + l] * v[LIMITS[j]] >= 0.0
    least, u = math.inf, np.empty(3)
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] == 0.0:
            continue
        long = is_long(t, l, i)
        for end in range(2 if long else 1):  # both ends of a line that counts at its middle
            along = contact_velocity(t, l, v, i, (2.0 * end - 1.0) if long else 0.0, u)
            good &= along >= 0.0
            across = math.sqrt(max(u[0] ** 2 + u[1] ** 2 + u[2] ** 2 - along * along, 0.0))
            least = min(least, along / across)
    return least if good and least > 0.0 else 0.0


@owning_njit
def wide_bound(t: Block, l: int, gap: float) -> float:
    """Return the coefficient that a motion shifted at a smaller one proves too small, or 0.

    The shift of `shifted_motion` may press a contact that stays in place into the terrain. At a slightly smaller coefficient,
    the contacts that slide can spare far more, and the shift hardly moves those that stay.

    Args:
        t: work arrays.
        l: lane.
        gap: as for `lane_friction.friction_batch`.
    """
    lanes, size = t.lanes, BALANCE_EQUATIONS
    mu = lanes[STATE.mu * LANES + l]
    mu -= SMALLER * PROVED * gap * max(1.0, mu)
    v, unit, part = np.empty(size), np.zeros(size), np.empty((3, size))
    m, shift, u = np.zeros((size, size)), np.empty(size), np.empty(3)
    for n in range(size):
        v[n] = lanes[(STATE.v + n) * LANES + l]
        shift[n] = lanes[(PROBLEM.b + n) * LANES + l]
    for i in range(t.queue[CAPACITY]):
        if lanes[(WHEEL.on + i) * LANES + l] == 0.0:
            continue
        long = is_long(t, l, i)
        for end in range(2 if long else 1):
            s = (2.0 * end - 1.0) if long else 0.0
            along = contact_velocity(t, l, v, i, s, u)
            spare = along - mu * math.sqrt(max(u[0] ** 2 + u[1] ** 2 + u[2] ** 2 - along * along, 0.0))
            if not spare > 0.0:
                return 0.0
            for n in range(size):
                unit[n] = 1.0
                contact_velocity(t, l, unit, i, s, part[:, n])
                unit[n] = 0.0
            for n in range(size):
                for k in range(n + 1):
                    m[n, k] += (part[0, n] * part[0, k] + part[1, n] * part[1, k] + part[2, n] * part[2, k]) / spare**2
    for j in range(3):
        if lanes[(PROBLEM.limit + j) * LANES + l] > 0.0:
            spare = lanes[(PROBLEM.sign + j) * LANES + l] * v[LIMITS[j]]
            if not spare > 0.0:
                return 0.0
            m[LIMITS[j], LIMITS[j]] += 1.0 / spare**2
    if not factor(m, size):
        return 0.0
    solve_factored(m, size, shift)
    work = total = 0.0
    for n in range(size):
        b = lanes[(PROBLEM.b + n) * LANES + l]
        work += b * v[n]
        total += b * shift[n]
    for n in range(size):
        v[n] -= PROOF * max(work, 0.0) / total * shift[n]
    return proved(t, l, v)


@njit
def is_proved(mu: float, below: float, gap: float) -> bool:
    """Return True if a friction coefficient is proved minimal.

    Args:
        mu: the coefficient.
        below: coefficient proved too small.
        gap: as for `friction_batch`.
    """
    return mu - below < PROVED * gap * max(1.0, mu)
