"""Limits of attitude, joints, clearance and forces, and the limits that a pose exceeds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, unknown_name
from ..settling.pose import Pose

#: Bits of the layer `exceeded`, in the order of its flag_meanings.
BITS = {
    "pitch": 1, "roll": 2, "tilt": 4, "rocker": 8, "bogie": 16, "clearance": 32, "unsettled": 64,
    "required_friction": 128, "tip_margin": 256, "max_torque": 512,
}  # fmt: skip
#: Unit of a limit, and ending of its key in a TOML file; all others are angles.
UNITS = {"clearance": ("m", "_m"), "required_friction": ("", ""), "max_torque": ("N m", "_n_m")}
#: Limits of forces, by the layers that they bound.
FORCES = ("required_friction", "tip_margin", "max_torque")


@dataclass(frozen=True)
class Limits:
    """Limits of a pose: angles in rad, clearance in m, torque in N m; None: no limit.

    Limits of angles are symmetric about 0. A pose must keep its clearance above the limit, its tip margin at or above it, and
    all other values within theirs. `required_friction` is the friction coefficient that the terrain has, `max_torque` the
    torque that each motor has.
    Independently of these limits, a joint at or beyond its joint limit counts as exceeded, and so does a position at which the
    rover cannot be settled. Forces that cannot be computed exceed their limits.
    """

    pitch: float | None = None
    roll: float | None = None
    tilt: float | None = None
    rocker: float | None = None  # of the left rocker against the body: half the angle between the rockers
    bogie: float | None = None  # of either bogie against its rocker
    clearance: float | None = None
    required_friction: float | None = None  # `wheel_loads(...).required_friction`
    tip_margin: float | None = None  # `stability(...).tip_margin`
    max_torque: float | None = None  # of the six wheels, under the law of least friction

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
            number = number and math.isfinite(value)
            most = math.inf if field.name in UNITS else math.pi
            if not number or (field.name != "clearance" and not 0 < value <= most):
                raise RockerbogieError(
                    f"limit {field.name} is {value!r}: give a number{_RANGES.get(field.name, ' (rad, above 0 and at most pi)')}, "
                    "or None for no limit"
                )

    @property
    def forces(self) -> tuple[str, ...]:
        """Names of the limits of forces that are set."""
        return tuple(name for name in FORCES if getattr(self, name) is not None)

    @classmethod
    def named(cls, name: str) -> Limits:
        """Return the limits with a name.

        Args:
            name: one of `PRESETS`.

        Returns:
            The limits.

        Raises:
            RockerbogieError: no such name; the message gives the most similar one.
        """
        if name not in PRESETS:
            raise RockerbogieError(unknown_name("limits", name, PRESETS))
        return PRESETS[name]

    def to_json(self) -> str:
        """Return the limits as JSON.

        Returns:
            An object: name → value in rad, m or N m, or without a unit (`required_friction`); null for no limit. Limits of
            forces are in it only if they are set.
        """
        return json.dumps(
            {
                name: None if value is None else float(value)
                for name, value in asdict(self).items()
                if value is not None or name not in FORCES
            }
        )


#: Ranges of the limits that are not angles.
_RANGES = {"clearance": " (m)", "required_friction": " above 0", "max_torque": " above 0 (N m)"}

#: Curiosity's are the limits at which its flight software stops a drive (Rankin, Maimone, Biesiadecki, Patel, Levine, Toupet
#: 2020, "Driving Curiosity: Mars Rover Mobility Trends During the First Seven Years").
PRESETS = {
    "curiosity": Limits(
        pitch=math.radians(15), roll=math.radians(15), tilt=math.radians(30),
        rocker=math.radians(7), bogie=math.radians(17), clearance=0.0,
    ),
    "none": Limits(),
}  # fmt: skip


def margin(pose: Pose, limits: Limits, tilt: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angle between each pose and its closest limit.

    Args:
        pose: (...) settled poses.
        limits: limits of pitch, roll, tilt, rocker and bogies; joint limits of the rover count too.
        tilt: (...) of the poses, rad.

    Returns:
        (...) rad; negative beyond a limit, NaN where the pose is NaN, infinite without any limit.
    """
    room = np.where(np.isnan(pose.z), np.nan, np.inf)
    for angle, limit in ((pose.pitch, limits.pitch), (pose.roll, limits.roll), (tilt, limits.tilt)):
        if limit is not None:
            np.minimum(room, limit - np.abs(angle), out=room)
    joints = ((pose.rocker, limits.rocker, pose.rover.rocker_limits),) + tuple(
        (pose.bogie[..., side], limits.bogie, pose.rover.bogie_limits) for side in (0, 1)
    )
    for angle, limit, (low, high) in joints:
        if limit is not None:
            np.minimum(room, limit - np.abs(angle), out=room)
        np.minimum(room, np.minimum(high - angle, angle - low), out=room)
    return room


def exceeded(
    pose: Pose,
    limits: Limits,
    tilt: NDArray[np.float64],
    clearance: NDArray[np.float64] | None,
    forces: Mapping[str, NDArray[np.float64]],
) -> NDArray[np.uint16]:
    """Return the limits that each pose exceeds.

    Args:
        pose: (...) settled poses.
        limits: the limits.
        tilt: (...) of the poses, rad.
        clearance: (...) of the poses, m; a NaN exceeds its limit. None: it is not compared.
        forces: (...) by the names of `FORCES`, at least those that the limits bound; a NaN exceeds its limit.

    Returns:
        (...) bit mask of `BITS`; `unsettled` alone where the pose is NaN.
    """
    bits = np.zeros(pose.shape, dtype=np.uint16)

    def note(name: str, where: Any) -> None:
        np.bitwise_or(bits, np.uint16(BITS[name]), out=bits, where=where)

    for name in ("pitch", "roll", "rocker"):
        if (limit := getattr(limits, name)) is not None:
            note(name, np.abs(getattr(pose, name)) > limit)
    if limits.tilt is not None:
        note("tilt", tilt > limits.tilt)
    if limits.bogie is not None:
        for side in (0, 1):
            note("bogie", np.abs(pose.bogie[..., side]) > limits.bogie)
    if limits.clearance is not None and clearance is not None:
        note("clearance", ~(clearance > limits.clearance))
    for name in limits.forces:
        limit = getattr(limits, name)
        note(name, ~(forces[name] >= limit if name == "tip_margin" else forces[name] <= limit))
    stopped = pose.joint_stop != 0
    for k, name in enumerate(("rocker", "bogie", "bogie")):
        note(name, stopped[..., k])
    lost = np.isnan(pose.z)
    bits[lost] = BITS["unsettled"]
    return bits
