"""The mechanism: two rockers joined by a differential, a bogie on each, six wheels.

Everything is given in the body frame with every joint at zero, metres, x forward, y left, z up.
Wheels are in the paper's order: rocker wheel left, right; middle left, right; the bogie's other wheel left, right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.model import linkage
from ..arrays import Array
from ..errors import RoverError
from .checks import check_rover
from .differential import DifferentialBar

#: What to do where a rover was wanted and something else given.
LOAD_ROVER = "load one with rockerbogie.load_rover(name or file), or build one with rockerbogie.Rover.from_pivots(...)"
IDEAL_DIFFERENTIAL = (0.0, -1.0)
#: Mass of a rover whose mass is not given: this many kg times the cube of its wheelbase (Curiosity 78, Rocky 7 128).
DEFAULT_DENSITY = 90.0
#: How a total mass is shared when the links' own are not given: body, each rocker, each bogie, each wheel.
MASS_SHARES = (0.60, 0.06, 0.04, 0.20 / 6)


@dataclass(frozen=True)
class Link:
    """A rigid part: mass (kg), centre of mass (3,) in the body frame at rest (m), inertia (3, 3) about it (kg m²)."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class Rover:
    """A rocker-bogie rover. Build one with `Rover.from_pivots` or `Rover.from_dh`, or load a preset."""

    name: str
    rocker_pivot: Array  # (2, 3) left, right
    bogie_pivot: Array  # (2, 3)
    hubs: Array  # (6, 3)
    wheel_radius: Array  # (6,)
    wheel_width: Array  # (6,)
    steering_offset: Array  # (6, 2) steering axis minus hub, x and y
    steers: NDArray[np.bool_]  # (6,)
    rocker_limits: Array  # (2,) of the left rocker, rad
    bogie_limits: Array  # (2,) rad
    differential: Array  # polynomial in the left rocker angle that gives the right one, lowest power first
    body_box: Array  # (2, 3) lowest and highest corner
    body: Link
    rockers: tuple[Link, Link]
    bogies: tuple[Link, Link]
    wheels: tuple[Link, ...]
    wheel_names: tuple[str, ...]
    source: str = ""

    # -- construction ---------------------------------------------------------------------------------------------

    @classmethod
    def from_pivots(
        cls,
        *,
        name: str = "rover",
        wheel_radius: ArrayLike,
        rocker_pivot: ArrayLike,
        bogie_pivot: ArrayLike,
        hubs: ArrayLike,
        wheel_width: ArrayLike = 0.0,
        steers: ArrayLike | None = None,
        steering_offset: ArrayLike = (0.0, 0.0),
        rocker_limits: ArrayLike = (-np.inf, np.inf),
        bogie_limits: ArrayLike = (-np.inf, np.inf),
        differential: ArrayLike | DifferentialBar = IDEAL_DIFFERENTIAL,
        body_box: ArrayLike | None = None,
        mass: float | None = None,
        body: Link | None = None,
        rockers: Sequence[Link] | None = None,
        bogies: Sequence[Link] | None = None,
        wheels: Sequence[Link] | None = None,
        wheel_names: Sequence[str] | None = None,
        source: str = "",
    ) -> Rover:
        """A rover from where its joints and hubs stand.

        Args:
            wheel_radius, wheel_width: scalar, (3,) per axle or (6,) per wheel, m. Width 0 is a thin disc.
            rocker_pivot, bogie_pivot: (3,) on the left, mirrored to the right; or (2, 3) left and right, m.
            hubs: (3, 3) left rocker wheel, middle wheel, bogie's other wheel, mirrored; or (6, 3) in wheel order, m.
            steers: (3,) per axle or (6,) per wheel, true where the wheel steers. Default: any wheel may.
            steering_offset: (2,), (3, 2) per left wheel (y is mirrored) or (6, 2); steering axis minus hub, m.
            rocker_limits, bogie_limits: (2,) stops of the left rocker and of both bogies, rad.
            differential: coefficients c of right = Σ cₖ leftᵏ; (0, -1) is the ideal one, (0, -k) a ratio. Or a
                `DifferentialBar`, which becomes the polynomial that follows it over the rocker's stops.
            body_box: (2, 3) lowest and highest corner of the body, m. Default: a box between the wheels.
            mass: the whole rover, kg. Default: `DEFAULT_DENSITY` times the wheelbase cubed; shared by `MASS_SHARES`.
            body, rockers, bogies, wheels: links, where their own masses are known; the rest is shared as above.

        Raises:
            RoverError: a shape, sign or size that cannot be; the message says which and what to do.
        """
        pivots = _sides("rocker_pivot", rocker_pivot)
        bogie = _sides("bogie_pivot", bogie_pivot)
        hub = _hubs(hubs)
        radius = _per_wheel("wheel_radius", wheel_radius)
        width = _per_wheel("wheel_width", wheel_width)
        mask = np.ones(6) if steers is None else _per_wheel("steers", steers)
        offset = _offsets(steering_offset)
        rocker_stops = _array("rocker_limits", rocker_limits, (2,))
        if isinstance(differential, DifferentialBar):
            if not np.allclose(pivots[1], pivots[0] * (1, -1, 1), rtol=0, atol=1e-9):
                raise RoverError(f"rover {name!r}: a DifferentialBar joins rockers whose pivots mirror each other; these do not")
            differential = differential.polynomial(pivots[0], rocker_stops)
        with np.errstate(invalid="ignore"):  # what is not finite is refused by name below
            box = _default_box(hub, pivots, bogie, radius) if body_box is None else _array("body_box", body_box, (2, 3))
            total = _default_mass(hub) if mass is None else float(_array("mass", mass, ()))
            links = _share_masses(total, pivots, bogie, hub, radius, width, box)
        rover = cls(
            name=name,
            rocker_pivot=pivots,
            bogie_pivot=bogie,
            hubs=hub,
            wheel_radius=radius,
            wheel_width=width,
            steering_offset=offset,
            steers=mask > 0.5,
            rocker_limits=rocker_stops,
            bogie_limits=_array("bogie_limits", bogie_limits, (2,)),
            differential=_numbers("differential", differential),
            body_box=box,
            body=body or links[0],
            rockers=tuple(rockers or links[1]),  # type: ignore[arg-type]
            bogies=tuple(bogies or links[2]),  # type: ignore[arg-type]
            wheels=tuple(wheels or links[3]),
            wheel_names=tuple(wheel_names or _wheel_names(hub)),
            source=source,
        )
        check_rover(rover)
        return rover

    @classmethod
    def from_dh(
        cls,
        *,
        K1: float = 0.0,
        K2: float = 0.0,
        K3: float,
        K4: float,
        K5: float,
        K6: float,
        K7: float,
        K8: float,
        K9: float,
        K10: float,
        K11: float,
        **more: Any,
    ) -> Rover:
        """A rover from the constants of the paper's Table I: K9 in radians, the rest in metres; K10 is the wheel radius.

        `more` are the other arguments of `from_pivots` (name, wheel_width, steers, masses, …).
        """
        if abs(K9) > np.pi:
            raise RoverError(f"K9 is {K9:g}: give it in radians, as in K9=np.radians(30.7)")
        bogie = (K2 + K6 * np.cos(K9), K3, K1 - K6 * np.sin(K9))
        return cls.from_pivots(
            wheel_radius=K10,
            rocker_pivot=(K2, K3, K1),
            bogie_pivot=bogie,
            hubs=[
                (K2 - K4, K3, K1 - K5),
                (bogie[0] - K11, K3, bogie[2] - K8),
                (bogie[0] + K7, K3, bogie[2] - K8),
            ],
            **more,
        )

    def to_dh(self) -> dict[str, float]:
        """The paper's K1…K11 (metres; K9 in radians), the inverse of `from_dh`.

        Raises:
            RoverError: the rover is not of the paper's form (one track, bogie hubs level, mirrored sides, no steering
                offset); `rockerbogie.dh_table` gives its table all the same.
        """
        d, b, h = self.rocker_pivot[0], self.bogie_pivot[0], self.hubs[::2]
        track = np.array([d[1], b[1], *h[:, 1]])
        mirrored = np.allclose(self.hubs[::2] * (1, -1, 1), self.hubs[1::2], atol=1e-12)
        level = abs(h[1, 2] - h[2, 2]) < 1e-12
        one_size = np.ptp(self.wheel_radius) < 1e-12
        if not (mirrored and level and one_size and np.ptp(track) < 1e-12 and not self.steering_offset.any()):
            raise RoverError(
                f"rover {self.name!r} is not of Table I's form (one track, bogie hubs level, sides mirrored, "
                "equal wheels, steering axes through the hubs): take its general table from rockerbogie.dh_table(rover)"
            )
        reach, drop = b[0] - d[0], d[2] - b[2]
        return {
            "K1": float(d[2]),
            "K2": float(d[0]),
            "K3": float(d[1]),
            "K4": float(d[0] - h[0, 0]),
            "K5": float(d[2] - h[0, 2]),
            "K6": float(np.hypot(reach, drop)),
            "K7": float(h[2, 0] - b[0]),
            "K8": float(b[2] - h[1, 2]),
            "K9": float(np.arctan2(drop, reach)),
            "K10": float(self.wheel_radius[0]),
            "K11": float(b[0] - h[1, 0]),
        }

    def replace(self, **changes: Any) -> Rover:
        """A copy with some fields changed (already in full shape), validated again."""
        rover = replace(self, **changes)
        check_rover(rover)
        return rover

    # -- what follows from it -------------------------------------------------------------------------------------

    @property
    def mass(self) -> float:
        """The whole rover's mass, kg."""
        return float(sum(link.mass for link in self.links))

    @property
    def links(self) -> tuple[Link, ...]:
        """Body, rockers (left, right), bogies (left, right), wheels (6)."""
        return (self.body, *self.rockers, *self.bogies, *self.wheels)

    @property
    def wheelbase(self) -> float:
        """Fore-aft distance between the outermost hubs at rest, m."""
        return float(np.ptp(self.hubs[:, 0]))

    @cached_property
    def packed(self) -> Array:
        """All that a kernel reads of the rover, in one flat array (`_kernels.linkage.P_*`)."""
        parent = np.concatenate([self.rocker_pivot, self.bogie_pivot, self.bogie_pivot])
        p = np.zeros(linkage.P_SIZE)

        def put(at: int, values: ArrayLike) -> None:
            flat = np.asarray(values, dtype=float).ravel()
            p[at : at + flat.size] = flat

        put(linkage.P_PIVOT, self.rocker_pivot)
        put(linkage.P_BOGIE_PIVOT, self.bogie_pivot - self.rocker_pivot)
        put(linkage.P_HUB, self.hubs - parent)
        put(linkage.P_OFFSET, self.steering_offset)
        put(linkage.P_RADIUS, self.wheel_radius)
        put(linkage.P_HALF, self.wheel_width / 2)
        put(linkage.P_STOPS, [*self.rocker_limits, *self.bogie_limits])
        put(linkage.P_BOX, self.body_box)
        put(linkage.P_BODY, [self.body.mass, *self.body.com])
        put(linkage.P_ROCKER, [[k.mass, *(k.com - o)] for k, o in zip(self.rockers, self.rocker_pivot, strict=True)])
        put(linkage.P_BOGIE, [[k.mass, *(k.com - o)] for k, o in zip(self.bogies, self.bogie_pivot, strict=True)])
        put(linkage.P_WHEEL, [[k.mass, *(k.com - o)] for k, o in zip(self.wheels, self.hubs, strict=True)])
        put(linkage.P_ORDER, len(self.differential))
        put(linkage.P_DIFF, self.differential)
        return p

    def right_rocker(self, rocker: ArrayLike) -> Array:
        """Angle (...) of the right rocker for the left one's, through the differential, rad."""
        return np.polynomial.polynomial.polyval(np.asarray(rocker, dtype=float), self.differential)


def _numbers(name: str, value: ArrayLike) -> Array:
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise RoverError(f"{name} must be numbers, not {value!r}") from None


def _array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = _numbers(name, value)
    if array.shape != shape:
        raise RoverError(f"{name} has shape {array.shape}; give {shape}")
    return array


def _sides(name: str, value: ArrayLike) -> Array:
    array = _numbers(name, value)
    if array.shape not in ((3,), (2, 3)):
        raise RoverError(f"{name} has shape {array.shape}; give (3,) for the left side or (2, 3) for both")
    sides = np.stack([array, array * (1, -1, 1)]) if array.ndim == 1 else array
    if sides[0, 1] < sides[1, 1]:
        raise RoverError(f"{name} has its left pivot at y = {sides[0, 1]:g} m, right of its right one: give the left side, y > 0")
    return sides


def _hubs(value: ArrayLike) -> Array:
    array = _numbers("hubs", value)
    if array.shape == (3, 3):
        return np.stack([array, array * (1, -1, 1)], axis=1).reshape(6, 3)
    if array.shape == (6, 3):
        return array
    raise RoverError(f"hubs has shape {array.shape}; give (3, 3) for the left side or (6, 3) in wheel order")


def _per_wheel(name: str, value: ArrayLike) -> Array:
    array = _numbers(name, value)
    if array.shape == (3,):
        return np.repeat(array, 2)
    if array.shape in ((), (6,)):
        return np.broadcast_to(array, (6,)).copy()
    raise RoverError(f"{name} has shape {array.shape}; give a number, (3,) per axle or (6,) per wheel")


def _offsets(value: ArrayLike) -> Array:
    array = _numbers("steering_offset", value)
    if array.shape == (2,):
        array = np.tile(array, (3, 1))
    if array.shape == (3, 2):
        return np.stack([array, array * (1, -1)], axis=1).reshape(6, 2)
    if array.shape == (6, 2):
        return array
    raise RoverError(f"steering_offset has shape {array.shape}; give (2,), (3, 2) for the left side or (6, 2)")


def _wheel_names(hubs: Array) -> tuple[str, ...]:
    outer = "F" if hubs[0, 0] > hubs[4, 0] else "R"
    other = "R" if outer == "F" else "F"
    return tuple(side + axle for axle in (outer, "M", other) for side in "LR")


def _default_box(hubs: Array, pivots: Array, bogies: Array, radius: Array) -> Array:
    """A body that fills 60 % of the wheelbase, stays inside the linkage, and clears the axles by 1.3 radii."""
    centre = (hubs[:, 0].max() + hubs[:, 0].min()) / 2
    half = 0.3 * np.ptp(hubs[:, 0])
    inner = 0.8 * np.abs(np.concatenate([hubs[:, 1], pivots[:, 1], bogies[:, 1]])).min()
    bottom = hubs[:, 2].max() + 1.3 * radius.max()
    top = max(pivots[:, 2].max(), bottom) + radius.max()
    return np.array([[centre - half, -inner, bottom], [centre + half, inner, top]])


def _default_mass(hubs: Array) -> float:
    return float(DEFAULT_DENSITY * np.ptp(hubs[:, 0]) ** 3)


def _share_masses(
    total: float, pivots: Array, bogies: Array, hubs: Array, radius: Array, width: Array, box: Array
) -> tuple[Link, list[Link], list[Link], list[Link]]:
    """Links for a rover of which only the total mass is known: a solid box, thin-rod triangles, solid cylinders."""
    m_body, m_rocker, m_bogie, m_wheel = (share * total for share in MASS_SHARES)
    size = box[1] - box[0]
    body = Link(m_body, box.mean(axis=0), np.diag(m_body / 12 * (size @ size - size**2)))
    rockers = [_points_link(m_rocker, pivots[s], bogies[s], hubs[s]) for s in (0, 1)]
    arms = [_points_link(m_bogie, bogies[s], hubs[2 + s], hubs[4 + s]) for s in (0, 1)]
    wheels = []
    for i in range(6):
        breadth = max(width[i], 0.2 * radius[i])  # a disc has no inertia of its own to speak of: give it a rim
        across = m_wheel * (3 * radius[i] ** 2 + breadth**2) / 12
        wheels.append(Link(m_wheel, hubs[i].copy(), np.diag([across, m_wheel * radius[i] ** 2 / 2, across])))
    return body, rockers, arms, wheels


def _points_link(mass: float, *points: Array) -> Link:
    """A link whose mass is shared by its joints, with a slender floor so that its inertia is never singular."""
    p = np.array(points)
    r = p - p.mean(axis=0)
    inertia = mass / len(p) * sum(np.eye(3) * (v @ v) - np.outer(v, v) for v in r)
    return Link(mass, p.mean(axis=0), inertia + np.eye(3) * 1e-3 * np.trace(inertia))
