"""Quasi-static climbs over a profile: friction, torque and verdict (docs/climbing.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..arrays import is_number
from ..errors import RockerbogieError, expect
from ..files.version import __version__
from ..gravity import GRAVITY, check_gravity
from ..rover.model import LOAD_ROVER, Rover
from .hub_curve import ARC
from .obstacles import Profile
from .planar_forces import balance, equal_friction, least_friction, least_torque
from .planar_run import PlanarRun, run_over

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

Direction = Literal["forward", "backward"]
ClimbLaw = Literal["least_friction", "equal_slip"]
DIRECTIONS: tuple[str, ...] = get_args(Direction)
CLIMB_LAWS: tuple[str, ...] = get_args(ClimbLaw)
#: Reasons for which a climb ends, and their meaning.
REASONS = {
    "": "the rover gets over the obstacle",
    "friction": "the wheels slip: the obstacle needs more friction",
    "torque": "the motors stall: the obstacle needs more torque",
    "tip_over": "no friction holds the rover, a wheel lifts",
    "belly": "the body is on the terrain",
    "joint_limit": "the bogies are at their joint limit",
    "stuck": "the wheels jam, no motion of the linkage leads on",
}
#: Stations for each length of the rover.
STATIONS = 150
#: Requirements may exceed the limit by this share, for rounding.
ROUNDING = 1e-9
#: Inclination of a contact normal, rad, up to which a wheel is on level terrain, and from which it is on a face.
LEVEL, STEEP = np.radians(0.5), np.radians(80.0)
PLACES = ("front", "middle", "rear")


@dataclass(frozen=True, eq=False)
class Climb:
    """Run over a profile: n stations, wheels in the paper's order, left and right alike.

    At corners of the wheels' paths two stations have the same position: just before and just after a wheel changes its contact.

    Attributes:
        rover, profile, direction, friction, law, gravity: as given.
        torque_limit: as given, or that of the rover's motors, N m; inf without a limit.
        distance: (n,) mean travel of the six hubs along their paths, m.
        x, z, pitch: (n,) of the body's reference point and of the body, m and rad; x and z are of the profile, pitch is
            nose-down positive.
        bogie: (n,) bogie angle, rad.
        hub, contact_point, contact_normal: (n, 6, 2) x and z of each hub, contact point and unit normal.
        normal, traction, torque: (n, 6) N, N and N m; traction and torque are positive in the direction of travel.
        unloaded: (n, 6) True for wheels that would have to pull under law "equal_slip": they carry no load, and may lift.
        required_friction: (n,) coefficient that the station needs under the law; inf where none holds the rover.
        required_torque: (n,) the smallest torque of the strongest loaded motor that suffices with `friction`, N m; inf where that
            friction does not.
        uphill: (n,) True where gravity acts against the motion.
        slides: (n,) True where the rover runs downhill faster than its wheels, because friction does not hold it.
        limit: "" or why the climb ends: friction, torque, tip_over, belly, joint_limit or stuck.
        station: index at which it ends; -1 if it does not.
        wheels: names of the wheels that climb there.
        phase: a few words on what they do there, such as "front wheels on the face".
    """

    rover: Rover
    profile: Profile
    direction: str
    friction: float
    torque_limit: float
    law: str
    gravity: float
    distance: Array
    x: Array
    z: Array
    pitch: Array
    bogie: Array
    hub: Array
    contact_point: Array
    contact_normal: Array
    normal: Array
    traction: Array
    torque: Array
    unloaded: NDArray[np.bool_]
    required_friction: Array
    required_torque: Array
    uphill: NDArray[np.bool_]
    slides: NDArray[np.bool_]
    limit: str
    station: int
    wheels: tuple[str, ...]
    phase: str

    @property
    def climbed(self) -> bool:
        """True if the rover gets over the obstacle."""
        return not self.limit

    @property
    def hardest(self) -> int:
        """Index of the uphill station that needs most friction, up to the end of the climb."""
        last = self.station + 1 if self.station >= 0 else self.distance.size
        return int(np.argmax(np.where(self.uphill, self.required_friction, -1.0)[:last]))

    @property
    def friction_needed(self) -> float:
        """Friction coefficient that the whole obstacle needs uphill; inf if none suffices."""
        return float(self.required_friction[self.uphill].max(initial=0.0))

    @property
    def friction_used(self) -> Array:
        """(n, 6) ratio of traction to normal force; NaN for a wheel without load."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.normal > 0.0, np.abs(self.traction) / self.normal, np.nan)

    def __repr__(self) -> str:
        return f"<Climb {self.rover.name} {self.direction} over {self.profile.name}: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """One sentence: the rover gets over, or where and why it does not."""
        if not self.limit:
            names = self.rover.wheel_names
            lifts = [names[k] for k in range(6) if (self.unloaded[:, k] & self.uphill).any()]
            more = f"; {' and '.join(lifts)} carry no load on the way and may lift" if lifts else ""
            return f"climbed; a friction coefficient of {self.friction_needed:.3f} suffices{more}"
        whole = self.friction_needed
        suffices = f"{whole:.3f} suffices" if np.isfinite(whole) else "no friction suffices"
        torque = float(self.required_torque[self.uphill].max(initial=0.0))
        reason = {
            "friction": f"friction {self.friction:g} is too small ({suffices})",
            "torque": f"a motor torque of {self.torque_limit:g} N m is too small ({torque:.3g} N m suffice)",
        }.get(self.limit, REASONS[self.limit])
        return f"not climbed: {reason}; {self.phase}, after {self.distance[self.station]:.3f} m"

    def to_dataset(self) -> xr.Dataset:
        """Return the climb as a Dataset over `station` and `wheel`.

        Returns:
            Every array with its unit; the verdict in the attributes `climbed` (1 or 0), `because` (as `limit`), `fails_at`
            (distance, m; NaN), `phase` and `verdict`.
        """
        import xarray as xr

        variables: dict[str, Any] = {}
        for name, unit in UNITS.items():
            value = getattr(self, name)
            dims = ("station", "wheel", "axis")[: value.ndim]
            variables[name] = (dims, value.astype(np.int8) if value.dtype == bool else value, {"units": unit})
        return xr.Dataset(
            variables,
            coords={"wheel": list(self.rover.wheel_names), "axis": ["x", "z"]},
            attrs={
                "rover": self.rover.name, "profile": self.profile.name, "profile_x": self.profile.x, "profile_z": self.profile.z,
                "direction": self.direction, "friction": self.friction, "torque_limit": self.torque_limit, "law": self.law,
                "gravity": self.gravity, "climbed": int(self.climbed), "because": self.limit, "phase": self.phase,
                "fails_at": float(self.distance[self.station]) if self.limit else np.nan, "verdict": self.verdict,
                "source": f"rockerbogie {__version__} climb",
            },
        )  # fmt: skip


#: Variables of the Dataset and their units.
UNITS = {
    "distance": "m", "x": "m", "z": "m", "pitch": "rad", "bogie": "rad", "hub": "m", "contact_point": "m", "contact_normal": "1",
    "normal": "N", "traction": "N", "torque": "N m", "unloaded": "1", "required_friction": "1", "required_torque": "N m",
    "uphill": "1", "slides": "1",
}  # fmt: skip


def climb(
    rover: Rover,
    profile: Profile,
    *,
    friction: float,
    torque: float | None = None,
    direction: Direction = "forward",
    law: ClimbLaw = "least_friction",
    gravity: float = GRAVITY["earth"],
) -> Climb:
    """Drive a rover quasi-statically over a profile, and compute what each station needs.

    Both sides do the same and the terrain is rigid. The wheels are on the terrain throughout; their contacts are exact,
    also on edges and vertical faces. Momentum does not help.

    Args:
        rover: with masses; its sides must mirror each other.
        profile: the obstacle (`rockerbogie.obstacles`).
        friction: coefficient of friction between wheels and terrain, 0 or more.
        torque: largest torque of a hub motor, N m, above 0; inf for no limit. Default: the least of the rover's `wheel_torque`,
            which is inf where it is not known.
        direction: "forward" or "backward".
        law: "least_friction": the smallest coefficient with which some distribution of torques holds the rover, a bound for every
            controller. "equal_slip": all wheels use the same share of friction, as wheels that are driven at one rate and slip.
        gravity: m/s², from 0.001 to 100 (`GRAVITY`).

    Returns:
        The climb. It goes on after the station at which it fails, as if it had not.

    Raises:
        RockerbogieError: a number out of its range, an unknown direction or law.
        RoverError: a rover without mass, or whose sides differ.
    """
    check_arguments(rover, friction, torque, gravity)
    expect(profile, Profile, "profile", "make one with rockerbogie.obstacles, such as obstacles.step(0.2)")
    if direction not in DIRECTIONS:
        raise RockerbogieError(f"direction {direction!r} is not known; give forward or backward")
    if law not in CLIMB_LAWS:
        raise RockerbogieError(f"law {law!r} is not known; give one of {', '.join(CLIMB_LAWS)}")
    run = run_over(rover, profile, direction == "backward", STATIONS)
    required, force, needed, torque_force = _forces(run, friction, law)
    if law == "least_friction":  # the forces to show: those of least torque where this friction suffices
        force = np.where(np.isfinite(needed)[:, None], torque_force, force)
    torque_limit = motor_limit(rover, torque)
    limit, station = first_failure(run, required, needed, friction, torque_limit / run.torque_unit(gravity))
    weight = run.rover.mass * gravity
    axle = [0, 0, 1, 1, 2, 2]
    radius = np.array(run.rover.radius)
    wheels, phase = describe(run, station, rover)
    vectors = {name: _plane(getattr(run, name)[:, axle]) for name in ("hub", "point", "contact")}
    with np.errstate(invalid="ignore"):
        slides = ~run.uphill & (required > friction * (1.0 + ROUNDING) + ROUNDING)
    return Climb(
        rover=rover, profile=profile, direction=direction, friction=float(friction),
        torque_limit=torque_limit, law=law, gravity=float(gravity),
        distance=run.distance, x=run.body.real, z=run.body.imag, pitch=run.pitch, bogie=run.bogie_angle,
        hub=vectors["hub"], contact_point=vectors["point"], contact_normal=vectors["contact"],
        normal=0.5 * weight * force[:, axle], traction=0.5 * weight * force[:, 3:][:, axle],
        torque=0.5 * weight * (force[:, 3:] * radius)[:, axle],
        unloaded=((force[:, :3] == 0.0) if law == "equal_slip" else np.zeros((len(force), 3), dtype=bool))[:, axle],
        required_friction=required, required_torque=needed * run.torque_unit(gravity),
        uphill=run.uphill, slides=slides, limit=limit, station=station, wheels=wheels, phase=phase,
    )  # fmt: skip


def check_arguments(rover: Rover, friction: float, torque: float | None, gravity: float) -> None:
    """Check the arguments that `climb` and `limits_of` share.

    Args:
        rover, friction, torque, gravity: as for `climb`.

    Raises:
        RockerbogieError: one is out of its range.
    """
    expect(rover, Rover, "rover", LOAD_ROVER)
    if not (is_number(friction) and friction >= 0.0):
        raise RockerbogieError(f"friction is {friction!r:.40}; give a coefficient of 0 or more, such as 0.7")
    if torque is not None and torque != np.inf and not (is_number(torque) and torque > 0.0):
        raise RockerbogieError(f"torque is {torque!r:.40}; give the limit of a hub motor in N m, above 0, or inf for no limit")
    check_gravity(gravity)


def motor_limit(rover: Rover, torque: float | None) -> float:
    """Return the torque limit of a climb.

    Args:
        rover: the rover.
        torque: limit given, N m, or None.

    Returns:
        The limit given, or the least of the rover's hub motors, N m; inf without a limit.
    """
    return float(rover.wheel_torque.min() if torque is None else torque)


def _plane(points: NDArray[np.complex128]) -> Array:
    """Return complex points (...) as (..., 2)."""
    return np.stack([points.real, points.imag], axis=-1)


def station_balance(run: PlanarRun) -> tuple[Array, Array]:
    """Return the balance equations of all stations.

    Lengths are in units of the rover's size, forces in units of its weight.

    Args:
        run: the motion.

    Returns:
        A (n, 4, 6), b (n, 4): `planar_forces.balance`.
    """
    size, mass = run.rover.size, run.rover.mass
    weights = ((run.upper / size, run.rover.upper_mass / mass), (run.bogie / size, run.rover.bogie_mass / mass))
    return balance(run.point / size, run.contact, run.pivot / size, weights)


def _forces(run: PlanarRun, friction: float, law: str) -> tuple[Array, Array, Array, Array]:
    """Return required friction (n,) with forces (n, 6), and least torque (n,) with forces."""
    a, b = station_balance(run)
    radius = np.array(run.rover.radius) / run.rover.size
    most = friction * (1.0 + ROUNDING) + ROUNDING
    if law == "least_friction":
        return (*least_friction(a, b), *least_torque(a, b, radius, most))
    required, force = equal_friction(a, b, run.uphill)
    needed = np.abs(force[:, 3:] * radius).max(axis=1)
    needed[~(required <= most)] = np.inf
    return required, force, needed, force


def first_failure(run: PlanarRun, required: Array, needed: Array, friction: float, torque: float) -> tuple[str, int]:
    """Return why and at which station a run fails first.

    Args:
        run: the motion.
        required: (n,) required friction.
        needed: (n,) least torque of an axle, in the unit of `torque`.
        friction: coefficient.
        torque: limit.

    Returns:
        The reason and the station, or "" and -1.
    """
    over = ~np.isfinite(required) & (run.uphill | run.unsupported)
    with np.errstate(invalid="ignore"):
        checks = {
            "belly": run.belly,
            "joint_limit": run.at_limit,
            "tip_over": over,
            "friction": run.uphill & (required > friction * (1.0 + ROUNDING) + ROUNDING),
            "torque": run.uphill & (needed > torque * (1.0 + ROUNDING)),
        }
    first = {reason: int(np.argmax(bad)) for reason, bad in checks.items() if bad.any()}
    if first:
        reason = min(first, key=first.__getitem__)
        return reason, first[reason]
    return ("", -1) if run.complete else ("stuck", run.distance.size - 1)


def describe(run: PlanarRun, station: int, rover: Rover) -> tuple[tuple[str, ...], str]:
    """Return the wheels that climb at a station, and what they do there.

    Args:
        run: the motion.
        station: index; -1 for none.
        rover: gives the wheels' names.

    Returns:
        Names of the wheels that climb, or go down if none climbs; and a phrase.
    """
    if station < 0:
        return (), ""
    incline = np.angle(run.contact[station]) - 0.5 * np.pi  # positive: the normal points back, the wheel climbs
    order = [int(axle) for axle in np.argsort([-hub.real for hub in run.rover.hub])]
    climbing = [axle for axle in order if incline[axle] > LEVEL]
    axles = climbing or [axle for axle in order if incline[axle] < -LEVEL]
    where: dict[str, list[str]] = {}
    for axle in axles:
        down = "" if climbing else "going down "
        part = "edge" if run.kind[station, axle] == ARC else "face" if abs(incline[axle]) >= STEEP else "slope"
        where.setdefault(f"{down}on the {part}", []).append(PLACES[order.index(axle)])
    names = tuple(rover.wheel_names[2 * axle + side] for axle in axles for side in (0, 1))
    phrase = ", ".join(f"{' and '.join(places)} wheels {part}" for part, places in where.items())
    return names, phrase or "all wheels on level terrain"
