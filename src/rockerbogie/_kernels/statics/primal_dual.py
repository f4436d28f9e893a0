"""Primal-dual steps of LANES cone problems at once.

Both problems balance contact forces in friction cones (`balance`), with one more unknown: the friction coefficient μ, to be
the least (`least_friction` has the conditions), or the tangent θ of gravity's turn in one azimuth, to be the largest:

    greatest θ   such that   Σ F + Σ y = b - θ e,   |F_t| ≤ μ F_n,   y ≥ 0

A step is Mehrotra's predictor and corrector with Nesterov-Todd scaling. The forces need not balance at the start. The velocities
of contacts need not be those of a motion at the start for the least μ; for the greatest θ they must be.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..jit.vectors import larger, on_lanes, root, smaller, where
from .cone_scaling import Cone, Vector, Wheel, read, write
from .lane_algebra import dots, factor, solve
from .lane_rows import (
    BOGIE_LEFT,
    BOGIE_RIGHT,
    CONTACTS,
    EQUATIONS,
    LIMITS,
    LINK,
    OX,
    OY,
    OZ,
    PROBLEM,
    RAY,
    RESULT,
    ROCKER_RATE,
    STATE,
    VX,
    VY,
    WHEELS,
)

Array = NDArray[np.float64]

TINY = 1e-300
FAR = 1e30
BALANCED = 1e-7  # of the weight: residual of forces that count as balanced
BACK = 0.98  # share of the way to the boundary of the cones
TRIES, SHORTER = 5, 0.75  # how often, and to which share, a step is shortened that leaves the cones of the new μ


class Limit:
    """Force that cannot be negative, in one equation."""

    def __init__(self, rows: Any, j: int, v: list[Any]) -> None:
        self.j, self.row = j, LIMITS[j]
        self.on, self.sign = rows[PROBLEM.limit + j], rows[PROBLEM.sign + j]
        self.y, self.w = rows[STATE.y + j], rows[STATE.w + j]
        self.over_y, self.over_w = 1.0 / self.y, 1.0 / self.w
        self.residual = self.sign * v[self.row] - self.w
        self.target: Any = None
        self.dy: Any = None
        self.dw: Any = None


def step(rows: Any, friction: bool, contacts: int) -> None:
    """Take one step in all lanes.

    Args:
        rows: rows of the lane array (`lane_rows`).
        friction: True: least friction coefficient; False: greatest turn of gravity.
        contacts: number of contacts, WHEELS or CONTACTS.

    Writes: STATE (all), RESULT.gap, RESULT.short, RESULT.bowed, RESULT.alpha, RESULT.proof; RAY where gravity turns
    """
    size = EQUATIONS - 1 if friction else EQUATIONS
    mu, price, theta, free = rows[STATE.mu], rows[STATE.price], rows[STATE.theta], rows[PROBLEM.free]
    v = [rows[STATE.v + k] for k in range(size)]
    b = [rows[PROBLEM.b + k] for k in range(size)]
    zero, over_mu = mu * 0.0, 1.0 / mu
    e = [zero] * size if friction else [rows[PROBLEM.e + k] for k in range(size)]
    short = list(b) if friction else [b[k] - theta * e[k] for k in range(size)]
    matrix: list[list[Any]] = [[None] * size for _ in range(size)]
    gap, bowed, left = zero, zero, price - 1.0
    wheels = [Wheel(rows, i, not friction) for i in range(contacts)]
    limits = [Limit(rows, j, v) for j in range(3 if friction else 4)]
    for s in wheels:
        f, u = read(rows, STATE.force, s.i), read(rows, STATE.speed, s.i)
        if friction:
            s.residual = (s.velocity(v) - u) * s.on
        n = s.n.dot(f)
        s.x = Cone(n, (f - s.n * n) * over_mu)
        n = s.n.dot(u)
        s.slide = u - s.n * n
        s.z = Cone(n, s.slide * mu)
        excess_x, excess_z, power = larger(s.x.excess(), TINY), larger(s.z.excess(), TINY), f.dot(u)
        gap = gap + s.on * power
        s.set_scaling(1.0 / root(excess_x), 1.0 / root(excess_z), power, excess_x, excess_z)
        s.add_metric(matrix, mu, friction)
        for k, part in s.generalized(f * s.on):
            short[k] = short[k] - part
        if friction:
            along = s.w.t.dot(s.slide)
            bowed = bowed - s.square * (2.0 * along * along + s.slide.dot(s.slide))
            left = left - s.on * s.slide.dot(s.x.t)
            by_mu = Cone(2.0 * s.square * s.w.n * along, (s.w.t * (2.0 * along) + s.slide) * s.square)
            for k, part in s.generalized(s.x.t * s.on - s.world(by_mu, mu)):
                e[k] = e[k] + part
    for q in limits:
        matrix[q.row][q.row] = matrix[q.row][q.row] + q.on * q.y * q.over_w
        short[q.row] = short[q.row] - q.on * q.sign * q.y
        gap = gap + q.on * q.y * q.w
    if friction:
        gap = gap + mu * price
    tau = gap / rows[PROBLEM.cones]
    over = factor(matrix, size)
    v_e = solve(matrix, over, e)
    bowed = bowed + dots(e, v_e)
    lag = [zero] * size  # generalized force of the residuals of velocities
    if friction:
        for s in wheels:
            s.lag = s.hessian(s.cone(s.residual, mu))
            for k, part in s.generalized(s.world(s.lag, mu)):
                lag[k] = lag[k] + part
    for q in limits:
        lag[q.row] = lag[q.row] + q.on * q.sign * q.y * q.over_w * q.residual
    if friction:
        bowed = bowed + price * over_mu
        held, v_b = b, solve(matrix, over, b)  # `held`: generalized force of the present forces and `short` together
        for k, part in enumerate(v_b):
            rows[RESULT.proof + k] = part
        v_held = [x + y for x, y in zip(v_b, solve(matrix, over, lag), strict=True)]
    else:
        find_sides(rows, wheels, limits, matrix, over, short)
        held = [x - theta * y for x, y in zip(b, e, strict=True)]
        v_held = solve(matrix, over, [x + y for x, y in zip(held, lag, strict=True)])
    sigma, alpha, rest, d_theta, d_price = zero, zero, zero + 1.0, zero, zero
    dv = v
    for phase in range(2):
        if phase == 0:
            v_p = [-x for x in v_held]
        else:
            v_p = [(1.0 - rest) * x - rest * y - z for x, y, z in zip(short, lag, held, strict=True)]
        if friction:
            back = -price if phase == 0 else (sigma * tau - alpha * alpha * d_theta * d_price) * over_mu - price
            short_e = left * rest + back
        else:
            short_e = rest * (1.0 - dots(e, v))
        for s in wheels:
            s.target = s.x * -s.on
            if phase == 1:
                correction = s.corrector(sigma * tau, alpha * alpha) * s.on
                s.target = s.target + correction
                for k, value in s.generalized(s.world(correction, mu)):
                    v_p[k] = v_p[k] + value
            if friction:
                short_e = short_e - s.slide.dot(s.target.t - s.lag.t * rest)
        for q in limits:
            q.target = -q.y
            if phase == 1:
                correction = (sigma * tau - alpha * alpha * q.dy * q.dw) * q.over_w
                q.target = q.target + correction
                v_p[q.row] = v_p[q.row] + q.on * q.sign * correction
        if phase == 1:
            v_p = solve(matrix, over, v_p)
        d_theta = free * (short_e - dots(e, v_p)) / bowed
        dv = [x + y * d_theta for x, y in zip(v_p, v_e, strict=True)]
        rate = zero + 1.0 / FAR
        if friction:
            d_price = free * (back - price * over_mu * d_theta)
            rate = larger(rate, larger(-over_mu * d_theta, -d_price / price))
        for s in wheels:
            s.du = s.velocity(dv) * s.on
            if friction:
                s.du = s.du + s.residual * rest
            s.dz = s.cone(s.du, mu)
            if friction:
                s.dz = Cone(s.dz.n, s.dz.t + s.slide * (s.on * d_theta))
            if phase == 0:
                rate = larger(rate, s.predicted_rate(s.dz))
            else:
                s.dx = s.target - s.hessian(s.dz)
                rate = larger(rate, larger(s.x.rate(s.dx, s.over_x), s.z.rate(s.dz, s.over_z)))
        for q in limits:
            q.dw = q.on * (q.sign * dv[q.row] + rest * q.residual)
            q.dy = q.on * (q.target - q.y * q.over_w * q.dw)
            rate = larger(rate, larger(-q.dy * q.over_y, -q.dw * q.over_w))
        alpha = smaller(BACK / rate, 1.0)
        if phase == 0:
            remains = 1.0 - alpha
            sigma = free * remains * remains * remains + (1.0 - free) * rows[PROBLEM.target] / tau
            rest = 1.0 - free * sigma
    forces = [s.world(s.dx, mu) + s.x.t * (s.on * d_theta) if friction else s.world(s.dx, mu) for s in wheels]
    if friction:
        alpha = inside_new_cones(wheels, forces, mu, alpha, d_theta)
    for s, df in zip(wheels, forces, strict=True):
        write(rows, STATE.force, s.i, read(rows, STATE.force, s.i) + df * alpha)
        write(rows, STATE.speed, s.i, read(rows, STATE.speed, s.i) + s.du * alpha)
    for k in range(size):
        rows[STATE.v + k] = v[k] + alpha * dv[k]
    for q in limits:
        rows[STATE.y + q.j], rows[STATE.w + q.j] = q.y + alpha * q.dy, q.w + alpha * q.dw
    if friction:
        rows[STATE.mu], rows[STATE.price] = mu + alpha * d_theta, price + alpha * d_price
    else:
        rows[STATE.theta] = theta + alpha * d_theta
    worst = zero
    for x in short:
        worst = larger(worst, larger(x, -x))
    rows[RESULT.gap], rows[RESULT.short], rows[RESULT.bowed], rows[RESULT.alpha] = gap, worst, bowed, alpha


def gravity_force(rows: Any, x: Any, y: Any) -> list[Any]:
    """Return the generalized force of horizontal gravity, of the weight.

    Args:
        rows: rows of the lane array (`lane_rows`).
        x, y: its components.
    """
    force: list[Any] = [x * 0.0] * EQUATIONS
    for k, at in ((BOGIE_LEFT, LINK.bogie_left), (BOGIE_RIGHT, LINK.bogie_right), (ROCKER_RATE, LINK.rocker)):
        force[k] = rows[at] * x + rows[at + 1] * y
    cx, cy, cz = rows[LINK.centre], rows[LINK.centre + 1], rows[LINK.centre + 2]
    force[VX], force[VY] = x, y
    force[OX], force[OY], force[OZ] = -cz * y, cz * x, cx * y - cy * x
    return force


def find_sides(
    rows: Any, wheels: list[Wheel], limits: list[Limit], matrix: list[list[Any]], over: list[Any], short: list[Any]
) -> None:
    """Compute how far forces hold while gravity turns along the last half-plane.

    Forces change by the least amount in the metric of the scaling. Close to the boundary of the region that forces hold, they
    move along it.

    Args:
        rows: rows of the lane array (`lane_rows`).
        wheels, limits: contacts and limits, with their scaling.
        matrix, over: factor of the step's matrix.
        short: residual of the balance.

    Writes: RAY.start, RAY.sx, RAY.sy, RAY.left, RAY.right
    """
    one = rows[STATE.mu] * 0.0 + 1.0
    flat = rows[RAY.size] > 0.0
    sx, sy = where(flat, rows[RAY.px] / rows[RAY.size], 0.0), where(flat, rows[RAY.py] / rows[RAY.size], 0.0)
    v = solve(matrix, over, gravity_force(rows, -sy, sx))
    left = right = one * (1.0 / FAR)
    for s in wheels:
        most, along = s.scaled.leaving(s.scale(s.cone(s.velocity(v) * s.on, rows[STATE.mu])), s.over_both)
        right, left = larger(right, most - along), larger(left, most + along)
    for q in limits:
        grows = q.on * q.sign * q.over_w * v[q.row]  # share of the limit's force y
        right, left = larger(right, -grows), larger(left, grows)
    worst = one * 0.0
    for x in short:
        worst = larger(worst, larger(x, -x))
    good = worst < BALANCED
    rows[RAY.start], rows[RAY.sx], rows[RAY.sy] = rows[STATE.theta], sx, sy
    rows[RAY.left], rows[RAY.right] = where(good, BACK / left, 0.0), where(good, BACK / right, 0.0)


def inside_new_cones(wheels: list[Wheel], forces: list[Vector], mu: Any, alpha: Any, d_mu: Any) -> Any:
    """Return the share of a step that keeps forces and velocities in the cones of the new μ.

    Args:
        wheels: contacts with their steps.
        forces: steps of the contact forces.
        mu: friction coefficient before the step.
        alpha: share of the step inside the cones of x and z.
        d_mu: step of the friction coefficient.
    """
    slides = [s.du - s.n * s.n.dot(s.du) for s in wheels]
    across = [df - s.n * s.n.dot(df) for s, df in zip(wheels, forces, strict=True)]
    for _ in range(TRIES):
        new, least = mu + alpha * d_mu, mu * 0.0 + FAR
        for s, slide, df in zip(wheels, slides, across, strict=True):
            force = Cone((s.x.n + alpha * s.dx.n) * new, s.x.t * mu + df * alpha)
            speed = Cone(s.z.n + alpha * s.dz.n, (s.slide + slide * alpha) * new)
            least = smaller(least, smaller(force.excess(), speed.excess()))
        alpha = where(least > 0.0, alpha, SHORTER * alpha)
    return alpha


def balance(rows: Any, contacts: int) -> None:
    """Fill forces that balance exactly, by the least relative change.

    Args:
        rows: rows of the lane array (`lane_rows`).
        contacts: number of contacts, WHEELS or CONTACTS.

    Writes: RESULT.force, RESULT.y
    """
    size = EQUATIONS - 1
    one = rows[STATE.mu] * 0.0 + 1.0
    short = [rows[PROBLEM.b + k] for k in range(size)]
    matrix: list[list[Any]] = [[None] * size for _ in range(size)]
    wheels = [Wheel(rows, i, False) for i in range(contacts)]
    limits = [Limit(rows, j, short) for j in range(3)]
    for s in wheels:
        force = read(rows, STATE.force, s.i)
        n = s.n.dot(force)
        s.w, s.square = Cone(one, s.n * 0.0), n * n * s.on  # the metric of `add_metric` is then n²
        s.add_metric(matrix, one, True)
        for k, part in s.generalized(force * s.on):
            short[k] = short[k] - part
    for q in limits:
        matrix[q.row][q.row] = matrix[q.row][q.row] + q.on * q.y * q.y
        short[q.row] = short[q.row] - q.on * q.sign * q.y
    shift = solve(matrix, factor(matrix, size), short)
    for s in wheels:
        write(rows, RESULT.force, s.i, read(rows, STATE.force, s.i) + s.velocity(shift) * s.square)
    for q in limits:
        rows[RESULT.y + q.j] = q.y + q.on * q.sign * q.y * q.y * shift[q.row]


def _friction(rows: Any) -> None:
    """Take one step of the least friction coefficient.

    Args:
        rows: rows of the lane array.
    """
    step(rows, True, WHEELS)


def _turn(rows: Any) -> None:
    """Take one step of the greatest turn of gravity.

    Args:
        rows: rows of the lane array.
    """
    step(rows, False, WHEELS)


def _turn_lines(rows: Any) -> None:
    """Take one step of the greatest turn of gravity, contacts along lines included.

    Args:
        rows: rows of the lane array.
    """
    step(rows, False, CONTACTS)


def _balance(rows: Any) -> None:
    """Fill forces of six contacts that balance exactly.

    Args:
        rows: rows of the lane array.
    """
    balance(rows, WHEELS)


def _balance_lines(rows: Any) -> None:
    """Fill forces that balance exactly, contacts along lines included.

    Args:
        rows: rows of the lane array.
    """
    balance(rows, CONTACTS)


friction_step = on_lanes(_friction)
_balance_six, _balance_twelve = on_lanes(_balance), on_lanes(_balance_lines)
_turn_six, _turn_twelve = on_lanes(_turn), on_lanes(_turn_lines)


@njit
def turn_step(lanes: Array, contacts: int) -> None:
    """Take one step of the greatest turn of gravity in all lanes.

    Args:
        lanes: the lane array.
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    if contacts == WHEELS:
        _turn_six(lanes)
    else:
        _turn_twelve(lanes)


@njit
def balance_step(lanes: Array, contacts: int) -> None:
    """Fill forces that balance exactly in all lanes.

    Args:
        lanes: the lane array.
        contacts: number of contacts, WHEELS or CONTACTS.
    """
    if contacts == WHEELS:
        _balance_six(lanes)
    else:
        _balance_twelve(lanes)
