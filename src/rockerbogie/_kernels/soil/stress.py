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
    L_EXIT,
    L_EXIT_SLIP,
    L_EXPONENT,
    L_EXPONENT_SLIP,
    L_FRICTION,
    L_ISOTROPIC,
    L_KX,
    L_KX_ANGLE,
    L_KY,
    L_KY_ANGLE,
    L_PEAK,
    L_PEAK_DRIVE,
    L_PEAK_SKID,
    L_RADIUS,
    L_REFERENCE,
    L_SHEAR_RADIUS,
    L_STIFFNESS,
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
#: The peak stays this fraction of the contact arc away from both ends.
PEAK_MARGIN = 0.02


@njit
def slip_of(rim: float, vx: float) -> float:
    """Return the slip of a wheel that turns forward and moves forward.

    Args:
        rim: rim speed, radius times rate, at least 0, m/s.
        vx: speed of the axle along the heading, at least 0, m/s.

    Returns:
        (rim − vx) / max(rim, vx), from −1 (locked) to 1 (spinning on the spot); 0 if both are 0.
    """
    top = max(rim, vx)
    return (rim - vx) / top if top > 0.0 else 0.0


@njit
def contact_arc(law: Array, sinkage: float, slip: float) -> tuple[float, float, float]:
    """Return the ends of the contact arc and the angle of the largest normal stress.

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        sinkage: below the radius, m.
        slip: from -1 to 1.

    Returns:
        Entry, peak and exit angle from the downward vertical, forward positive, rad.
    """
    radius = law[L_RADIUS]
    entry = math.acos(max(1.0 - sinkage / radius, -1.0))
    left = min(max(law[L_EXIT] + law[L_EXIT_SLIP] * abs(slip), 0.0) * sinkage / radius, 1.0)
    leave = -math.acos(1.0 - left)
    peak = (law[L_PEAK] + (law[L_PEAK_DRIVE] if slip > 0.0 else law[L_PEAK_SKID]) * slip) * entry
    margin = PEAK_MARGIN * (entry - leave)
    return entry, min(max(peak, leave + margin), entry - margin), leave


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
    if law[L_ISOTROPIC] != 0.0:
        j = math.sqrt(jx * jx + jy * jy)
        if j < 1e-9 * kx:
            return strength * jx / kx, strength * jy / kx
        scale = -strength * math.expm1(-j / kx) / j
        return scale * jx, scale * jy
    return (
        math.copysign(strength * math.expm1(-abs(jx) / kx), jx),
        math.copysign(strength * math.expm1(-abs(jy) / ky), jy),
    )


@njit
def stress_forces(law: Array, sinkage: float, slip: float, angle: float, along: float, across: float, out: Array) -> None:
    """Fill the resultant of the stresses under a wheel at a given sinkage.

    Normal stress after Wong and Reece (1967), shear stress after Janosi and Hanamoto (1961), shear displacements and the
    bulldozing of the side wall after Ishigami et al. (2007).

    Args:
        law: (LAW_SIZE,) packed law of kind SOIL.
        sinkage: above 0 and below the radius, m.
        slip: slip that moves the peak and changes the exponent, -1 to 1.
        angle: slip angle that changes the shear moduli, rad.
        along, across: axle speeds along and across the heading over the rim speed.
        out: (4,) filled with drawbar N, side force N, torque N m, vertical force N.
    """
    radius, shear_radius, width = law[L_RADIUS], law[L_SHEAR_RADIUS], law[L_WIDTH]
    entry, peak, leave = contact_arc(law, sinkage, slip)
    cos_entry, sin_entry = math.cos(entry), math.sin(entry)
    more = law[L_EXPONENT_SLIP] * abs(slip)
    exponent = law[L_EXPONENT] + more
    scale = law[L_STIFFNESS] * radius**exponent
    if more != 0.0:
        scale /= law[L_REFERENCE] ** more
    kx = law[L_KX] + law[L_KX_ANGLE] * abs(angle)
    ky = law[L_KY] + law[L_KY_ANGLE] * abs(angle)
    fx, fy, fz, torque, wall = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(NODES):
        normal = scale * max(math.cos(entry - (entry - peak) * POINTS[i]) - cos_entry, 0.0) ** exponent
        for side in range(2):
            if side == 0:
                theta, weight = entry - (entry - peak) * POINTS[i], (entry - peak) * WEIGHTS[i]
            else:
                theta, weight = leave + (peak - leave) * POINTS[i], (peak - leave) * WEIGHTS[i]
            s, c = math.sin(theta), math.cos(theta)
            jx = shear_radius * (entry - theta - along * (sin_entry - s))
            jy = -radius * across * (entry - theta)
            tx, ty = shear_stress(law, normal, jx, jy, kx, ky)
            fx += weight * (shear_radius * tx * c - radius * normal * s)
            fz += weight * (shear_radius * tx * s + radius * normal * c)
            fy += weight * radius * ty
            torque += weight * shear_radius * tx
            depth = max(radius * (c - cos_entry), 0.0)
            wall += weight * depth * (law[L_BULLDOZE_1] + law[L_BULLDOZE_2] * depth) * (radius - depth * c)
    reach = radius * abs(across) * (entry - leave)
    k_wall = kx if law[L_ISOTROPIC] != 0.0 else ky
    out[0] = width * fx
    out[1] = width * fy - math.copysign(wall * math.expm1(-reach / k_wall), across)
    out[2] = width * shear_radius * torque
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
    turn = max(rim, LOCKED * (vx + abs(vy)))
    angle = math.atan2(vy, max(vx, SPINNING * rim))
    stress_forces(law, sinkage, slip_of(rim, vx), angle, vx / turn, vy / turn, out)
