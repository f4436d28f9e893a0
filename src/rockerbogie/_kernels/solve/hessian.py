"""Quasi-Newton Hessian of the potential energy under contact forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit

Array = NDArray[np.float64]


@njit
def reset_hessian(hessian: Array) -> None:
    """Reset the Hessian to the same small curvature in every direction.

    Args:
        hessian: (6, 6) filled.
    """
    for i in range(6):
        for j in range(6):
            hessian[i, j] = 0.5 if i == j else 0.0


@owning_njit
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
