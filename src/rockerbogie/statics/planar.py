"""The rover in its plane of symmetry, and its one-parameter motion over a profile.

Both sides do the same, so the differential holds the rocker to the body: body and rockers are one link, both bogies another.
Points are complex numbers x + i z. A rover that drives backward is mirrored, so that it always travels along +x.
Each axle's hub is on its hub curve (hub_curve.py) at arc length s. With the three arc lengths as unknowns there are two closure
equations: the distance between the bogie's hubs, and the distance from the bogie pivot to the rocker wheel's hub. The solutions
are a curve, which is tracked by a predictor along its tangent and a Newton corrector.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, RoverError
from ..rover.masses import Link
from ..rover.model import Rover
from .hub_curve import HubCurve

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Vector = tuple[float, float, float]

#: Largest difference between left and right side, in units of the wheelbase.
SIDES_DIFFER = 0.02
NEWTON_STEPS = 12
#: Residual of the closure equations at convergence, in units of the rover's size.
CLOSED = 1e-12
#: Most stations of one run.
MOST_STATIONS = 40_000


@dataclass(frozen=True)
class PlanarRover:
    """A rover in its plane of symmetry, at rest, in the direction of travel.

    Attributes:
        hub: three hubs: rocker wheel, middle wheel, the bogie's other wheel.
        radius: of the three wheels, m.
        bogie_pivot: the pivot B.
        upper, bogie: centres of mass of body with rockers and rocker wheels, and of the bogies with their wheels.
        upper_mass, bogie_mass: kg, both sides.
        box: (4,) corners of the body's box.
        bogie_limits: of the bogie's rotation against the rocker, in the sense of `bogie_angle`, rad.
        sign: 1 forward, -1 backward; turns angles of the plane into those of the rover.
    """

    hub: tuple[complex, complex, complex]
    radius: Vector
    bogie_pivot: complex
    upper: complex
    bogie: complex
    upper_mass: float
    bogie_mass: float
    box: Complex
    bogie_limits: tuple[float, float]
    sign: float

    @property
    def mass(self) -> float:
        """Mass of the whole rover, kg."""
        return self.upper_mass + self.bogie_mass

    @property
    def size(self) -> float:
        """Distance between the outermost hubs, m."""
        return float(np.ptp([hub.real for hub in self.hub]))


def planar_rover(rover: Rover, backward: bool) -> PlanarRover:
    """Return a rover in its plane of symmetry.

    Args:
        rover: with masses; the mean of both sides is taken, with masses added up.
        backward: True if it drives backward: mirrored.

    Returns:
        The planar rover, its reference point at 0.

    Raises:
        RoverError: no mass; sides that differ by more than `SIDES_DIFFER`; a differential that has no position with equal angles.
    """
    if not (np.isfinite(rover.mass) and rover.mass > 0.0):
        raise RoverError(f"rover {rover.name!r} has no mass: give its masses, climbing depends on its centre of mass")
    sign = -1.0 if backward else 1.0
    spread = max(
        float(np.abs(a - b)[..., [0, 2]].max())
        for a, b in (
            (rover.hubs[::2], rover.hubs[1::2]),
            (rover.rocker_pivot[0], rover.rocker_pivot[1]),
            (rover.bogie_pivot[0], rover.bogie_pivot[1]),
        )
    )
    spread = max(spread, float(np.abs(rover.wheel_radius[::2] - rover.wheel_radius[1::2]).max()))
    if spread > SIDES_DIFFER * rover.wheelbase:
        raise RoverError(
            f"rover {rover.name!r}: left and right side differ by {spread:.3g} m; climbing is computed for a rover whose sides "
            "mirror each other"
        )

    def plane(point: Array) -> complex:
        return complex(sign * point[..., 0].mean(), point[..., 2].mean())

    rocker = _common_rocker(rover)
    pivot = plane(rover.rocker_pivot)
    swing = np.exp(-1j * sign * rocker)

    def on_rocker(point: complex) -> complex:
        return complex(pivot + swing * (point - pivot))

    hubs = [on_rocker(plane(rover.hubs[2 * k : 2 * k + 2])) for k in range(3)]

    def both(pair: tuple[Link, ...]) -> tuple[float, complex]:
        mass, centre = _joined(*((part.mass, plane(part.com[None])) for part in pair))
        return mass, on_rocker(centre)

    wheels = [both(rover.wheels[2 * k : 2 * k + 2]) for k in range(3)]
    rockers, bogies = both(rover.rockers), both(rover.bogies)
    upper_mass, upper = _joined((rover.body.mass, plane(rover.body.com)), rockers, wheels[0])
    bogie_mass, bogie = _joined(bogies, wheels[1], wheels[2])
    (x0, _, z0), (x1, _, z1) = rover.body_box
    low, high = rover.bogie_limits if sign > 0 else -rover.bogie_limits[::-1]
    return PlanarRover(
        hub=(hubs[0], hubs[1], hubs[2]),
        radius=tuple(float(rover.wheel_radius[2 * k : 2 * k + 2].mean()) for k in range(3)),  # type: ignore[arg-type]
        bogie_pivot=on_rocker(plane(rover.bogie_pivot)),
        upper=upper,
        bogie=bogie,
        upper_mass=upper_mass,
        bogie_mass=bogie_mass,
        box=np.array([sign * x0 + 1j * z0, sign * x1 + 1j * z0, sign * x1 + 1j * z1, sign * x0 + 1j * z1]),
        bogie_limits=(float(low), float(high)),
        sign=sign,
    )


def _common_rocker(rover: Rover) -> float:
    """Return the rocker angle that is equal on both sides, rad: the root of least size."""
    coefficients = np.array(rover.differential, dtype=float)
    coefficients = np.append(coefficients, np.zeros(max(0, 2 - coefficients.size)))
    coefficients[1] -= 1.0
    roots = np.polynomial.polynomial.polyroots(coefficients)
    real = roots.real[np.abs(roots.imag) < 1e-9]
    if not real.size:
        raise RoverError(f"rover {rover.name!r}: its differential never has equal angles on both sides")
    return float(real[np.argmin(np.abs(real))])


def _joined(*parts: tuple[float, complex]) -> tuple[float, complex]:
    """Return mass and centre of mass of several parts."""
    mass = sum(part[0] for part in parts)
    return mass, sum(part[0] * part[1] for part in parts) / mass if mass > 0.0 else parts[0][1]


class Station(NamedTuple):
    """Station of a run: arc lengths, pieces of the hub curves, direction (ds₁, ds₂, ds₃)."""

    s: Vector
    piece: tuple[int, int, int]
    motion: Vector


class Linkage:
    """The two closure equations of a rover on its hub curves."""

    def __init__(self, rover: PlanarRover, curves: tuple[HubCurve, HubCurve, HubCurve]) -> None:
        self.rover, self.curves = rover, curves
        hub = rover.hub
        self.bogie_base = hub[2] - hub[1]
        self.arm = (rover.bogie_pivot - hub[1]) / self.bogie_base
        self.spans = abs(self.bogie_base), abs(hub[0] - rover.bogie_pivot)
        self.size = rover.size

    def closure(self, s: Vector, piece: tuple[int, int, int]) -> tuple[tuple[float, float], Vector, Vector]:
        """Return residuals and gradients of the closure equations.

        Args:
            s: arc lengths of the three hubs, m.
            piece: piece of each hub curve.

        Returns:
            Two residuals, m, and their gradients with respect to s.
        """
        first_curve, second_curve, third_curve = self.curves
        a, na = first_curve.at(piece[0], s[0])
        m, nm = second_curve.at(piece[1], s[1])
        e, ne = third_curve.at(piece[2], s[2])
        base, arm, (long, reach) = e - m, self.arm, self.spans
        link = a - m - base * arm
        ta, tm, te = -1j * na, -1j * nm, -1j * ne
        value = (abs(base) - long, abs(link) - reach)
        unit, out = base.conjugate() / abs(base), link.conjugate() / abs(link)
        first = (0.0, -(unit * tm).real, (unit * te).real)
        second = ((out * ta).real, -(out * tm * (1.0 - arm)).real, -(out * te * arm).real)
        return value, first, second

    def solve(self, s: Vector, piece: tuple[int, int, int], normal: Vector, offset: float) -> Vector | None:
        """Return the solution of the closure equations on a plane normal·s = offset.

        Args:
            s: start, m.
            piece: piece of each hub curve.
            normal, offset: the plane.

        Returns:
            Arc lengths, m, or None if Newton's method does not converge.
        """
        scale = self.size
        for _ in range(NEWTON_STEPS):
            value, first, second = self.closure(s, piece)
            third = offset - _dot(normal, s)
            if max(abs(value[0]), abs(value[1]), abs(third)) < CLOSED * scale:
                return s
            det = _dot(normal, _cross(first, second))
            if abs(det) < 1e-14:
                return None
            a, b, c = _cross(second, normal), _cross(normal, first), _cross(first, second)
            p, q, r = -value[0] / det, -value[1] / det, third / det
            s = (
                s[0] + p * a[0] + q * b[0] + r * c[0],
                s[1] + p * a[1] + q * b[1] + r * c[1],
                s[2] + p * a[2] + q * b[2] + r * c[2],
            )
        value, _, _ = self.closure(s, piece)
        return s if max(abs(value[0]), abs(value[1])) < 100.0 * CLOSED * scale else None

    def motion(self, s: Vector, piece: tuple[int, int, int]) -> Vector | None:
        """Return the unit direction of motion (ds₁, ds₂, ds₃), of either sign.

        Args:
            s: arc lengths, m.
            piece: piece of each hub curve.

        Returns:
            Unit vector; None at a singular position.
        """
        _, first, second = self.closure(s, piece)
        v = _cross(first, second)
        size = _dot(v, v) ** 0.5
        return None if size < 1e-12 else (v[0] / size, v[1] / size, v[2] / size)

    def trace(self, start: Vector, end: Vector, step: float) -> list[Station]:
        """Track the motion from level terrain until every hub is past the obstacle.

        Corners of the hub curves are stations, twice where the contact normal jumps: with the normal before and after.

        Args:
            start: arc lengths near the first position, m.
            end: arc lengths beyond which a hub is past the obstacle, m.
            step: largest distance between stations along (s₁, s₂, s₃), m.

        Returns:
            The stations; the last one is before a dead end if the motion ends early.

        Raises:
            RockerbogieError: the rover does not stand on level terrain.
        """
        piece = tuple(curve.piece_at(t) for curve, t in zip(self.curves, start, strict=True))
        s = self.solve(start, piece, (0.0, 1.0, 0.0), start[1])  # type: ignore[arg-type]
        v = None if s is None else self.motion(s, piece)  # type: ignore[arg-type]
        if s is None or v is None:
            raise RockerbogieError("the rover does not stand on level terrain: check its hubs and pivots")
        v = v if sum(v) > 0 else _scaled(v, -1.0)
        stations = [Station(s, piece, v)]  # type: ignore[arg-type]
        h = step
        while len(stations) < MOST_STATIONS and not all(t >= e for t, e in zip(s, end, strict=True)):
            goal = _added(s, v, h)
            new = self.solve(goal, piece, v, _dot(v, goal))  # type: ignore[arg-type]
            if new is None or _distance(new, s) > 2.0 * h:
                h *= 0.5
                if h < 1e-7 * step:
                    break
                continue
            hit = self._first_corner(s, new, piece, v)  # type: ignore[arg-type]
            if hit is None:
                w = self.motion(new, piece)  # type: ignore[arg-type]
                if w is None:
                    break
                s, v = new, w if _dot(w, v) > 0 else _scaled(w, -1.0)
                stations.append(Station(s, piece, v))  # type: ignore[arg-type]
                h = min(step, 2.0 * h)
                continue
            axle, forward, new = hit
            w = self.motion(new, piece)  # type: ignore[arg-type]
            if w is None:
                break
            w = w if _dot(w, v) > 0 else _scaled(w, -1.0)
            if _distance(new, s) > 1e-9 * step:
                stations.append(Station(new, piece, w))  # type: ignore[arg-type]
            follow = piece[axle] + (1 if forward else -1)
            if not 0 <= follow < self.curves[axle].pieces:
                break
            after = tuple(follow if k == axle else p for k, p in enumerate(piece))
            u = self.motion(new, after)  # type: ignore[arg-type]
            if u is None:
                break
            if (u[axle] > 0) != forward:
                u = _scaled(u, -1.0)
            curve = self.curves[axle]
            if abs(curve.at(piece[axle], new[axle])[1] - curve.at(follow, new[axle])[1]) > 1e-9:
                stations.append(Station(new, after, u))  # type: ignore[arg-type]
            s, v, piece = new, u, after
        return stations

    def _first_corner(self, s: Vector, new: Vector, piece: tuple[int, int, int], v: Vector) -> tuple[int, bool, Vector] | None:
        """Return the axle that first reaches an end of its piece between s and new.

        Returns:
            Axle, True for the far end of the piece, and the position; None if no axle does.
        """
        best: tuple[float, int, bool, Vector] | None = None
        for axle, curve in enumerate(self.curves):
            low, high = curve.start[piece[axle]], curve.start[piece[axle] + 1]
            slack = 1e-12 * curve.length
            if low - slack <= new[axle] <= high + slack:
                continue
            bound = low if new[axle] < low else high
            share = (bound - s[axle]) / (new[axle] - s[axle])
            guess = _added(s, _added(new, s, -1.0), min(max(share, 0.0), 1.0))
            plane = tuple(1.0 if k == axle else 0.0 for k in range(3))
            found = self.solve(guess, piece, plane, bound)  # type: ignore[arg-type]
            found = found or guess
            found = tuple(bound if k == axle else t for k, t in enumerate(found))  # type: ignore[assignment]
            along = _dot(v, _added(found, s, -1.0))
            if best is None or along < best[0]:
                best = (along, axle, bound == high, found)
        return None if best is None else best[1:]


def _dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _scaled(a: Vector, by: float) -> Vector:
    """Return a vector times a number."""
    return by * a[0], by * a[1], by * a[2]


def _added(a: Vector, b: Vector, by: float) -> Vector:
    """Return a + by · b."""
    return a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]


def _distance(a: Vector, b: Vector) -> float:
    """Return the distance of two points, m."""
    d = _added(a, b, -1.0)
    return float(_dot(d, d) ** 0.5)
