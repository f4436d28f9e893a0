"""Motion and loads of a rover whose wheel forces balance: Newton's method on nine equations.

On rigid terrain, friction has a primal-dual Newton method (Chan, Golub and Mulet 1999, SIAM J. Sci. Comput. 20, 1964-1977):
Newton's method on the force of regularised friction fails where a wheel begins to slip, or to slip another way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..statics.balance import EQUATIONS
from .balance_residual import Law, Motion, reset_motion, residual_at
from .contact_law import TORQUE
from .linear import copy_numbers, decompose, solve_transposed
from .station import FREE, Station

Array = NDArray[np.float64]

RESIDUAL = 1e-10  # of the weight
DIRECT = 5  # Newton steps from the solution nearby
STEPS = 20  # Newton steps of one level of a continuation
PRIMAL_DUAL = 24  # steps of the primal-dual method
HALVINGS = 5  # of a Newton step of a continuation; from the solution nearby, 2
SMOOTHING = 1e-6  # σ of a solution
SLIP_SCALE = 1e-3  # of the reference speed: slip at which friction reaches 70 % of its limit
ROUGH = 0.05  # largest slip scale of a solution, where none is found at SLIP_SCALE
NEARBY = 0.03  # slip scale from which a continuation from the solution nearby starts
FIRST_RATIO, LEAST_RATIO = 0.2, 0.8  # of successive slip scales: at first, and before a continuation ends
ROUGH_RESIDUAL = 1e-4  # of the weight, of levels before the last
START_SCALE, START_RATIO = 0.3, 0.3  # first slip scale of the primal-dual method, and ratio of successive ones
SLOW_SCALE, SLOW_RATIO = 1.0, 0.5  # the same of its second attempt
FAR = 0.4  # residual, of the weight, from which it starts with a larger slip scale
LONGEST = 0.3  # of the weight: largest change of a load in one of its steps
RELAXATIONS = 150  # steps of a relaxation
DAMPED = 1.0  # first damping of a relaxation: at the reference speed, this share of the weight
LEAST_DAMPED, MOST_DAMPED = 1e-12, 30.0  # least and largest damping
LESS_DAMPED, MORE_DAMPED = 0.4, 3.0  # factors on the damping after a step that decreases the residual, and after another
UNLIMITED = 2.0**40  # factor on torque limits at which they have no effect
DECREASE, LEAST_DECREASE = 0.9, 0.995  # of torque limits: at first, and before the search ends
FASTEST = 30.0  # times the reference speed: a faster motion is no equilibrium


@inlined
def largest(values: Array) -> float:
    """Return the largest absolute value, NaN if the first is NaN.

    Args:
        values: (n,).
    """
    worst = abs(values[0])
    for k in range(1, values.shape[0]):
        worst = max(worst, abs(values[k]))
    return worst


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
    total = residual_at(s, rover, law, soil, scale, sigma, m.z, 0.0, m)
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
            trial = residual_at(s, rover, law, soil, scale, sigma, m.trial, 0.0, m)
            if trial < (1.0 - 0.1 * share) * total:
                better = True
                break
            share *= 0.5
        if not better:
            return -1 - it
        copy_numbers(m.trial, m.z)
        total = trial
        for k in range(FREE):
            if not abs(m.z[k]) < FASTEST * law.speed:
                return -1 - it
    return -1


@njit
def primal_dual(s: Station, rover: Array, law: Law, first: float, ratio: float, m: Motion) -> int:
    """Solve the balance on rigid terrain from m.z, by the primal-dual method.

    The slip scale starts larger if the start is far from balance, and decreases with each step.

    Args:
        s, rover, law: as for `residual_at`.
        first, ratio: first slip scale over the reference speed of a start that is far from balance, and ratio of successive ones.
        m: work arrays; z is replaced.

    Returns:
        Number of steps; -1 - steps without convergence.
    """
    scale, sigma = SLIP_SCALE, SMOOTHING
    total = residual_at(s, rover, law, False, scale, sigma, m.z, 0.0, m)
    worst = largest(m.residual)
    if worst > FAR:
        scale = max(first * min(worst, 1.0), SLIP_SCALE)
        sigma = 0.1 * scale
        total = residual_at(s, rover, law, False, scale, sigma, m.z, 0.0, m)
    for it in range(PRIMAL_DUAL + 1):
        if scale == SLIP_SCALE and largest(m.residual) < RESIDUAL:
            return it
        for k in range(EQUATIONS):
            m.step[k] = -m.residual[k]
        if it == PRIMAL_DUAL or not (math.isfinite(total) and decompose(m.jacobian, m.order)):
            return -1 - it
        solve_transposed(m.jacobian, m.order, m.step)
        share = 1.0
        for k in range(EQUATIONS):
            share = min(share, (2.0 * law.speed if k < FREE else LONGEST) / max(abs(m.step[k]), 1e-300))
        for k in range(EQUATIONS):
            m.z[k] += share * m.step[k]
        for k in range(FREE):
            if not abs(m.z[k]) < FASTEST * law.speed:
                return -1 - it
        scale = max(ratio * scale, SLIP_SCALE)
        sigma = 0.1 * scale if scale > SLIP_SCALE else SMOOTHING
        total = residual_at(s, rover, law, False, scale, sigma, m.z, share, m)
    return -1 - PRIMAL_DUAL


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
    copy_numbers(m.z, m.kept)
    while True:
        last = scale <= goal
        sigma = SMOOTHING if last else max(0.1 * scale, SMOOTHING)
        count = newton(s, rover, law, soil, scale, sigma, STEPS, HALVINGS, RESIDUAL if last else ROUGH_RESIDUAL, m)
        if count >= 0:
            total += count
            solved = scale
            copy_numbers(m.z, m.kept)
            if last:
                return total, solved
            ratio = max(ratio * ratio, FIRST_RATIO)
        else:
            total -= count
            copy_numbers(m.kept, m.z)
            ratio = math.sqrt(ratio)
            if solved == math.inf or ratio > LEAST_RATIO:
                break
        scale = max(solved * ratio, goal)
    if not solved <= ROUGH:
        return total, math.inf
    count = newton(s, rover, law, soil, solved, max(0.1 * solved, SMOOTHING), STEPS, HALVINGS, RESIDUAL, m)
    return (total + count, solved) if count >= 0 else (total - count, math.inf)


@inlined
def add_dampers(s: Station, damping: float, jacobian: Array) -> None:
    """Add a viscous damper at the first contact of each wheel to a Jacobian.

    Args:
        s: of the pose.
        damping: of each, weights per m/s.
        jacobian: (n, n) residual by unknown, one unknown a row; changed.
    """
    for i in range(6):
        for a in range(FREE):
            for b in range(FREE):
                drag = s.ways[i, 0, a] * s.ways[i, 0, b] + s.ways[i, 1, a] * s.ways[i, 1, b]
                jacobian[a, b] -= damping * drag


@njit
def relax(s: Station, rover: Array, law: Law, m: Motion) -> int:
    """Solve the balance on soil by pseudo-transient continuation from m.z.

    The rover decelerates as if each contact had a viscous damper (implicit Euler steps). The damping decreases with the residual,
    so that the last steps are Newton's. A step may increase the residual: kinks of the soil's table hold Newton's method up.

    Args:
        s, rover, law: as for `residual_at`.
        m: work arrays; z is replaced.

    Returns:
        Number of steps; -1 - steps without convergence.
    """
    damping, before = DAMPED, math.inf
    for it in range(RELAXATIONS + 1):
        total = residual_at(s, rover, law, True, SLIP_SCALE, SMOOTHING, m.z, 0.0, m)
        if largest(m.residual) < RESIDUAL:
            return it
        damping = min(max(damping * (LESS_DAMPED if total < before else MORE_DAMPED), LEAST_DAMPED), MOST_DAMPED)
        before = total
        for k in range(EQUATIONS):
            m.step[k] = -m.residual[k]
        add_dampers(s, damping / (6.0 * law.speed), m.jacobian)
        if it == RELAXATIONS or not (math.isfinite(total) and decompose(m.jacobian, m.order)):
            return -1 - it
        solve_transposed(m.jacobian, m.order, m.step)
        share = 1.0
        for k in range(EQUATIONS):
            share = min(share, (law.speed if k < FREE else LONGEST) / max(abs(m.step[k]), 1e-300))
        for k in range(EQUATIONS):
            m.z[k] += share * m.step[k]
        for k in range(FREE):
            if not abs(m.z[k]) < FASTEST * law.speed:
                return -1 - it
    return -1 - RELAXATIONS


@njit
def solve_motion(s: Station, rover: Array, law: Law, m: Motion) -> int:
    """Solve for the motion and the loads at which the wheel forces balance.

    Newton's method starts from the solution at the pose before; on rigid terrain it is the primal-dual one. If it fails,
    continuations follow, from that solution and from a rover at rest: with decreasing slip scales of friction, and from
    friction to soil. On soil, a relaxation from rest comes last.

    Args:
        s, rover, law: as for `residual_at`.
        m: work arrays; all are those of the solution.

    Returns:
        Number of Newton steps; -1 if no balance was found.
    """
    copy_numbers(m.z, m.kept)
    if law.soil:
        count = newton(s, rover, law, True, SLIP_SCALE, SMOOTHING, DIRECT, 2, RESIDUAL, m)
    else:
        count = primal_dual(s, rover, law, START_SCALE, START_RATIO, m)
        if count < 0:
            copy_numbers(m.kept, m.z)
            more = primal_dual(s, rover, law, SLOW_SCALE, SLOW_RATIO, m)
            count = more - count if more >= 0 else more + count
    m.scale[0] = SLIP_SCALE
    if count >= 0:
        return count
    total = -count
    copy_numbers(m.kept, m.z)
    count, m.scale[0] = continued(s, rover, law, law.soil, NEARBY, SLIP_SCALE, m)
    total += count
    if m.scale[0] <= SLIP_SCALE:
        return total
    reset_motion(m)
    if law.soil:
        count, scale = continued(s, rover, law, False, 1.0, 0.3, m)
        total += count
        if scale < math.inf:
            count, m.scale[0] = continued(s, rover, law, True, 1.0, SLIP_SCALE, m)
            total += count
            if m.scale[0] < math.inf:
                return total
        reset_motion(m)
        count, m.scale[0] = relax(s, rover, law, m), SLIP_SCALE
        return total + count if count >= 0 else -1
    count, m.scale[0] = continued(s, rover, law, False, 1.0, SLIP_SCALE, m)
    return total + count if m.scale[0] < math.inf else -1


@njit
def scale_limits(law: Law, factor: float) -> None:
    """Multiply the torque limits.

    Args:
        law: limit is changed.
        factor: above 0.
    """
    for i in range(6):
        law.limit[i] *= factor


@njit
def solve_limited(s: Station, rover: Array, law: Law, m: Motion) -> int:
    """Solve for the motion with motors of limited torque.

    From rest, all wheels slip and need more torque than at the balance. Where all motors are at their limits, the forces do not
    depend on the motion, and Newton's method ends. So the limits are first without effect, and then decrease.

    Args:
        s, rover, law: as for `residual_at`; law.limit is changed in between.
        m: work arrays; all are those of the solution.

    Returns:
        Number of Newton steps; -1 if no balance was found.
    """
    total, least = solve_motion(s, rover, law, m), math.inf
    for i in range(6):
        least = min(least, law.limit[i])
    if total >= 0 or least == math.inf:
        return total
    reset_motion(m)
    scale_limits(law, UNLIMITED)
    total = solve_motion(s, rover, law, m)
    scale_limits(law, 1.0 / UNLIMITED)
    if total < 0:
        return -1
    factor, ratio = 1.0, DECREASE
    for i in range(6):
        factor = max(factor, abs(m.force[i, TORQUE]) / law.limit[i])
    copy_numbers(m.z, m.kept)
    while factor > 1.0:
        goal = max(ratio * factor, 1.0)
        scale_limits(law, goal)
        if law.soil:
            count = newton(s, rover, law, True, SLIP_SCALE, SMOOTHING, STEPS, HALVINGS, RESIDUAL, m)
        else:
            count = primal_dual(s, rover, law, START_SCALE, START_RATIO, m)
        scale_limits(law, 1.0 / goal)
        if count >= 0:
            factor, total = goal, total + count
            copy_numbers(m.z, m.kept)
        else:
            copy_numbers(m.kept, m.z)
            ratio = math.sqrt(ratio)
            if ratio > LEAST_DECREASE:
                return -1
    return total
