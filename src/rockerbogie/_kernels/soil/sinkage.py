"""Load balance of a wheel: the sinkage at which the soil carries the load."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .layout import COMPUTED, L_DEEPEST, L_EXPONENT, L_RADIUS, L_STIFFNESS, L_WIDTH, NOT_CONVERGED, OVERLOADED
from .stress import motion_stress_forces

Array = NDArray[np.float64]

#: Growth and shrinkage of the sinkage while a bracket is searched.
GROW, SHRINK = 1.5, 0.5
MOST_STEPS = 80
#: Relative residual of the load at which the balance counts as solved.
BALANCED = 1e-11


@njit
def first_sinkage(law: Array, load: float) -> float:
    """Return Bekker's estimate of the sinkage of a towed rigid wheel.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        load: N, above 0.

    Returns:
        Above 0 and at most the law's largest sinkage, m.
    """
    n = min(law[L_EXPONENT], 2.0)
    z = (3.0 * load / (law[L_WIDTH] * law[L_STIFFNESS] * (3.0 - n) * math.sqrt(2.0 * law[L_RADIUS]))) ** (2.0 / (2.0 * n + 1.0))
    return min(max(z, 1e-12 * law[L_RADIUS]), law[L_DEEPEST])


@njit
def balanced_forces(law: Array, load: float, rim: float, vx: float, vy: float, out: Array) -> tuple[float, int]:
    """Fill the forces at the sinkage that carries the load.

    The smallest bracket around Bekker's estimate is found by growing or shrinking it; false position with Anderson and
    Bjorck's weights then converges inside the bracket.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        load: N, above 0.
        rim, vx, vy: motion as for `motion_stress_forces`.
        out: (4,) filled with drawbar N, side force N, torque N m, vertical force N. If the soil cannot carry the load, they
            are those at the law's largest sinkage.

    Returns:
        Sinkage, m, and COMPUTED, OVERLOADED or NOT_CONVERGED.
    """
    deepest = law[L_DEEPEST]
    high = first_sinkage(law, load)
    motion_stress_forces(law, high, rim, vx, vy, out)
    f_high = out[3] - load
    low, f_low = high, f_high
    if f_high < 0.0:
        while f_high < 0.0:
            if high >= deepest:
                return deepest, OVERLOADED
            low, f_low = high, f_high
            high = min(high * GROW, deepest)
            motion_stress_forces(law, high, rim, vx, vy, out)
            f_high = out[3] - load
    else:
        while f_low > 0.0:
            high, f_high = low, f_low
            low *= SHRINK
            if low < 1e-15 * deepest:
                break
            motion_stress_forces(law, low, rim, vx, vy, out)
            f_low = out[3] - load
    z = high
    for _ in range(MOST_STEPS):
        z = high - f_high * (high - low) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
        if not low < z < high:
            z = 0.5 * (low + high)
        motion_stress_forces(law, z, rim, vx, vy, out)
        f = out[3] - load
        if abs(f) <= BALANCED * load or high - low <= 1e-15 * high:
            return z, COMPUTED
        if f > 0.0:
            ratio = 1.0 - f / f_high
            f_low *= ratio if ratio > 0.0 else 0.5
            high, f_high = z, f
        else:
            ratio = 1.0 - f / f_low
            f_high *= ratio if ratio > 0.0 else 0.5
            low, f_low = z, f
    return z, NOT_CONVERGED
