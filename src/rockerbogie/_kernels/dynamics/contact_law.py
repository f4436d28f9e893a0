"""Force between a wheel and the terrain: one interface for all laws.

A law fills a row of numbers for one wheel. Forces are in units of the rover's weight, torques are divided by it (m). Channels are
traction, side force and a couple about the axle on the wheel's link. The couple is the part of the motor torque that traction at
the contact point does not explain. Velocities are those of the contact as if the wheel were braked, forward and to the left
(m/s), and the link's rate about the axle (rad/s).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, njit
from ..soil.layout import DRAWBAR, OVERLOADED, SIDE
from ..soil.layout import SINKAGE as DEPTH
from ..soil.layout import TORQUE as MOTOR
from ..soil.table import motion_table_forces

Array = NDArray[np.float64]

FORCE = 0  # (3,) traction, side force, couple
BY_LOAD = 3  # (3,) their change per load
BY_MOTION = 6  # (3, 3) their change per velocity
TORQUE, RIM, SINKAGE, OVERLOAD = 15, 16, 17, 18  # motor torque (m), rim speed (m/s), sinkage (m), 1 if the soil fails
ROW = 19

DUAL_SIZE = 5  # direction of friction (2,), slip velocity (2,) and its size of the last evaluation

ROOT_STEPS = 40  # of the search for the rim speed at a torque limit


@fma_njit
def coulomb(
    friction: float, load: float, radius: float, rim: float, along: float, side: float, small: float, limit: float,
    share: float, dual: Array, f: Array,
) -> None:  # fmt: skip
    """Fill the friction force of a wheel on rigid terrain, regularised.

    The force opposes the slip velocity v with the size μ n |v| / S, S = sqrt(|v|² + small²). If the motor's torque would exceed
    its limit, the wheel turns at the rate at which the torque equals the limit.

    In the primal-dual method, the direction d of the force is an unknown, with the equation S d = v. A Newton step moves v by dv
    and d to (v + dv − d (v · dv) / S) / S. With d = v / S, the change of the force with v is the exact one.

    Args:
        friction: coefficient of friction μ.
        load: normal force n over the weight.
        radius: m.
        rim: commanded rate times radius, m/s.
        along, side: velocity of the contact, m/s.
        small: m/s.
        limit: largest motor torque over the weight, m.
        share: of a Newton step that has been taken since the last call; 0 sets d to v / S.
        dual: (DUAL_SIZE,) d, and v and S of the last call; replaced.
        f: (ROW,) filled.
    """
    a, b = rim - along, -side
    size = math.sqrt(a * a + b * b + small * small)
    most = friction * load
    if share > 0.0:
        before = dual[4]
        da, db = (a - dual[2]) / share, (b - dual[3]) / share
        along_v = (dual[2] * da + dual[3] * db) / before
        dual[0] += share * ((dual[2] + da - dual[0] * along_v) / before - dual[0])
        dual[1] += share * ((dual[3] + db - dual[1] * along_v) / before - dual[1])
        big = max(math.sqrt(dual[0] * dual[0] + dual[1] * dual[1]), 1.0)
        dual[0], dual[1] = dual[0] / big, dual[1] / big
    else:
        dual[0], dual[1] = a / size, b / size
    dual[2], dual[3], dual[4] = a, b, size
    t = most * a / size
    f[:] = 0.0
    if abs(t) * radius <= limit:
        stiff = most / size
        f[FORCE], f[FORCE + 1], f[RIM] = t, most * b / size, rim
        f[BY_LOAD], f[BY_LOAD + 1] = friction * a / size, friction * b / size
        f[BY_MOTION], f[BY_MOTION + 1] = stiff * (dual[0] * a / size - 1.0), stiff * dual[0] * b / size
        f[BY_MOTION + 3], f[BY_MOTION + 4] = stiff * dual[1] * a / size, stiff * (dual[1] * b / size - 1.0)
    else:
        part = limit / (radius * most)
        rest = math.sqrt(1.0 - part * part)
        size = math.sqrt(b * b + small * small)
        f[FORCE] = math.copysign(limit / radius, t)
        f[RIM] = along + math.copysign(part * size / rest, t)
        f[FORCE + 1], f[BY_LOAD + 1] = most * rest * b / size, friction * b / (size * rest)
        f[BY_MOTION + 4] = -most * rest * small * small / (size * size * size)
    f[TORQUE] = radius * f[FORCE]


@njit
def tabulated(
    table: Array, weight: float, load: float, radius: float, rim: float, along: float, side: float, turn: float, floor: float,
    limit: float, scratch: Array, f: Array,
) -> None:  # fmt: skip
    """Fill the forces of a wheel on soil from its table.

    If the motor's torque would exceed its limit, the wheel turns at the rate at which the torque equals the limit.

    Args:
        table: packed table of a wheel (`soil.table`).
        weight: N.
        load: normal force over the weight.
        radius: m.
        rim: commanded rate times radius, m/s.
        along, side, turn: velocities of the contact and its link, m/s and rad/s.
        floor: m/s, added to the axle's speed so that a wheel at rest has a direction.
        limit: largest motor torque over the weight, m.
        scratch: (20 + SPACE,) scratch.
        f: (ROW,) filled.
    """
    out, space = scratch[:20].reshape(4, 5), scratch[20:]
    vx = along + radius * turn + floor
    spin = rim + radius * turn
    code = motion_table_forces(table, weight * load, spin, vx, side, out, space)
    held = abs(out[MOTOR, 0]) > limit * weight
    if held:
        goal = math.copysign(limit * weight, out[MOTOR, 0])
        way = math.copysign(1.0, goal)
        high, low = spin, vx - way * (abs(vx) + abs(spin))
        for _ in range(ROOT_STEPS):
            spin = 0.5 * (high + low)
            code = motion_table_forces(table, weight * load, spin, vx, side, out, space)
            if way * (out[MOTOR, 0] - goal) > 0.0:
                high = spin
            else:
                low = spin
        for n in range(4):
            if n != MOTOR and abs(out[MOTOR, 2]) > 0.0:
                share = out[n, 2] / out[MOTOR, 2]
                for k in (1, 3, 4):
                    out[n, k] -= share * out[MOTOR, k]
                out[n, 2] = 0.0
        for k in range(1, 5):
            out[MOTOR, k] = 0.0
    for c in range(3):
        for k in range(5):
            if c == 0:
                value = out[DRAWBAR, k]
            elif c == 1:
                value = out[SIDE, k]
            else:
                value = radius * out[DRAWBAR, k] - out[MOTOR, k]
            if k == 0:
                f[FORCE + c] = value / weight
            elif k == 1:
                f[BY_LOAD + c] = value
            elif k == 2:
                f[BY_MOTION + 3 * c + 2] = radius * value / weight
            elif k == 3:
                f[BY_MOTION + 3 * c] = value / weight
                f[BY_MOTION + 3 * c + 2] += radius * value / weight
            else:
                f[BY_MOTION + 3 * c + 1] = value / weight
    f[TORQUE], f[RIM], f[SINKAGE] = out[MOTOR, 0] / weight, spin - radius * turn, out[DEPTH, 0]
    f[OVERLOAD] = 1.0 if code == OVERLOADED else 0.0
