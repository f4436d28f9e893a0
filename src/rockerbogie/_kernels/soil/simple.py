"""Wheel-terrain laws without sinkage: Coulomb friction and an empirical slip curve."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .layout import COULOMB, DRAWBAR, L_CAP, L_CREEP, L_KIND, L_MU, L_POWER, L_RADIUS, L_RATIO, L_ROLLING, SIDE, SINKAGE, TORQUE

Array = NDArray[np.float64]

#: Rounding of min(rim, vx) of the slip curve, relative.
ROUND = 0.02


@njit
def simple_forces(law: Array, load: float, rim: float, vx: float, vy: float, out: Array) -> None:
    """Fill the forces of a law of kind COULOMB or CURVE, with their derivatives.

    Both are smooth in the sliding velocity d = (rim - vx, -vy). Coulomb: load mu d / sqrt(d² + (creep V)²), V² = (rim² + vx²) / 2
    + vy². Curve: see `curve_ratio`.

    Args:
        law: (LAW_SIZE,) packed law of kind COULOMB or CURVE.
        load: N.
        rim, vx, vy: rim speed and axle speeds along and across the heading; rim at least 0, not all 0.
        out: (4, 5) filled: rows drawbar N, side N, torque N m, sinkage m (0); columns value and derivatives with respect to
            load, rim, vx and vy.
    """
    dx, dy = rim - vx, -vy
    d2 = dx * dx + dy * dy
    if law[L_KIND] == COULOMB:
        e2 = law[L_CREEP] * law[L_CREEP]
        root2 = d2 + e2 * (0.5 * (rim * rim + vx * vx) + vy * vy)
        root = math.sqrt(root2)
        ratio = law[L_MU] / root
        half = -ratio / root2
        r_rim = half * (dx + 0.5 * e2 * rim)
        r_vx = half * (-dx + 0.5 * e2 * vx)
        r_vy = half * (1.0 + e2) * vy
        rolling = 0.0
    else:
        ratio, r_rim, r_vx, r_vy = curve_ratio(law, rim, vx, vy)
        rolling = law[L_ROLLING]
    radius = law[L_RADIUS]
    out[DRAWBAR, 0] = load * ratio * dx
    out[DRAWBAR, 1] = ratio * dx
    out[DRAWBAR, 2] = load * (r_rim * dx + ratio)
    out[DRAWBAR, 3] = load * (r_vx * dx - ratio)
    out[DRAWBAR, 4] = load * r_vy * dx
    out[SIDE, 0] = load * ratio * dy
    out[SIDE, 1] = ratio * dy
    out[SIDE, 2] = load * r_rim * dy
    out[SIDE, 3] = load * r_vx * dy
    out[SIDE, 4] = load * (r_vy * dy - ratio)
    for k in range(5):
        out[TORQUE, k] = radius * out[DRAWBAR, k]
        out[SINKAGE, k] = 0.0
    out[TORQUE, 0] += radius * rolling * load
    out[TORQUE, 1] += radius * rolling


@njit
def curve_ratio(law: Array, rim: float, vx: float, vy: float) -> tuple[float, float, float, float]:
    """Return force over load and sliding speed of the slip curve, with derivatives.

    Drawbar over load is D = D0 t^(1/m) with t = slip / (1 - slip), so that slip = (D/D0)^m / (1 + (D/D0)^m). Generally t is
    the sliding speed over the smaller of rim and vx. t is limited to the cap, and the root is linear below the creep.

    Args:
        law: (LAW_SIZE,) packed law of kind CURVE.
        rim, vx, vy: as for `simple_forces`.

    Returns:
        Ratio, s/m, and its derivatives with respect to rim, vx and vy.
    """
    mean, half = 0.5 * (rim + vx), 0.5 * (rim - vx)
    root = math.sqrt(half * half + ROUND * ROUND * mean * mean)
    least, l_rim, l_vx = 0.0, 0.0, 0.0
    if mean > root:
        least = mean - root
        curl = ROUND * ROUND * mean
        if root > 0.0:
            l_rim, l_vx = 0.5 - 0.5 * (half + curl) / root, 0.5 - 0.5 * (curl - half) / root
    slide = math.sqrt((rim - vx) ** 2 + vy * vy)
    cap = 1.0 / law[L_CAP]
    capped = cap * slide
    bottom = math.sqrt(math.sqrt(least**4 + capped**4))
    by_least, by_slide = (least / bottom) ** 3, cap * (capped / bottom) ** 3
    s_rim, s_vx, s_vy = 0.0, 0.0, 0.0
    if slide > 0.0:
        s_rim, s_vx, s_vy = (rim - vx) / slide, (vx - rim) / slide, vy / slide
    t = slide / bottom
    e2 = law[L_CREEP] * law[L_CREEP]
    power = -0.5 * (1.0 - 1.0 / law[L_POWER])
    core = t * t + e2
    head = law[L_RATIO] * core**power
    ratio = head / bottom
    # d ln ratio = 2 power t dt / core - d bottom / bottom, dt = (d slide - t d bottom) / bottom
    a = 2.0 * power * t / core / bottom
    b = -a * t - 1.0 / bottom
    return (
        ratio,
        ratio * (a * s_rim + b * (by_least * l_rim + by_slide * s_rim)),
        ratio * (a * s_vx + b * (by_least * l_vx + by_slide * s_vx)),
        ratio * (a * s_vy + b * by_slide * s_vy),
    )
