"""Number of separate contacts of one wheel, from the local minima of its gap."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import njit, owning_njit
from ..model.ground import META_DX, META_DY, Ground
from ..model.tolerances import GAP_TIE, NEARBY, ONE_CONTACT
from ..model.wheel import AZ, COS, COSINE, EX, EY, GAP, HALF, HX, HY, PLACE, RADIUS, SIN, VX, VY, gap_at, tread_point

Array = NDArray[np.float64]

STEPS_PER_CELL = 8


@owning_njit
def count_contacts(ground: Ground, w: Array, contacts: Array, count: int, keep: float) -> int:
    """Return the number of separate contacts of a tread.

    Two local minima belong to one contact if they are closer than `ONE_CONTACT` of the radius, if the gap is at most `keep`
    all along the straight line between them in (φ, s), or if both belong to one contact with a third.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel.
        contacts: (n, CONTACT_SIZE) local minima of the gap.
        count: number of minima listed.
        keep: m, the largest gap of a contact.
    """
    if count <= 1:
        return count
    label = np.arange(count)  # of two that are joined, the later takes the earlier's label; -1: no minimum
    for i in range(count):
        if not _is_minimum(ground, w, contacts[i]):
            label[i] = -1
            continue
        for j in range(i - 1, -1, -1):
            if label[j] >= 0 and label[i] != label[j]:
                apart = abs(contacts[i, SIN] - contacts[j, SIN]) * w[RADIUS] + abs(contacts[i, PLACE] - contacts[j, PLACE])
                if apart < ONE_CONTACT * w[RADIUS] or _joined(ground, w, contacts[i], contacts[j], keep):
                    old = label[i]
                    for k in range(i + 1):
                        if label[k] == old:
                            label[k] = label[j]
    separate = 0
    for i in range(count):
        separate += label[i] == i
    return max(separate, 1)


@njit
def _is_minimum(ground: Ground, w: Array, a: Array) -> bool:
    """Return True if the gap is not lower in any of eight directions from a point of the tread.

    The search of a cell also lists points where the gap falls further on in the next cell, or from a rim into the tread. The
    directions are both of φ, of s, and of the grid's axes: first-order descent on a smooth surface, across an edge of bilinear
    cells, from a node or from a rim shows in one of them.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel.
        a: (CONTACT_SIZE,) the point.
    """
    grid, _, meta = ground
    r = w[RADIUS]
    step = NEARBY * min(min(meta[META_DX], meta[META_DY]), r)
    px, py, _ = tread_point(w, a[SIN], a[COSINE], a[PLACE])
    for direction in range(8):
        size = step if direction % 2 == 0 else -step
        sine, cosine, s = a[SIN], a[COSINE], a[PLACE]
        if direction < 2:
            norm = math.sqrt(1.0 + (size / r) ** 2)
            sine, cosine = (sine + cosine * size / r) / norm, (cosine - sine * size / r) / norm
        elif direction < 4:
            s += size
        else:
            x, y = px + (size if direction < 6 else 0.0), py + (size if direction >= 6 else 0.0)
            sine = (x * w[EX] + y * w[EY]) / r
            if abs(sine) >= 1.0:
                continue
            cosine = math.copysign(math.sqrt(1.0 - sine * sine), cosine)
            s = (x * w[VX] + y * w[VY] - r * cosine * w[AZ]) / w[COS]
        if abs(s) <= w[HALF] and gap_at(grid, meta, w, sine, cosine, s) < a[GAP] - GAP_TIE:
            return False
    return True


@njit
def _joined(ground: Ground, w: Array, a: Array, b: Array, keep: float) -> bool:
    """Return True if the gap is at most `keep` along the line between two contacts in (φ, s).

    The gap is computed in steps of 1 / STEPS_PER_CELL of a cell. Where a step crosses a grid line of both axes, the
    piece over the cell between is computed too.

    Args:
        ground: terrain.
        w: (WHEEL_SIZE,) wheel.
        a, b: (CONTACT_SIZE,) contacts.
        keep: m.
    """
    grid, _, meta = ground
    dx, dy = meta[META_DX], meta[META_DY]
    phi, s = math.atan2(a[SIN], a[COSINE]), a[PLACE]
    turn, slide = math.atan2(b[SIN] * a[COSINE] - b[COSINE] * a[SIN], b[COSINE] * a[COSINE] + b[SIN] * a[SIN]), b[PLACE] - s
    n = STEPS_PER_CELL * (1 + int((abs(turn) * w[RADIUS] + abs(slide)) / min(dx, dy)))
    px, py, _ = tread_point(w, a[SIN], a[COSINE], s)
    column, row = (w[HX] + px) / dx, (w[HY] + py) / dy
    for k in range(1, n + 1):
        t = k / n
        sine, cosine = math.sin(phi + t * turn), math.cos(phi + t * turn)
        px, py, _ = tread_point(w, sine, cosine, s + t * slide)
        next_column, next_row = (w[HX] + px) / dx, (w[HY] + py) / dy
        if math.floor(column) != math.floor(next_column) and math.floor(row) != math.floor(next_row):
            # the step crosses a grid line of each axis at these parts of its length
            first = (max(math.floor(column), math.floor(next_column)) - column) / (next_column - column)
            second = (max(math.floor(row), math.floor(next_row)) - row) / (next_row - row)
            u = (k - 1 + 0.5 * (first + second)) / n
            if not gap_at(grid, meta, w, math.sin(phi + u * turn), math.cos(phi + u * turn), s + u * slide) <= keep:
                return False
        if not gap_at(grid, meta, w, sine, cosine, s + t * slide) <= keep:
            return False
        column, row = next_column, next_row
    return True
