"""Roles of links and joints in a rocker-bogie, and the rover's directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...arrays import Array
from ...errors import RoverError
from .tree import Joint, Tree

#: Hinges this close to the common direction of the wheels' axles are taken as parallel to it (cosine of 20 degrees).
PARALLEL = float(np.cos(np.radians(20)))
#: Axes of the file's own frame this close to the rover's are taken as the rover's (rad).
SNAP = 0.2
ROLES = ("wheels", "bogies", "rockers", "steering")


@dataclass(frozen=True)
class Hinge:
    """Hinge at rest in the root's frame: its point (3,), unit axis (3,), and groups."""

    joint: Joint
    parent: str
    child: str
    point: Array
    axis: Array


@dataclass
class Roles:
    """The hinges of a rocker-bogie, left before right, wheels in the paper's order.

    `axes` (3, 3) has forward, left, up as columns. `rockers` holds None if they are rigid with the body and no joint marks the
    pivot; `arms` the rocker wheel's own arm if the rocker consists of two. `groups` maps a link to its rigid group, `parents` a
    group to the group that carries it. The lists of text are the import's report.
    """

    tree: Tree
    wheels: list[Hinge]
    steers: list[Hinge | None]
    bogies: list[Hinge]
    rockers: list[Hinge | None]
    arms: list[Hinge | None]
    axes: Array
    groups: dict[str, str]
    parents: dict[str, str]
    freed: bool = False  # the rockers were fixed joints
    found: list[str] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    repaired: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def body(self) -> str:
        """Return the rigid group of the body: the one that carries the rockers."""
        rocker = self.rockers[0]
        return rocker.parent if rocker is not None else self.bogies[0].parent


def rover_axes(
    roles: Roles,
    what: str,
    lateral: Array,
    hubs: Array,
    pivots: Array,
    wheels: list[Hinge],
    forward: str | None,
    up: str | None,
) -> Array:
    """Return the rover's directions.

    Up points from the wheels to the pivots; forward along x if that is lengthwise.

    Args:
        roles: gets the lines of the report.
        what: the file's name, for messages.
        lateral: (3,) unit direction of the axles.
        hubs, pivots: (n, 3) points in the root's frame.
        wheels: the wheels' hinges; their names can tell the front.
        forward, up: directions given by the caller, or None.

    Returns:
        (3, 3): forward, left, up as columns.

    Raises:
        RoverError: directions that do not lie across the axles.
    """
    square = [axis for axis in np.eye(3) if abs(axis @ lateral) < 1e-12]
    if len(square) == 2:
        lengthwise, upright = sorted(square, key=lambda axis: -float(np.ptp(hubs @ axis)))
    else:
        flat = hubs - hubs.mean(axis=0)
        flat -= np.outer(flat @ lateral, lateral)
        lengthwise = np.linalg.svd(flat)[2][0]
        lengthwise = lengthwise * (np.sign(lengthwise[np.abs(lengthwise).argmax()]))
        upright = np.cross(lengthwise, lateral)
        roles.guessed.append(
            "its frame is parallel to none of the rover's directions; forward and up are taken from the wheels' positions"
        )
    if up is not None:
        upright = named_axis("up", up)
    elif (pivots.mean(axis=0) - hubs.mean(axis=0)) @ upright < 0:
        upright = -upright
    if forward is not None:
        lengthwise = named_axis("forward", forward)
    else:
        vote = _vote(wheels, lengthwise)
        if np.allclose(lengthwise, (1, 0, 0)):
            if vote < 0:
                roles.guessed.append("forward is +x of its frame; its names say otherwise: forward='-x' turns it round")
        else:
            lengthwise = lengthwise * (-1 if vote < 0 else 1)
            why = "from its names" if vote else "for want of better"
            roles.guessed.append(
                f"forward is {axis_name(lengthwise)} of its frame, {why}; forward='{axis_name(-lengthwise)}' turns it round"
            )
    left = np.cross(upright, lengthwise)
    if abs(left @ lateral) < PARALLEL:
        raise RoverError(
            f"{what}: forward {axis_name(lengthwise)} and up {axis_name(upright)} must both lie across the axles, "
            f"which lie along {axis_name(lateral)}"
        )
    left /= np.linalg.norm(left)
    if upright @ (0, 0, 1) < 0.5:
        roles.repaired.append(f"up is {axis_name(upright)} of its frame: turned")
    return np.stack([np.cross(left, upright), left, upright], axis=1)


def mean_direction(axes: Sequence[Array]) -> Array:
    """Return the unit mean (3,) of directions whose senses do not count.

    Args:
        axes: unit vectors (3,).

    Returns:
        (3,) with the sense of the first.
    """
    total = sum((a if a @ axes[0] > 0 else -a for a in axes), np.zeros(3))
    return np.asarray(total / np.linalg.norm(total))


def snap(direction: Array) -> Array | None:
    """Return the axis (3,) of the file's frame within `SNAP` of a direction, or None.

    Args:
        direction: (3,) unit vector.

    Returns:
        (3,) unit vector, or None.
    """
    k = int(np.abs(direction).argmax())
    return np.eye(3)[k] if abs(direction[k]) > np.cos(SNAP) else None


def _vote(wheels: list[Hinge], lengthwise: Array) -> float:
    """Return the sum of signs by which wheels' names put the front along `lengthwise`."""
    middle = np.mean([w.point for w in wheels], axis=0)
    total = 0.0
    for w in wheels:
        name = f"{w.joint.name} {w.child} {w.parent}".lower()
        says = ("front" in name) - ("rear" in name or "back" in name)
        total += says * np.sign((w.point - middle) @ lengthwise)
    return total


def named_axis(label: str, text: str) -> Array:
    """Return the axis (3,) that "x", "-y", ... names.

    Args:
        label: the argument's name, for messages.
        text: x, -x, y, -y, z or -z.

    Returns:
        (3,) unit vector.

    Raises:
        RoverError: another text.
    """
    names = {sign + axis: (1 if sign != "-" else -1) * np.eye(3)[k] for k, axis in enumerate("xyz") for sign in ("", "+", "-")}
    if text not in names:
        raise RoverError(f"{label} is {text!r}; give an axis of the file's frame: x, -x, y, -y, z or -z")
    return np.asarray(names[text], dtype=float)


def axis_name(direction: Array) -> str:
    """Return a direction (3,) as text: "x", "-y", ... or its three numbers.

    Args:
        direction: (3,) unit vector.

    Returns:
        Text for messages.
    """
    k = int(np.abs(direction).argmax())
    if abs(direction[k]) < 1 - 1e-9:
        return "(" + ", ".join(f"{v:.3g}" for v in direction) + ")"
    return ("-" if direction[k] < 0 else "") + "xyz"[k]
