"""First equilibrium by quasi-static descent: an overdamped flow of the potential energy.

With damping in proportion to inertia, R dq/dt = -(gradient of the height of the centre of mass), no gap negative,
joints within their
limits. Each step is a small quadratic program, implicit in time: any length is stable while the contacts hold.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import Ground
from ..model.linkage import BOGIE_L, P_BODY, P_BOGIE, P_BOGIE_PIVOT, P_PIVOT, P_ROCKER, P_STOPS, P_WHEEL, PITCH, ROCKER, ROLL, Z
from ..model.mass import centre_of_mass
from ..model.wheel import COSINE, PLACE, SIN
from ..search.workspace import Work
from .contact_set import touch_down
from .qp import solve_qp

Array = NDArray[np.float64]

REACH = 0.05  # rad, the longest step
SHORTEST = 1e-4  # rad: a shorter step that does not decrease the energy as predicted is left to `equilibrium`
PACE, LONGEST = 0.1, 4.0  # time of the first step and the longest, in that of a fall by the rover's own radius of gyration
SLOW = 1e-3  # rad: a pose that moves less in the longest time is near equilibrium
STEPS = 200
FALLEN = 1.3  # rad of roll or pitch beyond which the rover has tipped over


@njit
def build_constraints(
    rover: Array, q: Array, gap: Array, rows: Array, count: int, trust_radius: float, n: Array, b: Array
) -> int:
    """Write the constraints n_k·d ≥ b_k of a step d.

    They are contacts, joint limits and the trust region.

    Args:
        rover: (P_SIZE,) packed rover.
        q: (6,) pose.
        gap: (m,) gaps, m.
        rows: (m, 6) their changes.
        count: number of contacts.
        trust_radius: largest change of an unknown; inf for none.
        n: (k, 6) filled.
        b: (k,) filled.

    Returns:
        Number of constraints.
    """
    m = count
    for k in range(count):
        for j in range(6):
            n[k, j] = rows[k, j]
        b[k] = -gap[k]
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        for end in range(2):
            if math.isfinite(rover[at + end]):
                n[m] = 0.0
                sign = 1.0 if end == 0 else -1.0
                n[m, ROCKER + k] = sign
                b[m] = sign * (rover[at + end] - q[ROCKER + k])
                m += 1
    if trust_radius < math.inf:
        for k in range(6):
            for end in range(2):
                n[m] = 0.0
                n[m, k] = 1.0 if end == 0 else -1.0
                b[m] = -trust_radius
                m += 1
    return m


@njit
def damping_weights(rover: Array, hub_offsets: Array, out: Array) -> None:
    """Compute the damping of each unknown.

    It is the moment of inertia of the moving links about its axis, joints straight.

    Args:
        rover: (P_SIZE,) packed rover.
        hub_offsets: (6, 5) of `linkage.set_hub_offsets`.
        out: (6,) filled, m² (1 for z): divided by the rover's mass.
    """
    out[:] = 0.0
    total = rover[P_BODY]
    x, y, z = rover[P_BODY + 1], rover[P_BODY + 2], rover[P_BODY + 3]
    out[ROLL] += total * (y * y + z * z)
    out[PITCH] += total * (x * x + z * z)
    for side in range(2):
        pivot = rover[P_PIVOT + 3 * side : P_PIVOT + 3 * side + 3]
        bogie_pivot = rover[P_BOGIE_PIVOT + 3 * side : P_BOGIE_PIVOT + 3 * side + 3]
        for part in range(5):  # rocker, bogie, and the three wheels of this side
            i = 2 * (part - 2) + side
            at = P_ROCKER + 4 * side if part == 0 else (P_BOGIE + 4 * side if part == 1 else P_WHEEL + 4 * i)
            m, x, y, z = rover[at], rover[at + 1], rover[at + 2], rover[at + 3]
            if part >= 2:
                x, y, z = x + hub_offsets[i, 0], y + hub_offsets[i, 1], z + hub_offsets[i, 2]
            on_bogie = part == 1 or part >= 3
            if on_bogie:
                out[BOGIE_L + side] += m * (x * x + z * z)
                x, y, z = x + bogie_pivot[0], y + bogie_pivot[1], z + bogie_pivot[2]
            out[ROCKER] += m * (x * x + z * z)
            x, y, z = x + pivot[0], y + pivot[1], z + pivot[2]
            out[ROLL] += m * (y * y + z * z)
            out[PITCH] += m * (x * x + z * z)
            total += m
    for k in range(1, 6):
        out[k] = max(out[k], 1e-6 * out[PITCH]) / total
    out[Z] = 1.0


@njit
def let_down(
    ground: Ground, rover: Array, x: float, y: float, cy: float, sy: float, q: Array, work: Work,
    gap: Array, rows: Array, owner: NDArray[np.int64], n: Array, b: Array,
) -> tuple[int, int]:  # fmt: skip
    """Compute a first equilibrium by quasi-static descent from above.

    The descent starts horizontal and with straight joints.

    Args:
        ground: terrain.
        rover: (P_SIZE,) packed rover.
        x, y: m, the body's origin from the map's first node.
        cy, sy: cos and sin of yaw.
        q: (6,) filled with a pose near the equilibrium.
        work: scratch; work.hub_offsets holds the steering.
        gap, rows, owner: filled with the near contacts there (`touch_down`).
        n, b: scratch for the constraints of `build_constraints`.

    Returns:
        Code and number of contacts as `touch_down`; -1 contacts with code -1 if the rover tips over.
    """
    hub_offsets, axes, pivots = work.hub_offsets, work.axes, work.pivots
    force = np.empty(b.size)
    slope, trial, d, resist, inverse = np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.zeros((6, 6))
    next_gap, next_rows, next_owner, next_slope = np.empty_like(gap), np.empty_like(rows), np.empty_like(owner), np.empty(6)
    q[:] = 0.0
    for i in range(6):
        work.touch[i, SIN], work.touch[i, COSINE], work.touch[i, PLACE] = 0.0, 1.0, 0.0
    for k in range(3):
        at = P_STOPS if k == 0 else P_STOPS + 2
        q[ROCKER + k] = min(max(0.0, rover[at]), rover[at + 1])
    code, count = touch_down(ground, rover, x, y, cy, sy, q, True, work, gap, rows, owner)
    if count < 0:
        return code, -1
    height = q[Z] + centre_of_mass(rover, hub_offsets, q, cy, sy, axes, pivots, slope)
    damping_weights(rover, hub_offsets, resist)
    size_of_rover = math.sqrt(resist[PITCH])
    longest = LONGEST * size_of_rover
    pace = PACE * size_of_rover
    for _ in range(STEPS):
        m = build_constraints(rover, q, gap, rows, count, math.inf, n, b)
        size = math.inf
        while size > REACH:
            for k in range(6):
                inverse[k, k] = pace / resist[k]
            if not solve_qp(inverse, slope, n, b, m, d, force):
                return code, count
            size = 0.0
            for k in range(1, 6):
                size = max(size, abs(d[k]))
            if size > REACH:
                pace *= 0.8 * REACH / size
        if pace >= longest and size < SLOW:
            break
        predicted_decrease = 0.0
        for k in range(6):
            predicted_decrease -= slope[k] * d[k]
            trial[k] = q[k] + d[k]
        there, found = touch_down(ground, rover, x, y, cy, sy, trial, True, work, next_gap, next_rows, next_owner)
        fell = -math.inf
        if found >= 0:
            fell = height - trial[Z] - centre_of_mass(rover, hub_offsets, trial, cy, sy, axes, pivots, next_slope)
        if not fell > 0.5 * predicted_decrease:  # it met terrain that the program did not have: take a shorter step
            if size < SHORTEST:
                break
            pace *= 0.25
            continue
        if max(abs(trial[ROLL]), abs(trial[PITCH])) > FALLEN:
            return -1, -1
        height -= fell
        code, count = there, found
        q[:], slope[:] = trial, next_slope
        gap[:found], rows[:found], owner[:found] = next_gap[:found], next_rows[:found], next_owner[:found]
        if fell > 0.8 * predicted_decrease:
            pace = min(2.0 * pace, longest)
    return code, count
