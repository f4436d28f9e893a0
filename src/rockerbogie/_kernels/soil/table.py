"""Tabulated wheel forces with derivatives, for use inside other kernels.

The forces are a C² spline of load, slip and slip angle.
A table is one flat array: a packed law (`layout`), a header, and for laws with sinkage the coefficients of a uniform cubic
B-spline. Several tables of one size can be stacked, `tables[k]` is then table k. `rockerbogie.soil.table.tabulate` builds it.

The spline's variables are smooth functions of the motion (rim, vx, vy), with D = (rim + vx) / 2:
log(load); p = (rim - vx) / (rim + vx), which is slip / (2 - |slip|); q = vy / (D + sqrt(D² + vy²)).
p and q are stretched around 0 by t(p) = p (1 + sqrt((1 + k²) / (p² + k²))) / 2.
The forces of COULOMB and CURVE are computed directly.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, owning_fma_njit
from .forces import motion_of
from .layout import COMPUTED, DRAWBAR, L_KIND, L_RADIUS, LAW_SIZE, OUT_OF_RANGE, OVERLOADED, SIDE, SINKAGE, SOIL, TORQUE
from .simple import simple_forces

Array = NDArray[np.float64]

#: Header after the packed law: numbers of nodes, the least load (N), the step of log(load), stretches, the deepest sinkage (m).
T_LOADS, T_SLIPS, T_ANGLES, T_LOAD, T_LOAD_STEP, T_SLIP_STRETCH, T_ANGLE_STRETCH, T_DEEPEST = range(LAW_SIZE, LAW_SIZE + 8)
#: Coefficients [load][slip][angle][output] start here; each axis has two more coefficients than nodes.
T_VALUES = LAW_SIZE + 8

#: Size of the work space of a force.
SPACE = 68
#: Part of the deepest sinkage from which a tabulated wheel counts as overloaded.
DEEP = 0.995
Basis = tuple[float, float, float, float]


@fma_njit
def basis(f: float) -> Basis:
    """Return the four cubic B-splines of a cell.

    Args:
        f: position in the cell, 0 to 1.

    Returns:
        Their values.
    """
    g = 1.0 - f
    return g * g * g / 6.0, (4.0 + f * f * (3.0 * f - 6.0)) / 6.0, (1.0 + f * (3.0 + f * (3.0 - 3.0 * f))) / 6.0, f * f * f / 6.0


@fma_njit
def basis_slope(f: float) -> Basis:
    """Return the derivatives of the four cubic B-splines of a cell.

    Args:
        f: position in the cell, 0 to 1.

    Returns:
        Their derivatives with respect to f.
    """
    g = 1.0 - f
    return -0.5 * g * g, f * (1.5 * f - 2.0), 0.5 + f * (1.0 - 1.5 * f), 0.5 * f * f


@fma_njit
def spline_forces(table: Array, load: float, rim: float, vx: float, vy: float, out: Array, space: Array) -> int:
    """Fill the tabulated forces of a wheel on soil that turns forward and moves forward.

    Args:
        table: packed table of kind SOIL.
        load: N. Below the table's least load the ratios of force to load are constant.
        rim, vx, vy: motion; rim and vx at least 0, not all 0.
        out: (4, 5) filled as by `motion_table_forces`.
        space: (SPACE,) scratch.

    Returns:
        COMPUTED, OUT_OF_RANGE (load above the table) or OVERLOADED.
    """
    loads, slips, angles = int(table[T_LOADS]), int(table[T_SLIPS]), int(table[T_ANGLES])
    code = COMPUTED
    # load
    step = table[T_LOAD_STEP]
    x, x_slope, fill = 0.0, 0.0, 1.0
    if load > table[T_LOAD]:
        x = math.log(load / table[T_LOAD]) / step
        x_slope = 1.0 / step
        if x > loads - 1.0:
            x, x_slope = loads - 1.0, 0.0
            code = OUT_OF_RANGE
    else:
        fill = max(load, 0.0) / table[T_LOAD]
    n_load = min(int(x), loads - 2)
    # slip
    mean = 0.5 * (rim + vx)
    size = math.sqrt(mean * mean + vy * vy)
    mean = max(mean, 1e-9 * size)
    p = min(max(0.5 * (rim - vx) / mean, -1.0), 1.0)
    k = table[T_SLIP_STRETCH]
    root = p * p + k * k
    stretch = math.sqrt((1.0 + k * k) / root)
    half = 0.5 * (slips - 1.0)
    y = half * (1.0 + 0.5 * p * (1.0 + stretch))
    y_p = 0.5 * half * (1.0 + stretch * k * k / root)
    n_slip = min(int(y), slips - 2)
    y_rim, y_vx = y_p * 0.5 * (1.0 - p) / mean, -y_p * 0.5 * (1.0 + p) / mean
    # slip angle, by symmetry of |vy|
    sign = math.copysign(1.0, vy)
    across = abs(vy)
    q = across / (mean + size)
    k = table[T_ANGLE_STRETCH]
    root = q * q + k * k
    stretch = math.sqrt((1.0 + k * k) / root)
    w = 0.5 * (angles - 1.0) * q * (1.0 + stretch)
    w_q = 0.5 * (angles - 1.0) * (1.0 + stretch * k * k / root)
    n_angle = min(int(w), angles - 2)
    w_q /= size * (mean + size)
    w_vy, w_mean = sign * w_q * mean, -0.5 * w_q * across
    a, b, c = basis(x - n_load), basis(y - n_slip), basis(w - n_angle)
    da, db, dc = basis_slope(x - n_load), basis_slope(y - n_slip), basis_slope(w - n_angle)
    one, two = np.uint64(4 * (angles + 2)), np.uint64(8 * (angles + 2))
    three, plane = np.uint64(12 * (angles + 2)), np.uint64(4 * (angles + 2) * (slips + 2))
    start = np.uint64(T_VALUES + 4 * (n_angle + (angles + 2) * (n_slip + (slips + 2) * n_load)))
    for m in range(16):  # angle and output; LLVM vectorises this loop: indices without a sign need no test
        r = start + np.uint64(m)
        p0 = b[0] * table[r] + b[1] * table[r + one] + b[2] * table[r + two] + b[3] * table[r + three]
        q0 = db[0] * table[r] + db[1] * table[r + one] + db[2] * table[r + two] + db[3] * table[r + three]
        r += plane
        p1 = b[0] * table[r] + b[1] * table[r + one] + b[2] * table[r + two] + b[3] * table[r + three]
        q1 = db[0] * table[r] + db[1] * table[r + one] + db[2] * table[r + two] + db[3] * table[r + three]
        r += plane
        p2 = b[0] * table[r] + b[1] * table[r + one] + b[2] * table[r + two] + b[3] * table[r + three]
        q2 = db[0] * table[r] + db[1] * table[r + one] + db[2] * table[r + two] + db[3] * table[r + three]
        r += plane
        p3 = b[0] * table[r] + b[1] * table[r + one] + b[2] * table[r + two] + b[3] * table[r + three]
        q3 = db[0] * table[r] + db[1] * table[r + one] + db[2] * table[r + two] + db[3] * table[r + three]
        space[m] = a[0] * p0 + a[1] * p1 + a[2] * p2 + a[3] * p3
        space[16 + m] = da[0] * p0 + da[1] * p1 + da[2] * p2 + da[3] * p3
        space[32 + m] = a[0] * q0 + a[1] * q1 + a[2] * q2 + a[3] * q3
    radius = table[L_RADIUS]
    for n in range(4):
        value = c[0] * space[n] + c[1] * space[n + 4] + c[2] * space[n + 8] + c[3] * space[n + 12]
        by_w = dc[0] * space[n] + dc[1] * space[n + 4] + dc[2] * space[n + 8] + dc[3] * space[n + 12]
        by_x = c[0] * space[n + 16] + c[1] * space[n + 20] + c[2] * space[n + 24] + c[3] * space[n + 28]
        by_y = c[0] * space[n + 32] + c[1] * space[n + 36] + c[2] * space[n + 40] + c[3] * space[n + 44]
        scale = sign if n == SIDE else radius if n >= TORQUE else 1.0
        slope = scale
        if n == SINKAGE:
            scale *= fill
            slope = scale / max(load, table[T_LOAD])
            out[n, 1] = slope * by_x * x_slope if fill == 1.0 else radius * value / table[T_LOAD]
        else:
            scale *= load
            out[n, 1] = slope * (value + by_x * x_slope)
        out[n, 0] = scale * value
        out[n, 2] = scale * (by_y * y_rim + by_w * w_mean)
        out[n, 3] = scale * (by_y * y_vx + by_w * w_mean)
        out[n, 4] = scale * by_w * w_vy
    if out[SINKAGE, 0] > DEEP * table[T_DEEPEST]:
        code = OVERLOADED
    return code


@fma_njit
def motion_table_forces(table: Array, load: float, rim: float, vx: float, vy: float, out: Array, space: Array) -> int:
    """Fill the forces of a wheel in any motion, with derivatives.

    Forces depend on the direction of (rim, vx, vy) only, not on its size. A wheel that turns backward is the mirror image of
    one that turns forward. Where the axle moves against the wheel's turning (|slip| > 1), the forces pass from those of the
    wheel that spins on the spot to those of the wheel that is locked and dragged; they are continuous there, elsewhere C¹.

    Args:
        table: packed table of any kind (see the module).
        load: N. Forces are proportional to a load below the table's least load, also to a negative one.
        rim: rim speed, radius times wheel rate, forward positive, m/s.
        vx, vy: velocity of the axle relative to the terrain along the heading and to its left, m/s; rim, vx and vy not all 0.
        out: (4, 5) filled: rows DRAWBAR (force on the wheel along its heading, N), SIDE (force on the wheel to its left, N),
            TORQUE (motor torque, N m), SINKAGE (m); columns value and derivatives with respect to load, rim, vx and vy.
        space: (SPACE,) work space; one array serves all calls of a thread.

    Returns:
        COMPUTED; OVERLOADED if the soil cannot carry the load; otherwise OUT_OF_RANGE if |slip| > 1 or the load is above the
        table. The forces are finite in all cases.
    """
    flip = rim < 0.0 or (rim == 0.0 and vx < 0.0)
    if flip:
        rim, vx = -rim, -vx
    code = COMPUTED
    if table[L_KIND] != SOIL:
        simple_forces(table, load, rim, vx, vy, out)
    elif vx >= 0.0:
        code = spline_forces(table, load, rim, vx, vy, out, space)
    else:
        other = space[48:68].reshape(4, 5)
        spline_forces(table, load, rim, 0.0, vy, out, space)
        spline_forces(table, load, 0.0, -vx, vy, other, space)
        total = rim - vx
        part = -vx / total
        weight, slope = part * part * (3.0 - 2.0 * part), 6.0 * part * (1.0 - part)
        p_rim, p_vx = -part / total, -(1.0 - part) / total
        for n in range(4):
            turn = -1.0 if n == DRAWBAR or n == TORQUE else 1.0
            apart = turn * other[n, 0] - out[n, 0]
            by_rim = (1.0 - weight) * out[n, 2] + slope * p_rim * apart
            by_vx = -weight * turn * other[n, 3] + slope * p_vx * apart
            out[n, 0] += weight * apart
            out[n, 1] += weight * (turn * other[n, 1] - out[n, 1])
            out[n, 2], out[n, 3] = by_rim, by_vx
            out[n, 4] += weight * (turn * other[n, 4] - out[n, 4])
        code = OVERLOADED if out[SINKAGE, 0] > DEEP * table[T_DEEPEST] else OUT_OF_RANGE
    if flip:
        for n in range(4):
            if n == DRAWBAR or n == TORQUE:
                out[n, 0], out[n, 1], out[n, 4] = -out[n, 0], -out[n, 1], -out[n, 4]
            else:
                out[n, 2], out[n, 3] = -out[n, 2], -out[n, 3]
    return code


@fma_njit
def table_forces(table: Array, load: float, slip: float, slip_angle: float, out: Array, space: Array) -> int:
    """Fill the forces of a wheel by slip and slip angle, with derivatives.

    Side force is odd in the slip angle, all else even. All values are C¹ in load, slip and slip angle, also at slip 0.
    `motion_table_forces` takes the velocities themselves; it is also defined for a wheel that slides sideways without rolling.

    Args:
        table: packed table of any kind (see the module).
        load: N.
        slip: (rim - vx) / max(rim, vx), from -1 (locked) through 0 (rolling) to 1 (spinning); limited to that range.
        slip_angle: atan2(vy, vx), below pi/2 in size, rad: positive if the wheel moves to the left of its heading.
        out: (4, 5) filled: rows DRAWBAR (N), SIDE (to the left, N), TORQUE (N m), SINKAGE (m); columns value and derivatives
            with respect to load, slip and slip angle; the last column is 0.
        space: (SPACE,) work space; one array serves all calls of a thread.

    Returns:
        COMPUTED; OVERLOADED if the soil cannot carry the load; otherwise OUT_OF_RANGE if |slip| > 1 or the load is above the
        table.
    """
    code = COMPUTED
    if abs(slip) > 1.0:
        slip = math.copysign(1.0, slip)
        code = OUT_OF_RANGE
    rim, vx, vy = motion_of(slip, slip_angle)
    found = motion_table_forces(table, load, rim, vx, vy, out, space)
    tangent = math.tan(slip_angle)
    for n in range(4):
        by_slip = out[n, 2] if slip < 0.0 else -out[n, 3] - tangent * out[n, 4]
        out[n, 3] = vx * (1.0 + tangent * tangent) * out[n, 4]
        out[n, 2] = by_slip
        out[n, 4] = 0.0
    return found if code == COMPUTED or found == OVERLOADED else code


@owning_fma_njit
def table_batch(
    table: Array, load: Array, slip: Array, slip_angle: Array, out: Array, status: NDArray[np.uint8], start: int, stop: int
) -> None:
    """Fill tabulated forces of wheels with derivatives.

    Args:
        table: packed table.
        load, slip, slip_angle: (n,) as for `table_forces`.
        out: (n, 4, 5) filled as by `table_forces`.
        status: (n,) filled with the code of each item.
        start, stop: range of items.
    """
    space = np.empty(SPACE)
    for k in range(start, stop):
        status[k] = table_forces(table, load[k], slip[k], slip_angle[k], out[k], space)


@owning_fma_njit
def motion_table_batch(
    table: Array, load: Array, rim: Array, vx: Array, vy: Array, out: Array, status: NDArray[np.uint8], start: int, stop: int
) -> None:
    """Fill tabulated forces of wheels in given motions, with derivatives.

    Args:
        table: packed table.
        load, rim, vx, vy: (n,) as for `motion_table_forces`.
        out: (n, 4, 5) filled as by `motion_table_forces`.
        status: (n,) filled with the code of each item.
        start, stop: range of items.
    """
    space = np.empty(SPACE)
    for k in range(start, stop):
        status[k] = motion_table_forces(table, load[k], rim[k], vx[k], vy[k], out[k], space)
