"""Relations between joint angles as polynomials counted from rest.

They come from `mimic` and from joint equalities.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.polynomial.polynomial import polyval

from ...arrays import Array
from ...errors import RoverError
from ..differential import MOST_COEFFICIENTS
from .tree import Tree

#: A polynomial is inverted over this reach (rad), to this error (rad).
REACH, INVERSE_ERROR = 0.6, 1e-9


def compose(p: Array, q: Array, what: str) -> Array:
    """Return right = Σ cₖ leftᵏ, given left = p(t) and right = q(t), both without constant term.

    Args:
        p, q: coefficients, lowest power first.
        what: the file's name, for messages.

    Returns:
        Coefficients c, lowest power first.

    Raises:
        RoverError: p cannot be inverted, or by no polynomial.
    """
    if len(p) == 2:
        return np.asarray(q / p[1] ** np.arange(len(q)))
    t = np.linspace(-REACH, REACH, 401)
    left, right = polyval(t, p), polyval(t, q)
    order = np.argsort(left)
    left, right, inside = left[order], right[order], np.abs(left[order]) > 1e-9
    if (np.sign(np.diff(polyval(t, p))) == np.sign(p[1])).all() and p[1] != 0:
        domain = [float(left[0]), float(left[-1])]
        for count in range(1, MOST_COEFFICIENTS):
            slope = Chebyshev.fit(left[inside], right[inside] / left[inside], count - 1, domain=domain)
            c = np.concatenate([[0.0], slope.convert(kind=Polynomial).coef])
            if np.abs(polyval(left, c) - right).max() < INVERSE_ERROR:
                return np.asarray(c)
    raise RoverError(f"{what}: the polynomial that ties the rockers cannot be inverted: make the right one the follower")


def tie(tree: Tree, name: str, rest: dict[str, float], what: str) -> tuple[str, Array]:
    """Return the joint that this one mimics in the end, and the polynomial from its rest.

    A joint that mimics none is returned itself.

    Args:
        tree: the tree.
        name: a joint of it.
        rest: each joint's angle at rest, rad.
        what: the file's name, for messages.

    Returns:
        The leader's name, and coefficients without constant term.

    Raises:
        RoverError: it mimics itself or a joint that is not there.
    """
    polynomial, seen = Polynomial([0.0, 1.0]), {name}
    while (mimic := tree.joints[name].mimic) is not None:
        name = mimic[0]
        if name not in tree.joints or name in seen:
            raise RoverError(f"{what}: a joint mimics {name!r}, which is {'itself' if name in seen else 'not in the file'}")
        seen.add(name)
        if polynomial.degree() * (len(mimic[1]) - 1) >= MOST_COEFFICIENTS:
            raise RoverError(f"{what}: the polynomials by which {name!r} is mimicked are too long")
        step = Polynomial(mimic[1])(Polynomial([rest[name], 1.0]))  # counted from the leader's rest
        step = step - step.coef[0]
        polynomial = polynomial(step)
    c = polynomial.coef
    if len(c) < 2 or abs(c[1]) < 1e-6:
        return f"{name} (held)", np.array([0.0, 1.0])
    return name, np.asarray(c)
