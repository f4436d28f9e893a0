"""Equilibrium mode: a minimum of the potential energy.

No tread and no body is in the terrain, and joints are within their limits. Lifting the body by h opens every gap by
exactly h. A pose is therefore made to just touch by one shift of z, and what remains is to
lower the centre of mass. Of several minima the one is sought that the descent reaches (`descent.let_down`). From
near there a
sequence of small quadratic programs finds it exactly. Each has every near contact of every wheel and of the body as
a constraint, the
joint limits and a trust region. The energy decreases at every step taken. If a step meets terrain that the program
did not have
(a kink: another slope of the same wheel), its contacts join the program.

If the descent tips over or no equilibrium is found after it, `batch.rest_left` solves again from the six-wheel pose of
contact mode (`settle_from_pose`).

The forces are those of the contacts, none negative, that balance the weight best. If they do not, there is no
equilibrium and no
pose is given. Forces are stored divided by the rover's weight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..model.linkage import P_STOPS, PITCH, ROCKER, ROLL, Z, forward_kinematics
from ..model.mass import centre_of_mass
from ..model.tolerances import CONTACT_GAP, LIMIT_MARGIN, MAX_RESIDUAL, MIN_ENERGY_DECREASE
from ..model.wheel import COSINE, PLACE, SIN
from ..search.tread import BLANK, FOUND
from ..search.workspace import Work
from .contact_set import LISTED, touch_down
from .descent import FALLEN, build_constraints, let_down
from .newton import BELLY_CONTACT, CONVERGED, JOINT_STOP, NO_DATA, NOT_CONVERGED, OFF_MAP, TIPPED, WHEEL_LIFTED
from .qp import invert, solve_qp

Array = NDArray[np.float64]

MOST = 200  # programmes
TRUST = 0.02  # first trust region, rad (and m)
WIDEST = 0.3
CUTS = 24  # places met beyond a step that was not taken
ROWS = LISTED + CUTS
CONSTRAINTS = ROWS + 6 + 12

# What each pose reports beside q: forces of the wheels and the belly as shares of the weight, and flags.
R_FORCE = 0  # (6,)
R_BELLY = 6  # force on the belly
R_LIFTED = 7  # (6,) 1 if the wheel is off the ground
R_STOP = 13  # (3,) -1 or +1 where rocker, left, right bogie lie on their low or high stop
R_SIZE = 16


@njit
def settle_equilibrium(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, report: Array, work: Work
) -> int:
    """Compute the equilibrium that the rover reaches on the descent from above.

    The descent starts horizontal and with straight joints.

    Args:
        ground: the packed terrain (ground.Ground).
        rover: (P_SIZE,) the packed rover.
        x, y: position of the body's reference point from the first grid node, m.
        cy, sy: cosine and sine of the heading.
        q: (6,) z, roll, pitch, rocker and both bogies, m and rad; written, NaN on failure.
        report: (R_SIZE,) forces and flags; written, NaN on failure.
        work: scratch memory; `workspace.feet` holds the steering.

    Returns:
        Status code: CONVERGED, JOINT_STOP, WHEEL_LIFTED or BELLY_CONTACT at an equilibrium; otherwise OFF_MAP, NO_DATA,
        TIPPED or NOT_CONVERGED.
    """
    gap, rows, owner = np.empty(ROWS), np.empty((ROWS, 6)), np.empty(ROWS, np.int64)
    n, b = np.empty((CONSTRAINTS, 6)), np.empty(CONSTRAINTS)
    code, count = let_down(ground, rover, x, y, cy, sy, q, work, gap, rows, owner, n, b)
    if count < 0:
        q[:] = report[:] = math.nan
        return NO_DATA if code == BLANK else (OFF_MAP if code > 0 else TIPPED)
    return minimize_energy(ground, rover, x, y, cy, sy, q, report, work, gap, rows, owner, n, b, count, code)


@njit
def settle_from_pose(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, report: Array, work: Work
) -> int:
    """Compute the equilibrium that the exact solve reaches from a given pose.

    A joint beyond its limit starts at the limit. z is shifted so that the rover just touches the terrain.

    Args:
        ground: the packed terrain (ground.Ground).
        rover: (P_SIZE,) the packed rover.
        x, y: position of the body's reference point from the first grid node, m.
        cy, sy: cosine and sine of the heading.
        q: (6,) the start pose, replaced by the equilibrium, m and rad; NaN on failure.
        report: (R_SIZE,) forces and flags; written, NaN on failure.
        work: scratch memory; `workspace.feet` holds the steering.

    Returns:
        Status code as `settle_equilibrium`; TIPPED also if the start pose is tipped over.
    """
    gap, rows, owner = np.empty(ROWS), np.empty((ROWS, 6)), np.empty(ROWS, np.int64)
    n, b = np.empty((CONSTRAINTS, 6)), np.empty(CONSTRAINTS)
    code, count = -1, -1
    if max(abs(q[ROLL]), abs(q[PITCH])) <= FALLEN:
        for i in range(6):
            work.touch[i, SIN], work.touch[i, COSINE], work.touch[i, PLACE] = 0.0, 1.0, 0.0
        for k in range(3):
            at = P_STOPS if k == 0 else P_STOPS + 2
            q[ROCKER + k] = min(max(q[ROCKER + k], rover[at]), rover[at + 1])
        code, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
    if count < 0:
        q[:] = report[:] = math.nan
        return NO_DATA if code == BLANK else (OFF_MAP if code > 0 else TIPPED)
    return minimize_energy(ground, rover, x, y, cy, sy, q, report, work, gap, rows, owner, n, b, count, code)


@njit
def minimize_energy(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, report: Array, work: Work,
    gap: Array, rows: Array, owner: NDArray[np.int64], n: Array, b: Array, count: int, coverage: int,
) -> int:  # fmt: skip
    """Move q to a minimum of the potential energy and compute the contact forces.

    Args:
        ground: the packed terrain (ground.Ground).
        rover: (P_SIZE,) the packed rover.
        x, y: position of the body's reference point from the first grid node, m.
        cy, sy: cosine and sine of the heading.
        q: (6,) a pose that just touches, replaced by the equilibrium, m and rad; NaN on failure.
        report: (R_SIZE,) forces and flags; written, NaN on failure.
        work: scratch memory; work.hub_offsets holds the steering.
        gap, rows, owner: (ROWS,), (ROWS, 6), (ROWS,) the contacts of q as `touch_down` lists them; overwritten.
        n, b: (CONSTRAINTS, 6), (CONSTRAINTS,) scratch for the constraints.
        count: number of contacts listed.
        coverage: FOUND, or OFF or BLANK if the map's edge or missing data lies under q.

    Returns:
        Status code as `settle_equilibrium`.
    """
    hub_offsets, axes, pivots = work.hub_offsets, work.axes, work.pivots
    force = np.zeros(CONSTRAINTS)
    slope, trial, d = np.empty(6), np.empty(6), np.empty(6)
    hessian, inverse, copy = np.zeros((6, 6)), np.empty((6, 6)), np.empty((6, 6))
    old_pull, pull, moved, bearing = np.empty(6), np.empty(6), np.empty(6), np.empty(7)
    report[:] = math.nan
    forward_kinematics(rover, hub_offsets, x, y, cy, sy, q, axes, pivots, work.wheels)
    height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
    reset_hessian(hessian)
    trust_radius = TRUST
    blocked_by = FOUND  # OFF or BLANK if the map's edge or missing data stopped a step
    cut_gap, cut_rows, cut_owner = np.empty(CUTS), np.empty((CUTS, 6)), np.empty(CUTS, np.int64)
    listed, cut_constraints, farthest_cut = count, 0, 0.0
    for _ in range(MOST):
        m = build_constraints(rover, q, gap, rows, count, trust_radius, n, b)
        copy[:] = hessian
        if not (invert(copy, inverse) and solve_qp(inverse, slope, n, b, m, d, force)):
            reset_hessian(hessian)  # the Hessian is not positive definite
            trust_radius *= 0.25
            if trust_radius < 1e-9:
                break
            continue
        predicted_decrease = 0.0
        size = 0.0
        for k in range(6):
            predicted_decrease -= slope[k] * d[k]
            size = max(size, abs(d[k]))
        if predicted_decrease < MIN_ENERGY_DECREASE and size < 1e-6:
            if (
                cut_constraints > 0 and farthest_cut > 1e-6
            ):  # held by contacts met further off: search again with a smaller region
                trust_radius = 0.3 * farthest_cut
                count, cut_constraints, farthest_cut = listed, 0, 0.0
                continue
            arrived = True
        elif trust_radius < 1e-10:
            arrived = True
        else:
            arrived = False
        if arrived:
            if contact_forces(rover, q, slope, gap, rows, count, inverse, n, b, d, force) < MAX_RESIDUAL:
                if coverage != FOUND:
                    q[:] = report[:] = math.nan
                    return NO_DATA if coverage == BLANK else OFF_MAP
                return classify_equilibrium(rover, q, gap, owner, force, count, report)
            # not an equilibrium: kinks entered the Hessian as curvature and stopped the search; continue with a new one
            reset_hessian(hessian)
            trust_radius = 0.1 * TRUST
            count, cut_constraints, farthest_cut = listed, 0, 0.0
            continue
        for k in range(6):
            trial[k] = q[k] + d[k]
        low_before = height
        for k in range(6):  # gradient of the Lagrangian, from which the Hessian is updated
            old_pull[k] = slope[k]
            for j in range(count):
                old_pull[k] -= force[j] * rows[j, k]
        for j in range(7):
            bearing[j] = 0.0
        for j in range(count):
            bearing[owner[j]] += force[j]
        code, m = touch_down(ground, rover, x, y, cy, sy, trial, False, work, gap, rows, owner)
        stands = m >= 0
        if not stands:
            blocked_by = code
        else:
            new = trial[Z] + centre_of_mass(rover, hub_offsets, trial, cy, sy, axes, pivots, pull)
        if not stands or not new < low_before - 1e-4 * predicted_decrease + 1e-15:
            before = cut_constraints
            if stands:  # the contacts met join the program: past a kink the wheel has another slope
                lift = q[Z] + d[Z] - trial[Z]
                _, m = touch_down(ground, rover, x, y, cy, sy, trial, True, work, gap, rows, owner)
                for k in range(m):
                    if gap[k] + lift < -0.1 * predicted_decrease and cut_constraints < CUTS:
                        cut_gap[cut_constraints] = gap[k] + lift
                        for j in range(6):
                            cut_gap[cut_constraints] -= rows[k, j] * d[j]
                            cut_rows[cut_constraints, j] = rows[k, j]
                        cut_gap[cut_constraints] = max(cut_gap[cut_constraints], 0.0)
                        cut_owner[cut_constraints] = owner[k]
                        cut_constraints += 1
            farthest_cut = max(farthest_cut, size)
            if before > 0 or cut_constraints == 0:
                trust_radius = 0.25 * min(trust_radius, size)
            # the pose is unchanged: list its contacts again
            code, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
            height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
            listed = count
            for k in range(cut_constraints):
                gap[count], rows[count], owner[count] = cut_gap[k], cut_rows[k], cut_owner[k]
                count += 1
            continue
        if low_before - new > 0.5 * predicted_decrease and size > 0.9 * trust_radius:
            trust_radius = min(2.0 * trust_radius, WIDEST)
        for k in range(6):
            moved[k] = trial[k] - q[k]
            q[k] = trial[k]
        if max(abs(q[ROLL]), abs(q[PITCH])) > FALLEN:
            q[:] = math.nan
            return TIPPED
        coverage, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
        height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
        listed, cut_constraints, farthest_cut = count, 0, 0.0
        for k in range(6):
            pull[k] = slope[k]
        for i in range(7):  # the lowest contact of each wheel and of the body takes its force
            first = -1
            for j in range(count):
                if owner[j] == i and (first < 0 or gap[j] < gap[first]):
                    first = j
            if first >= 0:
                for k in range(6):
                    pull[k] -= bearing[i] * rows[first, k]
        bfgs_update(hessian, moved, pull, old_pull)
    q[:] = math.nan
    return NO_DATA if blocked_by == BLANK else (OFF_MAP if blocked_by > 0 else NOT_CONVERGED)


@njit
def reset_hessian(hessian: Array) -> None:
    """Reset the Hessian to the same small curvature in every direction.

    Args:
        hessian: (6, 6) filled.
    """
    for i in range(6):
        for j in range(6):
            hessian[i, j] = 0.5 if i == j else 0.0


@njit
def contact_forces(
    rover: Array,
    q: Array,
    slope: Array,
    gap: Array,
    rows: Array,
    count: int,
    inverse: Array,
    n: Array,
    b: Array,
    d: Array,
    force: Array,
) -> float:
    """Compute the contact forces that balance the weight best.

    None is negative; joint limits take part. A joint within `LIMIT_MARGIN` of its limit is moved to it.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose; joints may be moved to their limits.
        slope: (6,) gradient of the energy.
        gap, rows: (count,), (count, 6) contacts; those up to CONTACT_GAP bear.
        count: number of contacts.
        inverse, n, b, d: scratch.
        force: (count,) filled, divided by the weight.

    Returns:
        The largest component of the residual, 0 at an equilibrium; inf if the program fails.
    """
    m = 0
    for k in range(count):
        if gap[k] <= CONTACT_GAP:
            n[m], b[m] = rows[k], 0.0
            m += 1
    for k in range(3):
        for end in range(2):
            sign = 1.0 if end == 0 else -1.0
            stop = rover[(P_STOPS if k == 0 else P_STOPS + 2) + end]
            if sign * (q[ROCKER + k] - stop) < LIMIT_MARGIN:
                q[ROCKER + k] = stop
                n[m], b[m] = 0.0, 0.0
                n[m, ROCKER + k] = sign
                m += 1
    for i in range(6):
        for j in range(6):
            inverse[i, j] = 1.0 if i == j else 0.0
    if not solve_qp(inverse, slope, n, b, m, d, force):
        return math.inf
    m = 0
    for k in range(count):
        if gap[k] <= CONTACT_GAP:
            m += 1
    for k in range(count - 1, -1, -1):
        if gap[k] <= CONTACT_GAP:
            m -= 1
            force[k] = force[m]
        else:
            force[k] = 0.0
    left = 0.0
    for k in range(6):
        left = max(left, abs(d[k]))
    return left


@njit
def bfgs_update(hessian: Array, moved: Array, pull: Array, old_pull: Array) -> None:
    """Update the Hessian by Powell's damped BFGS formula.

    Args:
        hessian: (6, 6) replaced.
        moved: (6,) the step taken.
        pull: (6,) gradient of the Lagrangian after it.
        old_pull: (6,) the same before it.
    """
    bs = np.empty(6)
    sbs = sy = 0.0
    for i in range(6):
        bs[i] = 0.0
        for j in range(6):
            bs[i] += hessian[i, j] * moved[j]
    for i in range(6):
        sbs += moved[i] * bs[i]
        sy += moved[i] * (pull[i] - old_pull[i])
    if not sbs > 1e-24:
        return
    share = 1.0 if sy >= 0.2 * sbs else 0.8 * sbs / (sbs - sy)
    y = np.empty(6)
    sy = 0.0
    for i in range(6):
        y[i] = share * (pull[i] - old_pull[i]) + (1.0 - share) * bs[i]
        sy += moved[i] * y[i]
    for i in range(6):
        for j in range(6):
            hessian[i, j] += y[i] * y[j] / sy - bs[i] * bs[j] / sbs
    for i in range(6):
        hessian[i, i] += 1e-6


@njit
def classify_equilibrium(
    rover: Array, q: Array, gap: Array, owner: NDArray[np.int64], force: Array, count: int, report: Array
) -> int:
    """Write forces and flags of an equilibrium, and return its status.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        gap, owner, force: (count,) contacts: gap, m, wheel (6: body), force divided by the weight.
        count: number of contacts.
        report: (R_SIZE,) filled.

    Returns:
        Status code: BELLY_CONTACT, WHEEL_LIFTED, JOINT_STOP or CONVERGED, the first that holds.
    """
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
