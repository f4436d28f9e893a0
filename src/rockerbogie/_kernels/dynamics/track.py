"""Tracking of a contact on cubic terrain from a position nearby."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit
from ..model.ground import surface
from ..model.wheel import AX, AY, AZ, COSINE, EX, EY, GAP, HALF, HX, HY, HZ, PLACE, RADIUS, SIN, UX, UY, UZ

Array = NDArray[np.float64]

STEPS = 12  # Newton steps
ARRIVED = 1e-7  # rad, and of the radius: the gap of a contact that is off by less is exact to rounding
LONGEST = 0.3  # rad: longest step


@njit
def track_contact(grid: Array, meta: Array, w: Array, t: Array) -> bool:
    """Move a contact to the nearby minimum of the tread's gap, by Newton's method in φ and s.

    Args:
        grid, meta: cubic terrain.
        w: (WHEEL_SIZE,) wheel.
        t: (CONTACT_SIZE,) contact nearby; replaced.

    Returns:
        False if no minimum was found nearby, or the terrain has no data there.
    """
    r, half = w[RADIUS], w[HALF]
    sine, cosine, s = t[SIN], t[COSINE], t[PLACE]
    for _ in range(STEPS):
        tx, ty, tz = r * (cosine * w[EX] + sine * w[UX]), r * (cosine * w[EY] + sine * w[UY]), r * sine * w[UZ]
        nx, ny, nz = r * (-sine * w[EX] + cosine * w[UX]), r * (-sine * w[EY] + cosine * w[UY]), r * cosine * w[UZ]
        h, gx, gy, hxx, hxy, hyy = surface(grid, meta, w[HX] + s * w[AX] - nx, w[HY] + s * w[AY] - ny)
        bx, by = hxx * tx + hxy * ty, hxy * tx + hyy * ty
        slope, along = tz - gx * tx - gy * ty, w[AZ] - gx * w[AX] - gy * w[AY]
        curve = nz - gx * nx - gy * ny - bx * tx - by * ty
        mixed = -(bx * w[AX] + by * w[AY])
        across = -(hxx * w[AX] * w[AX] + 2.0 * hxy * w[AX] * w[AY] + hyy * w[AY] * w[AY])
        if not curve > 0.0:
            return False
        move = 0.0
        if half > 0.0 and not (s == half and along <= 0.0) and not (s == -half and along >= 0.0):
            rest = across - mixed * mixed / curve  # of the minima over φ, along the width
            fall = along - mixed * slope / curve
            goal = s - fall / rest if rest > 0.0 else math.copysign(half, -fall)
            move = min(max(goal, -half), half) - s
        turn = -(slope + mixed * move) / curve
        turn = min(max(turn, -LONGEST), LONGEST)
        if abs(turn) < ARRIVED and abs(move) < ARRIVED * r:
            t[GAP] = w[HZ] + s * w[AZ] - nz - h
            t[SIN], t[COSINE], t[PLACE] = sine, cosine, s
            return t[GAP] == t[GAP]
        size = math.sqrt(1.0 + turn * turn)
        sine, cosine = (sine + cosine * turn) / size, (cosine - sine * turn) / size
        s += move
        if abs(s) > half - 1e-12 * r:
            s = math.copysign(half, s)
    return False
