"""Tip margins of settled poses (docs/stability.md)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._kernels.jit.parallel import parallel_for
from .._kernels.statics import loads as kernel
from .._kernels.statics.lane_tipping import MARGIN
from ..arrays import Array, is_number
from ..errors import RockerbogieError
from ..gravity import check_gravity
from ..settling.engines import NO_TOUCH
from ..settling.pose import Pose
from .contacts import PackedContacts, pack_contacts
from .held_directions import HeldDirections
from .loads import solve_loads, wheel_loads

#: Friction coefficient at which a rover tips rather than slides: a plane of up to 63° holds it.
GRIP = 2.0
#: Angle up to which a rover that needs gravity to turn counts as held, rad.
HELD = 1e-7
#: Gravity's direction.
DOWN = np.array([0.0, 0.0, -1.0])
#: Accuracy of maps: power (of the weight) at which the search for the least friction ends, and largest difference of the
#: tip margin's bounds, rad.
MAP_GAP, MAP_MARGIN = 1e-7, 1e-3


@dataclass(frozen=True, eq=False)
class Stability:
    """By how much poses are short of tipping over; NaN without a pose or a solution.

    Attributes:
        tip_angle: (...) `tip_margin` where forces hold the rover; where none do, minus the least angle by which gravity must
            turn until some do, rad.
        tip_margin: (...) least angle by which gravity must turn until no contact forces hold the rover, rad; 0 if none
            holds it as it stands, π/2 if no turn up to that moves it.
        tip_bound: (...) angle up to which contact forces were found to hold the pose in every azimuth, rad: a lower bound of
            `tip_margin`; NaN where it is not known.
        direction: (...) azimuth in which the centre of mass then starts to move, from +x, counter-clockwise, rad; NaN where
            the margin is 0 or π/2.
        stays: (..., 6) True for the wheels whose contacts stay in place in that motion: the edge that the rover tips over.
        slides: (...) True if no wheel stays in place: it slides before it tips.
        force_angle: (...) measure of Papadopoulos & Rey (1996) of the rover as one rigid body, N m rad.
        energy: (...) energy that tips the rover as one rigid body over its worst edge (Messuri & Klein 1985), J.
        wheel_names: names of the six wheels.
    """

    tip_angle: Array
    tip_margin: Array
    tip_bound: Array
    direction: Array
    stays: NDArray[np.bool_]
    slides: NDArray[np.bool_]
    force_angle: Array
    energy: Array
    wheel_names: tuple[str, ...]

    @property
    def edge(self) -> NDArray[np.str_]:
        """(...) names of the wheels that the rover tips over, joined by spaces."""
        names = [" ".join(n for n, on in zip(self.wheel_names, row, strict=True) if on) for row in self.stays.reshape(-1, 6)]
        return np.array(names, dtype=np.str_).reshape(self.tip_margin.shape)

    def __repr__(self) -> str:
        if self.tip_margin.ndim:
            return f"<Stability of {self.tip_margin.size} poses>"
        if np.isnan(self.tip_margin):
            return "<Stability: no pose, or no margin found>"
        how = "slides" if self.slides else f"tips over {self.edge}"
        return f"<Stability: margin {np.degrees(float(self.tip_margin)):.2f} deg, then {how}>"


def stability(pose: Pose, *, gravity: float | None = None, friction: float = GRIP) -> Stability:
    """Compute by how much settled poses are short of tipping over.

    The rover is not one rigid body: rockers, bogies and differential move freely within their limits, and a pose is lost as
    soon as no forces within the friction cones balance all of its links. `force_angle` and `energy` are the published
    measures, of the rover as one rigid body on the support polygon of its contacts.

    Args:
        pose: settled poses (...), of either mode. Wheels off the ground do not count.
        gravity: m/s²; scales `force_angle` and `energy`. Default: that of the pose.
        friction: friction coefficient, above 0, at most 50. With less than the default, a rover may slide before it tips.

    Returns:
        Stability with the pose's batch axes.

    Raises:
        RockerbogieError: gravity not from 0.001 to 100, friction out of range, or a rover without mass.
    """
    packed = pack_contacts(pose)
    weight = pose.rover.mass * check_gravity(pose.gravity if gravity is None else gravity)
    if not (is_number(friction) and 0.0 < friction <= 50.0):
        raise RockerbogieError(f"friction is {friction!r:.40}; give a coefficient above 0, at most 50")
    n = pose.status.size
    margin, bound, direction, angle, energy = np.empty((5, n))
    stays, slides = np.empty((n, 6), dtype=bool), np.empty(n, dtype=bool)
    parallel_for(
        kernel.stability_batch, n, *packed, float(friction), MARGIN, margin, bound, direction, stays, slides, angle, energy
    )  # fmt: skip
    angle_to_hold = _tip_angles(packed, friction, margin, direction, stays, slides)
    shape = pose.shape
    return Stability(
        tip_angle=angle_to_hold.reshape(shape),
        tip_margin=margin.reshape(shape),
        tip_bound=bound.reshape(shape),
        direction=direction.reshape(shape),
        stays=stays.reshape(*shape, 6),
        slides=slides.reshape(shape),
        force_angle=(weight * angle).reshape(shape),
        energy=(weight * energy).reshape(shape),
        wheel_names=pose.rover.wheel_names,
    )


def _tip_angles(
    packed: PackedContacts, friction: float, margin: Array, direction: Array, stays: NDArray[np.bool_], slides: NDArray[np.bool_]
) -> Array:
    """Return the margins; where no forces hold, minus the turn of gravity until some do.

    Args:
        packed: contacts of the poses.
        friction: friction coefficient.
        margin: (n,) rad; NaN where the kernels have none is filled; 0 where no forces hold.
        direction, stays, slides: as of `stability_batch`; filled where the margin is.

    Returns:
        (n,) rad.
    """
    signed = margin.copy()
    for k in np.flatnonzero(~(margin > 0.0) & ~np.isnan(packed.q[:, 0])):
        cone = HeldDirections(packed, int(k), friction)
        if cone.empty:
            continue
        lacking = cone.project(DOWN)[0]
        if lacking > HELD:
            signed[k], margin[k] = -lacking, 0.0
        elif np.isnan(margin[k]):
            signed[k], direction[k], stays[k], slides[k] = cone.margin()
            margin[k] = signed[k]
    return signed


def force_values(pose: Pose, names: Collection[str], touch: Array = NO_TOUCH) -> dict[str, Array]:
    """Compute required friction, largest motor torque and tip margin for maps.

    Args:
        pose: settled poses (...).
        names: some of "required_friction", "max_torque" and "tip_margin".
        touch: contacts of the poses, as for `pack_contacts`.

    Returns:
        Arrays (...) by name: friction and torque (N m) under the law of least friction, the margin in rad.
    """
    if not names:
        return {}
    values, packed = {}, pack_contacts(pose, touch)
    if "required_friction" in names or "max_torque" in names:
        loads = solve_loads(pose, gap=MAP_GAP, packed=packed)
        values = {"required_friction": loads.required_friction, "max_torque": np.abs(loads.torque).max(axis=-1)}
    if "tip_margin" in names:
        values["tip_margin"] = _tip_margins(packed).reshape(pose.shape)
    return {name: values[name] for name in names}


def _tip_margins(packed: PackedContacts) -> Array:
    """Return the tip margins (n,) of poses to the accuracy of maps, rad."""
    n = packed.yaw.size
    margin, bound, direction = np.empty((3, n))
    stays, slides, unwanted = np.empty((n, 6), dtype=bool), np.empty(n, dtype=bool), np.empty(0)
    parallel_for(
        kernel.stability_batch, n, *packed, GRIP, MAP_MARGIN, margin, bound, direction, stays, slides, unwanted, unwanted
    )  # fmt: skip
    _tip_angles(packed, GRIP, margin, direction, stays, slides)
    return margin


def load_values(pose: Pose) -> dict[str, NDArray[np.generic]]:
    """Return the values of `dataset.LOAD_VARIABLES` for poses, under the law of least friction.

    Args:
        pose: settled poses (...).

    Returns:
        Arrays (...) and (..., 6) by name.
    """
    loads = wheel_loads(pose)
    return {
        "required_friction": loads.required_friction,
        "normal_force": loads.normal,
        "traction": loads.traction,
        "side_force": loads.side,
        "axle_torque": loads.torque,
        "max_torque": np.abs(loads.torque).max(axis=-1),
        "tip_margin": stability(pose).tip_margin,
        "load_status": loads.status,
    }
