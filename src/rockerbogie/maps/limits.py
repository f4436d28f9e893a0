"""What a rover may be asked to stand: limits of attitude, joints and clearance, and which of them a pose exceeds."""

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
    """The most that a pose may have of each, either way; None is no limit. Angles in rad, clearance in m.

    A pose must keep its clearance above the limit, and the rest within it. Whatever the limits, a joint on or beyond its
    mechanical stop exceeds, and so does a place where the rover cannot be settled.
    """

    pitch: float | None = None
    roll: float | None = None
    tilt: float | None = None
    rocker: float | None = None  # of the left rocker against the body: half of what a bar differential turns
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
        """Limits known by name: one of `PRESETS`.

        Raises:
            RockerbogieError: no such name; with the nearest that is.
        """
        if name not in PRESETS:
            raise RockerbogieError(unknown_name("limits", name, PRESETS))
        return PRESETS[name]

    def to_json(self) -> str:
        """As text, None as null."""
        return json.dumps({name: None if value is None else float(value) for name, value in asdict(self).items()})


#: Curiosity's are those its flight software stops a drive at (Rankin, Maimone, Biesiadecki, Patel, Levine, Toupet 2020,
#: "Driving Curiosity: Mars Rover Mobility Trends During the First Seven Years").
PRESETS = {
    "curiosity": Limits(
        pitch=math.radians(15), roll=math.radians(15), tilt=math.radians(30),
        rocker=math.radians(7), bogie=math.radians(17), clearance=0.0,
    ),
    "none": Limits(),
}  # fmt: skip


def exceeded(pose: Pose, limits: Limits, tilt: NDArray[np.float64], clearance: NDArray[np.float64] | None) -> NDArray[np.uint8]:
    """(...) bit mask of what each pose exceeds. Clearance that is not known (the map ends under the body) exceeds too."""
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
