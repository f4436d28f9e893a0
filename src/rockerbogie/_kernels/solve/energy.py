"""Minimum of the potential energy by a sequence of quadratic programs with a trust region.

Each program has every near contact of every wheel and of the body as a constraint, the joint limits and the trust region. The
energy decreases at every step taken. If a step meets terrain that the program did not have (a kink: another slope of the same
wheel), its contacts join the program as cuts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..model.linkage import PITCH, ROLL, Z, forward_kinematics
from ..model.mass import centre_of_mass
from ..model.tolerances import MAX_RESIDUAL, MIN_ENERGY_DECREASE
from ..search.tread import BLANK, FOUND
from .contact_set import touch_down
from .descent import FALLEN, build_constraints
from .forces import classify_equilibrium, contact_forces
from .hessian import bfgs_update, reset_hessian
from .newton import NO_DATA, NOT_CONVERGED, OFF_MAP, TIPPED
from .qp import invert, solve_qp
from .site import CUTS, Contacts, Memory, Program, Site

Array = NDArray[np.float64]

PROGRAMS = 200  # quadratic programs of one pose, at most
TRUST = 0.02  # first trust region, rad (and m)
WIDEST = 0.3  # largest trust region, rad (and m)


@inlined
def solve_step(
    rover: Array, q: Array, slope: Array, hessian: Array, contacts: Contacts, count: int, trust_radius: float,
    copy: Array, program: Program,
) -> bool:  # fmt: skip
    """Solve for the step to the minimum of the quadratic model of the energy.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        slope: (6,) gradient of the energy.
        hessian: (6, 6) its curvature.
        contacts, count: near contacts.
        trust_radius: largest change of an unknown, m or rad.
        copy: (6, 6) scratch.
        program: scratch; filled with the step and the multipliers.

    Returns:
        False if the Hessian is not positive definite or the program fails.
    """
    n, b, inverse, d, force = program
    m = build_constraints(rover, q, contacts, count, trust_radius, program)
    copy[:] = hessian
    return invert(copy, inverse) and solve_qp(inverse, slope, n, b, m, d, force)


@inlined
def predict(slope: Array, d: Array) -> tuple[float, float]:
    """Return the decrease of the energy to first order, m, and the size of a step.

    Args:
        slope: (6,) gradient of the energy.
        d: (6,) step.
    """
    decrease = size = 0.0
    for k in range(6):
        decrease -= slope[k] * d[k]
        size = max(size, abs(d[k]))
    return decrease, size


@njit
def multipliers(slope: Array, contacts: Contacts, force: Array, count: int, pull: Array, load: Array) -> None:
    """Compute the gradient of the Lagrangian, and the load of each wheel and of the body.

    Args:
        slope: (6,) gradient of the energy.
        contacts, count: near contacts.
        force: (count,) their forces.
        pull: (6,) filled with the gradient.
        load: (7,) filled with the sums.
    """
    _, rows, owner = contacts
    for k in range(6):
        pull[k] = slope[k]
        for j in range(count):
            pull[k] -= force[j] * rows[j, k]
    for j in range(7):
        load[j] = 0.0
    for j in range(count):
        load[owner[j]] += force[j]


@njit
def gradient_under_loads(slope: Array, contacts: Contacts, count: int, load: Array, pull: Array) -> None:
    """Compute the gradient of the Lagrangian under given loads.

    Each load acts at the lowest contact of its wheel or of the body.

    Args:
        slope: (6,) gradient of the energy.
        contacts, count: near contacts.
        load: (7,) forces on the wheels and on the body.
        pull: (6,) filled.
    """
    gap, rows, owner = contacts
    for k in range(6):
        pull[k] = slope[k]
    for i in range(7):
        first = -1
        for j in range(count):
            if owner[j] == i and (first < 0 or gap[j] < gap[first]):
                first = j
        if first >= 0:
            for k in range(6):
                pull[k] -= load[i] * rows[first, k]


@njit
def add_cuts(contacts: Contacts, found: int, d: Array, lift: float, limit: float, cuts: Contacts, count: int) -> int:
    """Add the contacts that a step would push into the terrain to the cuts.

    Args:
        contacts, found: near contacts at the end of the step, and their number.
        d: (6,) step.
        lift: m, height of the step's end above the pose of first contact there.
        limit: m, negative: contacts with a gap below it become cuts, up to CUTS.
        cuts: filled; their gaps are those at the start of the step to first order, at least 0.
        count: number of cuts so far.

    Returns:
        The new number of cuts.
    """
    gap, rows, owner = contacts
    cut_gap, cut_rows, cut_owner = cuts
    for k in range(found):
        if gap[k] + lift < limit and count < CUTS:
            cut_gap[count] = gap[k] + lift
            for j in range(6):
                cut_gap[count] -= rows[k, j] * d[j]
                cut_rows[count, j] = rows[k, j]
            cut_gap[count] = max(cut_gap[count], 0.0)
            cut_owner[count] = owner[k]
            count += 1
    return count


@inlined
def append_cuts(cuts: Contacts, cut: int, contacts: Contacts, count: int) -> int:
    """Append the cuts to the near contacts.

    Args:
        cuts, cut: the cuts and their number.
        contacts: near contacts; written.
        count: number of near contacts.

    Returns:
        The new number of near contacts.
    """
    gap, rows, owner = contacts
    for k in range(cut):
        gap[count], rows[count], owner[count] = cuts.gap[k], cuts.rows[k], cuts.owner[k]
        count += 1
    return count


@owning_njit
def minimize_energy(site: Site, q: Array, report: Array, count: int, coverage: int, memory: Memory) -> int:
    """Move q to a minimum of the potential energy and compute the contact forces.

    Args:
        site: rover, position and terrain.
        q: (6,) a pose that just touches, replaced by the equilibrium, m and rad; NaN on failure.
        report: (R_SIZE,) forces and flags; written, NaN on failure.
        count: number of contacts of q.
        coverage: FOUND, or OFF or BLANK if the map's edge or missing data lies under q.
        memory: its contacts are those of q as `touch_down` lists them; overwritten.

    Returns:
        Status code as `settle_equilibrium`.
    """
    _, rover, x, y, cy, sy, work = site
    contacts, cuts, program = memory
    hub_offsets, axes, pivots = work.hub_offsets, work.axes, work.pivots
    d, force = program.d, program.force
    force[:] = 0.0
    slope, trial = np.empty(6), np.empty(6)
    hessian, copy = np.zeros((6, 6)), np.empty((6, 6))
    old_pull, pull, moved, load = np.empty(6), np.empty(6), np.empty(6), np.empty(7)
    report[:] = math.nan
    forward_kinematics(rover, hub_offsets, x, y, cy, sy, q, axes, pivots, work.wheels)
    height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
    reset_hessian(hessian)
    trust_radius = TRUST
    blocked_by = FOUND  # OFF or BLANK if the map's edge or missing data stopped a step
    listed, cut, farthest_cut = count, 0, 0.0
    for _ in range(PROGRAMS):
        if not solve_step(rover, q, slope, hessian, contacts, count, trust_radius, copy, program):
            reset_hessian(hessian)  # the Hessian is not positive definite
            trust_radius *= 0.25
            if trust_radius < 1e-9:
                break
            continue
        predicted_decrease, size = predict(slope, d)
        small = predicted_decrease < MIN_ENERGY_DECREASE and size < 1e-6
        if small and cut > 0 and farthest_cut > 1e-6:  # held by contacts met farther off: search again with a smaller region
            trust_radius = 0.3 * farthest_cut
            count, cut, farthest_cut = listed, 0, 0.0
            continue
        if small or trust_radius < 1e-10:
            if contact_forces(rover, q, slope, contacts, count, program) < MAX_RESIDUAL:
                if coverage == FOUND:
                    return classify_equilibrium(rover, q, contacts, force, count, report)
                blocked_by = coverage
                break
            # not an equilibrium: kinks entered the Hessian as curvature and stopped the search; continue with a new one
            reset_hessian(hessian)
            trust_radius = 0.1 * TRUST
            count, cut, farthest_cut = listed, 0, 0.0
            continue
        for k in range(6):
            trial[k] = q[k] + d[k]
        multipliers(slope, contacts, force, count, old_pull, load)
        code, found = touch_down(site, trial, False, contacts)
        new = math.inf
        if found >= 0:
            new = trial[Z] + centre_of_mass(rover, hub_offsets, trial, cy, sy, axes, pivots, pull)
        else:
            blocked_by = code
        if not new < height - 1e-4 * predicted_decrease + 1e-15:
            before = cut
            if found >= 0:  # the contacts met join the program: past a kink the wheel has another slope
                lift, limit = q[Z] + d[Z] - trial[Z], -0.1 * predicted_decrease
                _, found = touch_down(site, trial, True, contacts)
                cut = add_cuts(contacts, found, d, lift, limit, cuts, cut)
            farthest_cut = max(farthest_cut, size)
            if before > 0 or cut == 0:
                trust_radius = 0.25 * min(trust_radius, size)
            # the pose is unchanged: list its contacts again
            _, listed = touch_down(site, q, True, contacts)
            height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
            count = append_cuts(cuts, cut, contacts, listed)
            continue
        if height - new > 0.5 * predicted_decrease and size > 0.9 * trust_radius:
            trust_radius = min(2.0 * trust_radius, WIDEST)
        for k in range(6):
            moved[k] = trial[k] - q[k]
            q[k] = trial[k]
        if max(abs(q[ROLL]), abs(q[PITCH])) > FALLEN:
            q[:] = math.nan
            return TIPPED
        coverage, count = touch_down(site, q, True, contacts)
        height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
        listed, cut, farthest_cut = count, 0, 0.0
        gradient_under_loads(slope, contacts, count, load, pull)
        bfgs_update(hessian, moved, pull, old_pull)
    q[:] = math.nan
    return NO_DATA if blocked_by == BLANK else (OFF_MAP if blocked_by > 0 else NOT_CONVERGED)
