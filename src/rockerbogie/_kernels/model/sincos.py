"""Sine and cosine of many angles at once, without branches: for SIMD."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import fma_njit, inlined

Array = NDArray[np.float64]

#: π/2 in three parts, the first two short: an angle minus k times their sum is exact to 1e-16 for |k| < 2^20.
PART_1, PART_2, PART_3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
#: fdlibm's polynomials within ±π/4 (Sun Microsystems, 1993).
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
#: Angles beyond this are first reduced one by one.
FAR = 1e5  # rad


@inlined
def sine_cosine(a: float) -> tuple[float, float]:
    """Return the sine and cosine of an angle, to two units in the last place; NaN for NaN.

    The angle minus its nearest multiple of π/2 is the argument of two polynomials. Arithmetic selects which of them is the
    sine, and the signs.

    Args:
        a: rad, at most `FAR` in magnitude.
    """
    turns = np.floor(a * (2.0 / math.pi) + 0.5)
    x = ((a - turns * PART_1) - turns * PART_2) - turns * PART_3
    z = x * x
    s = x + x * z * (S1 + z * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))))
    c = 1.0 - 0.5 * z + z * z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    quarter = turns - 4.0 * np.floor(turns * 0.25)  # 0, 1, 2, 3
    swap = quarter - 2.0 * np.floor(quarter * 0.5)  # 1 where sine and cosine change places
    flip = 1.0 - 2.0 * np.floor(quarter * 0.5)
    return flip * ((1.0 - swap) * s + swap * c), flip * (1.0 - 2.0 * swap) * ((1.0 - swap) * c + swap * s)


@fma_njit
def sincos(angle: Array, count: int, sine: Array, cosine: Array) -> None:
    """Compute the sine and cosine of several angles.

    Args:
        angle: (n,) rad, at most `FAR` in magnitude.
        count: number of angles, at most n.
        sine, cosine: (n,) filled up to `count`.
    """
    for k in range(count):
        sine[k], cosine[k] = sine_cosine(angle[k])
