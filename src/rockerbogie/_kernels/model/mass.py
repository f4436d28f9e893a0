"""The height of the centre of mass and its gradient."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from .linkage import P_BODY, P_BOGIE, P_ROCKER, P_WHEEL, ROCKER, gap_jacobian_row, right_rocker

Array = NDArray[np.float64]


@owning_njit
def centre_of_mass(
    rover: Array, hub_offsets: Array, q: Array, cy: float, sy: float, axes: Array, pivots: Array, slope: Array
) -> float:
    """Compute the height of the centre of mass and its gradient.

    Args:
        rover: (P_SIZE,) packed rover.
        hub_offsets: (6, 5) of `linkage.set_hub_offsets`.
        q: (6,) pose.
        cy, sy: cos and sin of yaw.
        axes, pivots: of `linkage.forward_kinematics`.
        slope: (6,) filled with the change of the height per unit of each unknown.

    Returns:
        Height above the body's origin, m.
    """
    row = np.empty(6)
    slope[:] = 0.0
    total = height = 0.0
    m, a, b, c = rover[P_BODY], rover[P_BODY + 1], rover[P_BODY + 2], rover[P_BODY + 3]
    px = axes[0, 0] * a + axes[1, 0] * b + axes[2, 0] * c
    py = axes[0, 1] * a + axes[1, 1] * b + axes[2, 1] * c
    pz = axes[0, 2] * a + axes[1, 2] * b + axes[2, 2] * c
    gap_jacobian_row(rover, q, cy, sy, axes, pivots, 0, px, py, pz, 0.0, 0.0, row)
    total += m
    height += m * pz
    for k in range(3):
        slope[k] += m * row[k]
    qr, _ = right_rocker(rover, q[ROCKER])
    for side in range(2):
        arm = q[ROCKER] if side == 0 else qr
        for part in range(5):  # rocker, bogie, and the three wheels of this side
            i = 2 * (part - 2) + side if part >= 2 else (side if part == 0 else 2 + side)
            at = P_ROCKER + 4 * side if part == 0 else (P_BOGIE + 4 * side if part == 1 else P_WHEEL + 4 * i)
            m, a, b, c = rover[at], rover[at + 1], rover[at + 2], rover[at + 3]
            if part >= 2:  # a wheel's mass moves with its hub; steering turns its offset from the hub
                cs, sn = hub_offsets[i, 3], hub_offsets[i, 4]
                a, b = hub_offsets[i, 0] + cs * a - sn * b, hub_offsets[i, 1] + sn * a + cs * b
                c += hub_offsets[i, 2]
            angle = arm + q[4 + side] if i >= 2 else arm
            base = 2 + side if i >= 2 else side
            ct, st = math.cos(angle), math.sin(angle)
            px = (
                pivots[base, 0]
                + (axes[0, 0] * ct - axes[2, 0] * st) * a
                + axes[1, 0] * b
                + (axes[0, 0] * st + axes[2, 0] * ct) * c
            )
            py = (
                pivots[base, 1]
                + (axes[0, 1] * ct - axes[2, 1] * st) * a
                + axes[1, 1] * b
                + (axes[0, 1] * st + axes[2, 1] * ct) * c
            )
            pz = (
                pivots[base, 2]
                + (axes[0, 2] * ct - axes[2, 2] * st) * a
                + axes[1, 2] * b
                + (axes[0, 2] * st + axes[2, 2] * ct) * c
            )
            gap_jacobian_row(rover, q, cy, sy, axes, pivots, i, px, py, pz, 0.0, 0.0, row)
            total += m
            height += m * pz
            for k in range(6):
                slope[k] += m * row[k]
    for k in range(6):
        slope[k] /= total
    return height / total
