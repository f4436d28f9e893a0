"""Statements of the paper on its figures 7 to 9, each decided from the numbers of a run.

The statements are paraphrased. Angles below `ZERO` count as zero, as the paper's lengths leave 0.032 deg on flat terrain;
contact angles count as zero below `ZERO_ON_RIM`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...rover.model import Rover
from ...terrain.heightfield import Terrain

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

ZERO = 0.1  # deg
ZERO_ON_RIM = 1.0  # deg of contact angle, 1.7 mm on the rim: scatter of a simulated contact
JUMP = 5.0  # deg within JUMP_DISTANCE
JUMP_DISTANCE = 0.01  # m
HARMONIC = 0.95  # least share of the variance explained by one harmonic
WINDOW = 0.06  # m on either side of a transition


@dataclass(frozen=True)
class Claim:
    """Statement of the paper, its verdict for one run, and the numbers that decide it."""

    figure: int
    says: str
    holds: bool
    because: str


@dataclass(frozen=True)
class Crossing:
    """Run straight over bumps between x = start and x = end, with its angles in degrees."""

    rover: Rover
    terrain: Terrain
    start: float
    end: float
    x: Array  # (n,) m, of the reference point; all angles in deg
    pitch: Array
    roll: Array
    bogie: Array  # (n, 2)
    contact_angle: Array  # (n, 6)
    contact_point: Array  # (n, 6, 3) m

    @classmethod
    def of(cls, rover: Rover, terrain: Terrain, run: xr.Dataset, start: float, end: float) -> Crossing:
        """Make a crossing from a run along +x.

        Args:
            rover: the rover of the run.
            terrain: the terrain of the run.
            run: from `drive` or `simulate`, (n,) records.
            start: x at which the bumps begin, m.
            end: x at which the bumps end, m.

        Returns:
            The crossing, its angles converted to degrees.
        """
        angle = {name: np.degrees(run[name].values) for name in ("pitch", "roll", "bogie", "contact_angle")}
        return cls(rover, terrain, start, end, run["x"].values, contact_point=run["contact_point"].values, **angle)

    @property
    def axles(self) -> list[int]:
        """Indices of the left wheels, front to rear; the next index is the right wheel of the axle."""
        return [2 * int(i) for i in np.argsort(-self.rover.hubs[::2, 0])]

    def reaches(self, wheel: int, at: float) -> float:
        """Return the x of the reference point at which a wheel's contact first reaches x = at.

        Args:
            wheel: index of the wheel, 0 to 5.
            at: x of the contact, m.

        Returns:
            m; the first x of the run if the contact does not reach `at`.
        """
        return float(self.x[np.argmax(self.contact_point[:, wheel, 0] >= at)])

    def rim(self, wheel: int) -> tuple[NDArray[np.bool_], Array, Array]:
        """Return the records in which a wheel is in contact, with x and contact angle there.

        Args:
            wheel: index of the wheel, 0 to 5.

        Returns:
            (n,) True where the wheel is in contact; x of those k records (k,), m; their contact angles (k,), deg.
        """
        touches = np.isfinite(self.contact_angle[:, wheel])
        return touches, self.x[touches], self.contact_angle[touches, wheel]

    def on_one_plane(self, wheels: list[int]) -> NDArray[np.bool_]:
        """Return the records in which the contacts of some wheels lie on one plane of the terrain.

        Args:
            wheels: indices of the wheels; all other contacts are compared with that of the first.

        Returns:
            (n,) True where the terrain normals differ by less than 1e-3 and the contacts lie within 2 mm of the plane through the
            first contact.
        """
        p = self.contact_point[:, wheels]
        normal = self.terrain.normal(p[..., 0], p[..., 1])
        level = (np.abs(normal - normal[:, :1]) < 1e-3).all(axis=(1, 2))
        flush = np.abs(np.einsum("nwk,nk->nw", p - p[:, :1], normal[:, 0])) < 2e-3
        return np.asarray(level & flush.all(axis=1))


def check_claims(crossing: Crossing) -> list[Claim]:
    """Decide every statement of section III.

    Args:
        crossing: the run.

    Returns:
        9 claims, in the paper's order.
    """
    return [check(crossing) for check in _CHECKS]


def _both_negative(c: Crossing) -> Claim:
    """Return the claim on the signs of pitch and roll at the start of the bumps, decided."""
    front, middle, _ = c.axles
    first = float(c.x[np.argmax((np.abs(c.pitch) > ZERO) | (np.abs(c.roll) > ZERO))])
    reach = min(c.reaches(front, c.start), c.reaches(front + 1, c.start))
    then = (c.x >= first) & (c.x < c.reaches(middle, c.start))
    low, high = ([float(most(a[then], initial=0.0)) for a in (c.pitch, c.roll)] for most in (np.min, np.max))
    holds = abs(first - reach) < 0.05 and max(low) < -ZERO and max(high) < ZERO
    return Claim(
        7,
        "Pitch and roll turn negative when the front wheels reach the bumps.",
        holds,
        f"The front wheels reach the bumps at X = {reach:.3f} m; pitch or roll first changes at {first:.3f} m. Until the middle "
        f"wheels arrive, pitch falls to {low[0]:.2f}°, roll to {low[1]:.2f}° (right side up); neither exceeds {max(high):.2f}°.",
    )


def _pitch_turns_at_the_top(c: Crossing) -> Claim:
    """Return the claim on the sign of the pitch at the top, decided."""
    front, _, rear = c.axles
    over = (c.x >= c.reaches(front, c.start)) & (c.x <= c.reaches(rear, c.end))
    x, pitch = c.x[over], c.pitch[over]
    turn = int(np.argmax(pitch > ZERO))
    lowest, least_after = float(pitch[:turn].min(initial=0.0)), float(pitch[turn:].min())
    off = float(x[turn] + (c.rover.hubs[:, 0].max() + c.rover.hubs[:, 0].min()) / 2 - (c.start + c.end) / 2)
    return Claim(
        7,
        "Pitch stays negative over the first half and turns positive as the rover crosses the top.",
        lowest < -ZERO < least_after and abs(off) < c.rover.wheelbase / 2,
        f"Negative from X = {x[0]:.3f} to {x[turn]:.3f} m (to {lowest:.2f}°), positive from there to {x[-1]:.3f} m (to "
        f"{pitch[turn:].max():+.2f}°); at the change of sign the middle of the wheelbase is {100 * off:+.1f} cm from the top.",
    )


def _right_bogie_zero_on_a_plane(c: Crossing) -> Claim:
    """Return the claim on the right bogie's angle on one plane, decided."""
    together = c.on_one_plane([1, 3, 5])
    most, apart = (float(np.abs(c.bogie[where, 1]).max(initial=0.0)) for where in (together, ~together))
    return Claim(
        8,
        "The right bogie's angle is zero while all wheels of its side are on one plane.",
        bool(together.any()) and most < ZERO < apart,
        f"In the {together.sum()} of {together.size} records whose three right contacts lie on one plane, |β2| ≤ {most:.4f}° "
        f"(0.0322° follows from the paper's lengths); elsewhere it reaches {apart:.2f}°.",
    )


def _left_bogie_harmonic(c: Crossing) -> Claim:
    """Return the claim on the shape of the left bogie's angle, decided by a harmonic fit."""
    front, _, rear = c.axles
    on = (c.x > c.reaches(rear, c.start)) & (c.x < c.reaches(front, c.end))
    phase = 2 * np.pi * c.x[on] / (c.end - c.start)
    basis = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)], axis=1)
    beta = c.bogie[on, 0]
    fit, *_ = np.linalg.lstsq(basis, beta, rcond=None)
    left = beta - basis @ fit
    explained = 1 - float(left.var() / beta.var()) if beta.any() else 0.0
    return Claim(
        8,
        "The left bogie's angle is a harmonic curve on the hill.",
        explained > HARMONIC,
        f"With all three left wheels on the hill (X = {c.x[on][0]:.3f} to {c.x[on][-1]:.3f} m), one harmonic of the hill's "
        f"length, amplitude {np.hypot(*fit[1:]):.2f}°, explains {100 * explained:.2f} % of the variance; "
        f"the residual is {left.std():.2f}° RMS.",
    )


def _left_bogie_transitions(c: Crossing) -> Claim:
    """Return the claim on transitions of the left bogie's angle, decided by its curvature."""
    front, middle, rear = c.axles
    arrive = [c.reaches(wheel, c.start) for wheel in (front, middle)]
    change = [_curvature_change(c.x, c.bogie[:, 0], at) for at in arrive]
    elsewhere = np.arange(c.reaches(rear, c.start) + WINDOW, c.reaches(front, c.end) - WINDOW, WINDOW / 2)
    usual = float(np.median([abs(_curvature_change(c.x, c.bogie[:, 0], at)) for at in elsewhere]))
    return Claim(
        8,
        "The left bogie goes through a transition as the front and the middle wheel reach the bump.",
        all(abs(step) > 3 * usual for step in change),
        f"The second derivative d²β1/dX² changes by {change[0]:+.0f}°/m² at X = {arrive[0]:.3f} m (front) and by "
        f"{change[1]:+.0f}°/m² at {arrive[1]:.3f} m (middle), against a median of {usual:.0f}°/m² on the hill itself.",
    )


def _contact_jumps(c: Crossing, side: int) -> Claim:
    """Return the claim on the jump of a front wheel's contact angle, decided."""
    front = c.axles[0] + side
    name = ("left", "right")[side]
    at = c.reaches(front, c.start)
    _, x, angle = c.rim(front)
    near = np.abs(x - at) < 0.05
    change = angle[near] - np.interp(x[near] - JUMP_DISTANCE, x, angle)
    most = float(change[np.argmax(np.abs(change))])
    beyond = c.terrain.gradient(c.start + 0.05, c.contact_point[0, front, 1])
    slope = float(np.degrees(np.arctan(np.abs(beyond[0]))))
    return Claim(
        9,
        f"The {name} contact angle changes abruptly where the front wheel reaches the bump.",
        abs(most) > JUMP,
        f"Around X = {at:.3f} m it changes by {most:+.2f}° within {1e3 * JUMP_DISTANCE:.0f} mm of distance"
        + (
            "."
            if abs(most) > JUMP
            else f": only its derivative jumps, as this hill begins with slope 0 (5 cm further, the slope is {slope:.1f}°)."
        ),
    )


def _left_contact_turns_positive(c: Crossing) -> Claim:
    """Return the claim on the sign of the left contact angle on the hill, decided."""
    front = c.axles[0]
    _, x, angle = c.rim(front)
    start, top = c.reaches(front, c.start), c.reaches(front, (c.start + c.end) / 2)
    climb = (x >= start) & (x <= top)
    lowest, at_top = float(angle[climb].min(initial=0.0)), float(np.interp(top, x, angle))
    positive = float(x[climb & (angle <= 0)].max(initial=start))
    until = float(x[(x > top) & (angle <= 0)].min(initial=x[-1]))
    return Claim(
        9,
        "The left contact angle then tends to a positive value once the hill is climbed.",
        lowest < -ZERO_ON_RIM and at_top > ZERO_ON_RIM,
        f"It falls to {lowest:.2f}° on the climb, is {at_top:+.2f}° with the front wheel on the top, and stays "
        f"positive from X = {positive:.3f} to {until:.3f} m.",
    )


def _right_contact_zero_on_a_plane(c: Crossing) -> Claim:
    """Return the claim on the right contact angle on one plane, decided."""
    front, middle, _ = c.axles
    touches, _, angle = c.rim(front + 1)
    together, angle = c.on_one_plane([front + 1, middle + 1])[touches], np.abs(angle)
    most, apart = (float(angle[where].max(initial=0.0)) for where in (together, ~together))
    return Claim(
        9,
        "The right contact angle is zero except where the bogie passes between slope and flat.",
        bool(together.any()) and most < ZERO_ON_RIM < apart,
        f"While both wheels of the right bogie are on one plane ({100 * together.mean():.0f} % of the path) |δ6| ≤ {most:.4f}°, "
        f"measured from the wheel's own link; while the bogie spans an edge it reaches {apart:.2f}°.",
    )


def _curvature_change(x: Array, angle: Array, at: float) -> float:
    """Return the change of the second derivative of angle over x at x = at, deg/m².

    A parabola is fitted to the `WINDOW` before `at` and another to the `WINDOW` after it.
    """
    second = []
    for low, high in ((at - WINDOW, at), (at, at + WINDOW)):
        near = (x >= low) & (x <= high)
        second.append(2 * float(np.polyfit(x[near] - at, angle[near], 2)[0]))
    return second[1] - second[0]


_CHECKS: tuple[Callable[[Crossing], Claim], ...] = (
    _both_negative,
    _pitch_turns_at_the_top,
    _right_bogie_zero_on_a_plane,
    _left_bogie_harmonic,
    _left_bogie_transitions,
    lambda c: _contact_jumps(c, 1),
    lambda c: _contact_jumps(c, 0),
    _left_contact_turns_positive,
    _right_contact_zero_on_a_plane,
)
