"""Equilibrium mode: a minimum of the potential energy.

No tread and no body is in the terrain, and joints are within their limits. Lifting the body by h opens every gap by exactly h. A
pose is therefore shifted in z until it just touches, and what remains is to lower the centre of mass. Of several minima the one
is sought that the descent from above reaches:

1. `six_wheels`: if the pose of contact mode is in balance and the descent leads to it, it is the equilibrium.
2. `descent.let_down`: a quasi-static descent gives a pose near the equilibrium.
3. `energy.minimize_energy`: a sequence of small quadratic programs finds it exactly, with its contact forces (`forces`).

If the descent tips over or no equilibrium is found after it, `batch.equilibrium_mode` solves again from the six-wheel pose of
contact mode (`settle_from_pose`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit, owning_njit
from ..model.linkage import P_STOPS, PITCH, ROCKER, ROLL, Z
from ..model.tolerances import MAX_RESIDUAL
from ..model.wheel import COSINE, PLACE, SIN
from ..search.tread import BLANK
from .contact_set import touch_down
from .descent import FALLEN, SIX_WHEELS, let_down, start_level
from .energy import minimize_energy
from .forces import classify_equilibrium, contact_forces
from .newton import CONVERGED, NO_DATA, OFF_MAP, TIPPED
from .site import Contacts, Memory, Program, Site
from .six_wheels import SixWheels, leads_straight, list_six

Array = NDArray[np.float64]


@owning_njit
def find_six_wheels(site: Site, report: Array, six: SixWheels, contacts: Contacts, program: Program) -> None:
    """Check the balance of the pose of contact mode, and write its report.

    Args:
        site: rover, position and terrain.
        report: (R_SIZE,) forces and flags; written if the pose is in balance.
        six: six.q holds the pose, NaN for none; six.share is written, 0 if the pose is not in balance.
        contacts, program: scratch.
    """
    six.share[0] = 0.0
    if math.isnan(six.q[Z]):
        return
    rover, slope, force = site.rover, np.empty(6), program.force
    force[:] = 0.0
    count = list_six(site, six, contacts, slope, force)
    if six.share[0] > 0.0:
        # more than one contact a wheel: the forces are those of the program, as in any other equilibrium
        if count > 6 and not contact_forces(rover, six.q, slope, contacts, count, program) < MAX_RESIDUAL:
            six.share[0] = 0.0
        classify_equilibrium(rover, six.q, contacts, force, count, report)


@owning_njit
def settle_equilibrium(site: Site, q: Array, report: Array, six: SixWheels, memory: Memory) -> int:
    """Compute the equilibrium that the rover reaches on the descent from above.

    The descent starts horizontal and with straight joints. If the pose of contact mode is given and in balance, and the
    descent leads to it, it is the equilibrium.

    Args:
        site: rover, position and terrain.
        q: (6,) z, roll, pitch, rocker and both bogies, m and rad; written, NaN on failure.
        report: (R_SIZE,) forces and flags; written, NaN on failure.
        six: scratch; six.q holds the pose of contact mode, NaN for none.
        memory: scratch.

    Returns:
        Status code: CONVERGED, JOINT_STOP, WHEEL_LIFTED or BELLY_CONTACT at an equilibrium; otherwise OFF_MAP, NO_DATA,
        TIPPED or NOT_CONVERGED.
    """
    contacts, _, program = memory
    find_six_wheels(site, report, six, contacts, program)
    if six.share[0] > 0.0:
        start_level(site.rover, q)
        if leads_straight(site, q, six):
            q[:] = six.q
            return CONVERGED
    code, count = let_down(site, q, six, contacts, program)
    if code == SIX_WHEELS:
        q[:] = six.q
        return CONVERGED
    if count < 0:
        return refuse(code, q, report)
    return minimize_energy(site, q, report, count, code, memory)


@njit
def settle_from_pose(site: Site, q: Array, report: Array, memory: Memory) -> int:
    """Compute the equilibrium that the exact solve reaches from a given pose.

    A joint beyond its limit starts at the limit. z is shifted so that the rover just touches the terrain.

    Args:
        site: rover, position and terrain.
        q: (6,) the start pose, replaced by the equilibrium, m and rad; NaN on failure.
        report: (R_SIZE,) forces and flags; written, NaN on failure.
        memory: scratch.

    Returns:
        Status code as `settle_equilibrium`; TIPPED also if the start pose is tipped over.
    """
    rover, touch = site.rover, site.work.touch
    code, count = -1, -1
    if max(abs(q[ROLL]), abs(q[PITCH])) <= FALLEN:
        for i in range(6):
            touch[i, SIN], touch[i, COSINE], touch[i, PLACE] = 0.0, 1.0, 0.0
        for k in range(3):
            at = P_STOPS if k == 0 else P_STOPS + 2
            q[ROCKER + k] = min(max(q[ROCKER + k], rover[at]), rover[at + 1])
        code, count = touch_down(site, q, True, memory.contacts)
    if count < 0:
        return refuse(code, q, report)
    return minimize_energy(site, q, report, count, code, memory)


@inlined
def refuse(code: int, q: Array, report: Array) -> int:
    """Write NaN for a pose without contacts, and return its status.

    Args:
        code: result of `touch_down` or `let_down` with -1 contacts.
        q: (6,) filled.
        report: (R_SIZE,) filled.

    Returns:
        Status code: NO_DATA, OFF_MAP or TIPPED.
    """
    q[:] = report[:] = math.nan
    return NO_DATA if code == BLANK else (OFF_MAP if code > 0 else TIPPED)
