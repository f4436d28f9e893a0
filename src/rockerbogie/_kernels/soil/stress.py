"""Stresses under a rigid wheel in soil, and their resultant at a given sinkage."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from .layout import (
    L_BULLDOZE_1,
    L_BULLDOZE_2,
    L_COHESION,
    L_COUPLED,
    L_EXIT,
    L_EXPONENT,
    L_FRICTION,
    L_KX,
    L_KX_ANGLE,
    L_KY,
    L_KY_ANGLE,
    L_LUG,
    L_LUG_EXIT,
    L_LUG_EXPONENT,
    L_PEAK,
    L_RADIUS,
    L_STIFFNESS,
    L_TRAVEL,
    L_WIDTH,
    LOCKED,
)  # fmt: skip

Array = NDArray[np.float64]

#: Gauss-Legendre nodes on each side of the peak. With x -> x² they cluster at the ends, where the pressure starts as a power.
NODES = 20
_X, _W = np.polynomial.legendre.leggauss(NODES)
POINTS: Array = (0.5 + 0.5 * _X) ** 2
WEIGHTS: Array = _W * (0.5 + 0.5 * _X)
#: Above slip 1 - SPINNING, the slip angle that enters the shear moduli is reduced, so that forces are continuous at slip 1.
SPINNING = 0.1
#: Side motion is rounded at 0 over this sine of the slip angle, so that forces are smooth there.
SIDE_ROUND = 0.1
#: Below this ratio of travel to rim speed side motion no longer counts.
STILL = 0.05
#: Least exponent of the pressure.
LEAST_EXPONENT = 0.2
#: The peak stays this fraction of the contact arc away from both ends; over a further fraction the limit is rounded.
PEAK_MARGIN, PEAK_ROUND = 0.02, 0.08
#: Exit fractions below this are rounded towards 0.
LEAST_EXIT = 0.1


@njit
def slip_of(rim: float, vx: float) -> float:
    """Return the slip of a wheel that turns forward and moves forward.

    Args:
        rim: rim speed, radius times rate, at least 0, m/s.
        vx: speed of the axle along the heading, or of its travel, at least 0, m/s.

    Returns:
        (rim − vx) / max(rim, vx), from −1 (locked) to 1 (spinning on the spot); 0 if both are 0.
    """
    top = max(rim, vx)
    return (rim - vx) / top if top > 0.0 else 0.0


@njit
def side_motion(rim: float, vx: float, vy: float) -> float:
    """Return the side motion y of a wheel, a smooth form of |sin(slip angle)|.

    Args:
        rim, vx, vy: rim speed and axle speeds along and across the heading, not all 0.

    Returns:
        sqrt(q + e²) - e with q = vy² / (vx² + vy² + (0.05 rim)²) and e = 0.1: 0 to 0.905.
    """
    q = vy * vy / (vx * vx + vy * vy + (STILL * rim) ** 2)
    return math.sqrt(q + SIDE_ROUND * SIDE_ROUND) - SIDE_ROUND


@njit
def contact_term(law: Array, first: int, slip: float, side: float) -> float:
    """Return a quantity that depends on slip s and side motion y.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        first: index of its terms c: L_EXPONENT, L_PEAK or L_EXIT.
        slip: s.
        side: y.

    Returns:
        c0 + c1 s + c2 s² + y (c3 + c4 s + c5 s²).
    """
    rolling = law[first] + slip * (law[first + 1] + slip * law[first + 2])
    return rolling + side * (law[first + 3] + slip * (law[first + 4] + slip * law[first + 5]))


@njit
def smooth_floor(value: float, width: float) -> float:
    """Return max(value, 0), rounded so that its derivative is continuous.

    Args:
        value: any number.
        width: the rounding is between 0 and this.

    Returns:
        0 up to 0, the value from `width` on, a cubic between.
    """
    t = min(max(value / width, 0.0), 1.0)
    return value if value >= width else width * t * t * (2.0 - t)


@njit
def contact_arc(law: Array, sinkage: float, slip: float, side: float) -> tuple[float, float, float]:
    """Return the ends of the contact arc and the angle of the largest normal stress.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        sinkage: below the radius, m.
        slip: from -1 to 1.
        side: side motion (`side_motion`).

    Returns:
        Entry, peak and exit angle from the downward vertical, forward positive, rad.
    """
    radius = law[L_RADIUS]
    entry = math.acos(max(1.0 - sinkage / radius, -1.0))
    fraction = contact_term(law, L_EXIT, slip, side) + law[L_LUG_EXIT] * law[L_LUG] * slip * max(slip, 0.0)
    leave = -math.acos(1.0 - min(smooth_floor(fraction, LEAST_EXIT) * sinkage / radius, 1.0))
    place = (contact_term(law, L_PEAK, slip, side) * entry - leave) / (entry - leave)
    place = PEAK_MARGIN + smooth_floor(place - PEAK_MARGIN, PEAK_ROUND)
    place = 1.0 - PEAK_MARGIN - smooth_floor(1.0 - PEAK_MARGIN - place, PEAK_ROUND)
    return entry, leave + place * (entry - leave), leave


@njit
def shear_stress(law: Array, normal: float, jx: float, jy: float, kx: float, ky: float) -> tuple[float, float]:
    """Return the shear stress of Janosi and Hanamoto.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        normal: normal stress, Pa.
        jx, jy: shear displacements along the rim and across the wheel, m.
        kx, ky: shear moduli, m.

    Returns:
        Components along the rim and across the wheel, Pa, with the signs of jx and jy.
    """
    strength = law[L_COHESION] + normal * law[L_FRICTION]
    if law[L_COUPLED] != 0.0:
        j = math.sqrt(jx * jx + jy * jy)
        mobilised = math.sqrt((jx / kx) ** 2 + (jy / ky) ** 2)
        if mobilised < 1e-9:
            return strength * jx / kx, strength * jy / ky
        scale = -strength * math.expm1(-mobilised) / j
        return scale * jx, scale * jy
    return (
        math.copysign(strength * math.expm1(-abs(jx) / kx), jx),
        math.copysign(strength * math.expm1(-abs(jy) / ky), jy),
    )


@njit
def stress_forces(
    law: Array, sinkage: float, slip: float, side: float, angle: float, along: float, across: float, out: Array
) -> None:
    """Fill the resultant of the stresses under a wheel at a given sinkage.

    Normal stress after Wong and Reece (1967), shear stress after Janosi and Hanamoto (1961), shear displacements and the
    bulldozing of the side wall after Ishigami et al. (2007).

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        sinkage: above 0 and below the radius, m.
        slip, side: slip and side motion that change exponent, peak and exit.
        angle: slip angle that changes the shear moduli, rad.
        along, across: axle speeds along and across the heading over the speed of the grousers' tips.
        out: (4,) filled with drawbar N, side force N, torque N m, vertical force N.
    """
    radius, width = law[L_RADIUS], law[L_WIDTH]
    entry, peak, leave = contact_arc(law, sinkage, slip, side)
    cos_entry, sin_entry = math.cos(entry), math.sin(entry)
    dig = law[L_LUG_EXPONENT] * law[L_LUG] * slip * max(slip, 0.0)
    exponent = max(contact_term(law, L_EXPONENT, slip, side) + dig, LEAST_EXPONENT)
    scale = law[L_STIFFNESS] * radius**exponent
    kx = law[L_KX] + law[L_KX_ANGLE] * abs(angle)
    ky = law[L_KY] + law[L_KY_ANGLE] * abs(angle)
    fx, fy, fz, torque, wall = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(NODES):
        normal = scale * max(math.cos(entry - (entry - peak) * POINTS[i]) - cos_entry, 0.0) ** exponent
        for rear in range(2):
            if rear == 0:
                theta, weight = entry - (entry - peak) * POINTS[i], (entry - peak) * WEIGHTS[i]
            else:
                theta, weight = leave + (peak - leave) * POINTS[i], (peak - leave) * WEIGHTS[i]
            s, c = math.sin(theta), math.cos(theta)
            jx = radius * (entry - theta - along * (sin_entry - s))
            jy = -radius * across * (entry - theta)
            tx, ty = shear_stress(law, normal, jx, jy, kx, ky)
            fx += weight * radius * (tx * c - normal * s)
            fz += weight * radius * (tx * s + normal * c)
            fy += weight * radius * ty
            torque += weight * radius * tx
            depth = max(radius * (c - cos_entry), 0.0)
            wall += weight * depth * (law[L_BULLDOZE_1] + law[L_BULLDOZE_2] * depth) * (radius - depth * c)
    reach = radius * abs(across) * (entry - leave)
    out[0] = width * fx
    out[1] = width * fy - math.copysign(wall * math.expm1(-reach / ky), across)
    out[2] = width * radius * torque
    out[3] = width * fz


@njit
def motion_stress_forces(law: Array, sinkage: float, rim: float, vx: float, vy: float, out: Array) -> None:
    """Fill the resultant of the stresses for a wheel in a given motion.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        sinkage: above 0 and below the radius, m.
        rim, vx, vy: rim speed and axle speeds along and across the heading; rim and vx at least 0, not all 0.
        out: (4,) filled with drawbar N, side force N, torque N m, vertical force N.
    """
    turn = max(rim, LOCKED * (vx + abs(vy))) * (1.0 + law[L_LUG])
    angle = math.atan2(vy, max(vx, SPINNING * rim))
    speed = math.sqrt(vx * vx + vy * vy) if law[L_TRAVEL] != 0.0 else vx
    stress_forces(law, sinkage, slip_of(rim, speed), side_motion(rim, vx, vy), angle, vx / turn, vy / turn, out)
