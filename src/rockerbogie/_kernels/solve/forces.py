"""Contact forces of an equilibrium, and its report.

The forces are those of the contacts, none negative, that balance the weight best. They are divided by the weight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.linkage import P_STOPS, ROCKER
from ..model.tolerances import CONTACT_GAP, LIMIT_MARGIN
from .newton import BELLY_CONTACT, CONVERGED, JOINT_STOP, WHEEL_LIFTED
from .qp import solve_qp
from .site import Contacts, Program

Array = NDArray[np.float64]

# Report of a pose beside q: forces of the wheels and the body divided by the weight, and flags.
R_FORCE = 0  # (6,)
R_BELLY = 6  # force on the belly
R_LIFTED = 7  # (6,) 1 if the wheel is off the ground
R_STOP = 13  # (3,) -1 or +1 where rocker, left, right bogie lie on their low or high stop
R_SIZE = 16


@njit
def contact_forces(rover: Array, q: Array, slope: Array, contacts: Contacts, count: int, program: Program) -> float:
    """Compute the contact forces that balance the weight best.

    None is negative; joint limits take part. A joint within `LIMIT_MARGIN` of its limit is moved to it.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose; joints may be moved to their limits.
        slope: (6,) gradient of the energy.
        contacts: those with a gap up to CONTACT_GAP bear.
        count: number of contacts.
        program: scratch; its first `count` forces are filled, divided by the weight.

    Returns:
        The largest component of the residual, 0 at an equilibrium; inf if the program fails.
    """
    gap, rows, _ = contacts
    n, b, inverse, d, force = program
    bearing = 0
    for k in range(count):
        if gap[k] <= CONTACT_GAP:
            for c in range(6):
                n[bearing, c] = rows[k, c]
            b[bearing] = 0.0
            bearing += 1
    m = add_limits(rover, q, n, b, bearing)
    for i in range(6):
        for j in range(6):
            inverse[i, j] = 1.0 if i == j else 0.0
    if not solve_qp(inverse, slope, n, b, m, d, force):
        return math.inf
    for k in range(count - 1, -1, -1):
        if gap[k] <= CONTACT_GAP:
            bearing -= 1
            force[k] = force[bearing]
        else:
            force[k] = 0.0
    left = 0.0
    for k in range(6):
        left = max(left, abs(d[k]))
    return left


@njit
def add_limits(rover: Array, q: Array, n: Array, b: Array, count: int) -> int:
    """Add a constraint for each joint at its limit.

    A joint within `LIMIT_MARGIN` of its limit is moved to it.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose; joints near their limits are changed.
        n, b: constraint normals and bounds; written.
        count: number of constraints so far.

    Returns:
        The new number of constraints.
    """
    for k in range(3):
        for end in range(2):
            sign = 1.0 if end == 0 else -1.0
            stop = rover[(P_STOPS if k == 0 else P_STOPS + 2) + end]
            if sign * (q[ROCKER + k] - stop) < LIMIT_MARGIN:
                q[ROCKER + k] = stop
                n[count], b[count] = 0.0, 0.0
                n[count, ROCKER + k] = sign
                count += 1
    return count


@njit
def classify_equilibrium(rover: Array, q: Array, contacts: Contacts, force: Array, count: int, report: Array) -> int:
    """Write forces and flags of an equilibrium, and return its status.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        contacts: the contacts.
        force: (count,) their forces divided by the weight.
        count: number of contacts.
        report: (R_SIZE,) filled.

    Returns:
        Status code: BELLY_CONTACT, WHEEL_LIFTED, JOINT_STOP or CONVERGED, the first that holds.
    """
    gap, _, owner = contacts
    report[:] = 0.0
    for i in range(6):
        report[R_LIFTED + i] = 1.0
    belly = False
    for k in range(count):
        report[R_FORCE + owner[k]] += force[k]
        if gap[k] <= CONTACT_GAP:
            if owner[k] < 6:
                report[R_LIFTED + owner[k]] = 0.0
            else:
                belly = True
    stopped = False
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        if q[ROCKER + k] <= rover[at] + 1e-9:
            report[R_STOP + k] = -1.0
        elif q[ROCKER + k] >= rover[at + 1] - 1e-9:
            report[R_STOP + k] = 1.0
        stopped |= report[R_STOP + k] != 0.0
    lifted = False
    for i in range(6):
        lifted |= report[R_LIFTED + i] != 0.0
    if belly:
        return BELLY_CONTACT
    if lifted:
        return WHEEL_LIFTED
    return JOINT_STOP if stopped else CONVERGED
