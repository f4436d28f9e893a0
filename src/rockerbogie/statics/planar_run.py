"""Motion of a rover over a profile: positions of all links at each station."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rover.model import Rover
from .hub_curve import HubCurve
from .obstacles import Profile
from .planar import Linkage, PlanarRover, Station, planar_rover

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Distance before and after the obstacle that the rover drives on level terrain, in units of its size.
MARGIN = 0.05


@dataclass(frozen=True, eq=False)
class PlanarRun:
    """Stations of a run; points are x + i z in the direction of travel.

    Attributes:
        rover: the planar rover.
        complete: False if the wheels jam: no motion of the linkage leads on.
        distance: (n,) mean arc length of the three hubs, m.
        hub, point, contact: (n, 3) hubs, contact points and unit contact normals; rocker wheel, middle, bogie's other wheel.
        kind: (n, 3) LINE or ARC of each hub curve.
        pivot, upper, bogie, body: (n,) bogie pivot, centres of mass of the upper link and of the bogie, body's reference point.
        pitch, bogie_angle: (n,) rad, of the rover (nose-down positive).
        uphill: (n,) True where the centre of mass rises along the motion.
        unsupported: (n,) True where the centre of mass is in front of all contacts or behind all.
        belly: (n,) True where the body's box and the profile overlap.
        at_limit: (n,) True where the bogie is beyond a joint limit.
    """

    rover: PlanarRover
    complete: bool
    distance: Array
    hub: Complex
    point: Complex
    contact: Complex
    kind: NDArray[np.int64]
    pivot: Complex
    upper: Complex
    bogie: Complex
    body: Complex
    pitch: Array
    bogie_angle: Array
    uphill: NDArray[np.bool_]
    unsupported: NDArray[np.bool_]
    belly: NDArray[np.bool_]
    at_limit: NDArray[np.bool_]

    def torque_unit(self, gravity: float) -> float:
        """Return the unit of motor torque: half the rover's weight times its size.

        Args:
            gravity: m/s².

        Returns:
            N m.
        """
        return 0.5 * self.rover.mass * gravity * self.rover.size


def run_over(rover: Rover, profile: Profile, backward: bool, stations: int) -> PlanarRun:
    """Return the motion of a rover over a profile.

    Args:
        rover: the rover.
        profile: the obstacle.
        backward: True if the rover drives backward; it still travels along +x.
        stations: number of stations for each length of the rover.

    Returns:
        The run.

    Raises:
        RoverError: as `planar_rover`.
        RockerbogieError: the rover does not stand on level terrain.
    """
    plane = planar_rover(rover, backward)
    size = plane.size
    vertices = profile.x + 1j * profile.z
    room = 3.0 * size + 4.0 * max(plane.radius)
    terrain = np.concatenate([[vertices[0] - room], vertices, [vertices[-1] + room]])
    made = {radius: HubCurve(terrain, radius) for radius in set(plane.radius)}
    curves = tuple(made[radius] for radius in plane.radius)
    front = max(hub.real + radius for hub, radius in zip(plane.hub, plane.radius, strict=True))
    back = min(hub.real - radius for hub, radius in zip(plane.hub, plane.radius, strict=True))
    offset = vertices[0].real - front - MARGIN * size
    start = tuple(curve.near_x(hub.real + offset) for curve, hub in zip(curves, plane.hub, strict=True))
    offset = vertices[-1].real - back + MARGIN * size
    past = min(hub.real for hub in plane.hub) + offset
    end = tuple(max(curve.near_x(past), curve.start[-2] + 1e-6 * size) for curve in curves)
    linkage = Linkage(plane, curves)  # type: ignore[arg-type]
    found = linkage.trace(start, end, size / stations)  # type: ignore[arg-type]
    complete = all(s >= e for s, e in zip(found[-1].s, end, strict=True))
    if not complete:  # the motion turns back: where it does, the wheels jam
        found = found[: 1 + int(np.argmax([sum(station.s) for station in found]))]
    return _positions(rover, plane, linkage, found, complete, vertices)


def _positions(
    rover: Rover, plane: PlanarRover, linkage: Linkage, found: list[Station], complete: bool, vertices: Complex
) -> PlanarRun:
    """Return the run with the positions of all links."""
    curves = linkage.curves
    at = np.array([[curve.at(p, s) for curve, p, s in zip(curves, k.piece, k.s, strict=True)] for k in found])
    hub, contact = at[..., 0], at[..., 1]
    kind = np.array([[curve.kind[p] for curve, p in zip(curves, k.piece, strict=True)] for k in found])
    moves = np.array([k.motion for k in found]) * (-1j * contact)  # velocities of the hubs
    a0, m0, e0 = plane.hub
    b0 = plane.bogie_pivot
    bogie_turn, bogie_rate = (hub[:, 2] - hub[:, 1]) / (e0 - m0), (moves[:, 2] - moves[:, 1]) / (e0 - m0)
    pivot, pivot_rate = hub[:, 1] + bogie_turn * (b0 - m0), moves[:, 1] + bogie_rate * (b0 - m0)
    turn, rate = (hub[:, 0] - pivot) / (a0 - b0), (moves[:, 0] - pivot_rate) / (a0 - b0)
    upper, bogie = pivot + turn * (plane.upper - b0), hub[:, 1] + bogie_turn * (plane.bogie - m0)
    rise = plane.upper_mass * (pivot_rate + rate * (plane.upper - b0)) + plane.bogie_mass * (
        moves[:, 1] + bogie_rate * (plane.bogie - m0)
    )
    point = hub - np.array(plane.radius) * contact
    centre = (plane.upper_mass * upper.real + plane.bogie_mass * bogie.real) / plane.mass
    bogie_angle = -np.angle(bogie_turn / turn)
    low, high = plane.bogie_limits
    body = pivot - turn * b0
    return PlanarRun(
        rover=plane, complete=complete,
        distance=np.array([sum(k.s) - sum(found[0].s) for k in found]) / 3.0,
        hub=hub, point=point, contact=contact, kind=kind, pivot=pivot, upper=upper, bogie=bogie, body=body,
        pitch=-plane.sign * np.angle(turn), bogie_angle=plane.sign * bogie_angle,
        uphill=rise.imag > 1e-9 * plane.mass,
        unsupported=(centre > point.real.max(axis=1)) | (centre < point.real.min(axis=1)),
        belly=_overlaps(plane.box, body, turn, vertices),
        at_limit=(bogie_angle < low - 1e-9) | (bogie_angle > high + 1e-9),
    )  # fmt: skip


def _overlaps(box: Complex, body: Complex, turn: Complex, vertices: Complex) -> NDArray[np.bool_]:
    """Return True (n,) where a vertex is in the body's box, or a corner below the profile."""
    low, high = box.real.min() + 1j * box.imag.min(), box.real.max() + 1j * box.imag.max()
    local = (vertices - body[:, None]) * np.conj(turn)[:, None]
    inside = (local.real > low.real) & (local.real < high.real) & (local.imag > low.imag) & (local.imag < high.imag)
    corner = body[:, None] + turn[:, None] * box
    below = corner.imag < np.interp(corner.real, vertices.real, vertices.imag)
    return np.asarray(inside.any(axis=1) | below.any(axis=1))
