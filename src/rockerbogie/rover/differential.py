"""The differential bar: a bar across the deck, tied by a link at each end to a horn on each rocker.

Each half is a spatial four-bar (a hinge on the bar's upright axis, a ball at each end of the link, the rocker's hinge), so
the bar's angle follows from the left rocker, and the right rocker from the bar's angle, each in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import RoverError

#: Coefficients a differential may have; the packed rover has room for as many.
MOST_COEFFICIENTS = 24
#: The right rocker turns by between these shares of the left one's angle, at rest.
LEAST_RATIO, LARGEST_RATIO = 0.01, 100.0
#: The polynomial follows the linkage this closely over its whole reach, rad.
FIT_ERROR = 1e-12
#: A quartic may stand for it where nothing longer is held, if it stays this close, rad.
QUARTIC_ERROR = 1e-3
#: Angles at which the fit is made, and at which it is checked.
FIT_POINTS, CHECK_POINTS = 200, 1001


@dataclass(frozen=True)
class DifferentialBar:
    """Where the bar's parts stand at rest: left side, body frame, m; the right side is its mirror image.

    `pivot` (2,): x and z of the bar's upright axis, in the body's middle plane. `end` (3,): the bar's left end. `horn` (3,):
    where the link from that end holds the left rocker.
    """

    pivot: tuple[float, float]
    end: tuple[float, float, float]
    horn: tuple[float, float, float]

    def right(self, rocker_pivot: ArrayLike, left: ArrayLike) -> Array:
        """Angle (...) of the right rocker for the left one's (...), rad; nan where the linkage cannot close.

        Args:
            rocker_pivot: (3,) of the left rocker, m.
        """
        P = np.asarray(rocker_pivot, dtype=float)
        q = np.asarray(left, dtype=float)
        C, end, horn = np.array([self.pivot[0], 0.0, self.pivot[1]]), np.array(self.end), np.array(self.horn)
        length2 = float((horn - end) @ (horn - end))
        arm, bar = horn - P, end - C
        c, s = np.cos(q), np.sin(q)
        w = P + np.stack([c * arm[0] + s * arm[2], np.full(q.shape, arm[1]), c * arm[2] - s * arm[0]], axis=-1) - C
        turn = _close(_pair(bar, w, (0, 1)), _pair(bar, horn - C, (0, 1)), _rise(bar, w, 2, length2))
        mirror = np.array([1.0, -1.0, 1.0])
        arm, bar = arm * mirror, bar * mirror
        c, s = np.cos(turn), np.sin(turn)
        w = C + np.stack([c * bar[0] - s * bar[1], s * bar[0] + c * bar[1], np.full(q.shape, bar[2])], axis=-1) - P * mirror
        return _close(_pair(arm, w, (2, 0)), _pair(arm, end * mirror - P * mirror, (2, 0)), _rise(arm, w, 1, length2))

    def polynomial(self, rocker_pivot: ArrayLike, reach: ArrayLike) -> Array:
        """Coefficients of right = Σ cₖ leftᵏ that follow `right` to `FIT_ERROR` over the left rocker's reach.

        Args:
            rocker_pivot: (3,) of the left rocker, m.
            reach: (2,) lowest and highest angle of the left rocker, its stops, rad.

        Raises:
            RoverError: the linkage locks within the reach, or is too near it for a polynomial to follow.
        """
        low, high = np.asarray(reach, dtype=float)
        if not (np.isfinite([low, high]).all() and low < high):
            raise RoverError(
                f"a differential bar needs the rocker's stops, as it does not turn all the way; they are ({low:g}, {high:g}) rad"
            )
        check = np.linspace(low, high, CHECK_POINTS)
        exact = self.right(rocker_pivot, check)
        if np.isnan(exact).any():
            locked = float(np.abs(check[np.isnan(exact)]).min())
            raise RoverError(
                f"the differential bar locks when the left rocker stands at {np.degrees(locked):.1f} deg, within its stops "
                f"({np.degrees(low):.1f}, {np.degrees(high):.1f} deg): narrow rocker_limits, or lengthen the bar or its links"
            )
        nodes = _nodes(low, high)
        ratio = self.right(rocker_pivot, nodes) / nodes  # so that zero stays zero
        for count in range(1, MOST_COEFFICIENTS):
            slope = Chebyshev.fit(nodes, ratio, count - 1, domain=[low, high]).convert(kind=Polynomial).coef
            coefficients = np.concatenate([[0.0], slope])
            error = float(np.abs(polyval(check, coefficients) - exact).max())
            if error <= FIT_ERROR:
                return coefficients
        raise RoverError(
            f"the differential bar all but locks at the rocker's stops ({np.degrees(low):.1f}, {np.degrees(high):.1f} deg): "
            f"{MOST_COEFFICIENTS} coefficients follow it to {error:.1g} rad only, not {FIT_ERROR:g}: narrow rocker_limits"
        )


def quartic(coefficients: ArrayLike, reach: ArrayLike) -> Array:
    """The polynomial (5,) of the fourth power that stays nearest to a longer one over the left rocker's reach.

    For programs that hold no longer one. A bar like Perseverance's is followed to 6e-5 rad within 25 degrees, 4e-4 within 32.

    Raises:
        RoverError: the reach has no end, or the quartic errs by more than `QUARTIC_ERROR`.
    """
    c = np.asarray(coefficients, dtype=float)
    low, high = np.asarray(reach, dtype=float)
    if not np.isfinite([low, high]).all():
        raise RoverError("a differential of more than the fourth power needs the rocker's stops to be followed by a quartic")
    nodes, check = _nodes(low, high), np.linspace(low, high, CHECK_POINTS)
    slope = Chebyshev.fit(nodes, polyval(nodes, c) / nodes, 3, domain=[low, high]).convert(kind=Polynomial).coef
    near = np.concatenate([[0.0], slope])
    if (error := float(np.abs(polyval(check, near) - polyval(check, c)).max())) > QUARTIC_ERROR:
        raise RoverError(
            f"a quartic misses the differential by {error:.2g} rad, more than {QUARTIC_ERROR:g}: narrow rocker_limits"
        )
    return near


def _nodes(low: float, high: float) -> Array:
    """Chebyshev's points of an interval, but for zero."""
    nodes = (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * (np.arange(FIT_POINTS) + 0.5) / FIT_POINTS)
    return np.asarray(nodes[np.abs(nodes) > 1e-9])


def check_ratio(slope: float, what: str) -> None:
    """Refuse a differential that does not turn the right rocker against the left one, or hardly, or hardly anything else.

    Raises:
        RoverError: the right rocker's turn to the left one's, at rest, is not between -`LARGEST_RATIO` and -`LEAST_RATIO`.
    """
    if not LEAST_RATIO <= -slope <= LARGEST_RATIO:
        raise RoverError(
            f"{what}: differential must turn the right rocker against the left one, by -{LEAST_RATIO:g} to -{LARGEST_RATIO:g} "
            f"of its angle; here it is {slope:.3g}"
        )


def _pair(u: Array, w: Array, plane: tuple[int, int]) -> tuple[Array, Array]:
    """A, B of A cos φ + B sin φ = (the turned u) · w within the plane, φ turning its first axis towards its second."""
    i, j = plane
    return u[i] * w[..., i] + u[j] * w[..., j], u[i] * w[..., j] - u[j] * w[..., i]


def _rise(u: Array, w: Array, axis: int, length2: float) -> Array:
    """What A cos φ + B sin φ must be for the turned u to end a link's length from w."""
    return np.asarray((u @ u + (w * w).sum(axis=-1) - length2) / 2 - u[axis] * w[..., axis])


def _close(pair: tuple[Array, Array], rest: tuple[Array, Array], rise: Array) -> Array:
    """The angle φ (...) on the branch that passes through 0 at rest; nan where there is none."""
    A, B = pair
    lead = np.arctan2(rest[1], rest[0])
    if abs(np.sin(lead)) < 1e-6:
        raise RoverError("the differential bar's link is in line with its arm at rest (a dead centre): it could turn either way")
    with np.errstate(invalid="ignore"):
        swing = np.arccos(rise / np.hypot(A, B))
    phi = np.arctan2(B, A) - np.sign(lead) * swing
    return np.asarray(np.arctan2(np.sin(phi), np.cos(phi)))
