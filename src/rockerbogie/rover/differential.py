"""Differential bar: a bar across the deck.

A link at each end joins it to a horn on each rocker.

Each half is a spatial four-bar (a hinge on the bar's upright axis, a ball at each end of the link, the rocker's hinge), so
the left rocker gives the bar's angle, and the bar's angle the right rocker, each in closed form.
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
#: Largest error of the polynomial over the linkage's whole reach, rad.
FIT_ERROR = 1e-12
#: Largest error of a quartic in formats that hold no longer polynomial, rad.
QUARTIC_ERROR = 1e-3
#: Number of angles at which the fit is made, and at which it is checked.
FIT_POINTS, CHECK_POINTS = 200, 1001


@dataclass(frozen=True)
class DifferentialBar:
    """Positions of a differential bar's parts at rest, body frame, m.

    They are those of the left side; the right side is its mirror image.

    `pivot` (2,): x and z of the bar's upright axis, in the body's middle plane. `end` (3,): the bar's left end. `horn` (3,):
    the point of the left rocker that the link from that end holds.
    """

    pivot: tuple[float, float]
    end: tuple[float, float, float]
    horn: tuple[float, float, float]

    def right(self, rocker_pivot: ArrayLike, left: ArrayLike) -> Array:
        """Return the right rocker's angle for the left one's.

        Args:
            rocker_pivot: (3,) of the left rocker, m.
            left: (...) rad.

        Returns:
            (...) rad; NaN if the linkage cannot close.

        Raises:
            RoverError: the link is in line with its arm at rest.
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
        """Return coefficients of right = Σ cₖ leftᵏ over the left rocker's reach.

        They agree with `right` to `FIT_ERROR`.

        Args:
            rocker_pivot: (3,) of the left rocker, m.
            reach: (2,) joint limits of the left rocker, rad.

        Returns:
            (n,) lowest power first, c₀ = 0.

        Raises:
            RoverError: the linkage locks within the reach, or so near it that no polynomial fits.
        """
        low, high = np.asarray(reach, dtype=float)
        if not (np.isfinite([low, high]).all() and low < high):
            raise RoverError(
                f"a differential bar needs the rocker's joint limits, as it turns only so far; they are ({low:g}, {high:g}) rad"
            )
        check = np.linspace(low, high, CHECK_POINTS)
        exact = self.right(rocker_pivot, check)
        if np.isnan(exact).any():
            locked = float(np.abs(check[np.isnan(exact)]).min())
            raise RoverError(
                f"the differential bar locks with the left rocker at {np.degrees(locked):.1f} deg, within its limits "
                f"({np.degrees(low):.1f}, {np.degrees(high):.1f} deg): narrow rocker_limits, or lengthen the bar or its links"
            )
        nodes = _nodes(low, high)
        ratio = self.right(rocker_pivot, nodes) / nodes  # so that right(0) stays 0
        for count in range(1, MOST_COEFFICIENTS):
            slope = Chebyshev.fit(nodes, ratio, count - 1, domain=[low, high]).convert(kind=Polynomial).coef
            coefficients = np.concatenate([[0.0], slope])
            error = float(np.abs(polyval(check, coefficients) - exact).max())
            if error <= FIT_ERROR:
                return coefficients
        raise RoverError(
            f"the differential bar almost locks at the rocker's limits ({np.degrees(low):.1f}, {np.degrees(high):.1f} deg): "
            f"{MOST_COEFFICIENTS} coefficients fit it to {error:.1g} rad only, not {FIT_ERROR:g}: narrow rocker_limits"
        )


def quartic(coefficients: ArrayLike, reach: ArrayLike) -> Array:
    """Return the quartic (5,) nearest to a longer polynomial over the left rocker's reach.

    For programs that hold no longer one. For a bar like Perseverance's it errs by 6e-5 rad within 25 degrees, 4e-4 within 32.

    Args:
        coefficients: (n,) lowest power first.
        reach: (2,) joint limits of the left rocker, rad.

    Returns:
        (5,) lowest power first.

    Raises:
        RoverError: the reach is infinite, or the quartic errs by more than `QUARTIC_ERROR`.
    """
    c = np.asarray(coefficients, dtype=float)
    low, high = np.asarray(reach, dtype=float)
    if not np.isfinite([low, high]).all():
        raise RoverError("a differential above the fourth power needs the rocker's joint limits to be fitted by a quartic")
    nodes, check = _nodes(low, high), np.linspace(low, high, CHECK_POINTS)
    slope = Chebyshev.fit(nodes, polyval(nodes, c) / nodes, 3, domain=[low, high]).convert(kind=Polynomial).coef
    near = np.concatenate([[0.0], slope])
    if (error := float(np.abs(polyval(check, near) - polyval(check, c)).max())) > QUARTIC_ERROR:
        raise RoverError(
            f"a quartic misses the differential by {error:.2g} rad, more than {QUARTIC_ERROR:g}: narrow rocker_limits"
        )
    return near


def _nodes(low: float, high: float) -> Array:
    """Return the Chebyshev points of an interval, without 0."""
    nodes = (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * (np.arange(FIT_POINTS) + 0.5) / FIT_POINTS)
    return np.asarray(nodes[np.abs(nodes) > 1e-9])


def check_ratio(slope: float, what: str) -> None:
    """Check that a differential turns the right rocker against the left one.

    Args:
        slope: the right rocker's turn over the left one's, at rest.
        what: the rover or file, for messages.

    Raises:
        RoverError: the right rocker's turn to the left one's, at rest, is not between -`LARGEST_RATIO` and -`LEAST_RATIO`.
    """
    if not LEAST_RATIO <= -slope <= LARGEST_RATIO:
        raise RoverError(
            f"{what}: differential must turn the right rocker against the left one, by -{LEAST_RATIO:g} to -{LARGEST_RATIO:g} "
            f"of its angle; here it is {slope:.3g}"
        )


def _pair(u: Array, w: Array, plane: tuple[int, int]) -> tuple[Array, Array]:
    """Return A, B of A cos φ + B sin φ = (u turned by φ) · w in a plane.

    φ turns the plane's first axis towards its second.
    """
    i, j = plane
    return u[i] * w[..., i] + u[j] * w[..., j], u[i] * w[..., j] - u[j] * w[..., i]


def _rise(u: Array, w: Array, axis: int, length2: float) -> Array:
    """Return the value of A cos φ + B sin φ at which the linkage closes.

    The end of u, turned by φ, is then a link's length from w.
    """
    return np.asarray((u @ u + (w * w).sum(axis=-1) - length2) / 2 - u[axis] * w[..., axis])


def _close(pair: tuple[Array, Array], rest: tuple[Array, Array], rise: Array) -> Array:
    """Return the angle φ (...) on the branch through 0 at rest; NaN if there is none."""
    A, B = pair
    lead = np.arctan2(rest[1], rest[0])
    if abs(np.sin(lead)) < 1e-6:
        raise RoverError("the differential bar's link is in line with its arm at rest (a dead centre): it could turn either way")
    with np.errstate(invalid="ignore"):
        swing = np.arccos(rise / np.hypot(A, B))
    phi = np.arctan2(B, A) - np.sign(lead) * swing
    return np.asarray(np.arctan2(np.sin(phi), np.cos(phi)))
