"""Frictionless contact forces of poses in which wheels touch along their whole width."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from .balance import EQUATIONS
from .lane_problem import has_lines
from .least_norm import factor, solve_factored
from .mechanism import EXTRA, ON_BELLY, assemble, gravity_column, new_mechanism

Array = NDArray[np.float64]

MOST = 6  # unknown forces that the six equations of a held position and heading determine
BALANCED = 1e-9  # of the weight: residual of forces that balance


@owning_njit
def line_support_batch(
    rover: Array, yaw: Array, steering: Array, q: Array, point: Array, normal: Array, span: Array, stops: NDArray[np.int8],
    belly_point: Array, belly_normal: Array, force: Array, belly: Array, start: int, stop: int,
) -> None:  # fmt: skip
    """Replace frictionless contact forces by those at the middles of contact lines.

    Position and heading are held, so that six equations are left: force along z, moments about the axes of roll and pitch, and
    the joints. A pose is left as it is if it has no contact line, or if these forces are not determined or not all at least 0.

    Args:
        rover, yaw, steering, q, point, normal, span, stops, belly_point, belly_normal: as for `loads.loads_batch`.
        force: (n, 6) vertical parts of the wheels' contact forces, of the weight, changed; wheels without force stay without.
        belly: (n,) vertical part of the body's contact force, of the weight, changed.
        start, stop: range of poses.
    """
    m, b, row = new_mechanism(), np.empty(EQUATIONS), np.empty((6 + EXTRA, 6))
    a, x, held, who = np.empty((MOST, MOST)), np.empty(MOST), np.empty(6), np.empty(6 + EXTRA, np.int64)
    for k in range(start, stop):
        if not has_lines(span, k) or math.isnan(force[k, 0]):
            continue
        at = k if belly_point.shape[0] > 1 else 0
        count, more, reach = assemble(
            m, rover, yaw[k], steering[k if steering.shape[0] > 1 else 0], q[k], point[k], normal[k], stops[k],
            belly_point[at], belly_normal[at],
        )  # fmt: skip
        if count == 0:
            continue
        weight = gravity_column(m, rover, reach, 0.0, 0.0, -1.0, b)
        for n in range(EQUATIONS):
            b[n] /= -weight
        cy, sy, unknown = math.cos(yaw[k]), math.sin(yaw[k]), 0
        _project(b, m.axes, cy, sy, held)
        for i in range(count + more):
            if i < count and not force[k, m.who[i]] > 0.0:
                continue
            _project(m.columns[i, 0] if i < count else m.extra[i - count], m.axes, cy, sy, row[unknown])
            who[unknown] = i
            unknown += 1
        if unknown > MOST:
            continue
        for i in range(unknown):
            x[i] = 0.0
            for n in range(6):
                x[i] += row[i, n] * held[n]
            for j in range(i + 1):
                a[i, j] = 0.0
                for n in range(6):
                    a[i, j] += row[i, n] * row[j, n]
        if not factor(a, unknown):
            continue
        solve_factored(a, unknown, x)
        good = True
        for n in range(6):
            left = held[n]
            for i in range(unknown):
                left -= row[i, n] * x[i]
            good &= abs(left) < BALANCED
        for i in range(unknown):
            good &= x[i] >= 0.0
        if not good:
            continue
        belly[k] = 0.0
        for i in range(unknown):
            if who[i] < count:
                force[k, m.who[who[i]]] = row[i, 0] * x[i]
            elif m.owner[who[i] - count] == ON_BELLY:
                belly[k] += row[i, 0] * x[i]


@njit
def _project(column: Array, axes: Array, cy: float, sy: float, held: Array) -> None:
    """Fill the six equations of a generalized force.

    Args:
        column: (9,) generalized force.
        axes: (3, 3) the body's directions in the world, one a row.
        cy, sy: cosine and sine of the heading.
        held: (6,) filled: force along z, moments about the axes of roll and pitch, joints.
    """
    held[0] = column[2]
    held[1] = axes[0, 0] * column[3] + axes[0, 1] * column[4] + axes[0, 2] * column[5]
    held[2] = cy * column[4] - sy * column[3]
    for n in range(3):
        held[3 + n] = column[6 + n]
