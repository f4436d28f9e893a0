"""Balance residual of a rover's wheel forces, and its Jacobian.

Unknowns are the rates w of x, y and yaw and one number a of each contact. The load is n = (a + √(a² + 4 σ²)) / 2 times the
weight, and the lift rate is u = (√(a² + 4 σ²) − a) / 2 times the reference speed. Their product n u is σ²: for σ → 0 a wheel is
either loaded or lifts. A wheel off the ground has no load (σ²) and the lift rate −a.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined, njit, owning_njit
from ..jit.raw_views import unowned_view
from ..model.linkage import P_RADIUS
from ..soil.table import SPACE
from ..statics.balance import EQUATIONS
from .contact_law import BY_LOAD, BY_MOTION, DUAL_SIZE, FORCE, ROW, coulomb, tabulated
from .linear import copy_numbers
from .station import FREE, Station

Array = NDArray[np.float64]

FLOOR = 1e-9  # of the reference speed


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
    free: Array  # (6,) 1 for a wheel off the ground, which has no load and moves up or down freely; else 0


class Motion(NamedTuple):
    """Work arrays of the solve; `z` starts the next one."""

    z: Array  # (9,) unknowns: w, m/s and rad/s, and a
    y: Array  # (9,) w and lift rates
    load: Array  # (6,) over the weight
    force: Array  # (6, ROW) of the laws
    residual: Array  # (9,)
    jacobian: Array  # (9, 9) residual by unknown, one unknown a row
    step: Array  # (9,)
    trial: Array  # (9,)
    kept: Array  # (9,)
    slope: Array  # (6, 2) of load and lift rate by a
    scale: Array  # (1,) slip scale of the solution over the reference speed
    scratch: Array  # (20 + SPACE,) of the tables
    dual: Array  # (6, DUAL_SIZE) directions of friction (`coulomb`)
    order: NDArray[np.int64]  # (9,)


MOTION_SIZE = 6 * EQUATIONS + 6 + 6 * ROW + EQUATIONS * EQUATIONS + 12 + 1 + 20 + SPACE + 6 * DUAL_SIZE


@owning_njit
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
    n += 20 + SPACE
    dual = b[n : n + 6 * DUAL_SIZE].reshape(6, DUAL_SIZE)
    k = EQUATIONS
    return Motion(
        b[:k], b[k : 2 * k], load, force, b[2 * k : 3 * k], jacobian, b[3 * k : 4 * k], b[4 * k : 5 * k], b[5 * k : 6 * k],
        slope, scale, scratch, dual, unowned_view(order),
    )  # fmt: skip


@njit
def reset_motion(m: Motion) -> None:
    """Set the start of a solve to a rover at rest, its weight shared equally.

    Args:
        m: work arrays; z is set.
    """
    m.z[:FREE] = 0.0
    m.z[FREE:] = 1.0 / 6.0


@inlined
def add_column(ways: Array, by_motion: Array, soil: bool, n: int, share: float, column: Array) -> None:
    """Add the change of a wheel's forces with one rate to a column of the Jacobian.

    Args:
        ways: (3, 9) of the wheel (`Station`).
        by_motion: (9,) change of its forces with the motion of the contact, (3, 3) in a row.
        soil: True for three channels, False for two.
        n: index of the rate.
        share: of the rate.
        column: (9,) changed.
    """
    along, side = ways[0], ways[1]
    a, b = share * along[n], share * side[n]
    ct, cs = by_motion[0] * a + by_motion[1] * b, by_motion[3] * a + by_motion[4] * b
    if soil:
        link = ways[2]
        c = share * link[n]
        ct, cs = ct + by_motion[2] * c, cs + by_motion[5] * c
        couple = by_motion[6] * a + by_motion[7] * b + by_motion[8] * c
        for k in range(EQUATIONS):
            column[k] += couple * link[k]
    for k in range(EQUATIONS):
        column[k] += ct * along[k] + cs * side[k]


@fma_njit
def residual_at(
    s: Station, rover: Array, law: Law, soil: bool, scale: float, sigma: float, z: Array, share: float, m: Motion
) -> float:
    """Fill the balance residual and its Jacobian.

    Args:
        s: the balance equations of the pose.
        rover: (P_SIZE,) packed rover.
        law: of the wheels.
        soil: True for the tabulated law, False for friction.
        scale: slip scale of friction over the reference speed.
        sigma: σ.
        z: (9,) unknowns.
        share: 0 for the exact Jacobian. Otherwise `z` has moved by this share of a Newton step since the last call, and the
            Jacobian is that of the primal-dual method (`coulomb`).
        m: work arrays; y, load, force, residual, jacobian and dual are filled.

    Returns:
        Sum of the squares of the residual.
    """
    y, r, J = m.y, m.residual, m.jacobian
    copy_numbers(z[:FREE], y[:FREE])
    for i in range(6):
        root = math.sqrt(z[FREE + i] * z[FREE + i] + 4.0 * sigma * sigma)
        big = 0.5 * (abs(z[FREE + i]) + root)
        other = sigma * sigma / big
        m.load[i], lift = (big, other) if z[FREE + i] >= 0.0 else (other, big)
        if law.free[i] == 0.0:
            y[FREE + i] = law.speed * lift
            m.slope[i, 0], m.slope[i, 1] = m.load[i] / root, -law.speed * lift / root
        else:
            m.load[i], y[FREE + i] = sigma * sigma, -law.speed * z[FREE + i]
            m.slope[i, 0], m.slope[i, 1] = 0.0, -law.speed
    copy_numbers(s.pull, r)
    J[:] = 0.0
    for i in range(6):
        f, load, ways = m.force[i], m.load[i], s.ways[i]
        along, side, link, row = ways[0], ways[1], ways[2], J[FREE + i]  # J is transposed: rows are unknowns
        ut = us = turn = 0.0
        for k in range(EQUATIONS):
            ut += along[k] * y[k]
            us += side[k] * y[k]
        radius = rover[P_RADIUS + i]
        if soil:
            for k in range(EQUATIONS):
                turn += link[k] * y[k]
            tabulated(
                law.tables[law.table_of[i]], law.weight, load, radius, law.rim[i], ut, us, turn, FLOOR * law.speed, law.limit[i],
                m.scratch, f,
            )  # fmt: skip
        else:
            coulomb(law.friction, load, radius, law.rim[i], ut, us, scale * law.speed, law.limit[i], share, m.dual[i], f)
        r[FREE + i] += load
        ft, fs, by_load = f[FORCE], f[FORCE + 1], m.slope[i, 0]
        nt, ns = by_load * f[BY_LOAD], by_load * f[BY_LOAD + 1]
        row[FREE + i] += by_load
        for k in range(EQUATIONS):
            r[k] += ft * along[k] + fs * side[k]
            row[k] += nt * along[k] + ns * side[k]
        if soil:
            couple, nc = f[FORCE + 2], by_load * f[BY_LOAD + 2]
            for k in range(EQUATIONS):
                r[k] += couple * link[k]
                row[k] += nc * link[k]
        by_motion = f[BY_MOTION:]
        for n in range(FREE):
            add_column(ways, by_motion, soil, n, 1.0, J[n])
        for n in range(6):
            if abs(m.slope[n, 1]) >= 1e-9 * law.speed:
                add_column(ways, by_motion, soil, FREE + n, m.slope[n, 1], J[FREE + n])
    total = 0.0
    for k in range(EQUATIONS):
        total += r[k] * r[k]
    return total
