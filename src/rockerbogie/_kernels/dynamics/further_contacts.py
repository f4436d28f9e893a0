"""The balance of wheels on soil that touch the terrain in several places.

A wheel between two faces touches the terrain in two places. On each of the two contacts alone, the motion may be towards the
other. The balance then has both. A further contact has a load and a lift rate, whose product is σ², as the first one of each
wheel (`balance_residual`). Its lift rate counts from the closing rate at which its gap vanishes by the end of the step. The
forces at each contact are its share of the wheel's load times those of the law at the whole load.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..model.linkage import P_RADIUS
from ..search.workspace import Work
from ..statics.balance import EQUATIONS
from .balance_residual import FLOOR, Law, Motion, add_column, residual_at
from .contact_law import BY_LOAD, BY_MOTION, FORCE, ROW, TORQUE, tabulated
from .equilibrium_motion import (
    FASTEST,
    LEAST_DAMPED,
    LESS_DAMPED,
    LONGEST,
    MORE_DAMPED,
    MOST_DAMPED,
    RESIDUAL,
    SLIP_SCALE,
    SMOOTHING,
    add_dampers,
    largest,
)
from .further_minima import add_closing, list_minima
from .further_state import Further, rate_of
from .linear import copy_numbers, decompose, solve_transposed
from .station import FREE, Station

Array = NDArray[np.float64]

NEAR = 0.01  # of the first wheel's radius: largest gap of a contact in the balance
ROUNDS = 4  # of adding contacts
ATTEMPTS = 200  # steps of a solve
FIRST_DAMPING = 1e-3  # of a solve
FIRST_SMOOTHING, LESS_SMOOTH = 0.01, 0.3  # σ of its first step, and ratio of successive ones


@njit
def add_share(
    law: Law, rover: Array, i: int, load: float, slope: float, ways: Array, m: Motion, f: Array, row: Array, further: Further
) -> None:  # fmt: skip
    """Fill the forces of one of several contacts of a wheel.

    They are its share of the wheel's load times those of the law at the whole load.

    Args:
        law: of the wheels.
        rover: (P_SIZE,) packed rover.
        i: wheel.
        load, slope: of the contact, over the weight, and its change with the contact's unknown.
        ways: (3, 9) of the contact: forward, to the left, link's rate.
        m: y is read.
        f: (ROW,) filled with the share of the law's row.
        row: (n,) of the Jacobian for the contact's unknown; changed by what does not depend on the wheel's load.
        further: total is read; by_total is changed: the change of the forces with the wheel's load at fixed loads of contacts.
    """
    total, by_total = further.total[i], further.by_total[i]
    tabulated(
        law.tables[law.table_of[i]], law.weight, total, rover[P_RADIUS + i], law.rim[i], rate_of(ways[0], m.y),
        rate_of(ways[1], m.y), rate_of(ways[2], m.y), FLOOR * law.speed, law.limit[i], m.scratch, f,
    )  # fmt: skip
    share = load / total
    for c in range(3):
        for k in range(EQUATIONS):
            row[k] += slope * f[FORCE + c] / total * ways[c, k]
            by_total[k] += share * (f[BY_LOAD + c] - f[FORCE + c] / total) * ways[c, k]
    for k in range(ROW):
        if k < BY_LOAD or (k >= BY_MOTION and k <= TORQUE):
            f[k] *= share


@njit
def add_force(ways: Array, f: Array, factor: float, speed: float, m: Motion, r: Array, J: Array) -> None:
    """Add the forces of a contact to the residual, and their change to the Jacobian.

    The change is that with the motion.

    Args:
        ways: (3, 9) of the contact: forward, to the left, link's rate.
        f: (ROW,) of its law.
        factor: on all.
        speed: reference speed, m/s.
        m: slope is read.
        r: (n,) residual; changed.
        J: (n, n) Jacobian, one unknown a row; changed.
    """
    for c in range(3):
        for k in range(EQUATIONS):
            r[k] += factor * f[FORCE + c] * ways[c, k]
    for k in range(EQUATIONS):
        share = factor if k < FREE else factor * m.slope[k - FREE, 1]
        if abs(share) >= 1e-9 * speed:
            add_column(ways, f[BY_MOTION:], True, k, share, J[k, :EQUATIONS])


@njit
def residual_with(s: Station, rover: Array, law: Law, sigma: float, span: float, m: Motion, further: Further) -> float:
    """Fill the balance residual with further contacts, and its Jacobian.

    Args:
        s, rover, law, sigma: as for `residual_at`.
        span: duration of the next step, s.
        m: work arrays of the first contacts, filled.
        further: z holds the unknowns; load, force, residual and jacobian are filled. The equations of the further contacts
            follow the nine others. They are rates over the reference speed.

    Returns:
        Sum of the squares of the residual.
    """
    residual_at(s, rover, law, True, SLIP_SCALE, sigma, further.z[:EQUATIONS], 0.0, m)
    n = EQUATIONS + further.size[0]
    r, J, loads = further.residual, further.jacobian[: n * n].reshape(n, n), further.total
    copy_numbers(m.residual, r[:EQUATIONS])
    J[:] = 0.0
    for k in range(EQUATIONS):
        copy_numbers(m.jacobian[k], J[k, :EQUATIONS])
    for i in range(6):
        loads[i] = 0.0
    for j in range(further.size[0]):
        a = further.z[EQUATIONS + j]
        big = 0.5 * (abs(a) + math.sqrt(a * a + 4.0 * sigma * sigma))
        further.load[j] = big if a >= 0.0 else sigma * sigma / big
        loads[further.wheel[j]] += further.load[j]
    for i in range(6):
        if loads[i] > 0.0:
            loads[i] += m.load[i]
            further.by_total[i] = 0.0
            f, ways = m.force[i], s.ways[i]
            for c in range(3):  # the law of the first contact alone does not count
                for k in range(EQUATIONS):
                    J[FREE + i, k] -= m.slope[i, 0] * f[BY_LOAD + c] * ways[c, k]
            add_force(ways, f, -1.0, law.speed, m, r, J)
            add_share(law, rover, i, m.load[i], m.slope[i, 0], ways, m, f, J[FREE + i], further)
            add_force(ways, f, 1.0, law.speed, m, r, J)
    for j in range(further.size[0]):
        e, i, f, ways = EQUATIONS + j, further.wheel[j], further.force[j], further.ways[j]
        a, load = further.z[e], further.load[j]
        root = math.sqrt(a * a + 4.0 * sigma * sigma)
        lift = sigma * sigma / load
        add_share(law, rover, i, load, load / root, ways[1:], m, f, J[e], further)
        add_force(ways[1:], f, 1.0, law.speed, m, r, J)
        r[e] = (rate_of(ways[0], m.y) + further.gap[j] / span) / law.speed - lift
        J[e, e] = lift / root
        for k in range(EQUATIONS):
            r[k] += load * ways[0, k]
            J[e, k] += load / root * ways[0, k]
            J[k, e] = (1.0 if k < FREE else m.slope[k - FREE, 1]) * ways[0, k] / law.speed
    for i in range(6):
        if loads[i] > 0.0:
            for k in range(EQUATIONS):
                J[FREE + i, k] += m.slope[i, 0] * further.by_total[i, k]
    for j in range(further.size[0]):
        e, i, a = EQUATIONS + j, further.wheel[j], further.z[EQUATIONS + j]
        for k in range(EQUATIONS):
            J[e, k] += further.load[j] / math.sqrt(a * a + 4.0 * sigma * sigma) * further.by_total[i, k]
    total = 0.0
    for k in range(n):
        total += r[k] * r[k]
    return total


@njit
def solve_with(s: Station, rover: Array, law: Law, span: float, m: Motion, further: Further) -> int:
    """Solve the balance with further contacts.

    The method is pseudo-transient continuation as `relax`, with σ that decreases.

    Args:
        s, rover, law, span: as for `residual_with`.
        m: work arrays; those of the solution, but z.
        further: z is the start; replaced.

    Returns:
        Number of steps; -1 if no balance was found.
    """
    n = EQUATIONS + further.size[0]
    r, step, order = further.residual[:n], further.step[:n], further.order[:n]
    J = further.jacobian[: n * n].reshape(n, n)
    damping, before, sigma = FIRST_DAMPING, math.inf, FIRST_SMOOTHING
    for it in range(ATTEMPTS):
        total = residual_with(s, rover, law, sigma, span, m, further)
        if sigma == SMOOTHING and largest(r) < RESIDUAL:
            return it
        damping = min(max(damping * (LESS_DAMPED if total < before else MORE_DAMPED), LEAST_DAMPED), MOST_DAMPED)
        before = total
        for k in range(n):
            step[k] = -r[k]
        add_dampers(s, damping / (6.0 * law.speed), J)
        if not (math.isfinite(total) and decompose(J, order)):
            return -1
        solve_transposed(J, order, step)
        share = 1.0
        for k in range(n):
            share = min(share, (law.speed if k < FREE else LONGEST) / max(abs(step[k]), 1e-300))
        for k in range(n):
            further.z[k] += share * step[k]
        for k in range(FREE):
            if not abs(further.z[k]) < FASTEST * law.speed:
                return -1
        sigma = max(LESS_SMOOTH * sigma, SMOOTHING)
    return -1


@njit
def add_contacts(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, span: float, law: Law, raised: Array, work: Work,
    s: Station, m: Motion, further: Further,
) -> int:  # fmt: skip
    """Solve for the motion again with further contacts, if the motion closes any too fast.

    Args:
        ground, rover, x, y, cy, sy, span, law, work, s: as for `add_closing`.
        raised: (6,) gaps of the wheels, m.
        m: the motion without further contacts; replaced if there are any, but z, from which the next pose starts.
        further: filled.

    Returns:
        Number of steps; -1 if no motion with them was found. Then m is not valid, but z.
    """
    further.size[0] = 0
    levels, steps = list_minima(ground, raised, min(law.speed * span, NEAR * rover[P_RADIUS]), work, further), 0
    copy_numbers(m.z, further.z[:EQUATIONS])
    for _ in range(ROUNDS):
        if levels == 0 or not add_closing(ground, rover, x, y, cy, sy, levels, span, law, work, s, m, further):
            break
        count = solve_with(s, rover, law, span, m, further)
        if count < 0:
            return -1
        steps += count + 1
    return steps
