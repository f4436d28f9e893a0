"""What became of each pose. Hard ground never raises; it says here what happened."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """One code a pose (uint8). `MEANING` says what each is and what to do about it."""

    CONVERGED = 0
    OFF_MAP = 1
    NO_DATA = 2
    JOINT_STOP = 3
    NOT_CONVERGED = 4
    WHEEL_LIFTED = 5
    BELLY_CONTACT = 6
    TIPPED = 7


MEANING: dict[Status, tuple[str, str]] = {
    Status.CONVERGED: ("settled: all six wheels touch, every joint within its stops", "use it"),
    Status.OFF_MAP: (
        "part of a tread (at rest: or of the body's box) lies off the map: the pose is nan",
        "move the place inward or load more ground",
    ),
    Status.NO_DATA: (
        "part of a tread (at rest: or of the body's box) lies over unknown ground: the pose is nan",
        "fill the hole before loading, or leave the place out",
    ),
    Status.JOINT_STOP: (
        "contact mode: six wheels touch only with a joint beyond its stop; equilibrium: at rest with a joint on its stop",
        "ask mode='equilibrium' which wheel lifts; or widen the rover's stops",
    ),
    Status.NOT_CONVERGED: (
        "contact mode: no pose was found whose six gaps are zero; equilibrium: none that its forces hold; the pose is nan",
        "the ground is too steep for this linkage here; try mode='equilibrium'",
    ),
    Status.WHEEL_LIFTED: ("equilibrium: at rest with a wheel in the air", "see wheel_lifted for which"),
    Status.BELLY_CONTACT: (
        "equilibrium: at rest with the body's box on the ground; contact mode does not look (see clearance)",
        "the rover is high-centred: choose another place",
    ),
    Status.TIPPED: (
        "equilibrium: the rover tips over (1.3 rad of roll or pitch) on the descent from above, and no rest was found "
        "from the six-wheel pose either; the pose is nan",
        "no rest is known here: choose another place or heading",
    ),
}
