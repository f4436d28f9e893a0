"""Motion and loads of a rover whose wheel forces balance: Newton's method on nine equations.

Unknowns are the rates w of x, y and yaw and one number ζ a contact. Load and lift rate are n = (ζ + √(ζ² + 4 σ²)) / 2 over the
weight and (√(ζ² + 4 σ²) − ζ) / 2 times the reference speed. Their product is σ²: for σ → 0 a wheel is either loaded or lifts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, njit
from ..jit.raw_views import unowned_view
from ..model.linkage import P_RADIUS
from ..soil.table import SPACE
from ..statics.balance import EQUATIONS
from .contact_law import BY_LOAD, BY_MOTION, FORCE, ROW, coulomb, tabulated
from .linear import decompose, solve_transposed
from .station import FREE, Station

Array = NDArray[np.float64]

RESIDUAL = 1e-10  # of the weight
DIRECT = 5  # Newton steps from the solution nearby
STEPS = 20  # Newton steps of one level of a continuation
HALVINGS = 5  # of a Newton step of a continuation; from the solution nearby, 2
SMOOTHING = 1e-6  # σ of a solution
SLIP_SCALE = 1e-3  # of the reference speed: slip at which friction reaches 70 % of its limit
ROUGH = 0.05  # largest slip scale of a solution, where none is found at SLIP_SCALE
NEARBY = 0.03  # slip scale from which a continuation from the solution nearby starts
FIRST_RATIO, LEAST_RATIO = 0.2, 0.8  # of successive slip scales: at first, and before a continuation ends
ROUGH_RESIDUAL = 1e-4  # of the weight, of levels before the last
FLOOR = 1e-9  # of the reference speed
FASTEST = 30.0  # times the reference speed: a faster motion is no equilibrium


class Law(NamedTuple):
    """Force law of a rover's wheels."""

    friction: float  # coefficient on rigid terrain; on soil, that of the start of a continuation
    soil: bool  # True if the wheels' forces are tabulated
    tables: Array  # (m, size) packed tables
    table_of: NDArray[np.int64]  # (6,) table of each wheel
    weight: float  # N
    rim: Array  # (6,) commanded rim speeds, m/s
    limit: Array  # (6,) torque limits over the weight, m
    speed: float  # reference speed, m/s


class Motion(NamedTuple):
    """Work arrays of the solve; `z` starts the next one."""

    z: Array  # (9,) unknowns: w, m/s and rad/s, and ζ
    y: Array  # (9,) w and lift rates
    load: Array  # (6,) over the weight
    force: Array  # (6, ROW) of the laws
    residual: Array  # (9,)
    jacobian: Array  # (9, 9) residual by unknown, one unknown a row
    step: Array  # (9,)
    trial: Array  # (9,)
    kept: Array  # (9,)
    slope: Array  # (6, 2) of load and lift rate by ζ
    scale: Array  # (1,) slip scale of the solution over the reference speed
    scratch: Array  # (20 + SPACE,) of the tables
    order: NDArray[np.int64]  # (9,)


MOTION_SIZE = 6 * EQUATIONS + 6 + 6 * ROW + EQUATIONS * EQUATIONS + 12 + 1 + 20 + SPACE


@njit
def new_motion(buffer: Array, order: NDArray[np.int64]) -> Motion:
    """Return work arrays as unowned views into a buffer.

    Args:
        buffer: (MOTION_SIZE,) memory; the caller must keep it alive.
        order: (9,) memory, the same.
    """
    b, n = unowned_view(buffer), 6 * EQUATIONS
    load = b[n : n + 6]
    n += 6
    force = b[n : n + 6 * ROW].reshape(6, ROW)
    n += 6 * ROW
    jacobian = b[n : n + EQUATIONS * EQUATIONS].reshape(EQUATIONS, EQUATIONS)
    n += EQUATIONS * EQUATIONS
    slope = b[n : n + 12].reshape(6, 2)
    n += 12
    scale = b[n : n + 1]
    n += 1
    scratch = b[n : n + 20 + SPACE]
    k = EQUATIONS
    return Motion(
        b[:k], b[k : 2 * k], load, force, b[2 * k : 3 * k], jacobian, b[3 * k : 4 * k], b[4 * k : 5 * k], b[5 * k : 6 * k],
        slope, scale, scratch, unowned_view(order),
    )  # fmt: skip


@njit
def reset_motion(m: Motion) -> None:
    """Set the start of a solve to a rover at rest, its weight shared equally.

    Args:
        m: work arrays; z is set.
    """
    m.z[:FREE] = 0.0
    m.z[FREE:] = 1.0 / 6.0


@fma_njit
def residual_at(s: Station, rover: Array, law: Law, soil: bool, scale: float, sigma: float, z: Array, m: Motion) -> float:
    """Fill the balance residual and its Jacobian.

    Args:
        s: the balance equations of the pose.
        rover: (P_SIZE,) packed rover.
        law: of the wheels.
        soil: True for the tabulated law, False for friction.
        scale: slip scale of friction over the reference speed.
        sigma: σ.
        z: (9,) unknowns.
        m: work arrays; y, load, force, residual and jacobian are filled.

    Returns:
        Sum of the squares of the residual.
    """
    y, r, J = m.y, m.residual, m.jacobian
    y[:FREE] = z[:FREE]
    for i in range(6):
        root = math.sqrt(z[FREE + i] * z[FREE + i] + 4.0 * sigma * sigma)
        big = 0.5 * (abs(z[FREE + i]) + root)
        other = sigma * sigma / big
        m.load[i], lift = (big, other) if z[FREE + i] >= 0.0 else (other, big)
        y[FREE + i] = law.speed * lift
        m.slope[i, 0], m.slope[i, 1] = m.load[i] / root, -law.speed * lift / root
    r[:] = s.pull
    J[:] = 0.0
    channels = 3 if soil else 2
    for i in range(6):
        f, load = m.force[i], m.load[i]
        ut = us = turn = 0.0
        for k in range(EQUATIONS):
            ut += s.ways[i, 0, k] * y[k]
            us += s.ways[i, 1, k] * y[k]
        radius = rover[P_RADIUS + i]
        if soil:
            for k in range(EQUATIONS):
                turn += s.ways[i, 2, k] * y[k]
            tabulated(
                law.tables[law.table_of[i]], law.weight, load, radius, law.rim[i], ut, us, turn, FLOOR * law.speed, law.limit[i],
                m.scratch, f,
            )  # fmt: skip
        else:
            coulomb(law.friction, load, radius, law.rim[i], ut, us, scale * law.speed, law.limit[i], f)
        r[FREE + i] += load
        J[FREE + i, FREE + i] += m.slope[i, 0]  # J is transposed: rows are unknowns
        for c in range(channels):
            force, by_load = f[FORCE + c], m.slope[i, 0] * f[BY_LOAD + c]
            for k in range(EQUATIONS):
                r[k] += force * s.ways[i, c, k]
                J[FREE + i, k] += by_load * s.ways[i, c, k]
        for n in range(EQUATIONS):
            by_z = 1.0 if n < FREE else m.slope[n - FREE, 1]
            if abs(by_z) < 1e-9 * law.speed:
                continue
            for c in range(channels):
                change = 0.0
                for d in range(channels):
                    change += f[BY_MOTION + 3 * c + d] * s.ways[i, d, n]
                change *= by_z
                for k in range(EQUATIONS):
                    J[n, k] += change * s.ways[i, c, k]
    total = 0.0
    for k in range(EQUATIONS):
        total += r[k] * r[k]
    return total


@njit
def newton(
    s: Station,
    rover: Array,
    law: Law,
    soil: bool,
    scale: float,
    sigma: float,
    most: int,
    halvings: int,
    tolerance: float,
    m: Motion,
) -> int:
    """Solve the balance from m.z.

    Args:
        s, rover, law, soil, scale, sigma: as for `residual_at`.
        most, halvings: number of steps, and of halvings of a step.
        tolerance: largest residual of a solution, of the weight.
        m: work arrays; z is replaced.

    Returns:
        Number of steps; -1 - steps without convergence.
    """
    total = residual_at(s, rover, law, soil, scale, sigma, m.z, m)
    for it in range(most + 1):
        worst = 0.0
        for k in range(EQUATIONS):
            worst = max(worst, abs(m.residual[k]))
            m.step[k] = -m.residual[k]
        if worst < tolerance:
            return it
        if it == most or not (math.isfinite(total) and decompose(m.jacobian, m.order)):
            return -1 - it
        solve_transposed(m.jacobian, m.order, m.step)
        share = 1.0
        for k in range(FREE):
            share = min(share, 2.0 * law.speed / max(abs(m.step[k]), 1e-300))
        better = False
        for _ in range(halvings):
            for k in range(EQUATIONS):
                m.trial[k] = m.z[k] + share * m.step[k]
            trial = residual_at(s, rover, law, soil, scale, sigma, m.trial, m)
            if trial < (1.0 - 0.1 * share) * total:
                better = True
                break
            share *= 0.5
        if not better:
            return -1 - it
        m.z[:] = m.trial
        total = trial
        for k in range(FREE):
            if not abs(m.z[k]) < FASTEST * law.speed:
                return -1 - it
    return -1


@njit
def continued(s: Station, rover: Array, law: Law, soil: bool, first: float, goal: float, m: Motion) -> tuple[int, float]:
    """Solve with slip scales that decrease to a goal.

    Each level starts from the solution of the one before. If a level fails, a level nearer to the last solution follows.

    Args:
        s, rover, law, soil: as for `residual_at`. On soil, the scale sets σ alone.
        first, goal: first and last slip scale over the reference speed.
        m: work arrays; z is the start, replaced by the solution with the smallest slip scale.

    Returns:
        Number of Newton steps; slip scale of the solution, inf if there is none.
    """
    total, scale, solved, ratio = 0, first, math.inf, FIRST_RATIO
    m.kept[:] = m.z
    while True:
        last = scale <= goal
        sigma = SMOOTHING if last else max(0.1 * scale, SMOOTHING)
        count = newton(s, rover, law, soil, scale, sigma, STEPS, HALVINGS, RESIDUAL if last else ROUGH_RESIDUAL, m)
        if count >= 0:
            total += count
            solved = scale
            m.kept[:] = m.z
            if last:
                return total, solved
            ratio = max(ratio * ratio, FIRST_RATIO)
        else:
            total -= count
            m.z[:] = m.kept
            ratio = math.sqrt(ratio)
            if solved == math.inf or ratio > LEAST_RATIO:
                break
        scale = max(solved * ratio, goal)
    if not solved <= ROUGH:
        return total, math.inf
    count = newton(s, rover, law, soil, solved, max(0.1 * solved, SMOOTHING), STEPS, HALVINGS, RESIDUAL, m)
    return (total + count, solved) if count >= 0 else (total - count, math.inf)


@njit
def solve_motion(s: Station, rover: Array, law: Law, m: Motion) -> int:
    """Solve for the motion and the loads at which the wheel forces balance.

    Newton's method starts from the solution at the pose before. If it fails, continuations follow, from that solution and from
    a rover at rest: with decreasing slip scales of friction, and from friction to soil.

    Args:
        s, rover, law: as for `residual_at`.
        m: work arrays; all are those of the solution.

    Returns:
        Number of Newton steps; -1 if no balance was found.
    """
    m.kept[:] = m.z
    count = newton(s, rover, law, law.soil, SLIP_SCALE, SMOOTHING, DIRECT, 2, RESIDUAL, m)
    m.scale[0] = SLIP_SCALE
    if count >= 0:
        return count
    total = -count
    m.z[:] = m.kept
    count, m.scale[0] = continued(s, rover, law, law.soil, NEARBY, SLIP_SCALE, m)
    total += count
    if m.scale[0] <= SLIP_SCALE:
        return total
    reset_motion(m)
    if law.soil:
        count, scale = continued(s, rover, law, False, 1.0, 0.3, m)
        total += count
        if scale == math.inf:
            return -1
    count, m.scale[0] = continued(s, rover, law, law.soil, 1.0, SLIP_SCALE, m)
    return total + count if m.scale[0] < math.inf else -1
