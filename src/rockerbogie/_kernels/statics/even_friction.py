"""Forces with about the least friction, by reweighted least squares."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import owning_njit
from .least_norm import least_norm

Array = NDArray[np.float64]

LAWSON_ROUNDS = 7
THIN = 0.03  # scale of tangential forces against normal ones in these rounds
LIGHT = 0.03  # of the weight: normal forces below it count as this
LEAST_SHARE = 1e-4


@owning_njit
def even_friction(columns: Array, count: int, extra: Array, more: int, b: Array, f: Array, y: Array) -> float:
    """Fill forces that balance b with about the least friction, by reweighted least squares.

    Lawson's method: each round minimizes Σ λ (t² + s²) / n², with n from the round before, and multiplies the weights λ by the
    friction used.

    Args:
        columns, count, extra, more, b: as for `least_norm`.
        f, y: (6, 3), (m,) filled with the best forces found.

    Returns:
        The friction coefficient that they use; inf if every round has forces that pull.
    """
    least = math.inf
    share, load = np.full(6, 1.0 / count), np.full(6, 1.0 / count)
    weight, one = np.ones((6, 2)), np.ones(more)
    trial, trial_y = np.zeros((6, 3)), np.zeros(more)
    for _ in range(LAWSON_ROUNDS):
        for i in range(count):
            weight[i, 1] = THIN * load[i] / math.sqrt(count * share[i])
        if not least_norm(columns, count, extra, more, b, weight, one, trial, trial_y):
            break
        pulls, total, most = False, 0.0, 0.0
        for i in range(count):
            n = trial[i, 0]
            pulls |= not n > 0.0
            load[i] = max(n, LIGHT)
            used = math.sqrt(trial[i, 1] ** 2 + trial[i, 2] ** 2) / load[i]
            most = max(most, used)
            share[i] *= used
            total += share[i]
        for e in range(more):
            pulls |= not trial_y[e] > 0.0
        if not pulls and most < least:
            least = most
            f[:], y[:more] = trial, trial_y
        for i in range(count):
            share[i] = max(share[i] / total, LEAST_SHARE)
    return least
