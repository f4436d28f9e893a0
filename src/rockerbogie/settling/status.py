"""Status codes of poses, with their meaning and remedy."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Status code of a pose (uint8). `MEANING` gives the meaning and the remedy of each."""

    CONVERGED = 0
    OFF_MAP = 1
    NO_DATA = 2
    JOINT_STOP = 3
    NOT_CONVERGED = 4
    WHEEL_LIFTED = 5
    BELLY_CONTACT = 6
    TIPPED = 7


#: Status -> (meaning, remedy).
MEANING: dict[Status, tuple[str, str]] = {
    Status.CONVERGED: ("settled: all six wheels in contact, every joint within its limits", "use it"),
    Status.OFF_MAP: (
        "part of a tread (in equilibrium mode also of the body's box) lies off the map: the pose is NaN",
        "move the position inward or load more terrain",
    ),
    Status.NO_DATA: (
        "part of a tread (in equilibrium mode also of the body's box) lies over missing data: the pose is NaN",
        "fill the missing data before loading, or leave the position out",
    ),
    Status.JOINT_STOP: (
        "contact mode: six wheels are in contact only with a joint beyond its limit; equilibrium mode: a joint is at its limit",
        "settle with mode='equilibrium' to see which wheel lifts; or widen the rover's joint limits",
    ),
    Status.NOT_CONVERGED: (
        "contact mode: no pose with six zero gaps was found; equilibrium mode: no pose in balance was found; the pose is NaN",
        "the terrain is too steep for this linkage here; try mode='equilibrium'",
    ),
    Status.WHEEL_LIFTED: ("equilibrium mode, `predict`: a wheel is off the ground", "see wheel_lifted for which"),
    Status.BELLY_CONTACT: (
        "equilibrium mode: the body's box is on the terrain; contact mode does not check this (see clearance)",
        "the rover is high-centred: choose another position",
    ),
    Status.TIPPED: (
        "equilibrium mode: the rover tips over (1.3 rad of roll or pitch) on the descent from above, and no equilibrium was "
        "found from the six-wheel pose either; the pose is NaN",
        "no equilibrium is known here: choose another position or yaw",
    ),
}
