"""The mechanism: two rockers joined by a differential, a bogie on each, six wheels.

Everything is given in the body frame with every joint at zero, metres, x forward, y left, z up.
Wheels are in the paper's order: rocker wheel left, right; middle left, right; the bogie's other wheel left, right.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from html import escape
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._kernels.model import linkage
from ..arrays import Array, frozen
from ..errors import RoverError, unknown_name
from . import arguments
from .checks import check_rover
from .differential import DifferentialBar
from .masses import (
    DEFAULT_DENSITY,
    GEOMETRY,
    GROUPS,
    MASS_SHARES,
    Link,
    default_box,
    default_mass,
    links_for,
    share_masses,
)  # fmt: skip

__all__ = ["DEFAULT_DENSITY", "IDEAL_DIFFERENTIAL", "LOAD_ROVER", "MASS_SHARES", "Link", "Rover"]

#: Remedy for a call that got something else than a rover.
LOAD_ROVER = "load one with rockerbogie.load_rover(name or file), or build one with rockerbogie.Rover.from_pivots(...)"
IDEAL_DIFFERENTIAL = (0.0, -1.0)


@dataclass(frozen=True, eq=False)
class Rover:
    """A rocker-bogie rover.

    Build one with `Rover.from_pivots` or `Rover.from_dh`, or load a preset.

    Its arrays are read-only copies: change a rover with `replace`.
    """

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
    wheel_torque: Array = field(default_factory=lambda: np.full(6, np.inf))  # (6,) limit of the hub motors, N m; inf: not known

    def __post_init__(self) -> None:
        self._freeze()

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._freeze()

    def _freeze(self) -> None:
        """Make every array read-only; unpickled arrays are writable."""
        for one in fields(self):
            object.__setattr__(self, one.name, frozen(getattr(self, one.name)))

    def __repr__(self) -> str:
        low, high = float(self.wheel_radius.min()), float(self.wheel_radius.max())
        radius = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
        return (
            f"<Rover {self.name}: wheelbase {self.wheelbase:.4g} m, wheel radius {radius} m, "
            f"{int(self.steers.sum())} of 6 wheels steer, {self.mass:.4g} kg>"
        )

    def _repr_html_(self) -> str:
        """Return the table that a notebook shows."""
        rows: list[tuple[str, ...]] = [("", "x m", "y m", "z m")]
        points = [("rocker pivot, left", self.rocker_pivot[0]), ("bogie pivot, left", self.bogie_pivot[0])]
        points += [(f"hub {name}", hub) for name, hub in zip(self.wheel_names, self.hubs, strict=True)]
        rows += [(label, *(f"{v:.4g}" for v in point)) for label, point in points]
        cells = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        return f"<div>{escape(repr(self))}<table>{cells}</table></div>"

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
        wheel_torque: ArrayLike = np.inf,
    ) -> Rover:
        """Return a rover from the positions of its joints and hubs.

        Args:
            name: short name, used in messages and file names.
            wheel_radius, wheel_width: scalar, (3,) per axle or (6,) per wheel, m. Width 0 is a thin disc.
            rocker_pivot, bogie_pivot: (3,) on the left, mirrored to the right; or (2, 3) left and right, m.
            hubs: (3, 3) left rocker wheel, middle wheel, bogie's other wheel, mirrored; or (6, 3) in wheel order, m.
            steers: (3,) per axle or (6,) per wheel, true where the wheel steers. Default: any wheel may.
            steering_offset: (2,), (3, 2) per left wheel (y is mirrored) or (6, 2); steering axis minus hub, m.
            rocker_limits, bogie_limits: (2,) joint limits of the left rocker and of both bogies, rad.
            differential: coefficients c of right = Σ cₖ leftᵏ; (0, -1) is the ideal one, (0, -k) a ratio. Or a
                `DifferentialBar`, which becomes its polynomial over the rocker's limits.
            body_box: (2, 3) lowest and highest corner of the body, m. Default: a box between the wheels.
            mass: the whole rover, kg. Default: `DEFAULT_DENSITY` times the wheelbase cubed; shared by `MASS_SHARES`.
            body, rockers, bogies, wheels: links whose own masses are known; the others are shared as above.
            wheel_names: six names in wheel order. Default: by position, LF, RM, ...
            source: origin of the numbers.
            wheel_torque: torque limit of the hub motors, as `wheel_radius`, N·m; inf where it is not known. `simulate` uses it.

        Returns:
            The rover.

        Raises:
            RoverError: a shape, sign or size that is impossible; the message states which, and the remedy.
        """
        pivots = arguments.sides("rocker_pivot", rocker_pivot)
        bogie = arguments.sides("bogie_pivot", bogie_pivot)
        hub = arguments.hubs(hubs)
        radius = arguments.per_wheel("wheel_radius", wheel_radius)
        width = arguments.per_wheel("wheel_width", wheel_width)
        mask = np.ones(6, dtype=bool) if steers is None else arguments.flags("steers", steers)
        offset = arguments.offsets(steering_offset)
        rocker_stops = arguments.array("rocker_limits", rocker_limits, (2,))
        if isinstance(differential, DifferentialBar):
            if not np.allclose(pivots[1], pivots[0] * (1, -1, 1), rtol=0, atol=1e-9):
                raise RoverError(f"rover {name!r}: a DifferentialBar joins rockers whose pivots mirror each other; these do not")
            differential = differential.polynomial(pivots[0], rocker_stops)
        with np.errstate(invalid="ignore"):  # check_rover refuses non-finite numbers by name
            box = default_box(hub, pivots, bogie, radius) if body_box is None else arguments.array("body_box", body_box, (2, 3))
            total = default_mass(hub) if mass is None else float(arguments.array("mass", mass, ()))
            links = share_masses(total, pivots, bogie, hub, radius, width, box)
        rover = cls(
            name=name,
            rocker_pivot=pivots,
            bogie_pivot=bogie,
            hubs=hub,
            wheel_radius=radius,
            wheel_width=width,
            steering_offset=offset,
            steers=mask,
            rocker_limits=rocker_stops,
            bogie_limits=arguments.array("bogie_limits", bogie_limits, (2,)),
            differential=arguments.numbers("differential", differential),
            body_box=box,
            body=body or links[0],
            rockers=tuple(rockers or links[1]),  # type: ignore[arg-type]
            bogies=tuple(bogies or links[2]),  # type: ignore[arg-type]
            wheels=tuple(wheels or links[3]),
            wheel_names=tuple(wheel_names or arguments.wheel_names(hub)),
            source=source,
            wheel_torque=arguments.per_wheel("wheel_torque", wheel_torque),
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
        """Return a rover from the constants of the paper's Table I.

        Args:
            K1, K2, K3, K4, K5, K6, K7, K8, K10, K11: lengths, m; K10 is the wheel radius.
            K9: slope of the rocker's arm at rest, rad.
            more: other arguments of `from_pivots` (name, wheel_width, steers, masses, …).

        Returns:
            The rover.

        Raises:
            RoverError: K9 in degrees, or an impossible rover.
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
        """Return the paper's K1…K11 (m; K9 in rad), the inverse of `from_dh`.

        Returns:
            The constants by name.

        Raises:
            RoverError: the rover is not of the paper's form (one track, bogie hubs at one height, mirrored sides, no steering
                offset); `rockerbogie.dh_table` returns the table of any rover.
        """
        d, b, h = self.rocker_pivot[0], self.bogie_pivot[0], self.hubs[::2]
        track = np.array([d[1], b[1], *h[:, 1]])
        mirrored = np.allclose(self.hubs[::2] * (1, -1, 1), self.hubs[1::2], atol=1e-12)
        level = abs(h[1, 2] - h[2, 2]) < 1e-12
        one_size = np.ptp(self.wheel_radius) < 1e-12
        if not (mirrored and level and one_size and np.ptp(track) < 1e-12 and not self.steering_offset.any()):
            raise RoverError(
                f"rover {self.name!r} is not of Table I's form (one track, bogie hubs at one height, sides mirrored, "
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

    def replace(self, *, masses: Literal["auto", "keep", "derive"] = "auto", **changes: Any) -> Rover:
        """Return a copy with some fields changed, validated again.

        Masses follow a change of lengths: links that the rule of thumb has made (`MASS_SHARES`) get centres and inertias for the
        new lengths, with their masses kept. Links whose masses were given stay as they are, with a warning.

        Args:
            masses: "auto": as above. "keep": leave every link as it is. "derive": share the total mass anew by the rule of thumb.
            changes: fields of the rover, in any shape that `from_pivots` takes.

        Returns:
            The new rover; a body box that was the default one follows the lengths too.

        Raises:
            RoverError: no such field, or an impossible rover.
        """
        known = [field.name for field in fields(self)]
        for name in changes:
            if name not in known:
                raise RoverError(f"rover {self.name!r}: {unknown_name('field', name, known)}")
        if masses not in ("auto", "keep", "derive"):
            raise RoverError(f"masses is {masses!r}; give 'auto', 'keep' or 'derive'")
        changes = {name: _full(name, value) for name, value in changes.items()}
        with np.errstate(invalid="ignore"):  # check_rover refuses non-finite numbers by name
            rover = replace(self, **changes)
            if "body_box" not in changes and np.array_equal(self.body_box, _box(self)):
                rover = replace(rover, body_box=_box(rover))
        check_rover(rover)
        moved = any(not np.array_equal(getattr(self, name), getattr(rover, name)) for name in GEOMETRY)
        if masses == "keep" or not moved:
            return rover
        links, kept = links_for(self, rover, [group for group in GROUPS if group not in changes], masses == "derive")
        if kept:
            warnings.warn(
                f"rover {self.name!r}: lengths changed, and the given masses of {', '.join(kept)} stay where they were; give "
                "them anew, or pass masses='derive' (rule of thumb) or masses='keep' (as they are, without this warning)",
                stacklevel=2,
            )
        rover = replace(rover, **links)
        check_rover(rover)
        return rover

    # -- derived quantities ---------------------------------------------------------------------------------------

    @property
    def mass(self) -> float:
        """Mass of the whole rover, kg."""
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
        """The rover's numbers in one flat array for the kernels (`_kernels.model.linkage.P_*`)."""
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
        """Return the right rocker's angle that the differential gives for the left one's.

        Args:
            rocker: (...) left rocker angle, rad.

        Returns:
            (...) rad.
        """
        return np.polynomial.polynomial.polyval(np.asarray(rocker, dtype=float), self.differential)


def _full(name: str, value: Any) -> Any:
    """Return a field's new value in full shape."""
    if name in ("rocker_pivot", "bogie_pivot"):
        return arguments.sides(name, value)
    if name == "hubs":
        return arguments.hubs(value)
    if name in ("wheel_radius", "wheel_width", "wheel_torque"):
        return arguments.per_wheel(name, value)
    if name == "steers":
        return arguments.flags(name, value)
    if name == "steering_offset":
        return arguments.offsets(value)
    if name in ("rocker_limits", "bogie_limits"):
        return arguments.array(name, value, (2,))
    if name == "body_box":
        return arguments.array(name, value, (2, 3))
    if name == "differential":
        return arguments.numbers(name, value)
    return tuple(value) if name in ("rockers", "bogies", "wheels", "wheel_names") else value


def _box(rover: Rover) -> Array:
    """Return the default body box (2, 3) for a rover's lengths, m."""
    return default_box(rover.hubs, rover.rocker_pivot, rover.bogie_pivot, rover.wheel_radius)
