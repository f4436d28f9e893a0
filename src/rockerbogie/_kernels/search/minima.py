"""Local minima of a tread's gap: the lowest, and a list of those with a small gap."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..jit.decorators import inlined, njit
from ..model.tolerances import CONTACT_TIE, SAME_CONTACT
from ..model.wheel import COSINE, GAP, PLACE, RADIUS, SIN

Array = NDArray[np.float64]

BESIDE = 1e-4  # rad


class Minima(NamedTuple):
    """Local minima of a tread's gap that a search finds."""

    lowest: Array  # (CONTACT_SIZE,) the lowest point so far
    keep: float  # m: points with a gap up to this are listed
    contacts: Array  # (n, CONTACT_SIZE) the list; n may be 0


@inlined
def keep_lower_contact(w: Array, found: Minima, gap: float, sine: float, cosine: float, s: float, count: int) -> int:
    """Keep a point of the tread if it is the lowest so far, and list it if its gap is small.

    Points that tie within `CONTACT_TIE` do not replace each other; a point within `BESIDE` of the lowest on the same rim
    is the same one, refined.

    Args:
        w: (WHEEL_SIZE,) wheel.
        found: lowest point and list; replaced or extended.
        gap: m, the point's gap.
        sine, cosine, s: sin φ, cos φ and m along the axle.
        count: number of points listed.

    Returns:
        The new count.
    """
    lowest, keep, contacts = found
    # contacts that tie up to rounding do not alternate; one beside the lowest is the same contact, refined
    beside = abs(sine - lowest[SIN]) + abs(cosine - lowest[COSINE]) < BESIDE and s == lowest[PLACE]
    if gap < lowest[GAP] - CONTACT_TIE or (beside and gap < lowest[GAP] + CONTACT_TIE):
        lowest[GAP], lowest[SIN], lowest[COSINE], lowest[PLACE] = gap, sine, cosine, s
    if gap <= keep and contacts.shape[0] > 0:
        for k in range(count):  # cells that share a node or an edge find the same minimum: it takes one row of the list
            apart = max(abs(contacts[k, SIN] - sine), abs(contacts[k, COSINE] - cosine))
            if apart < SAME_CONTACT and abs(contacts[k, PLACE] - s) < SAME_CONTACT * w[RADIUS]:
                if gap < contacts[k, GAP]:
                    contacts[k, GAP], contacts[k, SIN], contacts[k, COSINE], contacts[k, PLACE] = gap, sine, cosine, s
                return count
        spot = count if count < contacts.shape[0] else dispensable(w, contacts, gap, sine, cosine, s)
        if spot >= 0:
            contacts[spot, GAP], contacts[spot, SIN], contacts[spot, COSINE], contacts[spot, PLACE] = gap, sine, cosine, s
        count = min(count + 1, contacts.shape[0])
    return count


@njit
def dispensable(w: Array, contacts: Array, gap: float, sine: float, cosine: float, s: float) -> int:
    """Return the index of the contact to replace when the list is full.

    It is -1 if the new one is to be dropped. Of the two contacts closest to each other the higher one goes. If the new
    one is within a tenth of the radius of one listed, these two
    are taken.

    Args:
        w: (WHEEL_SIZE,) wheel.
        contacts: (n, CONTACT_SIZE) full list.
        gap, sine, cosine, s: the new contact.
    """
    n = contacts.shape[0]
    r = w[RADIUS]
    closest, spot = math.inf, -1
    for i in range(n):
        apart = r * (abs(contacts[i, SIN] - sine) + abs(contacts[i, COSINE] - cosine)) + abs(contacts[i, PLACE] - s)
        if apart < closest:
            closest, spot = apart, (i if contacts[i, GAP] > gap else -1)
    if closest < 0.1 * r:  # two of one neighbourhood: no need to find the closest pair
        return spot
    for i in range(n):
        for j in range(i):
            apart = r * (abs(contacts[i, SIN] - contacts[j, SIN]) + abs(contacts[i, COSINE] - contacts[j, COSINE]))
            apart += abs(contacts[i, PLACE] - contacts[j, PLACE])
            if apart < closest:
                closest, spot = apart, (i if contacts[i, GAP] > contacts[j, GAP] else j)
    return spot
