"""The least friction coefficient that holds a pose, by a primal-dual interior-point method.

    least μ   such that   Σ (n a_n + t a_t + s a_s) + Σ y e = b,   n μ ≥ |(t, s)|,   n, y ≥ 0

with (n, t, s) the contact force of each wheel and y the forces at joint limits and under the body. For a fixed μ the
constraints are second-order cones; in μ the problem is quasi-convex, so a point where the optimality conditions hold is the
minimum. With x = (n, t/μ, s/μ) and z = (u_n, μ u_t, μ u_s), u the velocities of the contacts in a virtual motion v of the
mechanism, these conditions are: balance; x and z in the cone t² + s² ≤ n²; x·z = 0; and Σ u_t·(t, s)/μ = -1, which
fixes the size of v. The virtual motion is the proof of the minimum: docs/forces.md.

The iteration starts from the analytic centre of the forces that hold at a larger μ, which lies on the central path, and
takes Mehrotra's predictor and corrector with Nesterov-Todd scaling. The forces balance exactly throughout, so the
friction coefficient they use bounds the minimum from above.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .analytic_centre import CENTRED, NO_CENTRE, centre
from .balance import EQUATIONS
from .cones import contact_velocities, inside
from .even_friction import even_friction
from .friction_path import OFF_PATH, UNFINISHED, UNHELD, follow_path
from .least_norm import balance_exactly, factor, solve_factored

Array = NDArray[np.float64]

ROUNDS = 20
LEAST_GAP = 2e-8  # the least distance from the minimum at which a proof is tried
START = 0.5  # friction coefficient tried first where the rounds give none
WIDEST = 64.0  # friction coefficients above it do not count


@njit
def least_friction(
    columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array, v: Array
) -> tuple[float, int, int]:
    """Find the forces that need the least friction.

    Args:
        columns: (6, 3, 9) generalized forces of unit contact forces (normal, traction, side) of the first `count` wheels.
        extra: (m, 9) generalized forces of unit forces at joint limits and under the body, of which `more` are used.
        b: (9,) generalized force to balance, of size about 1.
        f, y: (6, 3), (m,) filled with the forces, in the units of b.
        v: (9,) filled with the virtual motion that proves the minimum.

    Returns:
        The friction coefficient; HELD, UNHELD if no coefficient up to WIDEST holds, or UNFINISHED; iterations used.
    """
    used = even_friction(columns, count, extra, more, b, f, y)
    low, high, total = 0.0, WIDEST, 0  # no centre was found at low; from high the path was lost
    mu = used + 0.1 * (used + 0.02)
    even = used == math.inf
    if even:
        mu = START
    for _ in range(ROUNDS):
        if even:
            f[:] = y[:] = 1.0 / count
            f[:, 1:] = 0.0
        outcome = centre(columns, count, extra, more, b, mu, f, y, v)
        if outcome != NO_CENTRE:
            high = mu
        if outcome == CENTRED:
            mu, code, iterations = follow_path(columns, count, extra, more, b, mu, f, y, v)
            total += iterations
            if code != OFF_PATH:
                balance_exactly(columns, count, extra, more, b, f, y)
                return mu, code, total
        elif outcome == NO_CENTRE:
            if not even:
                even = True
                continue
            low = mu
        even = True
        mu = 2.0 * low if high == WIDEST and low > 0.0 else low + 0.6 * (high - low)
        if mu > WIDEST:
            return math.inf, UNHELD, total
    return mu, UNFINISHED, total


@owning_njit
def lower_bound(columns: Array, count: int, extra: Array, more: int, b: Array, mu: float, v: Array) -> float:
    """Return a friction coefficient proved too small, just below a minimum found.

    A virtual motion v proves that μ does not hold the pose if every contact separates with u_n > μ |u_t|, no limit is
    violated and gravity does work (v·b < 0): no force within the friction cones can then take up that work.

    Args:
        columns, count, extra, more, b: as for `least_friction`.
        mu: the minimum found.
        v: (9,) its virtual motion; replaced by the proof.

    Returns:
        The largest coefficient for which a proof was found, of `mu` less LEAST_GAP, 4 LEAST_GAP ...; 0 if there is none.
    """
    u, ue = np.empty((6, 3)), np.empty(more)
    m, w, proof = np.empty((EQUATIONS, EQUATIONS)), np.empty(EQUATIONS), np.empty(EQUATIONS)
    work = 0.0
    for k in range(EQUATIONS):
        work += v[k] * b[k]
    below = LEAST_GAP
    while below < mu:
        low = mu - below
        below *= 4.0
        contact_velocities(columns, count, extra, more, v, u, ue)
        if not inside(1.0 / low, count, u, more, ue):
            continue
        if work < 0.0:
            return low
        m[:] = 0.0  # the shift w that costs the contacts least of what they can spare, with w·b = 1
        for i in range(count):
            spare = u[i, 0] - low * math.sqrt(u[i, 1] ** 2 + u[i, 2] ** 2)
            for c in range(3):
                for k in range(EQUATIONS):
                    part = columns[i, c, k] * (mu / spare) ** 2
                    for j in range(k + 1):
                        m[k, j] += part * columns[i, c, j]
        for e in range(more):
            for k in range(EQUATIONS):
                part = extra[e, k] * (mu / ue[e]) ** 2
                for j in range(k + 1):
                    m[k, j] += part * extra[e, j]
        if not factor(m, EQUATIONS):
            continue
        w[:] = b
        solve_factored(m, EQUATIONS, w)
        size = 0.0
        for k in range(EQUATIONS):
            size += w[k] * b[k]
        shifted = 0.0
        for k in range(EQUATIONS):
            proof[k] = v[k] - 1.5 * work / size * w[k]
            shifted += proof[k] * b[k]
        contact_velocities(columns, count, extra, more, proof, u, ue)
        if shifted < 0.0 and inside(1.0 / low, count, u, more, ue):
            v[:] = proof
            return low
    return 0.0
