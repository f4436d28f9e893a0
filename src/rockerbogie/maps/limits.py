"""Limits of attitude, joints and clearance, and the limits that a pose exceeds."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, unknown_name
from ..settling.pose import Pose

#: Bits of the layer `exceeded`, in the order of its flag_meanings.
BITS = {"pitch": 1, "roll": 2, "tilt": 4, "rocker": 8, "bogie": 16, "clearance": 32, "unsettled": 64}


@dataclass(frozen=True)
class Limits:
    """Limits of a pose, symmetric about 0; None: no limit. Angles in rad, clearance in m.

    A pose must keep its clearance above the limit and all other values within theirs. Independently of these limits, a joint
    at or beyond its joint limit counts as exceeded, and so does a position at which the rover cannot be settled.
    """

    pitch: float | None = None
    roll: float | None = None
    tilt: float | None = None
    rocker: float | None = None  # of the left rocker against the body: half the angle between the rockers
    bogie: float | None = None  # of either bogie against its rocker
    clearance: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            number = isinstance(value, (int, float, np.integer, np.floating)) and math.isfinite(value)
            if not number or (field.name != "clearance" and not 0 < value <= math.pi):
                unit = "m" if field.name == "clearance" else "rad, above 0 and at most pi"
                raise RockerbogieError(f"limit {field.name} is {value!r}: give a number ({unit}), or None for no limit")

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
            An object: name → value in rad or m, null for no limit.
        """
        return json.dumps({name: None if value is None else float(value) for name, value in asdict(self).items()})


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


def exceeded(pose: Pose, limits: Limits, tilt: NDArray[np.float64], clearance: NDArray[np.float64] | None) -> NDArray[np.uint8]:
    """Return the limits that each pose exceeds.

    Args:
        pose: (...) settled poses.
        limits: the limits.
        tilt: (...) of the poses, rad.
        clearance: (...) of the poses, m; a NaN exceeds its limit. None: it is not compared.

    Returns:
        (...) bit mask of `BITS`; `unsettled` alone where the pose is NaN.
    """
    bits = np.zeros(pose.shape, dtype=np.uint8)

    def note(name: str, where: Any) -> None:
        np.bitwise_or(bits, np.uint8(BITS[name]), out=bits, where=where)

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
    stopped = pose.joint_stop != 0
    for k, name in enumerate(("rocker", "bogie", "bogie")):
        note(name, stopped[..., k])
    lost = np.isnan(pose.z)
    bits[lost] = BITS["unsettled"]
    return bits
